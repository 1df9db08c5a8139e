"""
The engine: the one thread that changes anything. Whatever goes wrong in it is told on every page and tried again; what
was asked is done, or refused in a sentence, and never forgotten.
"""

from __future__ import annotations

import errno
import os
import re
import signal
import subprocess
import sys
import threading
from pathlib import Path

import pytest

from jobs import experiments, queue
from jobs.errors import DataDirectoryProblem
from jobs.store import Store
from renderer.errors import BadParameter, EnvironmentProblem
from service import engine as engines
from service import schemas
from service.engine import Engine
from tests.e2e.test_run import render_processes
from tests.jobs.conftest import assert_sound, planned, select
from tests.jobs.painter import Painter
from tests.service.conftest import GRID, PAINT, House, Watch, answer, measure

ROOT = Path(__file__).resolve().parent.parent.parent


@pytest.fixture
def watch() -> Watch:
    return Watch()


@pytest.fixture
def engine(tmp_path, painter, watch):
    engine = Engine(tmp_path / "data", PAINT, on_change=watch.poke)
    engine.start()
    yield engine
    engine.stop()


def submit(engine: Engine, **keys) -> int:
    return engine.do(lambda _, dispatcher: dispatcher.submit(planned(**keys)))[0].id


def state(engine: Engine, experiment: int) -> str:
    with engine.readers.lend() as store:
        return experiments.standing(store, experiment).state


def test_it_draws_what_is_asked_and_says_what_it_does(engine, painter, watch):
    """idle → rendering, with the cell, its experiment and the picture → idle, with a rate."""
    assert (engine.moment.state, engine.moment.queued, engine.moment.rate) == ("idle", 0, None)
    painter.allowed = 1
    number = submit(engine, name="first", spp=[1], replicates=2, reference=False)
    watch.until(lambda: engine.moment.rate)
    moment = engine.moment
    assert (moment.state, moment.queued, moment.trouble) == ("rendering", 1, None)
    assert moment.drawing.description == "cornell_box · path · independent · 1 spp"
    assert (moment.drawing.experiments, moment.drawing.role, moment.drawing.replicate) == ((number,), "cell", 0)
    assert (moment.drawing.done, moment.drawing.passes) == (1, 1)
    assert moment.rate == pytest.approx(81 / 1e-3)
    painter.allow(1)
    watch.until(lambda: engine.moment.state == "idle")
    assert (engine.moment.drawing, engine.moment.queued) == (None, 0)
    assert state(engine, number) == "done"
    with engine.readers.lend() as store:
        assert engine.moment.revision == store.revision()


def test_a_deleted_experiment_is_not_what_is_drawn_for(engine, painter, watch):
    """Two share a cell, one is in the trash: the header of every page links to the other."""
    painter.allowed = 0
    first = submit(engine, name="first", spp=[1])
    engine.do(lambda _, dispatcher: dispatcher.delete(first))
    second = submit(engine, name="second", spp=[1])
    watch.until(lambda: engine.moment.drawing)
    assert engine.moment.drawing.experiments == (second,)


def test_an_error_of_a_change_comes_back_and_the_engine_goes_on(engine):
    def fail(store, dispatcher):
        raise BadParameter("no")

    for _ in range(2):
        with pytest.raises(BadParameter, match="no"):
            engine.do(fail)
    with pytest.raises(ZeroDivisionError):
        engine.do(lambda store, _: 1 / 0)
    assert engine.do(lambda store, _: store.revision()) == 0
    assert engine.moment.state == "idle"


