"""What a name for a parameter means, without Mitsuba: one parameter, or a sentence that says what there is."""

from __future__ import annotations

import json
import math
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from renderer.errors import BadParameter
from renderer.parameters import MAX_MAGNITUDE, Parameter, as_value, assign, check_value, find, told

KNOWN = {
    parameter.key: parameter
    for parameter in (
        Parameter("sphere.bsdf.brdf_0.nu.value", "number", 10),
        Parameter("sphere.bsdf.brdf_0.nv.value", "number", 10),
        Parameter("sphere.bsdf.brdf_0.rd.value", "colour", (0.5, 0.5, 0.5)),
        Parameter("sphere.to_world", "other"),
        Parameter("floor.bsdf.brdf_0.reflectance.color0.value", "colour", (0.1, 0.1, 0.1)),
        Parameter("floor.bsdf.brdf_0.reflectance.color1.value", "colour", (0.9, 0.9, 0.9)),
        Parameter("blend.bsdf_0.alpha.value", "number", 0.1),
        Parameter("blend.bsdf_1.alpha.value", "number", 0.2),
        Parameter("ball.bsdf.alpha", "number", 0.1),
        Parameter("ball.bsdf.nested.alpha", "number", 0.2),
        Parameter("white.reflectance.value", "colour", (0.7, 0.7, 0.7)),
        Parameter("lamp.emitter.radiance.value", "colour", (9, 9, 9)),
    )
}


@pytest.mark.parametrize(
    ("name", "key"),
    [
        ("sphere.bsdf.brdf_0.nu.value", "sphere.bsdf.brdf_0.nu.value"),
        ("sphere.bsdf.brdf_0.nu", "sphere.bsdf.brdf_0.nu.value"),
        ("sphere.bsdf.nu", "sphere.bsdf.brdf_0.nu.value"),
        ("sphere.nu", "sphere.bsdf.brdf_0.nu.value"),
        ("floor.color1", "floor.bsdf.brdf_0.reflectance.color1.value"),
        ("ball.bsdf.alpha", "ball.bsdf.alpha"),  # written out, it is no doubt which
        ("blend.bsdf_1.alpha", "blend.bsdf_1.alpha.value"),
    ],
)
def test_a_name_means_the_parameter_whose_words_it_has(name: str, key: str) -> None:
    assert find(name, KNOWN).key == key


@pytest.mark.parametrize("key", sorted(key for key, parameter in KNOWN.items() if parameter.kind != "other"))
def test_the_short_form_that_sentences_offer_is_understood(key: str) -> None:
    assert find(KNOWN[key].short, KNOWN) is KNOWN[key]


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("sphere.bsdf.mu", ["'sphere.bsdf.mu'", "its object has sphere.bsdf.brdf_0.nu", "sphere.bsdf.brdf_0.rd"]),
        ("spere.bsdf.brdf_0.nu", ["did you mean 'sphere.bsdf.brdf_0.nu'"]),
        ("nu", ["there is no parameter 'nu'", "the scene has"]),
        ("blend.alpha", ["may mean blend.bsdf_0.alpha, blend.bsdf_1.alpha", "write one of these"]),
        ("ball.alpha", ["may mean ball.bsdf.alpha, ball.bsdf.nested.alpha"]),
        ("sphere.to_world", ["neither a number nor a colour", "its object has sphere.bsdf.brdf_0.nu"]),
        ("floor.bsdf.reflectance", ["floor.bsdf.brdf_0.reflectance.color0"]),
        ("nu.bsdf.sphere", ["there is no parameter"]),  # the order of the words counts
    ],
)
def test_what_means_none_or_several_is_refused_with_what_there_is(name: str, words: list[str]) -> None:
    with pytest.raises(BadParameter) as refused:
        find(name, KNOWN)
    assert all(word in str(refused.value) for word in words), refused.value
    assert len(str(refused.value)) < 1000


def test_a_sentence_offers_some_of_thousands() -> None:
    known = {f"shape_{n}.bsdf.alpha": Parameter(f"shape_{n}.bsdf.alpha", "number") for n in range(5000)}
    with pytest.raises(BadParameter, match="more") as refused:
        find("qqq.zzz", known)
    assert len(str(refused.value)) < 1000


@given(
    st.text(max_size=60) | st.lists(st.sampled_from(["sphere", "bsdf", "nu", "value", ""]), max_size=6).map(".".join)
)
def test_any_name_is_found_or_refused(name: str) -> None:
    try:
        assert find(name, KNOWN).kind != "other"
    except BadParameter as error:
        assert str(error)


@pytest.mark.parametrize(
    ("name", "value", "words"),
    [
        ("sphere.nu", (1.0, 2.0, 3.0), "is one number; give a number"),
        ("white.reflectance", 1.5, "1.5 is outside what white.reflectance allows; give 0 to 1"),
        ("white.reflectance", (0.1, -0.1, 0), "give 0 to 1"),
        ("lamp.radiance", (-1, 0, 0), "give 0 or more"),
    ],
)
def test_a_value_outside_is_refused(name: str, value: Any, words: str) -> None:
    with pytest.raises(BadParameter, match=words):
        check_value(find(name, KNOWN), value)


def test_what_is_allowed_is_taken() -> None:
    check_value(find("sphere.nu", KNOWN), -3)  # what a plugin takes is its own business
    check_value(find("white.reflectance", KNOWN), (0, 1, 0.5))
    check_value(find("white.reflectance", KNOWN), 1)
    check_value(find("lamp.radiance", KNOWN), (1e6, 0, 0))


def test_two_names_of_one_parameter_are_refused() -> None:
    with pytest.raises(BadParameter, match="'sphere.bsdf.nu' and 'sphere.nu' are one parameter"):
        assign([("sphere.bsdf.nu", 1), ("sphere.nu", 2)], KNOWN)


@pytest.mark.parametrize(
    "data", [None, True, "10", [], [1, 2], [1, 2, 3, 4], [1, 2, "3"], [1, 2, [3]], {"r": 1}, math.nan, math.inf, 1e31,
             10**400, [1, 2, math.nan], [True, 0, 0]],
)  # fmt: skip
def test_what_is_no_number_and_no_colour_is_no_value(data: Any) -> None:
    assert as_value(data) is None


numbers = st.floats(-MAX_MAGNITUDE, MAX_MAGNITUDE) | st.integers(-(10**9), 10**9)


@given(numbers | st.lists(numbers, min_size=3, max_size=3))
def test_a_value_has_one_spelling(data: Any) -> None:
    """It survives JSON, keeps its number, and reading it again changes nothing."""
    value = as_value(data)
    assert value is not None and as_value(value) == value
    assert as_value(json.loads(json.dumps(value))) == value
    assert value == (tuple(data) if isinstance(data, list) else data)


def test_whole_numbers_are_written_without_a_point() -> None:
    assert [repr(as_value(data)) for data in (10.0, -0.0, 0.5, [1.0, 0.25, 3])] == ["10", "0", "0.5", "(1, 0.25, 3)"]


def test_colours_are_told_as_they_are_written() -> None:
    assert told((("a.nu", 10), ("a.rd", (0.5, 0, 1)))) == told({"a.nu": 10, "a.rd": [0.5, 0, 1]})
    assert told({"a.rd": [0.5, 0, 1]}) == ["a.rd = [0.5, 0, 1]"]
