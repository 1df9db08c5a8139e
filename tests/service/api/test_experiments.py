"""The life of an experiment over HTTP: submitted, followed, stopped, gone on with, deleted, brought back, exported."""

from __future__ import annotations

import csv
import io
import json
from typing import Any

import pytest

from jobs import convergence, results
from renderer.metrics import METRICS
from service import schemas
from tests.service.conftest import GRID, PICTURES, House, answer, answers, refusal

TOML = """
name = "small"
scenes = ["cornell_box"]
samplers = ["independent", "stratified"]
spp = [4, 16]
replicates = 2
resolution = [16, 12]
reference = { spp = 32 }
"""


def post(house: House, path: str) -> schemas.Experiment:
    return answer(house.client.post(f"/api/experiments/{path}"), schemas.Experiment)


def submit(house: House, key: str | None = None, **keys: Any):
    headers = {} if key is None else {"idempotency-key": key}
    return house.client.post("/api/experiments", json={"grid": {**GRID, **keys}}, headers=headers)


def all_cells(house: House, number: int, limit: int = 1000, after: int = 0) -> list[schemas.Cell]:
    found: list[schemas.Cell] = []
    start: int | None = 0
    while start is not None:
        query = {"start": start, "limit": limit, "after": after}
        page = answer(house.client.get(f"/api/experiments/{number}/cells", params=query), schemas.Cells)
        found, start = [*found, *page.cells], page.next
    return found


def test_a_grid_is_submitted_once_in_whatever_spelling(house: House) -> None:
    """201 with its address for a new one; 200 for the same grid as JSON again, as TOML text, and as a TOML body."""
    first = submit(house)
    assert (first.status_code, first.headers["location"]) == (201, "/api/experiments/1")
    same = [
        submit(house),
        house.client.post("/api/experiments", json={"toml": TOML}),
        house.client.post("/api/experiments", content=TOML, headers={"content-type": "application/toml"}),
    ]
    assert [(one.status_code, answer(one, schemas.Experiment).id) for one in same] == [(200, 1)] * 3
    assert house.count("experiment") == 1


def test_a_dry_run_counts_and_stores_nothing(house: House) -> None:
    body = {"grid": {**GRID, "spp": [4, 5]}}
    told = answer(house.client.post("/api/experiments?dry_run=true", json=body), schemas.DryRun)
    assert told.axes == {"scenes": 1, "samplers": 2, "integrators": 1, "spp": 2, "replicates": 2}
    assert (told.cells, told.references, told.replicates, told.reused, told.experiment) == (4, 1, PICTURES, 0, None)
    assert [(one.sampler, one.asked, one.rendered) for one in told.rounded] == [("stratified", 5, 9)]
    assert (house.count("experiment"), house.count("cell")) == (0, 0)
    again = house.client.post("/api/experiments?dry_run=true", json={"toml": told.toml})
    assert answer(again, schemas.DryRun) == told


def test_a_finished_grid_reads_the_same_everywhere(house: House) -> None:
    """Cells, curves, CSV, JSON and the store's own summary hold the same numbers."""
    submit(house)
    house.finish(1)
    cells = [cell for cell in all_cells(house, 1) if cell.role == "cell"]
    with house.engine.readers.lend() as store:
        summary = results.summary(store, 1)
        rows = list(results.rows(store, 1))
        curves = {name: convergence.curves(store, 1, name) for name in METRICS}
    by_cell = {(cell.sampler, cell.spp): cell for cell in cells}
    assert len(summary) == len(cells) * len(METRICS)
    for point in summary:
        assert by_cell[point.sampler, point.spp].metrics[point.metric] == (point.mean, point.error, point.n)
    for name in METRICS:
        told = answer(house.client.get("/api/experiments/1/convergence", params={"metric": name}), schemas.Convergence)
        assert told.metric.formula == METRICS[name].formula
        assert [[p.mean for p in one.points] for one in told.series] == [
            [p["mean"] for p in one.points] for one in curves[name]
        ]
    listed = house.client.get("/api/experiments/1/results.json").json()
    assert listed == rows
    text = house.client.get("/api/experiments/1/results.csv").text
    found = list(csv.DictReader(io.StringIO(text)))
    assert found == [{key: "" if value is None else str(value) for key, value in row.items()} for row in listed]


def test_pages_of_cells_are_the_plan_whole_and_in_order(house: House) -> None:
    submit(house, spp=[1, 2, 3, 4, 5, 6, 7])
    house.finish(1)
    whole = all_cells(house, 1)
    assert [cell.position for cell in whole] == list(range(15))
    assert all_cells(house, 1, limit=4) == whole
    assert {cell.state for cell in whole} == {"done"}


