"""
Laws of following: each end of a cell is told once, trouble is told when it begins, and the table waits for the last
errors. The events are made here; real ones flow in tests/e2e/test_server_cli.py.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from renderer.errors import BadParameter
from service.client import Away, Back, Client
from service.following import Watcher, measured
from service.progress import Bars
from service.remote import points
from service.schemas import Cell, Experiment, ExperimentDetail, Progress, Update, Worker
from service.settings import place, server_address

URL = "http://127.0.0.1:8000"
EXPERIMENT = Experiment(
    id=3, name="first", state="running", created_at="2026-01-01T00:00:00+00:00", cells={"queued": 2}, references={},
    had=1, wanted=6, failed=0, seconds_left=None,
)  # fmt: skip
WORKER = Worker(state="idle", device="CPU", trouble=None, experiment=None, cell=None, description=None, queued=0)


def cell(position: int, **values: Any) -> Cell:
    usual: dict[str, Any] = {
        "position": position, "cell": 10 + position, "role": "cell", "scene": "room", "integrator": "path",
        "sampler": "independent", "spp": 4, "spp_actual": 4, "state": "done", "had": 2, "wanted": 2, "reference": 20,
    }  # fmt: skip
    return Cell(**usual | values)


def update(*cells: Cell, worker: Worker = WORKER, **values: Any) -> Update:
    experiment = EXPERIMENT.model_copy(update=values)
    return Update(revision=1, experiment=experiment, worker=worker, reload=False, cells=list(cells))


@pytest.fixture
def watcher() -> Watcher:
    return Watcher(Client(URL), EXPERIMENT, Bars(6, 1))


def test_the_end_of_a_cell_is_told_once(watcher: Watcher, capsys: pytest.CaptureFixture[str]) -> None:
    """It changes again when it is measured; that is no second end."""
    watcher.hear(update(cell(0, state="running")))
    watcher.hear(update(cell(0), had=3, seconds_left=90.0))
    watcher.hear(update(cell(0, metrics={"mse": (0.1, None, 2)}), had=3, seconds_left=90.0))
    assert capsys.readouterr().err == "   3/6  room · path · independent · 4 spp  (≈ 1 min 30 s left)\n"


def test_a_failed_cell_is_told_with_its_reason(watcher: Watcher, capsys: pytest.CaptureFixture[str]) -> None:
    """Brackets of a message are no markup."""
    watcher.hear(update(cell(0, state="failed", error_class="crash", error="it [red] died")))
    assert capsys.readouterr().err == "crash in room · path · independent · 4 spp: it [red] died\n"


def test_a_server_in_trouble_is_told_when_it_begins(watcher: Watcher, capsys: pytest.CaptureFixture[str]) -> None:
    stalled = WORKER.model_copy(update={"state": "stalled", "trouble": "the disk is full"})
    for worker in (stalled, stalled, WORKER, stalled):
        watcher.hear(update(worker=worker))
    assert capsys.readouterr().err.count("the server is stalled: the disk is full") == 2


def test_a_pause_is_told_with_the_way_out(watcher: Watcher, capsys: pytest.CaptureFixture[str]) -> None:
    for state in ("paused", "paused", "running"):
        watcher.hear(update(state=state))
    assert capsys.readouterr().err == f"paused: `dartboard resume 3 --server {URL}` goes on\n"


def test_a_lost_server_is_told(watcher: Watcher, capsys: pytest.CaptureFixture[str]) -> None:
    watcher.hear(Away())
    watcher.hear(Back())
    lines = [f"the server at {URL} does not answer; trying again", f"the server at {URL} is back"]
    assert capsys.readouterr().err.splitlines() == lines


def test_passes_of_cells_that_were_never_named_are_no_error(watcher: Watcher) -> None:
    """Progress may come before the cell itself, after a connection was lost."""
    watcher.hear(Progress(cell=99, role="reference", replicate=1, done=1, passes=4, seconds=0.1, preview=0))
    assert watcher.bars.one.tasks[0].description == "reference 2 · pass 1/4"


def test_where_an_experiment_is(monkeypatch: pytest.MonkeyPatch) -> None:
    """The command line counts more than the environment, there the server more than the data directory."""
    monkeypatch.delenv("DARTBOARD_SERVER", raising=False)
    monkeypatch.setenv("DARTBOARD_DATA", "elsewhere")
    assert place(None, None) == Path("elsewhere")
    assert place(None, URL) == URL
    monkeypatch.setenv("DARTBOARD_SERVER", URL)
    assert place(None, None) == server_address(None) == URL
    assert place(Path("here"), None) == Path("here")
    assert server_address("other:80") == "other:80"


def test_two_places_or_none_are_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("DARTBOARD_SERVER", raising=False)
    with pytest.raises(BadParameter, match="--data here and --server http://x are two places; give one of them"):
        place(Path("here"), "http://x")
    with pytest.raises(BadParameter, match="which server?"):
        server_address(None)


class Pages(Client):
    """Answers with one list of cells after the other."""

    def __init__(self, *pages: list[Cell]):
        super().__init__(URL)
        self.pages = list(pages)

    def cells(self, experiment: int) -> Any:
        return iter(self.pages.pop(0) if len(self.pages) > 1 else self.pages[0])


def test_the_table_waits_for_the_last_errors() -> None:
    reference = cell(1, cell=20, role="reference", reference=None)
    half = cell(0, metrics={"mse": (0.1, None, 1)})
    whole = cell(0, metrics={"mse": (0.2, 0.1, 2)})
    start = ExperimentDetail(
        **EXPERIMENT.model_dump(), revision=1, scenes=[], integrators=[], samplers=[], spp=[], sweeps={}, replicates=2,
        metrics=[], default_metric="relmse", toml="",
    )  # fmt: skip
    last = measured(Pages([cell(0), reference], [half, reference], [whole, reference]), start)
    assert [(point.metric, point.mean, point.n) for point in points(last)] == [("mse", 0.2, 2)]
    unfinished = [cell(0), reference.model_copy(update={"state": "cancelled"})]  # there will be none
    assert points(measured(Pages(unfinished), start)) == []
