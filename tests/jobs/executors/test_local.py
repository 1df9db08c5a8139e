"""The local executor with a real render process: whatever happens to it, each order ends exactly once."""

from __future__ import annotations

import os
import signal
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from jobs.executors.base import Done, Event, Failed, Finished, Order, Released, Started
from jobs.executors.local import LocalExecutor, explain_exit
from renderer import devices
from renderer.images import read_picture
from renderer.scenes import sources
from tests.renderer.conftest import make_cell

MakeOrder = Callable[..., Order]


@pytest.fixture
def executor(tmp_path: Path) -> Iterator[LocalExecutor]:
    local = LocalExecutor(
        devices.pick("llvm"), kernels=tmp_path / "kernels", logs=tmp_path / "logs", cwd=tmp_path / "cwd"
    )
    yield local
    local.close()


@pytest.fixture
def make_order(tmp_path: Path) -> MakeOrder:
    def make(
        number: int, *, scene: str = "cornell_box", trust: str = "builtin", spp: int = 4, replicates: int = 1
    ) -> Order:
        source = sources.find(scene, Path())
        return Order(
            order=number, spec=make_cell(scene, spp=spp).text, colour="rgb", scene=source.folder, main=source.main,
            trust=trust, replicates=tuple(("cell", k) for k in range(replicates)), out=tmp_path,
        )  # fmt: skip

    return make


def follow(local: LocalExecutor, until: Callable[[Event], bool]) -> list[Event]:
    """Events up to and including the first that ``until`` accepts."""
    seen: list[Event] = []
    while True:
        for event in local.events(5.0):
            seen.append(event)
            if until(event):
                return seen


def ends(event: Event) -> bool:
    return isinstance(event, (Done, Failed, Released))


def kill_child(local: LocalExecutor) -> None:
    assert local.child is not None
    os.kill(local.child.process.pid, signal.SIGKILL)


def test_orders_are_drawn_in_turn(executor: LocalExecutor, make_order: MakeOrder, tmp_path: Path) -> None:
    """Two orders fit at once; each starts, brings its replicates in order, and is done."""
    executor.submit(make_order(1, replicates=2))
    executor.submit(make_order(2))
    assert executor.room() == 0
    seen = follow(executor, lambda event: event == Done(2))
    told = [event for event in seen if isinstance(event, (Started, Finished, Done))]
    assert [(type(event).__name__, event.order) for event in told] == [
        ("Started", 1), ("Finished", 1), ("Finished", 1), ("Done", 1), ("Started", 2), ("Finished", 2), ("Done", 2),
    ]  # fmt: skip
    finished = [event for event in told if isinstance(event, Finished)]
    assert [(event.role, event.k) for event in finished] == [("cell", 0), ("cell", 1), ("cell", 0)]
    assert read_picture(tmp_path / finished[0].file).shape == (24, 32, 3)
    assert finished[0].seed != finished[1].seed
    assert executor.room() == 2


def test_a_killed_child_blames_what_it_was_drawing(executor: LocalExecutor, make_order: MakeOrder) -> None:
    """The order that was drawn fails as a crash; the one ahead is drawn by the next child."""
    executor.submit(make_order(1, spp=2**14))
    executor.submit(make_order(2))
    follow(executor, lambda event: event == Started(1))
    kill_child(executor)
    seen = follow(executor, lambda event: event == Done(2))
    (failed,) = [event for event in seen if isinstance(event, Failed)]
    assert (failed.order, failed.error_class) == (1, "crash")
    assert "SIGKILL" in failed.message


def test_cancel_stops_the_drawing_at_once(executor: LocalExecutor, make_order: MakeOrder) -> None:
    """A cancelled order is released, its child is gone, and the one ahead is drawn all the same."""
    executor.submit(make_order(1, spp=2**20))  # minutes
    executor.submit(make_order(2))
    follow(executor, lambda event: event == Started(1))
    assert executor.child is not None
    child = executor.child.process
    executor.cancel(1)
    assert child.returncode == -signal.SIGKILL
    ended = [event for event in follow(executor, lambda event: event == Done(2)) if ends(event)]
    assert ended == [Released(1), Done(2)]


def test_cancel_of_what_waits_leaves_what_is_drawn(executor: LocalExecutor, make_order: MakeOrder) -> None:
    executor.submit(make_order(1, trust="a"))
    executor.submit(make_order(2, trust="b"))  # another process: it waits here
    executor.cancel(2)
    ended = [event for event in follow(executor, lambda event: event == Done(1)) if ends(event)]
    assert ended == [Released(2), Done(1)]


def test_a_trust_class_never_shares_a_process(executor: LocalExecutor, make_order: MakeOrder) -> None:
    """Orders of two trust classes are drawn by two processes with two kernel caches."""
    children = []
    for number, trust in enumerate(("builtin", "0123456789abcdef0123"), 1):
        executor.submit(make_order(number, trust=trust))
        follow(executor, lambda event, number=number: event == Done(number))  # type: ignore[misc]
        assert executor.child is not None
        children.append(executor.child.process.pid)
    assert children[0] != children[1]
    for caches in (executor.kernels, executor.kernels.with_name("tables")):
        assert {folder.name for folder in caches.iterdir()} == {"builtin", "0123456789abcdef"}


def test_a_scene_that_cannot_be_loaded_fails_without_the_process(
    executor: LocalExecutor, make_order: MakeOrder, tmp_path: Path
) -> None:
    """A scene error is the cell's fault: one sentence, and the same child draws the next order."""
    (tmp_path / "scene").mkdir()
    (tmp_path / "scene" / "scene.xml").write_text('<scene version="3.0.0"/>')
    good = make_order(2)
    bad = Order(**{**good.__dict__, "order": 1, "scene": tmp_path / "scene"})
    executor.submit(bad)
    executor.submit(good)
    ended = [event for event in follow(executor, lambda event: event == Done(2)) if ends(event)]
    assert isinstance(ended[0], Failed)
    assert ended[0].error_class == "scene_error"
    assert "no camera" in ended[0].message


def test_nan_pictures_are_refused(executor: LocalExecutor, make_order: MakeOrder, tmp_path: Path) -> None:
    """A picture with NaN pixels fails its cell with the count; it is kept as evidence, never as a replicate."""
    (tmp_path / "scene").mkdir()
    (tmp_path / "scene" / "scene.xml").write_text(
        '<scene version="3.0.0"><sensor type="perspective"/>'
        '<emitter type="constant"><rgb name="radiance" value="nan, 1, 1"/></emitter></scene>'
    )
    executor.submit(Order(**{**make_order(1).__dict__, "scene": tmp_path / "scene"}))
    failed = follow(executor, ends)[-1]
    assert isinstance(failed, Failed), failed
    assert failed.error_class == "nan_output"
    assert "768 of 768 pixels" in failed.message
    assert (tmp_path / "1-cell-0.exr").exists()


def test_exit_codes_are_explained() -> None:
    assert explain_exit(-6, False) == ("crash", "the render process was ended by SIGABRT")
    assert explain_exit(-9, True)[0] == "out_of_memory"
    assert explain_exit(3, False)[0] == "crash"
