"""
The dispatcher: the one loop that claims cells, hands them to an executor and records what comes back.

It runs in the owner of the data directory, in one thread, and all that changes the database happens there: other
threads hand in a task (``ask``). A finished picture is moved into place and its row
committed before the loop looks at anything else, so whatever dies next, that replicate stays. Measuring is
done in small steps between events, while the executor draws the next cell. Whoever follows a run listens to
``on_news`` and never touches the queue.
"""

from __future__ import annotations

import itertools
import logging
import queue as queues
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from jobs import disk, experiments, inbox, points, queue
from jobs.artifacts import Artifacts
from jobs.executors import base
from jobs.executors.base import Done, Event, Executor, Failed, Finished, Order, Passed, Released, Started
from jobs.experiments import Experiment
from jobs.measure import Measurer
from jobs.plan import Plan
from jobs.queue import Work
from jobs.store import Store

WAIT_SECONDS = 0.25  # longest wait for an event: also how soon a request in the inbox is seen
IDLE_WAIT_SECONDS = 2.0  # the same with nothing to do: a server that sleeps
REST_SECONDS = 60.0  # idle for so long, and the render process is ended: it holds some 200 MB
ORDERS = itertools.count(1)  # a dispatcher that takes over an executor must not mistake its predecessor's orders
MEASURE_SECONDS = 0.02  # measured at a stretch between two looks at the executor

log = logging.getLogger("dartboard")


@dataclass(frozen=True)
class News:
    """
    Something a person following the run may want to know.

    kind   "started", "pass", "replicate", "done", "failed", "cancelled" or "requeued"
    event  the executor's own event, with numbers
    state  of the cell after it, where it has changed
    """

    kind: str
    work: Work
    event: Event
    state: str = ""