def test_pause_resume_cancel_and_retry(house: House) -> None:
    house.painter.allowed = 3
    submit(house)
    house.watch.until(lambda: house.experiment(1).had == 3)
    assert post(house, "1/pause").state == "paused"
    assert post(house, "1/pause").state == "paused"
    assert post(house, "1/resume").state in ("queued", "running")
    assert post(house, "1/cancel").state == "cancelled"
    assert post(house, "1/resume").state == "cancelled"  # there is no pause to end
    assert post(house, "1/retry").state in ("queued", "running")
    house.painter.allow(PICTURES)
    assert house.until_state(1, "done").had == PICTURES
    for move in ("pause", "resume", "cancel", "retry"):  # of something that is done: nothing is lost
        assert post(house, f"1/{move}").had == PICTURES


def test_a_deletion_says_what_goes_and_can_be_undone(house: House) -> None:
    submit(house)
    house.finish(1)
    path = "/api/experiments/1"
    before, cells = house.experiment(1), all_cells(house, 1)
    asked = answer(house.client.delete(path, params={"dry_run": True}), schemas.Deleted)
    assert (asked.cells, asked.pictures) == (4, PICTURES)  # the reference is the cell of 16 independent samples
    assert asked.disk_bytes > 0
    assert house.experiment(1) == before
    assert answer(house.client.delete(path), schemas.Deleted).pictures == PICTURES
    for gone in (
        path,
        f"{path}/cells",
        f"{path}/convergence",
        f"{path}/results.csv",
        f"{path}/report",
        f"{path}/events",
    ):
        refusal(house.client.get(gone), 404, "experiment-deleted")
    refusal(house.client.post(f"{path}/cancel"), 404, "experiment-deleted")
    assert answers(house.client.get("/api/experiments"), schemas.Experiment) == []
    assert post(house, "1/restore").state == "done"
    assert all_cells(house, 1) == cells


def test_a_key_makes_a_request_that_may_be_sent_again(house: House) -> None:
    """The second changes nothing, not even an experiment that was cancelled since; another grid is refused."""
    assert submit(house, key="k1", spp=[4]).status_code == 201
    post(house, "1/cancel")
    state = house.experiment(1).state
    assert answer(submit(house, key="k1", spp=[4]), schemas.Experiment).state == state
    refusal(submit(house, key="k1", spp=[16]), 409, "conflict")
    assert house.count("experiment") == 1
    answer(submit(house, spp=[4]), schemas.Experiment)  # without a key it is wanted again
    assert house.until_state(1, "done")


@pytest.mark.parametrize("key", ["", "k" * 201])
def test_a_key_that_names_nothing_is_refused(house: House, key: str) -> None:
    """An empty one would be the same for everybody."""
    refusal(submit(house, key=key), 422, "bad-request")
    assert house.count("experiment") == 0


def test_experiments_are_found_by_name_newest_first(house: House) -> None:
    for spp in ([1], [2]):
        submit(house, spp=spp)
    submit(house, name="another", spp=[3])
    found = answers(house.client.get("/api/experiments", params={"name": "small"}), schemas.Experiment)
    assert [one.id for one in found] == [2, 1]
    assert answers(house.client.get("/api/experiments", params={"name": "none"}), schemas.Experiment) == []


@pytest.mark.parametrize("method, path", [
    ("GET", ""), ("GET", "/cells"), ("GET", "/convergence"), ("GET", "/results.csv"), ("GET", "/results.json"),
    ("GET", "/report"), ("GET", "/events"), ("DELETE", ""), ("POST", "/pause"), ("POST", "/resume"),
    ("POST", "/cancel"), ("POST", "/retry"), ("POST", "/restore"),
])  # fmt: skip
@pytest.mark.parametrize("number", ["77", str(2**63 - 1)])
def test_an_unknown_experiment_is_404_on_every_route(house: House, method: str, path: str, number: str) -> None:
    refusal(house.client.request(method, f"/api/experiments/{number}{path}"), 404, "not-found")


@pytest.mark.parametrize("number", ["0", "-1", "x", str(2**63), "1.5", "1e3", "%00"])
def test_what_is_no_id_is_refused(house: House, number: str) -> None:
    refusal(house.client.get(f"/api/experiments/{number}"), 422)


def test_every_fault_of_a_grid_is_told_with_its_field(house: House) -> None:
    grid = {**GRID, "scenes": ["nowhere"], "samplers": ["poison"], "spp": [0, 1e9], "replicates": 0, "colour": "green"}
    found = refusal(house.client.post("/api/experiments", json={"grid": grid}), 422, "bad-grid")
    assert {fault.field for fault in found.problems} >= {"scenes", "samplers", "spp", "replicates", "colour"}
    assert all(fault.detail in found.detail for fault in found.problems)


def test_a_name_is_text_whatever_it_holds(house: House) -> None:
    hostile = '<script>alert("x")</script>'
    found = answer(submit(house, name=hostile), schemas.Experiment)
    assert found.name == hostile
    assert json.loads(house.client.get("/api/experiments").text)[0]["name"] == hostile
    refusal(submit(house, name="a" * 500), 422, "bad-grid")
