"""Sweeps over HTTP: what can be swept, what is refused, and how cells, curves and exports tell values apart."""

from __future__ import annotations

import csv
import io
from pathlib import Path

import pytest

from jobs.lister import SceneLister
from renderer.parameters import Parameter
from renderer.scenes import sources
from service import schemas
from tests.service.api.test_experiments import all_cells, submit
from tests.service.conftest import House, answer, answers, refusal

NU = {"parameter": "ball.nu", "values": [10, 1000]}
RD = {"parameter": "ball.bsdf.rd", "values": [[0.1, 0.5, 1], 0.5]}
KNOWN = {
    key: Parameter(key, kind, now)
    for key, kind, now in (
        ("ball.bsdf.nu.value", "number", 10.0),
        ("ball.bsdf.rd.value", "colour", (0.5, 0.5, 0.5)),
        ("ball.to_world", "other", None),
    )
}
DIGEST = sources.find("cornell_box", Path()).digest


@pytest.fixture(autouse=True)
def scene_has_a_ball(monkeypatch: pytest.MonkeyPatch) -> None:
    """The pictures of this house are painted, and so are the parameters of its scenes."""
    monkeypatch.setattr(SceneLister, "__call__", lambda *_: KNOWN)


def test_the_parameters_of_a_scene_are_told(house: House) -> None:
    found = answers(house.client.get(f"/api/scenes/{DIGEST}/parameters"), schemas.SceneParameter)
    assert [(one.name, one.kind, one.now) for one in found] == [
        ("ball.bsdf.nu", "number", 10.0), ("ball.bsdf.rd", "colour", (0.5, 0.5, 0.5))
    ]  # fmt: skip
    assert house.client.get(f"/api/scenes/{DIGEST}/parameters?colour=spectral").status_code == 200
    refusal(house.client.get(f"/api/scenes/{'0' * 64}/parameters"), 422, "bad-scene")
    refusal(house.client.get("/api/scenes/cornell_box/parameters"), 422)
    refusal(house.client.get(f"/api/scenes/{DIGEST}/parameters?colour=mono"), 422)


def test_a_dry_run_counts_sweeps_and_gives_them_back_as_a_grid_file(house: House) -> None:
    grid = {"scenes": ["cornell_box"], "spp": 4, "sweep": [NU, RD]}
    response = house.client.post("/api/experiments?dry_run=true", json={"grid": {"name": "swept", **grid}})
    told = answer(response, schemas.DryRun)
    assert (told.cells, told.references) == (4, 4)
    assert (told.axes["ball.nu"], told.axes["ball.bsdf.rd"]) == (2, 2)
    assert answer(house.client.post("/api/experiments?dry_run=true", json={"toml": told.toml}), schemas.DryRun) == told


@pytest.mark.parametrize(
    ("sweep", "words"),
    [
        ({**NU, "parameter": "ball.mu"}, "there is no parameter 'ball.mu'"),
        ({**NU, "values": [[1, 0, 0]]}, "is one number"),
        ({**NU, "parameter": "nu"}, "name the object first"),
    ],
)
def test_what_is_wrong_with_a_sweep_is_a_fault_of_that_field(house: House, sweep: object, words: str) -> None:
    found = refusal(submit(house, sweep=[sweep]), 422, "bad-grid")
    assert [fault.field for fault in found.problems] == ["sweep"]
    assert words in found.problems[0].detail
    assert house.count("experiment") == 0


def test_swept_cells_are_told_apart_everywhere(house: House) -> None:
    number = answer(submit(house, sweep=[NU, RD]), schemas.Experiment).id
    house.finish(number)
    detail = answer(house.client.get(f"/api/experiments/{number}"), schemas.ExperimentDetail)
    assert detail.sweeps == {"ball.nu": [10, 1000], "ball.bsdf.rd": [[0.1, 0.5, 1], 0.5]}
    cells = [cell for cell in all_cells(house, number) if cell.role == "cell"]
    values = [{"ball.bsdf.rd": rd, "ball.nu": nu} for nu in (10, 1000) for rd in ([0.1, 0.5, 1], 0.5)]
    assert len(cells) == 4 * 2 * 2
    for value in values:
        of_value = [cell for cell in cells if cell.sweep == value]
        assert len(of_value) == 4 and len({cell.reference for cell in of_value}) == 1
    assert len({cell.reference for cell in cells}) == 4
    curves = answer(house.client.get(f"/api/experiments/{number}/convergence"), schemas.Convergence).series
    assert sorted(str(curve.sweep) for curve in curves) == sorted(str(value) for value in values for _ in range(2))
    text = house.client.get(f"/api/experiments/{number}/results.csv").text
    rows = list(csv.DictReader(io.StringIO(text)))
    assert {(row["ball.nu"], row["ball.bsdf.rd"]) for row in rows} == {
        (nu, rd) for nu in ("10", "1000") for rd in ("[0.1, 0.5, 1]", "0.5")
    }
    assert house.client.get(f"/api/experiments/{number}/report").text.count("ball.nu = 1000") >= 2