class Dispatcher:
    """
    Works for one experiment, or for all of them (``experiment`` None), until nothing is left to do, or with
    ``forever`` until it is stopped.

    ``on_news`` hears what happens to cells, ``on_turn`` is called between two events. ``stop`` may be called from a
    signal handler. Errors of the data directory (full, gone) end ``run`` with ``DataDirectoryProblem``: what was
    committed stays, the rest is rendered by the next owner.
    """

    def __init__(
        self,
        store: Store,
        artifacts: Artifacts,
        executor: Executor,
        *,
        machine: str,
        device: str,
        experiment: int | None = None,
        forever: bool = False,
        on_news: Callable[[News], None] = lambda news: None,
        on_turn: Callable[[], None] = lambda: None,
    ):
        self.store, self.artifacts, self.executor = store, artifacts, executor
        self.machine, self.device, self.experiment, self.on_news = machine, device, experiment, on_news
        self.forever, self.on_turn = forever, on_turn
        self.measurer = Measurer(store, artifacts)
        self.tasks: queues.SimpleQueue[Callable[[], None]] = queues.SimpleQueue()
        self.under_way: dict[int, Work] = {}  # order number → work
        self.cancelled: set[int] = set()  # orders killed because nobody wants their cell any more
        self.stopping = False

    def stop(self) -> None:
        """End ``run`` soon; what is being drawn goes back to the queue."""
        self.stopping = True
        self.executor.wake()

    def ask(self, task: Callable[[], None]) -> None:
        """Have ``task`` done between two events, by the thread that may write; returns at once. From any thread."""
        self.tasks.put(task)
        self.executor.wake()

    def run(self) -> None:
        """Claim, render, record and measure until nothing is left or ``stop`` is called."""
        self.measurer.look_for_gaps()
        idle_since: float | None = None
        while not self.stopping:
            self._answer_requests()
            self._fill()
            busy = self.measurer.step(MEASURE_SECONDS)
            self.on_turn()
            idle = not self.under_way and not busy
            if not idle:
                idle_since = None
            elif not self.forever:
                return
            elif idle_since is None:
                idle_since = time.monotonic()
            elif time.monotonic() - idle_since > REST_SECONDS:
                self.executor.rest()
            for event in self.executor.events(0.0 if busy else IDLE_WAIT_SECONDS if idle else WAIT_SECONDS):
                self._record(event)
        for order, work in self.under_way.items():
            self.executor.cancel(order)
            queue.release(self.store, work)
        self.under_way.clear()

    def submit(self, wanted: Plan, key: str | None = None) -> tuple[Experiment, int]:
        """``experiments.submit``; what the plan shares with others is measured against its own references."""
        found, new = experiments.submit(self.store, wanted, self.artifacts.scenes, key, points=self.artifacts.points)
        self.measurer.look_into(found.id)
        return found, new

    def cancel(self, experiment: int) -> None:
        """Stop an experiment for good (until retry), and what is drawn for it alone at once."""
        self._drop(queue.cancel(self.store, experiment))

    def pause(self, experiment: int) -> None:
        """Stop an experiment for a while."""
        self._drop(queue.pause(self.store, experiment))

    def delete(self, experiment: int) -> None:
        """Put an experiment into the trash."""
        self._drop(queue.delete(self.store, experiment))

    def _drop(self, cells: list[int]) -> None:
        """Kill what draws these cells: nobody wants them any more."""
        unwanted = set(cells)
        for order, work in list(self.under_way.items()):
            if work.cell_id in unwanted:
                self.cancelled.add(order)
                self.executor.cancel(order)

    def _fill(self) -> None:
        """Give the executor as much as it takes."""
        while self.executor.room() and not self.stopping:
            work = queue.claim(self.store, machine=self.machine, device=self.device, experiment=self.experiment)
            if work is None:
                return
            order = next(ORDERS)
            scene = self.store.one("scene_by_digest", digest=work.spec.estimand.scene)
            assert scene is not None, "a cell's scene is a foreign key"
            self.under_way[order] = work
            self.executor.submit(
                Order(
                    order=order,
                    spec=work.spec.text,
                    colour=work.spec.estimand.colour,
                    scene=self.artifacts.scene_folder(work.spec.estimand.scene),
                    main=scene["main"],
                    trust="builtin" if scene["builtin"] else work.spec.estimand.scene,
                    replicates=work.missing,
                    out=self.artifacts.work,
                    preview=self.artifacts.preview(work.digest),
                    points=self.artifacts.points,
                )
            )

    def _record(self, event: Event) -> None:
        work = self.under_way.get(event.order)
        if work is None:
            return  # an order that was cancelled while its last event was on its way
        state, kind = "", "pass"
        match event:
            case Started():
                kind = "started"
            case Passed():
                pass
            case Finished():
                kind = "replicate"
                self._keep(work, event)
            case Done():
                kind, state = "done", queue.finish(self.store, work)
            case Failed(error_class=base.DISK_FULL):
                raise disk.full(self.artifacts.data)  # the cell is not to blame; the next owner queues it again
            case Failed():
                kept = self.artifacts.write_log(work.attempt_id, event.log)
                state = queue.fail(self.store, work, event.error_class, event.message, kept)
                kind = "failed" if state == "failed" else "requeued"
            case Released():
                if event.order in self.cancelled:
                    kind = "cancelled"
                else:
                    queue.release(self.store, work)
                    kind = "requeued"
        if isinstance(event, (Done, Failed, Released)):
            del self.under_way[event.order]
            self.artifacts.preview(work.digest).unlink(missing_ok=True)
            self.cancelled.discard(event.order)
        self.on_news(News(kind, work, event, state))

    def _keep(self, work: Work, event: Finished) -> None:
        """Move a finished picture into place, commit its row, and queue it for measuring."""
        image = self.artifacts.picture(work.digest, event.role, event.k)
        self.artifacts.adopt(self.artifacts.work / event.file, image)
        with self.store.transaction():
            replicate = queue.finish_replicate(
                self.store, work, event.role, event.k, image=image, seed=event.seed,
                render_seconds=event.render_seconds, compile_seconds=event.compile_seconds, threads=event.threads,
                neighbours=event.neighbours,
            )  # fmt: skip
            points.refresh(self.store, [work.cell_id])
        self.measurer.add(replicate)

    def _answer_requests(self) -> None:
        """What other threads asked, and what commands left in the inbox."""
        while True:
            try:
                task = self.tasks.get_nowait()
            except queues.Empty:
                break
            task()
        for request in inbox.take(self.artifacts.data):
            self._answer(request)

    def _answer(self, request: dict[str, Any]) -> None:
        match request["do"], request["experiment"]:
            case "cancel", experiment:
                self.cancel(experiment)
            case "pause", experiment:
                self.pause(experiment)
            case "resume", experiment:
                queue.resume(self.store, experiment)
            case "retry", experiment:
                queue.retry(self.store, experiment)
            case what, _:
                log.warning("the inbox holds a request that this version does not know: %s", what)