def test_changes_are_done_one_after_the_other(engine):
    """From many threads at once: no two overlap, and each gets its own result."""
    inside, results = [], {}

    def change(number):
        def run(store, dispatcher):
            inside.append(number)
            store.insert("add_event", at="now", what="x", cell_id=None, experiment_id=None)
            assert inside.pop() == number and not inside
            return number

        results[number] = engine.do(run)

    threads = [threading.Thread(target=change, args=(number,)) for number in range(20)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert results == {number: number for number in range(20)}
    assert engine.moment.revision == 20


def test_who_changes_something_and_asks_what_is_new_sees_it(engine, monkeypatch):
    """The moment is that of the change when the answer comes, not some turn later."""
    monkeypatch.setattr(engine, "_turn", lambda store: None)

    def change(store, dispatcher):
        return store.insert("add_event", at="now", what="x", cell_id=None, experiment_id=None)

    for _ in range(20):
        assert engine.do(change) == engine.moment.revision


def test_what_is_still_asked_when_it_ends_is_refused_at_once(tmp_path, painter, monkeypatch):
    """A request that waits would keep the process alive after SIGTERM."""
    engine = Engine(tmp_path / "data", PAINT)
    engine.start()
    monkeypatch.setattr(engine, "_serve", lambda: None)  # it does not come round to it
    told: list[BaseException] = []

    def ask():
        with pytest.raises(EnvironmentProblem, match="the server is ending; start it again") as refused:
            engine.do(lambda store, _: store.revision())
        told.append(refused.value)

    asking = threading.Thread(target=ask)
    asking.start()
    engine.stop()
    asking.join()
    ask()
    assert len(told) == 2


@pytest.mark.parametrize("broken", ["prepare", "open", "recover"])
def test_a_data_directory_that_cannot_be_used_is_told_at_the_start(tmp_path, painter, monkeypatch, broken):
    """Wherever it turns out: ``start`` raises, and waits for nothing."""

    def refuse(*_):
        raise DataDirectoryProblem("full")

    place = {"prepare": (engines.Artifacts, "prepare"), "open": (Store, "open"), "recover": (queue, "recover")}
    monkeypatch.setattr(*place[broken], refuse)
    engine = Engine(tmp_path / "data", PAINT)
    with pytest.raises(DataDirectoryProblem, match="full"):
        engine.start()


def test_what_a_dead_owner_left_running_is_drawn_again(tmp_path, painter, watch):
    with_work = Store.open(tmp_path / "data")
    found, _ = experiments.submit(with_work, planned(), tmp_path / "data" / "scenes")
    assert queue.claim(with_work, machine="here", device="llvm")
    with_work.close()
    engine = Engine(tmp_path / "data", PAINT, on_change=watch.poke)
    engine.start()
    watch.until(lambda: state(engine, found.id) == "done")
    engine.stop()
    assert dict(select(Store.read(tmp_path / "data"), "select outcome, count(*) from attempt group by 1")) == {
        "owner_lost": 1, "done": 3,
    }  # fmt: skip


def test_stopping_gives_back_what_is_drawn(tmp_path, painter, watch):
    engine = Engine(tmp_path / "data", PAINT, on_change=watch.poke)
    engine.start()
    painter.allowed = 1
    submit(engine, spp=[1], replicates=2, reference=False)
    watch.until(lambda: engine.moment.drawing and engine.moment.drawing.done)
    engine.stop()
    store = Store.read(tmp_path / "data")
    assert select(store, "select state from cell") == [("queued",)]
    assert select(store, "select outcome from attempt") == [("released",)]
    assert select(store, "select count(*) from replicate") == [(1,)]
    assert painter.closed


class Trouble(Painter):
    """Raises once, instead of drawing."""

    def __init__(self, error: BaseException):
        super().__init__()
        self.error: BaseException | None = error

    def events(self, timeout):
        if self.held and self.error is not None:
            error, self.error = self.error, None
            raise error
        return super().events(timeout)


@pytest.mark.parametrize(
    ("error", "told"),
    [
        (EnvironmentProblem("the render process does not start"), "the render process does not start"),
        (DataDirectoryProblem("the disk of the data directory is full"), "the disk of the data directory is full"),
        (ValueError("a bug of ours"), "a bug of ours"),
        (OSError(errno.EMFILE, "Too many open files"), r"\[Errno 24\] Too many open files"),
    ],
    ids=["environment", "data directory", "bug", "system"],
)
@pytest.mark.parametrize("asked", [False, True], ids=["by itself", "when asked"])
def test_a_stall_is_told_and_tried_again(tmp_path, monkeypatch, watch, error, told, asked):
    """After a while, or at once when somebody asks for something; nothing is lost and nothing drawn twice."""
    painter = Trouble(error)
    monkeypatch.setattr(engines, "LocalExecutor", lambda *_, **__: painter)
    monkeypatch.setattr(engines, "RETRY_SECONDS", 3600.0 if asked else 0.01)
    engine = Engine(tmp_path / "data", PAINT)
    seen: list[tuple[str, str | None]] = []

    def hear():
        seen.append((engine.moment.state, engine.moment.trouble))
        watch.poke()

    engine.on_change = hear
    engine.start()
    number = submit(engine)
    if asked:
        watch.until(lambda: any(state == "stalled" for state, _ in seen))
        assert engine.do(lambda store, _: store.revision()) > 0
    watch.until(lambda: state(engine, number) == "done" and engine.moment.state == "idle")
    stalled = [trouble for state_, trouble in seen if state_ == "stalled"]
    assert stalled and all(re.fullmatch(told, trouble) for trouble in stalled)
    assert engine.moment.trouble is None
    assert len(painter.drawn) == len(set(painter.drawn)) == 6
    engine.stop()


def test_a_stall_ends_when_there_is_nothing_left_to_draw(tmp_path, monkeypatch, watch):
    """A cancelled experiment leaves no red message behind."""
    painter = Trouble(EnvironmentProblem("it does not start"))
    monkeypatch.setattr(engines, "LocalExecutor", lambda *_, **__: painter)
    monkeypatch.setattr(engines, "RETRY_SECONDS", 3600.0)
    engine = Engine(tmp_path / "data", PAINT, on_change=watch.poke)
    engine.start()
    number = submit(engine)
    watch.until(lambda: engine.moment.state == "stalled")
    engine.do(lambda _, dispatcher: dispatcher.cancel(number))
    watch.until(lambda: engine.moment.state == "idle")
    assert engine.moment.trouble is None
    engine.stop()


def test_a_folder_that_cannot_be_written_stalls_it_until_it_can(engine, painter, watch, monkeypatch):
    """A file stands where the pictures should go; reading works all the time."""
    monkeypatch.setattr(engines, "RETRY_SECONDS", 0.01)
    obstacle = engine.artifacts.data / "images"
    obstacle.write_text("in the way")
    number = submit(engine)
    watch.until(lambda: engine.moment.state == "stalled")
    assert "is a file, and a data directory is a folder" in engine.moment.trouble
    assert state(engine, number) in ("queued", "running")
    obstacle.unlink()
    watch.until(lambda: state(engine, number) == "done" and engine.moment.state == "idle")
    assert engine.moment.trouble is None


FULL = """
import os
import sys
from pathlib import Path
from jobs import experiments
from renderer import devices
from service import engine as engines
from service.engine import Engine
from tests.jobs.conftest import assert_sound, planned
from tests.service.conftest import Watch

out = os.fdopen(os.dup(1), "w")  # reading a picture swaps stdout for a moment
folder, watch = Path(sys.argv[1]), Watch()
engines.RETRY_SECONDS = 0.01
filler = folder / "filler.bin"
engine = Engine(folder / "data", devices.pick("llvm"), on_change=watch.poke)
engine.start()

def submit_and_fill(store, dispatcher):
    found, _ = dispatcher.submit(planned(spp=[1, 2], resolution=[256, 256]))
    with filler.open("wb", buffering=0) as file:
        try:
            while file.write(bytes(4096)):
                pass
        except OSError as error:
            print(error.strerror, file=out)
        file.truncate(file.tell() - int(sys.argv[2]))
    return found

found = engine.do(submit_and_fill)
watch.until(lambda: engine.moment.state == "stalled")
print(engine.moment.trouble, file=out)
filler.unlink()

def state():
    with engine.readers.lend() as store:
        return experiments.standing(store, found.id)

watch.until(lambda: state().state == "done" and engine.moment.state == "idle")
print(engine.moment.trouble, state().failed, state().had, file=out)
engine.do(lambda store, _: assert_sound(store))
engine.stop()
out.close()
"""


@pytest.mark.parametrize("space", [0, 300_000], ids=["for nothing", "for rows, not for a picture"])
def test_a_full_disk_stalls_it_until_there_is_space(tmp_path, space):
    """A real file system that runs full, and a real render process: the owner or its child finds no space."""
    alone = ["unshare", "--mount", "--map-root-user"]
    if (
        subprocess.run([*alone, "true"], capture_output=True).returncode
        or subprocess.run([*alone, "mount", "-t", "tmpfs", "none", str(tmp_path)], capture_output=True).returncode
    ):
        pytest.skip("this machine lets nobody mount a file system")
    script = 'mount -t tmpfs -o size=12m none "$1" && cd "$4" && exec "$2" -c "$3" "$1" "$5"'
    told = subprocess.run(
        [*alone, "sh", "-c", script, "sh", str(tmp_path), sys.executable, FULL, str(ROOT), str(space)],
        capture_output=True, text=True, timeout=120,
    )  # fmt: skip
    assert told.returncode == 0, told.stderr
    full, trouble, *rest = told.stdout.splitlines()
    assert full == "No space left on device"
    assert "is full; free some space and run again: what was finished is there" in trouble
    assert rest == ["None 0 6"], told


def test_a_render_process_that_is_killed_is_replaced(rendered: House):
    """kill -9 in the middle of a picture: the grid goes on to its end, and the experiment knows of nothing."""
    found = rendered.submit(name="killed", spp=[64, 256], replicates=2, samplers=["independent"])
    rendered.watch.until(lambda: (drawing := rendered.engine.moment.drawing) and found.id in drawing.experiments)
    (child,) = render_processes(os.getpid())
    os.kill(child, signal.SIGKILL)
    rendered.finish(found.id)
    assert child not in render_processes(os.getpid())
    assert rendered.experiment(found.id).failed == 0
    worker = answer(rendered.client.get("/api/worker"), schemas.Worker)
    assert (worker.state, worker.trouble, worker.queued) == ("idle", None, 0)


def test_real_pictures_are_measured_and_the_estimate_is_learnt(rendered: House):
    """What one experiment took, the next is told beforehand."""
    rendered.do(lambda _, dispatcher: measure(dispatcher))
    cells = answer(rendered.client.get("/api/experiments/1/cells"), schemas.Cells)
    assert all(cell.metrics["relmse"][2] == 2 and cell.seconds for cell in cells.cells if cell.role == "cell")
    told = answer(rendered.client.post("/api/experiments?dry_run=true", json={"grid": GRID}), schemas.DryRun)
    assert (told.experiment, told.reused, told.replicates, told.rough) == (1, 10, 10, False)
    rendered.do(lambda store, _: assert_sound(store))
