"""Reading a grid: defaults, precedence, and one clear sentence for everything that can be wrong."""

from __future__ import annotations

import json
import math
import os
import subprocess
import sys
import tomllib
from dataclasses import replace
from functools import partial
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from jobs import grid, plan
from jobs.errors import GridError
from renderer import catalog
from renderer.errors import DartboardError
from renderer.scenes import builtin, sources
from renderer.scenes.defaults import SceneDefaults
from renderer.scenes.sources import SceneSource
from tests.jobs.grids import INTEGRATORS, SAMPLERS, complaints, parse, tables

ROOT = Path(grid.__file__).parents[1]
FIRST = ROOT / "examples" / "first.toml"


@pytest.fixture
def imaginary_scene(monkeypatch):
    """``find`` gives a scene of fixed content, whatever the name: 200×100 pixels, max_depth 8."""
    defaults = SceneDefaults(width=200, height=100, max_depth=8)

    def find(name, base):
        return SceneSource(name, base, "scene.xml", (), "0" * 64, False, defaults)

    monkeypatch.setattr(sources, "find", find)


# What a grid means


def test_a_grid_needs_only_a_scene():
    spec = parse(name="n")
    assert [choice.name for choice in spec.samplers + spec.integrators] == ["independent", "path"]
    assert (spec.spp, spec.replicates, spec.rfilter.name, spec.colour) == ((16, 64, 256), 4, "box", "rgb")
    reference = spec.scenes[0].reference
    assert (reference.integrator.name, reference.sampler.name) == ("path", "independent")
    assert (reference.asked_total, reference.replicates, reference.spp) == (4096, 2, 2048)


def test_what_nobody_says_is_the_scene_files(imaginary_scene):
    scene = parse().scenes[0]
    assert (scene.width, scene.height, scene.crop, scene.max_depth) == (200, 100, None, 8)


def test_crop_and_filter_are_the_scene_files_where_nobody_speaks(monkeypatch, caplog):
    """The nearest counts; the whole film can be said; a filter that mixes pixels is told, once it holds."""
    defaults = SceneDefaults(width=200, height=100, crop=(20, 10, 100, 50), rfilter="gaussian")
    source = SceneSource("room.xml", ROOT, "room.xml", (), "0" * 64, False, defaults)
    builtin_find = sources.find
    monkeypatch.setattr(sources, "find", lambda name, base: source if name == "room.xml" else builtin_find(name, base))

    def of_the_room(**keys):
        spec = parse(scenes=["cornell_box", "room.xml"], **keys)
        assert spec.scenes[0].rfilter.name == keys.get("rfilter", "box")
        return spec.scenes[1].crop, catalog.label("rfilter", spec.scenes[1].rfilter)

    assert of_the_room(rfilter="box") == ((20, 10, 100, 50), "box")
    assert of_the_room(scene={"room": {"rfilter": "tent"}}) == ((20, 10, 100, 50), "tent")
    assert not caplog.records
    assert of_the_room() == ((20, 10, 100, 50), "gaussian")
    assert ["room.xml has the filter gaussian" in told for told in caplog.messages] == [True]
    assert of_the_room(resolution=[100, 50]) == ((10, 5, 50, 25), "gaussian")
    assert of_the_room(crop=[1, 2, 3, 4]) == ((1, 2, 3, 4), "gaussian")
    assert of_the_room(crop=[0, 0, 200, 100], resolution=[200, 100]) == (None, "gaussian")
    plans = [plan.expand(parse(scenes=["room.xml"], **keys)).cells[0].spec for keys in ({}, {"rfilter": "tent"})]
    assert [spec.estimand.rfilter.name for spec in plans] == ["gaussian", "tent"]


def test_a_scene_files_bad_crop_and_filter_are_told(monkeypatch):
    defaults = SceneDefaults(width=20, height=10, crop=(-1, 0, 5, 5), rfilter="gaussian:stddev=9")
    source = SceneSource("s", ROOT, "s.xml", (), "0" * 64, False, defaults)
    monkeypatch.setattr(sources, "find", lambda name, base: source)
    crop, rfilter = complaints()
    assert "scenes[0] of grid.toml: the crop of the file is [-1, 0, 5, 5], outside the 20×10 film" in crop
    assert "stddev = 9 of rfilter 'gaussian' in scenes[0] of grid.toml is not allowed" in rfilter
    assert complaints(crop=[0, 0, 5, 5], rfilter="box") == ()


