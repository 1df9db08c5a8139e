"""Sweeps of a grid: what may be written, where it applies, which cells it makes, and what a scene must have."""

from __future__ import annotations

import itertools
import json
from functools import partial
from itertools import groupby
from typing import Any

import pytest

from jobs import grid
from jobs.errors import GridError
from jobs.gridspec import MAX_CELLS, GridSpec
from jobs.plan import expand
from renderer.errors import SceneError
from renderer.parameters import Parameter
from renderer.scenes import sources
from renderer.spec import CellSpec
from tests.jobs.grids import HERE, complaints, parse

NU = {"parameter": "sphere.bsdf.nu", "values": [10, 100]}
NV = {"parameter": "sphere.bsdf.nv", "values": [1, 2, 3]}
BOTH = ["cornell_box", "defocus"]


def swept(spec: GridSpec) -> list[tuple[str, tuple[tuple[str, Any], ...]]]:
    """(scene, what is set) of every cell, in order, each once."""
    cells = [(cell.scene, cell.spec.estimand.sweep) for cell in expand(spec).cells if cell.role == "cell"]
    return list(dict.fromkeys(cells))


def test_several_sweeps_multiply_and_each_point_has_a_reference() -> None:
    spec = parse(sweep=[NU, NV], spp=[4, 16], samplers=["independent", "stratified"])
    points = [dict(sweep) for _, sweep in swept(spec)]
    wanted = [{"sphere.bsdf.nu": nu, "sphere.bsdf.nv": nv} for nu, nv in itertools.product([10, 100], [1, 2, 3])]
    assert points == wanted  # the last sweep fastest
    cells = expand(spec).cells
    assert sum(cell.role == "cell" for cell in cells) == 6 * 2 * 2
    references = [cell.spec.estimand.digest for cell in cells if cell.role == "reference"]
    assert len(references) == len(set(references)) == 6


def test_a_scene_is_finished_with_all_its_values_before_the_next() -> None:
    cells = expand(parse(scenes=BOTH, sweep=[NU], spp=[4, 16])).cells
    assert [scene for scene, _ in groupby(cell.scene for cell in cells)] == BOTH
    steps = [(cell.role, cell.spp_asked if cell.role == "cell" else 0) for cell in cells if cell.scene == "defocus"]
    assert [step for step, _ in groupby(steps)] == [("cell", 4), ("reference", 0), ("cell", 16)]


@pytest.mark.parametrize("scenes", ["defocus", ["defocus"]])
def test_a_sweep_may_apply_to_some_scenes(scenes: Any) -> None:
    spec = parse(scenes=BOTH, sweep=[{**NU, "scenes": scenes}])
    assert swept(spec) == [
        ("cornell_box", ()), ("defocus", (("sphere.bsdf.nu", 10),)), ("defocus", (("sphere.bsdf.nu", 100),))
    ]  # fmt: skip


def test_scenes_may_sweep_one_parameter_through_values_of_their_own() -> None:
    spec = parse(scenes=BOTH, sweep=[{**NU, "scenes": "defocus"}, {**NU, "values": [7], "scenes": "cornell_box"}])
    assert [(scene, dict(sweep)["sphere.bsdf.nu"]) for scene, sweep in swept(spec)] == [
        ("cornell_box", 7), ("defocus", 10), ("defocus", 100)
    ]  # fmt: skip
    assert spec.axes["sphere.bsdf.nu"] == 3


def test_one_value_has_one_spelling() -> None:
    """10 and 10.0 are one cell, a colour may be written with or without points, and specs survive the database."""
    one = parse(sweep=[{"parameter": "a.b", "values": [10, 10.0, [1, 0, 0.5], [1.0, 0.0, 0.5]]}])
    other = parse(sweep=[{"parameter": " a.b ", "values": [10.0, [1.0, -0.0, 0.5]]}])
    assert one.digest == other.digest
    assert one.sweeps[0].values == (10, (1, 0, 0.5))
    for cell in expand(one).cells:
        assert CellSpec.parse(cell.spec.text) == cell.spec
        assert CellSpec.parse(cell.spec.text).digest == cell.spec.digest


def test_one_table_need_not_be_a_list() -> None:
    assert parse(sweep=NU).digest == parse(sweep=[NU]).digest
    assert parse(sweep={**NU, "values": 10}).sweeps[0].values == (10,)


def test_a_grid_without_sweeps_is_the_experiment_that_it_was() -> None:
    """Its identity says nothing of sweeps, so what was submitted before there were any is found again."""
    assert "sweep" not in json.loads(parse().text)
    assert "sweeps" not in json.loads(parse(sweep=[]).text)
    assert parse(sweep=[]).digest == parse().digest


def test_sweeps_count_towards_the_limit() -> None:
    many = list(range(1, 1001))
    sweeps = [{"parameter": "a.b", "values": many}, {"parameter": "a.c", "values": many[:101], "scenes": "defocus"}]
    told = complaints(scenes=BOTH, sweep=sweeps, spp=4)
    assert len(told) == 1 and f"{1000 * 101 + 1000} cells" in told[0] and str(MAX_CELLS) in told[0]
    assert "102000 sweep values in 2 scenes" in told[0]
    assert not complaints(scenes=BOTH, sweep=[sweeps[0]], spp=4, reference=False)


