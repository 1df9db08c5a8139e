"""The dispatcher with a real store and a real render process: one bad cell costs the grid that cell and no more."""

from __future__ import annotations

import os
import signal
from collections.abc import Iterator
from functools import partial
from pathlib import Path

import pytest

from jobs import experiments, grid, plan, results
from jobs.artifacts import Artifacts
from jobs.dispatcher import Dispatcher, News
from jobs.executors.base import Started
from jobs.executors.local import LocalExecutor
from jobs.queue import MAX_ATTEMPTS
from jobs.store import Store
from renderer import devices
from renderer.scenes import sources

GRID = {
    "name": "small", "scenes": ["cornell_box"], "samplers": ["independent", "stratified"], "spp": [4, 16],
    "replicates": 2, "resolution": [16, 12], "reference": {"spp": 64},
}  # fmt: skip


@pytest.fixture
def data(tmp_path: Path) -> Iterator[tuple[Store, Artifacts, LocalExecutor]]:
    artifacts = Artifacts(tmp_path / "data")
    artifacts.prepare()
    store = Store.open(tmp_path / "data")
    local = LocalExecutor(devices.pick("llvm"), kernels=tmp_path / "kernels", logs=artifacts.logs, cwd=artifacts.empty)
    yield store, artifacts, local
    local.close()
    store.close()


def test_a_cell_that_kills_its_process_fails_alone(
    data: tuple[Store, Artifacts, LocalExecutor], tmp_path: Path
) -> None:
    """The bad cell is tried MAX_ATTEMPTS times, ends as failed with its reason, and everything else is rendered."""
    store, artifacts, local = data
    planned = plan.expand(grid.parse(GRID, find=partial(sources.find, base=tmp_path), origin="test"))
    experiment, _ = experiments.submit(store, planned, artifacts.scenes)
    bad = planned.cells[1].spec.digest
    tries = 0

    def hear(news: News) -> None:
        nonlocal tries
        if isinstance(news.event, Started) and news.work.digest == bad:
            tries += 1
            assert local.child is not None
            os.kill(local.child.process.pid, signal.SIGSTOP)  # so that it cannot finish before the next line
            os.kill(local.child.process.pid, signal.SIGKILL)

    Dispatcher(store, artifacts, local, machine="here", device="llvm", experiment=experiment.id, on_news=hear).run()
    assert tries == MAX_ATTEMPTS
    standing = experiments.standing(store, experiment.id)
    assert (standing.cells, standing.references) == ({"done": 3, "failed": 1}, {"done": 1})
    (failure,) = store.rows("failures", experiment_id=experiment.id)
    assert failure["error_class"] == "crash"
    assert "SIGKILL" in failure["error"]
    measured = [row for row in results.rows(store, experiment.id) if row["state"] == "done"]
    assert len(measured) == 6
    assert all(row["mse_cross"] is not None for row in measured)


def test_stop_gives_back_what_was_claimed(data: tuple[Store, Artifacts, LocalExecutor], tmp_path: Path) -> None:
    """After ``stop`` no cell is running and no attempt is open; a second run completes the grid."""
    store, artifacts, local = data
    planned = plan.expand(grid.parse(GRID, find=partial(sources.find, base=tmp_path), origin="test"))
    experiment, _ = experiments.submit(store, planned, artifacts.scenes)
    first = Dispatcher(
        store, artifacts, local, machine="here", device="llvm", experiment=experiment.id,
        on_news=lambda news: first.stop(),
    )  # fmt: skip
    first.run()
    assert not experiments.standing(store, experiment.id).cells.get("running")
    Dispatcher(store, artifacts, local, machine="here", device="llvm", experiment=experiment.id).run()
    standing = experiments.standing(store, experiment.id)
    assert standing.state == "done"
    assert standing.had == standing.wanted