def test_the_name_is_the_files_unless_said(tmp_path):
    (tmp_path / "two lamps.toml").write_text('scenes = "cornell_box"')
    assert grid.read(tmp_path / "two lamps.toml").name == "two lamps"
    assert parse(name=" glass ").name == "glass"


def test_the_nearest_setting_counts():
    """[scene.NAME] before the grid before the scene file; a reference is put together field by field."""
    spec = parse(
        scenes=["cornell_box", "defocus"],
        resolution=[64, 32],
        max_depth=5,
        reference={"spp": 100, "sampler": "stratified"},
        scene={"defocus": {"resolution": [8, 9], "crop": [1, 2, 3, 4], "max_depth": 3, "reference": {"spp": 50}}},
    )
    box, lens = spec.scenes
    assert (box.width, box.height, box.crop, box.max_depth) == (64, 32, None, 5)
    assert (lens.width, lens.height, lens.crop, lens.max_depth) == (8, 9, (1, 2, 3, 4), 3)
    assert (box.reference.sampler.name, box.reference.asked, box.reference.spp) == ("stratified", 50, 64)
    assert (lens.reference.sampler.name, lens.reference.asked, lens.reference.spp) == ("stratified", 25, 25)


@pytest.mark.parametrize(
    ("whole", "own", "wanted"),
    [(False, {}, (False, False)), (True, False, (True, False)), (False, True, (False, True)),
     ({"spp": 8}, False, (True, False)), (False, {"spp": 8}, (False, True))],
)  # fmt: skip
def test_references_can_be_switched_off_everywhere_or_for_one_scene(whole, own, wanted):
    own = {} if own == {} else {"reference": own}
    spec = parse(scenes=["cornell_box", "defocus"], reference=whole, scene={"defocus": own})
    assert tuple(scene.reference is not None for scene in spec.scenes) == wanted


def test_a_built_in_scene_brings_its_reference(monkeypatch):
    """Key by key: what the grid says for the scene, else for all, else the scene's own, else the defaults."""
    own = {"integrator": "path:rr_depth=9", "spp": 999, "sampler": "multijitter"}
    room = replace(sources.find("defocus", ROOT), reference=own)
    monkeypatch.setattr(sources, "find", lambda name, base: room)

    def told(**keys):
        reference = parse(scenes=["room"], **keys).scenes[0].reference
        names = [catalog.label("integrator", reference.integrator), reference.sampler.name]
        return *names, reference.asked_total, reference.replicates

    assert told() == told(reference=True) == ("path:rr_depth=9", "multijitter", 999, 2)
    assert told(reference={"spp": 8, "replicates": 4}) == ("path:rr_depth=9", "multijitter", 8, 4)
    nearer = {"room": {"reference": {"integrator": "path"}}}
    assert told(reference={"spp": 8}, scene=nearer) == ("path", "multijitter", 8, 2)
    assert parse(scenes=["room"], reference=False).scenes[0].reference is None


def test_every_built_in_scene_is_a_grid_by_itself():
    for name, scene in builtin.BUILTIN.items():
        assert parse(scenes=[name]).scenes[0].reference.asked_total == scene.reference["spp"]


def test_one_value_may_stand_without_a_list():
    alone = parse(scenes="cornell_box", samplers="stratified", integrators={"type": "path"}, spp=16)
    assert alone == parse(scenes=["cornell_box"], samplers=["stratified"], integrators=["path"], spp=[16])


def test_repeated_values_are_dropped_and_spp_sorted():
    spec = parse(scenes=["cornell_box"] * 2, samplers=["random", "independent"], spp=[64, 4, 64.0, 16])
    assert (len(spec.scenes), len(spec.samplers), spec.spp) == (1, 1, (4, 16, 64))


def test_a_crop_of_the_whole_film_is_no_crop():
    """Both spellings are one estimand, so they share cells."""
    assert parse(resolution=[64, 32], crop=[0, 0, 64, 32]) == parse(resolution=[64, 32])


