"""A cell's identity: what is the same cell has the same digest everywhere, what is not has another."""

from __future__ import annotations

import json
import math
import os
import subprocess
import sys
from dataclasses import replace
from itertools import pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st

from renderer import spec
from renderer.spec import CellSpec, Choice, Estimand, canonical, seed

BOX = Choice("box", 1)
ESTIMAND = Estimand(scene="0" * 64, width=128, height=96, max_depth=6, rfilter=BOX)
CELL = CellSpec(ESTIMAND, Choice("path", 1, (("rr_depth", 5),)), Choice("stratified", 1, (("jitter", True),)), 16)

numbers = st.integers() | st.floats(allow_nan=False, allow_infinity=False)
values = st.recursive(
    st.none() | st.booleans() | numbers | st.text(),
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text(), inner, max_size=4),
    max_leaves=12,
)
choices = st.builds(
    Choice,
    st.sampled_from(["path", "direct", "box", "stratified"]),
    st.integers(1, 9),
    st.dictionaries(
        st.text("abcdef", min_size=1), st.booleans() | numbers | st.text(), max_size=3
    ).map(lambda pairs: tuple(sorted(pairs.items()))),
)  # fmt: skip
crops = st.none() | st.tuples(*[st.integers(0, 999)] * 4)
estimands = st.builds(
    Estimand,
    scene=st.text("0123456789abcdef", min_size=64, max_size=64), width=st.integers(1, 9999),
    height=st.integers(1, 9999), max_depth=st.integers(-1, 99), rfilter=choices, crop=crops,
    hide_emitters=st.booleans(), colour=st.sampled_from(["rgb", "spectral"]),
    sweep=st.dictionaries(st.text(min_size=1), numbers, max_size=2).map(lambda pairs: tuple(sorted(pairs.items()))),
)  # fmt: skip
cells = st.builds(CellSpec, estimands, choices, choices, st.integers(1, 10**7))


@given(values)
def test_canonical_text_is_its_own_canonical_text(value):
    """Reading the text back and writing it again changes nothing."""
    text = canonical(value)
    assert text.isascii()
    assert canonical(json.loads(text)) == text


@given(st.dictionaries(st.text(), values, max_size=5))
def test_canonical_text_ignores_the_order_of_keys(table):
    assert canonical(dict(reversed(table.items()))) == canonical(table)


@pytest.mark.parametrize(("one", "other"), [(10, 10.0), (0, -0.0), ((1, 2), [1.0, 2]), (2**53 - 1, float(2**53 - 1))])
def test_equal_numbers_have_one_spelling(one, other):
    assert canonical({"value": one}) == canonical({"value": other})


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf])
def test_what_is_no_number_has_no_text(value):
    with pytest.raises(ValueError):
        canonical({"value": value})


@given(cells)
def test_text_of_a_cell_is_canonical_and_reads_back(cell):
    """The text is put together from parts, and is still what ``canonical`` would write."""
    assert cell.text == canonical(json.loads(cell.text))
    back = CellSpec.parse(cell.text)
    assert back == cell
    assert back.digest == cell.digest


def test_digest_of_a_cell_is_for_ever():
    """
    This literal is what databases and file names hold. If it differs, every cell of every user is a new one: either
    the change was an accident, or FORMAT has to be raised on purpose and the literal with it.
    """
    assert (spec.FORMAT, spec.PASS_LOOP, spec.SCENE_LOADER) == (1, 1, 1), "raised on purpose? then renew the literal"
    assert CELL.digest == "4f968bcd101c4fd54bec4a1c2752f6796ec02fef83b0c9416c094b68e0bcd028"
    assert ESTIMAND.digest == "f60fcff9fa5c5a959c89ae894d1ee7105d68e4cf218dba0d1fa841a973da0697"


@pytest.mark.parametrize("hash_seed", ["0", "1", "4711"])
def test_digest_is_the_same_in_every_process(hash_seed):
    """Python shuffles the hashes of texts anew in each process; a digest must not notice."""
    code = f"from renderer.spec import CellSpec; print(CellSpec.parse({CELL.text!r}).digest)"
    run = subprocess.run(
        [sys.executable, "-c", code], env={**os.environ, "PYTHONHASHSEED": hash_seed}, capture_output=True, text=True
    )
    assert run.stdout.strip() == CELL.digest, run.stderr


@pytest.mark.parametrize(
    "other",
    [
        replace(CELL, spp=17),
        replace(CELL, sampler=Choice("stratified", 1, (("jitter", False),))),
        replace(CELL, sampler=replace(CELL.sampler, version=2)),
        replace(CELL, integrator=replace(CELL.integrator, version=2)),
        *(
            replace(CELL, estimand=replace(ESTIMAND, **change))
            for change in (
                {"scene": "1" * 64}, {"width": 96, "height": 128}, {"max_depth": -1}, {"rfilter": Choice("tent", 1)},
                {"rfilter": Choice("box", 2)}, {"crop": (0, 0, 8, 8)}, {"hide_emitters": True},
                {"colour": "spectral"}, {"sweep": (("sphere.bsdf.nu", 10),)},
            )
        ),
    ],
)  # fmt: skip
def test_whatever_changes_a_picture_changes_the_digest(other):
    assert other.digest != CELL.digest


@pytest.mark.parametrize("constant", ["FORMAT", "PASS_LOOP", "SCENE_LOADER", "PRECISION"])
def test_how_pictures_are_made_is_part_of_the_digest(constant, monkeypatch):
    monkeypatch.setattr(spec, constant, 99)
    assert CellSpec.parse(CELL.text).digest != CELL.digest


def test_a_picture_has_the_size_of_its_crop():
    assert ESTIMAND.size == (128, 96)
    assert replace(ESTIMAND, crop=(3, 4, 5, 6)).size == (5, 6)


@given(st.text("0123456789abcdef", min_size=64, max_size=64), st.integers(0, 10**6))
def test_reference_seeds_and_other_seeds_never_meet(digest, replicate):
    """32 bits; the top one tells references from the rest, so no picture is compared with itself."""
    assert 0 <= seed(digest, replicate) < 2**31 <= seed(digest, replicate, reference=True) < 2**32


def test_seeds_are_hashed():
    """No common difference, which would repeat samples in other pixels; and the same on every machine."""
    seeds = [seed(CELL.digest, replicate) for replicate in range(1000)]
    assert len(set(seeds)) == 1000
    assert len({after - before for before, after in pairwise(seeds)}) == 999
    assert seed("0" * 64, 0) == 890720446
