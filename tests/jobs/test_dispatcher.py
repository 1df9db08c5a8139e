"""
The dispatcher with a real store: what one step loses, what it never loses, and what others ask of it meanwhile. The
first tests have a real render process: one bad cell costs the grid that cell and no more.
"""

from __future__ import annotations

import errno
import os
import signal
from collections.abc import Iterator
from functools import partial
from pathlib import Path

import pytest

from jobs import experiments, grid, plan, points, queue, results
from jobs.artifacts import Artifacts
from jobs.dispatcher import Dispatcher, News
from jobs.errors import DataDirectoryProblem
from jobs.executors.base import DISK_FULL, Event, Failed, Finished, Started
from jobs.executors.local import LocalExecutor
from jobs.queue import MAX_ATTEMPTS
from jobs.render_process import explain
from jobs.store import Store
from renderer import devices
from renderer.errors import SceneError
from renderer.scenes import sources
from tests.jobs.conftest import assert_sound, planned, select, submit
from tests.jobs.painter import Painter

GRID = {
    "name": "small", "scenes": ["cornell_box"], "samplers": ["independent", "stratified"], "spp": [4, 16],
    "replicates": 2, "resolution": [16, 12], "reference": {"spp": 64},
}  # fmt: skip


@pytest.fixture
def real(tmp_path: Path) -> Iterator[tuple[Store, Artifacts, LocalExecutor]]:
    artifacts = Artifacts(tmp_path / "data")
    artifacts.prepare()
    store = Store.open(tmp_path / "data")
    local = LocalExecutor(devices.pick("llvm"), kernels=tmp_path / "kernels", logs=artifacts.logs, cwd=artifacts.empty)
    yield store, artifacts, local
    local.close()
    store.close()


def test_a_cell_that_kills_its_process_fails_alone(
    real: tuple[Store, Artifacts, LocalExecutor], tmp_path: Path
) -> None:
    """The bad cell is tried MAX_ATTEMPTS times, ends as failed with its reason, and everything else is rendered."""
    store, artifacts, local = real
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


def test_stop_gives_back_what_was_claimed(real: tuple[Store, Artifacts, LocalExecutor], tmp_path: Path) -> None:
    """After ``stop`` no cell is running and no attempt is open; a second run completes the grid."""
    store, artifacts, local = real
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


def painted(store: Store, artifacts: Artifacts, painter: Painter | None = None, **keys: object) -> Dispatcher:
    """A dispatcher whose pictures are there at once."""
    return Dispatcher(store, artifacts, painter or Painter(), machine="here", device="llvm", **keys)  # type: ignore[arg-type]