def test_a_scene_table_is_found_by_path_or_stem(imaginary_scene):
    for key in ("rooms/kitchen.xml", "kitchen"):
        spec = parse(scenes=["rooms/kitchen.xml", "defocus"], scene={key: {"max_depth": 3}})
        assert [scene.max_depth for scene in spec.scenes] == [3, 8]


def test_a_scene_path_is_relative_to_the_grid_file(tmp_path):
    folder = tmp_path / "room"
    folder.mkdir()
    (folder / "scene.xml").write_bytes((builtin.BUILTIN["cornell_box"].folder / "scene.xml").read_bytes())
    (tmp_path / "g.toml").write_text('scenes = ["cornell_box", "room"]\nscene.room.max_depth = 3')
    first, second = grid.read(tmp_path / "g.toml").scenes
    assert first.source.digest == second.source.digest and second.source.folder == folder


# Identity


@given(tables(), st.randoms())
@settings(max_examples=30, deadline=None)
def test_identity_ignores_the_order_of_keys(table, random):
    def shuffled(value):
        if not isinstance(value, dict):
            return value
        keys = random.sample(sorted(value), len(value))
        return {key: shuffled(value[key]) for key in keys}

    assert parse(shuffled(table)).digest == parse(table).digest


@pytest.mark.parametrize(
    ("one", "other"),
    [
        ({"max_depth": 10}, {"max_depth": 10.0}),
        ({"spp": [4, 16]}, {"spp": [16.0, 4, 4]}),
        ({"samplers": "random"}, {"samplers": [{"type": "independent"}]}),
        ({"integrators": "path"}, {"integrators": "path:rr_depth=5"}),
        ({}, {"replicates": 4, "spp": [16, 64, 256], "colour": "rgb", "rfilter": "box", "reference": True}),
        ({"reference": {"spp": 4096}}, {"reference": {"replicates": 2, "integrator": "path"}}),
    ],
)
def test_spellings_of_one_request_are_one_experiment(one, other):
    assert parse(one).digest == parse(other).digest


@pytest.mark.parametrize(
    "change",
    [
        {"name": "b"}, {"spp": [16, 64]}, {"replicates": 5}, {"max_depth": 7}, {"resolution": [8, 8]},
        {"crop": [0, 0, 1, 1]}, {"samplers": "stratified"}, {"integrators": "direct"}, {"rfilter": "tent"},
        {"colour": "spectral"}, {"scenes": "defocus"}, {"reference": False}, {"reference": {"spp": 64}},
        {"reference": {"replicates": 4}},
    ],
)  # fmt: skip
def test_another_request_is_another_experiment(change):
    assert parse(change).digest != parse().digest


def test_the_text_of_a_grid_is_for_ever(imaginary_scene):
    """See test_spec: a database finds an experiment again by this digest."""
    spec = parse(name="n", spp=[4, 16], crop=[0, 0, 8, 8], reference={"sampler": "stratified", "spp": 100})
    assert json.loads(spec.text)["scenes"][0]["digest"] == "0" * 64
    assert spec.digest == "53d043dd58fe0c026ca8ecdafb1aaf8f23bde13dac4372f6b7480a847564e62a"


def test_identity_is_the_same_in_every_process():
    code = "from pathlib import Path; from jobs import grid; print(grid.read(Path('examples/first.toml')).digest)"
    for hash_seed in ("0", "1"):
        environment = {**os.environ, "PYTHONHASHSEED": hash_seed}
        run = subprocess.run([sys.executable, "-c", code], env=environment, cwd=ROOT, capture_output=True, text=True)
        assert run.stdout.strip() == grid.read(FIRST).digest, run.stderr


# What can be wrong: value, place and way out are in one sentence

