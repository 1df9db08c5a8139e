"""
The engine: the thread that owns the data directory while the server runs.

It opens the database for writing, runs the dispatcher and its render process, and does every change that a route asks
for (``do``), one after the other. Routes read through connections of their own (``Readers``). A disk that is full or a
renderer that does not start stalls it, with the reason on every page; it tries again by itself and when asked.
"""

from __future__ import annotations

import datetime
import logging
import platform
import threading
import time
from collections.abc import Callable
from concurrent.futures import Future
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, TypeVar

from jobs import experiments, queue, trash
from jobs.artifacts import Artifacts
from jobs.dispatcher import Dispatcher, News
from jobs.executors.base import Done, Failed, Finished, Passed, Released, Started
from jobs.executors.local import LocalExecutor
from jobs.lister import SceneLister
from jobs.store import Store
from renderer.devices import Device
from renderer.errors import DartboardError, EnvironmentProblem
from service.names import cell_name
from service.readers import Readers
from service.settings import usable_kernel_caches
from service.standings import Standings

T = TypeVar("T")
Change = Callable[[Store, Dispatcher], T]

RETRY_SECONDS = 10.0  # after a stall
CHANGE_SECONDS = 60.0  # longest wait for a change: a grid of 100 000 cells takes 5 s on a slow disk
CLEANING_SECONDS = 60.0  # between two looks into the trash
MEMORY = 0.9  # of the rate of drawing: what a new picture leaves of the samples and seconds of those before it
ENDING = "the server is ending; start it again with `dartboard up` and ask once more"

log = logging.getLogger("dartboard")


@dataclass(frozen=True)
class Drawing:
    """The picture that is being drawn, and the experiments that want it."""

    cell: int
    role: str
    replicate: int
    description: str
    experiments: tuple[int, ...]
    done: int = 0
    passes: int = 0
    seconds: float = 0.0
    preview: int = 0


@dataclass(frozen=True)
class Moment:
    """
    What the engine is doing: replaced as a whole, so that other threads read it without a lock.

    rate  samples per second that this machine draws now; None before the first picture
    """

    state: str = "starting"
    trouble: str | None = None
    drawing: Drawing | None = None
    rate: float | None = None
    revision: int = 0
    queued: int = 0