def test_a_picture_and_its_points_are_recorded_together(
    store: Store, artifacts: Artifacts, monkeypatch: pytest.MonkeyPatch
) -> None:
    """An owner that dies between the two would leave a picture whose time nobody ever adds up."""
    submit(store, spp=[1], replicates=1, reference=False)

    def die(*_: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(points, "refresh", die)
    with pytest.raises(KeyboardInterrupt):
        painted(store, artifacts).run()
    assert select(store, "select count(*) from replicate") == [(0,)]


class Full(Painter):
    """Has no space for its second picture."""

    def events(self, timeout: float) -> list[Event]:
        if len(self.drawn) == 1 and self.held:
            return [Failed(self.held.popleft().order.order, DISK_FULL, "No space left on device", "")]
        return super().events(timeout)


def test_a_full_disk_is_no_fault_of_a_cell(store: Store, artifacts: Artifacts) -> None:
    """Not once, and not three times: the run ends with the reason, and the next one draws what is missing."""
    experiment = submit(store, spp=[1, 2])
    painter = Full()
    for _ in range(MAX_ATTEMPTS + 1):
        with pytest.raises(DataDirectoryProblem, match="is full; free some space and run again"):
            painted(store, artifacts, painter).run()
        queue.recover(store)
        painter.held.clear()
    assert select(store, "select distinct state, crashes, error_class from cell") == [("queued", 0, None)]
    again = Painter()
    painted(store, artifacts, again).run()
    assert experiments.standing(store, experiment.id).state == "done"
    assert not set(painter.drawn) & set(again.drawn)


@pytest.mark.parametrize(
    ("error", "error_class"),
    [
        (OSError(errno.ENOSPC, os.strerror(errno.ENOSPC)), DISK_FULL),
        (OSError(errno.EDQUOT, os.strerror(errno.EDQUOT)), DISK_FULL),
        (RuntimeError('Failed to write pixel data to image file "x.exr". No space left on device.'), DISK_FULL),
        (RuntimeError("jit_var_eval(): out of memory!"), "out_of_memory"),
        (MemoryError(), "out_of_memory"),
        (SceneError("no such mesh"), "scene_error"),
        (ZeroDivisionError("division by zero"), "crash"),
    ],
)
def test_an_error_of_a_render_process_has_its_class(error: Exception, error_class: str) -> None:
    found, sentence = explain(error)
    assert found == error_class
    assert sentence and "\n" not in sentence


def test_what_another_experiment_had_already_is_measured_for_a_new_one(store: Store, artifacts: Artifacts) -> None:
    """All pictures are there, none was ever compared with *this* reference: nothing is rendered, all is measured."""
    large = planned(name="large", reference={"spp": 16, "replicates": 4})
    small = planned(name="small", reference={"spp": 8, "replicates": 2})  # the first two of the same reference
    painter = Painter()
    dispatcher = painted(store, artifacts, painter)
    dispatcher.submit(large)
    dispatcher.run()
    drawn = list(painter.drawn)
    found, new = dispatcher.submit(small)
    while dispatcher.measurer.step(1.0):
        pass
    assert new == 0
    assert painter.drawn == drawn
    rows = list(results.rows(store, found.id))
    assert rows and all(row["mse_cross"] is not None for row in rows)
    assert len(results.summary(store, found.id)) == 8


def test_what_others_ask_is_done_between_two_pictures(store: Store, artifacts: Artifacts) -> None:
    """Pausing, cancelling and deleting stop what is being drawn; going on draws the rest, and nothing twice."""
    one, two = submit(store, name="one", spp=[1, 2], replicates=3), submit(store, name="two", spp=[2, 3], replicates=2)
    painter = Painter(allowed=1)
    dispatcher = painted(store, artifacts, painter)
    steps = iter([dispatcher.pause, dispatcher.cancel, dispatcher.delete])
    targets = iter([one.id, two.id, two.id])

    def turn() -> None:
        if painter.allowed == 0 and not painter.happened:
            if step := next(steps, None):
                dispatcher.ask(partial(step, next(targets)))
            painter.allow(1)

    dispatcher.on_turn = turn
    dispatcher.run()
    assert [experiments.standing(store, found.id).state for found in (one, two)] == ["paused", "cancelled"]
    assert select(store, "select count(*) from attempt where ended_at is null") == [(0,)]
    queue.resume(store, one.id)
    queue.restore(store, two.id)
    dispatcher.run()
    assert [experiments.standing(store, found.id).state for found in (one, two)] == ["done", "cancelled"]
    assert len(painter.drawn) == len(set(painter.drawn))
    assert select(store, "select count(*) from replicate") == [(len(painter.drawn),)]
    assert_sound(store)
    assert not list(artifacts.work.glob("*.exr"))


def test_stop_from_a_task_gives_everything_back(store: Store, artifacts: Artifacts) -> None:
    """``stop`` is heard although nothing happens, and the next dispatcher draws only what is missing."""
    experiment = submit(store)
    painter = Painter(allowed=2)
    dispatcher = painted(store, artifacts, painter, forever=True)
    dispatcher.on_turn = lambda: dispatcher.stop() if painter.allowed == 0 else None
    dispatcher.run()
    assert not experiments.standing(store, experiment.id).count("running")
    assert select(store, "select count(*) from attempt where ended_at is null") == [(0,)]
    again = Painter()
    painted(store, artifacts, again).run()
    assert experiments.standing(store, experiment.id).state == "done"
    assert not set(painter.drawn) & set(again.drawn)


def test_a_preview_stays_until_the_finished_picture_is_in_its_place(store: Store, artifacts: Artifacts) -> None:
    """Whoever asks in between sees one of the two; when the cell is done, nothing is left."""
    submit(store)
    there = []

    def hear(news: News) -> None:
        preview = artifacts.preview(news.work.digest)
        if isinstance(news.event, Started):
            preview.write_bytes(b"what is drawn so far")
        elif isinstance(news.event, Finished):
            there.append(preview.exists())

    Dispatcher(store, artifacts, Painter(), machine="here", device="llvm", on_news=hear).run()
    assert there and all(there)
    assert not list(artifacts.previews.iterdir())