BAD = {
    "scene": ({"scenes": ["cornel_box"]}, ["scenes[0] of grid.toml", "'cornel_box'", "did you mean 'cornell_box'"]),
    "scene file": ({"scenes": ["nix/x.xml"]}, ["scenes[0] of grid.toml", "nix/x.xml", "a scene is a path"]),
    "scene number": ({"scenes": [3]}, ["scenes[0] of grid.toml is 3", "built-in scene, or a path"]),
    "no scene": ({"scenes": []}, ["scenes of grid.toml is empty", "at least one"]),
    "sampler": ({"samplers": ["stratifed"]}, ["'stratifed'", "samplers[0] of grid.toml", "did you mean 'stratified'"]),
    "sampler type": ({"samplers": [3]}, ["3", "samplers[0] of grid.toml", "NAME"]),
    "no sampler": ({"samplers": []}, ["samplers of grid.toml is empty", "at least one", "leave it out"]),
    "integrator": ({"integrators": "pat"}, ["'pat'", "integrators of grid.toml", "did you mean 'path'"]),
    "parameter": ({"samplers": ["stratified:jiter=1"]}, ["'jiter'", "samplers[0]", "known: jitter"]),
    "value": ({"integrators": [{"type": "path", "max_depth": 0}]}, ["max_depth = 0", "integrators[0]", "not 0"]),
    "spp 0": ({"spp": [4, 0]}, ["spp[1] of grid.toml is 0", "integer from 1 to 10000000"]),
    "spp -1": ({"spp": -1}, ["spp of grid.toml is -1", "integer from 1 to 10000000"]),
    "spp 1e9": ({"spp": [1e9]}, ["spp[0] of grid.toml is 1000000000", "integer from 1 to 10000000"]),
    "spp 2.5": ({"spp": [2.5]}, ["spp[0] of grid.toml is 2.5", "integer from 1"]),
    "spp text": ({"spp": ["16"]}, ["spp[0] of grid.toml is '16'", "without quotes"]),
    "spp true": ({"spp": [True]}, ["spp[0] of grid.toml is true", "integer from 1"]),
    "spp nan": ({"spp": [math.nan]}, ["spp[0] of grid.toml is nan", "integer from 1"]),
    "spp inf": ({"spp": [math.inf]}, ["spp[0] of grid.toml is inf", "integer from 1"]),
    "spp list": ({"spp": [[16]]}, ["spp[0] of grid.toml is [16]", "integer from 1"]),
    "no spp": ({"spp": []}, ["spp of grid.toml is empty", "at least one"]),
    "spp rounded": ({"spp": 9 * 10**6, "samplers": "ldsampler"}, ["spp of grid.toml", "16777216", "ask for less"]),
    "replicates 0": ({"replicates": 0}, ["replicates of grid.toml is 0", "from 1 to 1000"]),
    "replicates": ({"replicates": 10**6}, ["replicates of grid.toml is 1000000", "from 1 to 1000"]),
    "resolution 0": ({"resolution": [0, 64]}, ["resolution[0] of grid.toml is 0", "from 1 to 16384"]),
    "resolution -": ({"resolution": [64, -1]}, ["resolution[1] of grid.toml is -1", "from 1 to 16384"]),
    "resolution +": ({"resolution": [10**6, 1]}, ["resolution[0] of grid.toml is 1000000", "from 1 to 16384"]),
    "resolution all": ({"resolution": [16384, 16384]}, ["resolution of grid.toml", "268435456 pixels", "lower"]),
    "resolution one": ({"resolution": 64}, ["resolution of grid.toml is 64", "[width, height]"]),
    "crop short": ({"crop": [1, 2]}, ["crop of grid.toml is [1, 2]", "[x, y, width, height]"]),
    "crop outside": ({"resolution": [64, 32], "crop": [60, 0, 8, 8]},
                     ["crop of grid.toml is [60, 0, 8, 8]", "64×32 film of cornell_box", "inside"]),
    "crop empty": ({"crop": [0, 0, 0, 8]}, ["crop of grid.toml is [0, 0, 0, 8]", "outside", "inside it"]),
    "max_depth": ({"max_depth": 0}, ["max_depth of grid.toml is 0", "-1 for unlimited"]),
    "max_depth -": ({"max_depth": -2}, ["max_depth of grid.toml is -2", "from -1"]),
    "rfilter": ({"rfilter": "boxx"}, ["'boxx'", "rfilter of grid.toml", "did you mean 'box'"]),
    "colour": ({"colour": "mono"}, ["'mono'", "grid.toml", "known: rgb, spectral"]),
    "polarized": ({"colour": "spectral_polarized"}, ["spectral_polarized", "not supported", "use rgb or spectral"]),
    "name": ({"name": 3}, ["name of grid.toml is 3", "text"]),
    "name blank": ({"name": "  "}, ["name of grid.toml", "text"]),
    "name lines": ({"name": "a\nb"}, ["name of grid.toml", "one line"]),
    "name number": ({"name": "42"}, ["name of grid.toml is '42'", "id", "add a word"]),
    "key": ({"smaplers": []}, ["'smaplers'", "grid.toml", "did you mean 'samplers'"]),
    "reference": ({"reference": 3}, ["reference of grid.toml is 3", "or false"]),
    "reference key": ({"reference": {"ssp": 3}}, ["'ssp'", "[reference] of grid.toml", "did you mean 'spp'"]),
    "reference spp": ({"reference": {"spp": 0}}, ["spp of [reference] of grid.toml is 0", "from 1"]),
    "reference one": ({"reference": {"replicates": 1}}, ["replicates of [reference] of grid.toml is 1", "even"]),
    "reference odd": ({"reference": {"replicates": 3}}, ["replicates of [reference] of grid.toml is 3", "even"]),
    "reference depth": ({"reference": {"integrator": "path:max_depth=3"}},
                        ["max_depth in integrator of [reference] of grid.toml is 3", "leave it out"]),
    "reference direct": ({"reference": {"integrator": "direct"}, "max_depth": 6},
                         ["reference of cornell_box", "direct", "2 edges only", "max_depth 6", "such as path"]),
    "scene table": ({"scene": {"defocus": {}}}, ["'defocus'", "[scene.defocus] of grid.toml", "known: cornell_box"]),
    "scene flat": ({"scene": 3}, ["scene of grid.toml is 3", "[scene.NAME]"]),
    "scene flat 2": ({"scene": {"cornell_box": 3}}, ["[scene.cornell_box] of grid.toml is 3", "table"]),
    "scene key": ({"scene": {"cornell_box": {"spp": 3}}}, ["'spp'", "[scene.cornell_box] of grid.toml", "known: crop"]),
    "scene reference": ({"scene": {"cornell_box": {"reference": {"spp": 0}}}},
                        ["spp of [scene.cornell_box.reference] of grid.toml is 0", "from 1"]),
}  # fmt: skip