WRONG: dict[str, tuple[Any, list[str]]] = {
    "not tables": ("nu", ["sweep of grid.toml is 'nu'", "[[sweep]]"]),
    "not a table": ([NU, 3], ["sweep of grid.toml", "[[sweep]]"]),
    "empty": ({}, ["parameter of [[sweep]] 0 of grid.toml", "values is missing in [[sweep]] 0"]),
    "key": ({**NU, "value": 3}, ["'value'", "[[sweep]] 0 of grid.toml", "did you mean 'values'"]),
    "no object": ({**NU, "parameter": "nu"}, ["parameter of [[sweep]] 0", "is 'nu'", "sphere.bsdf.nu"]),
    "only dots": ({**NU, "parameter": "..."}, ["is '...'", "object first"]),
    "lines": ({**NU, "parameter": "a\n.b"}, ["printable"]),
    "long": ({**NU, "parameter": "a." + "b" * 300}, ["200 printable characters"]),
    "number": ({**NU, "parameter": 3}, ["is 3", "sphere.bsdf.nu"]),
    "no values": ({**NU, "values": []}, ["values of [[sweep]] 0 of grid.toml is empty", "at least one"]),
    "text": ({**NU, "values": [1, "2"]}, ["values[1] of [[sweep]] 0 of grid.toml is '2'", "colour of three"]),
    "two": ({**NU, "values": [[1, 2]]}, ["values[0] of [[sweep]] 0", "[1, 2]", "colour of three"]),
    "infinite": ({**NU, "values": [float("inf")]}, ["is inf", "finite"]),
    "scene": ({**NU, "scenes": ["defocs"]}, ["unknown scene 'defocs'", "scenes[0] of [[sweep]] 0", "known"]),
    "scene number": ({**NU, "scenes": [3]}, ["scenes[0] of [[sweep]] 0 of grid.toml is 3", "name of a scene"]),
    "no scenes": ({**NU, "scenes": []}, ["scenes of [[sweep]] 0 of grid.toml is empty"]),
    "twice": ([NU, {**NU, "values": [3]}], ["[[sweep]] 1 of grid.toml sweeps sphere.bsdf.nu in cornell_box a second"]),
}


@pytest.mark.parametrize("case", WRONG)
def test_what_is_wrong_is_told_with_its_place_and_the_way_out(case: str) -> None:
    sweep, words = WRONG[case]
    told = "\n".join(complaints(sweep=sweep))
    assert all(word in told for word in words), told


KNOWN = {
    "ball.bsdf.nu.value": Parameter("ball.bsdf.nu.value", "number", 10),
    "ball.bsdf.reflectance.value": Parameter("ball.bsdf.reflectance.value", "colour", (0.5, 0.5, 0.5)),
}


def asking(lister: Any, **keys: Any) -> GridSpec:
    table = {"scenes": BOTH, **keys}
    return grid.parse(table, find=partial(sources.find, base=HERE), origin="grid.toml", lister=lister)


def test_a_scene_without_the_parameter_is_an_error_unless_the_sweep_does_not_apply_there() -> None:
    def lister(scene: sources.SceneSource, colour: str) -> dict[str, Parameter]:
        assert colour == "spectral"
        return KNOWN if scene.name == "defocus" else {}

    sweep = {"parameter": "ball.nu", "values": [10, 100]}
    with pytest.raises(GridError) as refused:
        asking(lister, colour="spectral", sweep=[sweep])
    assert len(refused.value.problems) == 1
    assert "in scene 'cornell_box' there is no parameter 'ball.nu'" in str(refused.value)
    assert "scenes = [...]" in str(refused.value)
    assert asking(lister, colour="spectral", sweep=[{**sweep, "scenes": ["defocus"]}])


def test_everything_that_a_scene_does_not_take_is_told_at_once() -> None:
    sweeps = [
        {"parameter": "ball.nu", "values": [10, [1, 0, 0]]},
        {"parameter": "ball.reflectance", "values": [0.5, 2, [0, 0, -1]]},
        {"parameter": "ball.bsdf.nu", "values": [3]},
        {"parameter": "ball.size", "values": [3]},
    ]
    with pytest.raises(GridError) as refused:
        asking(lambda scene, colour: KNOWN, scenes="defocus", sweep=sweeps)
    told = refused.value.problems
    words = ["[1, 0, 0] is a colour", "2 is outside", "[0, 0, -1] is outside", "are one parameter", "'ball.size'"]
    assert len(told) == len(words)
    for word, sentence in zip(words, told, strict=True):
        assert word in sentence and "in scene 'defocus'" in sentence


def test_nobody_is_asked_where_nothing_is_swept() -> None:
    asked = []

    def lister(scene: sources.SceneSource, colour: str) -> None:
        asked.append(scene.name)

    asking(lister)
    assert asked == []
    asking(lister, sweep=[{**NU, "scenes": "defocus"}])
    assert asked == ["defocus"]


def test_a_scene_that_does_not_load_is_one_more_problem() -> None:
    def lister(scene: sources.SceneSource, colour: str) -> None:
        raise SceneError(f"scene {scene.name} is broken")

    with pytest.raises(GridError) as refused:
        asking(lister, sweep=[NU], replicates=0)
    assert [problem for problem in refused.value.problems if "is broken" in problem] == [
        "scene cornell_box is broken", "scene defocus is broken"
    ]  # fmt: skip
    assert any("replicates" in problem for problem in refused.value.problems)