class Engine:
    """
    One per server. ``start`` returns when the database is open, ``stop`` when nothing of it is left.

    on_change  called from the engine's thread whenever ``moment`` is another: quick, and thread-safe
    """

    def __init__(self, data: Path, device: Device, on_change: Callable[[], None] = lambda: None):
        self.artifacts = Artifacts(data)
        self.device, self.on_change = device, on_change
        self.lister = SceneLister(lambda: device)  # what can be swept in a scene
        self.readers, self.standings = Readers(self.artifacts.data), Standings()
        self.moment = Moment()
        self.machine = platform.node()
        self.started_at = datetime.datetime.now(datetime.UTC).isoformat(timespec="milliseconds")
        self.stopping = threading.Event()
        self.wanted = threading.Event()  # something to do while it is stalled
        self.dispatcher: Dispatcher | None = None
        self.waiting: list[tuple[Change[Any], Future[Any]]] = []
        self.lock = threading.Lock()
        self.ended = False
        self.opened: Future[None] = Future()
        self.thread = threading.Thread(target=self._run, name="engine", daemon=True)
        self.cleaned = 0.0
        self.samples = self.seconds = 0.0  # of the last pictures, see MEMORY

    def start(self) -> None:
        """Raises ``DataDirectoryProblem`` if the data directory cannot be opened."""
        self.thread.start()
        self.opened.result()

    def stop(self) -> None:
        """End the render process and the thread; what is finished is kept, what is drawn goes back to the queue."""
        self.stopping.set()
        self.wanted.set()
        with self.lock:
            if self.dispatcher is not None:
                self.dispatcher.stop()
        self.thread.join()
        self.readers.close()

    def do(self, change: Change[T]) -> T:
        """
        Have ``change(store, dispatcher)`` done by the engine's thread; its result, or its error.

        Raises ``EnvironmentProblem`` if the engine does not come round to it, or ends first.
        """
        future: Future[T] = Future()
        with self.lock:
            if self.ended:
                raise EnvironmentProblem(ENDING)
            self.waiting.append((change, future))
            self.wanted.set()
            if self.dispatcher is not None:
                self.dispatcher.ask(self._serve)  # under the lock: what wakes it is closed when it is gone
        try:
            return future.result(CHANGE_SECONDS)
        except TimeoutError:
            future.cancel()
            raise EnvironmentProblem(
                f"the server did not come round to this in {CHANGE_SECONDS:.0f} s; it is busy or stalled: "
                f"{self.moment.trouble or 'try again'}"
            ) from None

    # -- in the engine's thread ----------------------------------------------------------------------------------------

    def _run(self) -> None:
        store: Store | None = None
        try:
            self.artifacts.prepare()
            store = Store.open(self.artifacts.data)
            queue.recover(store)
            self._clean(store)
            self._change(revision=store.revision(), queued=int(store.value("open_cells")))
            self.opened.set_result(None)
            while not self.stopping.is_set():
                self._work(store)
        except BaseException as error:
            if self.opened.done():
                log.exception("the engine has ended; start the server again")
            else:
                self.opened.set_exception(error)
        finally:
            self._refuse_the_rest()
            if store is not None:
                store.close()

    def _work(self, store: Store) -> None:
        """Dispatch until the end, or until something stalls it; then wait for better times, or for somebody to ask."""
        try:
            self._dispatch(store)
        except DartboardError as error:
            self._stall(error)
        except Exception as error:  # a bug of ours must not leave a server that looks alive and does nothing
            log.exception("the engine stumbled")
            self._stall(error)
        if self.moment.trouble and not self.stopping.is_set():
            self.wanted.wait(RETRY_SECONDS)

    def _dispatch(self, store: Store) -> None:
        executor = LocalExecutor(
            self.device, kernels=usable_kernel_caches(self.artifacts.data), logs=self.artifacts.logs,
            cwd=self.artifacts.empty,
        )  # fmt: skip
        dispatcher = Dispatcher(
            store, self.artifacts, executor, machine=self.machine, device=self.device.name, forever=True,
            on_news=lambda news: self._hear(store, news), on_turn=lambda: self._turn(store),
        )  # fmt: skip
        self.serving = (store, dispatcher)
        with self.lock:
            self.dispatcher = dispatcher
        try:
            self._serve()
            queue.recover(store)  # what a stall has left under way
            if not self.stopping.is_set():
                dispatcher.run()
        finally:
            with self.lock:
                self.dispatcher = None
            executor.close()

    def _stall(self, error: Exception) -> None:
        log.warning("rendering has stalled: %s", error)
        self._change(trouble=str(error) or type(error).__name__, drawing=None)

    def _serve(self) -> None:
        """Do what routes asked for."""
        while True:
            with self.lock:
                if not self.waiting:
                    self.wanted.clear()
                    return
                change, future = self.waiting.pop(0)
            if not future.set_running_or_notify_cancel():
                continue
            store, dispatcher = self.serving
            try:
                result = change(store, dispatcher)
                self._look(store)  # first: who asked, and asks what is new now, sees it
            except BaseException as error:
                future.set_exception(error)
            else:
                future.set_result(result)

    def _refuse_the_rest(self) -> None:
        """Nobody will do what is still asked for, or will be: whoever waits is told so at once."""
        with self.lock:
            self.ended = True
            waiting, self.waiting = self.waiting, []
        for _, future in waiting:
            if future.set_running_or_notify_cancel():
                future.set_exception(EnvironmentProblem(ENDING))

    def _turn(self, store: Store) -> None:
        """Between two events: has something changed that no news tells?"""
        if time.monotonic() - self.cleaned > CLEANING_SECONDS:
            self._clean(store)
        if self.moment.trouble and not self.serving[1].under_way:
            self._change(trouble=None)  # with nothing to draw there is nothing that could be in trouble
        self._look(store)

    def _look(self, store: Store) -> None:
        revision = store.revision()
        if revision != self.moment.revision:
            self._change(revision=revision, queued=int(store.value("open_cells")))

    def _clean(self, store: Store) -> None:
        self.cleaned = time.monotonic()
        trash.empty(store, self.artifacts)

    def _hear(self, store: Store, news: News) -> None:
        """News of the dispatcher as a new moment."""
        drawing, rate, trouble = self.moment.drawing, self.moment.rate, None
        match news.event:
            case Started():
                drawing = self._drawing(store, news)
            case Passed() as passed:
                if drawing is None or drawing.cell != news.work.cell_id:
                    drawing = self._drawing(store, news)
                drawing = replace(
                    drawing, role=passed.role, replicate=passed.k, done=passed.done, passes=passed.passes,
                    seconds=passed.seconds, preview=passed.preview,
                )  # fmt: skip
                self._change(drawing=drawing, trouble=None)
                return
            case Finished() as finished:
                width, height = news.work.spec.estimand.size
                seconds = max(finished.render_seconds + finished.compile_seconds, 1e-3)
                self.samples = MEMORY * self.samples + width * height * news.work.spec.spp
                self.seconds = MEMORY * self.seconds + seconds
                rate = self.samples / self.seconds  # of sums: a large picture tells more than a small one
            case Done() | Failed() | Released() as last:
                if isinstance(last, Failed):
                    log.warning("%s: %s", last.error_class, last.message)
                if isinstance(last, Released):
                    trouble = self.moment.trouble  # nothing was drawn: that says nothing about it
                if drawing is not None and drawing.cell == news.work.cell_id:
                    drawing = None
        self._change(
            drawing=drawing, rate=rate, trouble=trouble, revision=store.revision(),
            queued=int(store.value("open_cells")),
        )  # fmt: skip

    def _drawing(self, store: Store, news: News) -> Drawing:
        wanted = store.rows("experiments_of_cell", cell_id=news.work.cell_id)
        where = wanted[0] if wanted else {"scene": "", "integrator": "", "sampler": ""}
        role, replicate = news.work.missing[0]
        spec = news.work.spec
        description = cell_name(where["scene"], where["integrator"], where["sampler"], spec.spp, spec.estimand.sweep)
        return Drawing(
            news.work.cell_id, role, replicate, description, tuple(dict.fromkeys(row["id"] for row in wanted))
        )

    def _change(self, **values: Any) -> None:
        moment = replace(self.moment, **values)
        self.moment = replace(moment, state=self._state(moment))
        self.on_change()

    def _state(self, moment: Moment) -> str:
        if moment.trouble is not None:
            return "stalled"
        if moment.drawing is not None:
            return "rendering"
        return "starting" if self.dispatcher and self.dispatcher.under_way else "idle"


def seconds_left(store: Store, experiment: int, rate: float | None) -> float | None:
    """How long an experiment still takes on this machine; None if nothing is left or nothing was ever timed."""
    samples = store.value("samples_left", experiment_id=experiment)
    if not samples:
        return None
    rate = rate or max(experiments.rates(store, platform.node()).values(), default=0.0)
    return samples / rate if rate else None