@pytest.mark.parametrize(("table", "words"), BAD.values(), ids=BAD)
def test_what_is_wrong_is_one_sentence_with_value_place_and_way_out(table, words):
    told = complaints(table)
    assert len(told) == 1, told
    assert not [word for word in words if word not in told[0]], told[0]


def test_all_problems_are_told_together():
    """Nobody should correct a file line by line."""
    told = complaints(
        scenes=["nix", 3],
        samplers=["nix", "stratified:nix=1"],
        integrators=["nix"],
        spp=[0, "16"],
        replicates=0,
        resolution=[0, -1],
        crop=[1],
        max_depth=0,
        reference={"spp": 0, "nix": 1},
        scene={"cornell_box": {"max_depth": 0}},
        nix=1,
    )
    assert len(told) == 17, told


def test_a_mistake_repeated_a_thousand_times_stays_readable():
    told = complaints(spp=[0] * 1000)
    assert len(told) == 51 and told[-1] == "… and 950 more problems"


def test_a_grid_without_scenes_says_what_to_add():
    with pytest.raises(GridError, match=r'scenes is missing in g\.toml.*scenes = \["cornell_box"\]'):
        grid.parse({}, find=partial(sources.find, base=ROOT), origin="g.toml")


@pytest.mark.parametrize("data", [[], 3, None, "scenes"])
def test_a_request_that_is_no_table_is_refused(data):
    with pytest.raises(GridError, match="a grid is a table"):
        grid.parse(data, find=partial(sources.find, base=ROOT), origin="the request")


