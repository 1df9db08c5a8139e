"""A grid as TOML: reading the text gives the same grid, whatever it holds."""

from __future__ import annotations

import json
import tomllib
from dataclasses import replace
from functools import partial

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from jobs import grid, gridtoml
from jobs.errors import GridError
from jobs.gridspec import GridSpec
from renderer.errors import DartboardError
from renderer.scenes import sources
from renderer.scenes.defaults import SceneDefaults
from tests.jobs.grids import HERE, parse, settings_of_a_scene, tables

FIND = partial(sources.find, base=HERE)
ODD = "\"'\\#[]={}.,\x7f\u00a0\u2028\u2029\ufeff\u202e😀é\u0301"
# What ``grid.py`` takes for a name: one line that can be printed.
names = st.text(st.characters(exclude_categories=["Cs"]) | st.sampled_from(ODD), min_size=1, max_size=40).filter(
    lambda text: text.isprintable() and text.strip() and not text.strip().isdecimal()
)


def toml_of(spec: GridSpec) -> str:
    return gridtoml.toml_of(json.loads(spec.text))


def read_back(text: str, find=FIND) -> GridSpec:
    return grid.parse(grid.loads(text, "a grid"), find=find, origin="a grid")


def valid(table) -> GridSpec | None:
    try:
        return parse(table)
    except DartboardError:
        return None


@given(table=tables(), name=st.none() | names)
@settings(max_examples=300, deadline=None, derandomize=True)
def test_reading_the_text_gives_the_same_grid(table, name):
    """Every axis, every setting of every scene, every reference: the digest is the same."""
    spec = valid(table if name is None else {**table, "name": name})
    if spec is None:
        return
    text = toml_of(spec)
    again = read_back(text)
    assert again.digest == spec.digest, text
    assert toml_of(again) == text


own = st.fixed_dictionaries({}, optional=settings_of_a_scene)
odd_names = st.lists(names.filter(lambda text: text == text.strip()), min_size=2, max_size=4, unique=True)


@given(scenes=odd_names, common=own, data=st.data())
@settings(max_examples=150, deadline=None, derandomize=True)
def test_scenes_of_any_name_with_settings_of_their_own(scenes, common, data):
    """Quotes, brackets, dots, characters of every script: a scene's table finds its scene."""
    box = sources.find("cornell_box", HERE)

    def find(name):
        return replace(box, name=name, digest=f"{scenes.index(name):064}")

    tables = {name: data.draw(own) for name in scenes}
    try:
        spec = grid.parse({"name": "g", "scenes": scenes, "scene": tables, **common}, find=find, origin="a grid")
    except GridError as error:
        # Two names with one stem, or a crop outside of its film: what cannot be said cannot be written either.
        assert all("crop" in sentence or "means" in sentence for sentence in error.problems), error.problems
        return
    assert read_back(toml_of(spec), find).digest == spec.digest, toml_of(spec)


def test_the_text_is_what_a_person_would_write():
    """Defaults that cannot depend on a scene are left out, what a scene has in common stands once."""
    spec = parse(
        name='the "best" sampler', scenes=["cornell_box", "defocus"], samplers=["random", "stratified:jitter=false"],
        integrators=["path"], spp=[64, 4], replicates=2, resolution=[32, 24], max_depth=6,
        reference={"spp": 128}, scene={"defocus": {"crop": [1, 2, 8, 9], "reference": False}},
    )  # fmt: skip
    assert toml_of(spec) == (
        'name = "the \\"best\\" sampler"\n'
        'scenes = ["cornell_box", "defocus"]\n'
        'samplers = ["independent", "stratified:jitter=false"]\n'
        'integrators = ["path"]\n'
        "spp = [4, 64]\n"
        "replicates = 2\n"
        "resolution = [32, 24]\n"
        "max_depth = 6\n"
        'reference = { integrator = "path", sampler = "independent", spp = 128, replicates = 2 }\n'
        "\n"
        '[scene."defocus"]\n'
        "crop = [1, 2, 8, 9]\n"
        "reference = false\n"
    )


def test_a_filter_and_a_colour_mode_are_told_where_they_are_not_the_default():
    text = toml_of(parse(rfilter="gaussian:stddev=0.4", colour="spectral"))
    assert 'rfilter = "gaussian:stddev=0.4"\n' in text
    assert 'colour = "spectral"\n' in text
    assert "rfilter" not in toml_of(parse()) and "colour" not in toml_of(parse())


def test_a_scene_that_shows_the_whole_film_beside_one_with_a_crop():
    spec = parse(scenes=["cornell_box", "defocus"], resolution=[20, 20],
                 scene={"cornell_box": {"crop": [1, 1, 5, 5]}})  # fmt: skip
    assert [scene.crop for scene in read_back(toml_of(spec)).scenes] == [(1, 1, 5, 5), None]


@pytest.mark.parametrize("order", [("cornell_box", "room"), ("room", "cornell_box"), ("room",)])
@pytest.mark.parametrize(
    "keys",
    [
        {},
        {"rfilter": "box"},
        {"crop": [0, 0, 256, 256]},
        {"rfilter": "tent", "crop": [1, 1, 2, 2]},
        {"scene": {"room": {"rfilter": "box", "crop": [0, 0, 256, 256]}}},
    ],
)
def test_what_a_file_would_say_is_overruled_again(order, keys):
    """A scene file with a crop and a filter: the text gives the same grid, though the file would say another."""
    own = SceneDefaults(crop=(8, 8, 16, 16), rfilter="gaussian")
    room = replace(FIND("defocus"), name="room", defaults=own)

    def find(name):
        return room if name == "room" else FIND(name)

    spec = grid.parse({"name": "n", "scenes": list(order), **keys}, find=find, origin="a grid")
    again = read_back(toml_of(spec), find)
    assert again.scenes == spec.scenes and again.digest == spec.digest, toml_of(spec)


@pytest.mark.parametrize("character", [chr(code) for code in (0x00, 0x08, 0x0A, 0x1F, 0x7F, 0x85, 0x2028, 0xFEFF)])
def test_every_text_is_a_toml_string(character):
    text = f"a{character}b\\"
    assert tomllib.loads(f"x = {gridtoml._text(text)}")["x"] == text