def test_a_million_cells_are_refused_before_any_is_made(monkeypatch):
    """Before a scene is read, even: the count is a product."""
    monkeypatch.setattr(sources, "find", lambda name, base: pytest.fail("a scene was read"))
    integrators = [f"path:rr_depth={depth}" for depth in range(1, 101)]
    told = complaints(scenes=["a", "b"], integrators=integrators, samplers=["independent"], spp=list(range(1, 5001)))
    words = ["1000000 cells", "2 scenes × 100 integrators × 1 samplers × 5000 spp", "more than 100000", "several grids"]
    assert len(told) == 1 and not [word for word in words if word not in told[0]], told


def test_an_axis_of_a_million_values_is_refused_unread():
    assert "spp of grid.toml has 1000000 values, more than 100000" in complaints(spp=list(range(10**6)))[0]


def test_the_same_scene_under_two_names_is_refused(tmp_path):
    """Its cells would be the same, and only one name could be shown."""
    (tmp_path / "room.xml").write_bytes((builtin.BUILTIN["defocus"].folder / "scene.xml").read_bytes())
    told = complaints_in(tmp_path, scenes=["room.xml", "./room.xml"])
    assert len(told) == 1 and "'room.xml' and './room.xml' are one scene" in told[0] and "leave one out" in told[0]


def test_an_ambiguous_or_second_scene_table_is_refused(imaginary_scene):
    two = {"scenes": ["a/room.xml", "b/room.xml"], "scene": {"room": {}, "b/room.xml": {"max_depth": 3}}}
    assert ["quote the whole path" in sentence for sentence in complaints(two)] == [True]
    twice = {"scenes": ["a/room.xml"], "scene": {"room": {}, "a/room.xml": {}}}
    assert ["second table for a/room.xml" in sentence for sentence in complaints(twice)] == [True]


@pytest.mark.parametrize(("width", "height", "depth"), [(0, 5, 6), (10**6, 5, 6), (5, 5, 0), (5, 5, -7)])
def test_a_scene_file_with_impossible_settings_says_which_key_replaces_them(monkeypatch, width, height, depth):
    source = SceneSource("s", ROOT, "s.xml", (), "0" * 64, False, SceneDefaults(width, height, depth))
    monkeypatch.setattr(sources, "find", lambda name, base: source)
    told = complaints()
    assert len(told) == 1 and "scenes[0] of grid.toml: the file asks for" in told[0] and "; set " in told[0]
    assert complaints(resolution=[8, 8], max_depth=3) == ()


def complaints_in(base, **table):
    with pytest.raises(GridError) as caught:
        grid.parse(table, find=partial(sources.find, base=base), origin="grid.toml")
    return caught.value.problems


# Files

FILES = {
    "not TOML": (b'name = "n"\nscenes = [\n"a" "b"]', ["g.toml is not TOML", "line 3, column", "correct it there"]),
    "half": (b'scenes = ["a', ["g.toml is not TOML", "correct it there"]),
    "twice": (b"spp = 1\nspp = 2\n", ["g.toml is not TOML", "line 2", "overwrite"]),
    "empty": (b"", ["g.toml is empty", 'scenes = ["cornell_box"]']),
    "blank": (b" \n\t\n", ["g.toml is empty", "examples/first.toml"]),
    "UTF-16": ("scenes = 'cornell_box'".encode("utf-16"), ["g.toml is not UTF-8", "line 1", "save it as UTF-8"]),
    "Latin-1": (b'scenes = "cornell_box"\nname = "B\xe4r"', ["g.toml is not UTF-8", "line 2"]),
    "deep": (b"a = " + b"[" * 5000 + b"]" * 5000, ["g.toml", "nested too deeply"]),
    "digits": (b"spp = " + b"9" * 5000, ["g.toml is not TOML"]),
    "hex": (b'scenes = "cornell_box"\nspp = 0x' + b"f" * 9000, ["spp of g.toml is a very long int", "from 1"]),
    "date": (b'scenes = "cornell_box"\nspp = 2024-01-01', ["spp of g.toml is", "from 1"]),
    "huge": (b"# " + b"x" * 2**24, ["g.toml has more than 16 MiB"]),
}  # fmt: skip


@pytest.mark.parametrize(("content", "words"), FILES.values(), ids=FILES)
def test_a_file_that_is_no_grid_says_why_and_where(tmp_path, content, words):
    (tmp_path / "g.toml").write_bytes(content)
    with pytest.raises(GridError) as caught:
        grid.read(tmp_path / "g.toml")
    (told,) = caught.value.problems
    assert not [word for word in words if word not in told], told


@pytest.mark.parametrize(
    ("path", "words"),
    [("nix.toml", ["no grid file", "nix.toml", "examples/first.toml"]), (".", ["is a folder", "grid.toml"]),
     ("a\0b", ["cannot read", "check its name"]), ("x" * 5000, ["cannot read", "too long"]),
     ("g.toml/x", ["cannot read", "Not a directory"])],
)  # fmt: skip
def test_a_file_that_cannot_be_opened_says_why(tmp_path, path, words):
    (tmp_path / "g.toml").write_text("")
    with pytest.raises(GridError) as caught:
        grid.read(tmp_path / path)
    (told,) = caught.value.problems
    assert not [word for word in words if word not in told], told


def test_editors_on_windows_are_welcome(tmp_path):
    (tmp_path / "g.toml").write_bytes(b'\xef\xbb\xbfscenes = "cornell_box"\r\nspp = 4\r\n')
    assert grid.read(tmp_path / "g.toml").spp == (4,)


# Whatever comes, the answer is a grid or sentences

words = st.text(max_size=8)
anything = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=8) | st.sampled_from([10**400, "a:b=c"]),
    lambda inner: (
        st.lists(inner, max_size=4) | st.dictionaries(st.text(max_size=8) | st.just("type"), inner, max_size=4)
    ),
    max_leaves=8,
)
keys = st.sampled_from(["name", "scenes", "samplers", "integrators", "spp", "replicates", "resolution", "crop",
                        "max_depth", "rfilter", "colour", "reference", "scene", "sweep"])  # fmt: skip


@given(st.dictionaries(keys | words, anything))
@settings(max_examples=200, deadline=None)
def test_arbitrary_requests_never_raise_anything_else(data):
    """DartboardError or a grid; ``base`` is a folder without scenes."""
    try:
        spec = grid.parse(data, find=partial(sources.find, base=ROOT / "jobs"), origin="request")
    except DartboardError as error:
        assert str(error)
    else:
        assert spec.digest


@given(tables(), keys, anything, st.sampled_from([None, "reference", "scene"]))
@settings(max_examples=200, deadline=None, suppress_health_check=[HealthCheck.filter_too_much])
def test_one_wrong_value_in_a_good_grid_never_raises_anything_else(table, key, value, inside):
    """Also one level down, where the values of references and scenes are."""
    place = table
    if inside == "reference" and isinstance(table.get("reference"), dict):
        place = table["reference"]
    elif inside == "scene" and table.get("scene"):
        place = next(iter(table["scene"].values()))
    place[key] = value
    for sentence in complaints(table):
        assert "grid.toml" in sentence, sentence


@given(st.binary(max_size=200) | st.text(max_size=200).map(lambda text: text.encode("utf-8", "ignore")))
@settings(max_examples=100, suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_arbitrary_files_never_raise_anything_else(tmp_path, content):
    (tmp_path / "g.toml").write_bytes(content)
    with pytest.raises(GridError):
        grid.read(tmp_path / "g.toml")


# Beside the reader


def test_the_first_example_is_what_its_comments_say():
    spec = grid.read(FIRST)
    assert [scene.source.name for scene in spec.scenes] == ["cornell_box", "defocus"]
    assert (len(spec.samplers), len(spec.integrators), len(spec.spp), spec.replicates) == (3, 1, 4, 4)
    assert spec.name == tomllib.loads(FIRST.read_text("utf-8"))["name"]


def test_every_name_of_the_catalog_can_be_written_in_a_grid():
    assert complaints(samplers=SAMPLERS, integrators=INTEGRATORS) == ()


def test_reading_a_grid_needs_no_mitsuba_and_no_numpy():
    code = (
        "import sys; from pathlib import Path; from jobs import estimate, grid, plan; "
        "estimate.estimate(plan.expand(grid.read(Path('examples/first.toml')))); "
        "print({'mitsuba', 'drjit', 'numpy', 'pydantic'} & set(sys.modules))"
    )
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, cwd=ROOT)
    assert run.stdout.strip() == "set()", run.stderr
