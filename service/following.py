"""
Following an experiment on a server to its end, with the bars of ``dartboard run``.

Whoever follows only watches: Ctrl-C lets go and the server works on. A server that goes away is waited for.
"""

from __future__ import annotations

import contextlib
import signal
import time
from collections.abc import Iterator

from service.client import Away, Back, Client
from service.names import cell_name, replicate_name
from service.progress import Bars
from service.schemas import Cell, Experiment, ExperimentDetail, Progress, Update, Worker

ENDS = ("done", "failed", "cancelled")  # states that nothing leaves by itself
MEASURE_SECONDS = 10.0  # after the last picture, for its errors: each takes milliseconds
LOOK_SECONDS = 0.3


class Watcher:
    """Turns a server's events into bars or lines, and keeps the newest state of the experiment."""

    def __init__(self, client: Client, experiment: Experiment, bars: Bars):
        self.client, self.experiment, self.bars = client, experiment, bars
        self.names: dict[int, str] = {}
        self.told: set[tuple[int, str, str]] = set()  # cells whose end was told
        self.trouble: str | None = None

    def hear(self, event: Update | Progress | Away | Back) -> None:
        match event:
            case Away():
                self.bars.say(f"the server at {self.client.url} does not answer; trying again")
            case Back():
                self.bars.say(f"the server at {self.client.url} is back")
            case Progress():
                name = self.names.get(event.cell, "")
                what = f"{replicate_name(event.role, event.replicate)} · pass {event.done}/{event.passes}"
                self.bars.now(" · ".join(filter(None, (name, what))), event.done, event.passes)
            case Update():
                self._update(event)

    def _update(self, update: Update) -> None:
        if update.experiment.state == "paused" != self.experiment.state:
            self.bars.say(f"paused: `dartboard resume {update.experiment.id} --server {self.client.url}` goes on")
        self.experiment = update.experiment
        self.bars.count(update.experiment.had, update.experiment.seconds_left)
        self._look_at(update.worker)
        for cell in update.cells:
            name = cell_name(cell.scene, cell.integrator, cell.sampler, cell.spp, cell.sweep)
            self.names[cell.cell] = name
            if cell.state in ("done", "failed") and (cell.cell, cell.role, cell.state) not in self.told:
                self.told.add((cell.cell, cell.role, cell.state))
                self._end(cell, name)

    def _look_at(self, worker: Worker) -> None:
        if worker.trouble and worker.trouble != self.trouble:
            self.bars.say(f"the server is stalled: {worker.trouble}; it goes on by itself when that has ended")
        self.trouble = worker.trouble
        if worker.cell is not None and worker.description:
            self.names[worker.cell] = worker.description
            if worker.experiment != self.experiment.id:
                self.bars.now(f"the server renders another experiment: {worker.description}", 0, None)

    def _end(self, cell: Cell, name: str) -> None:
        if cell.state == "done":
            self.bars.done(name)
        else:
            self.bars.failed(name, cell.error_class or "failed", cell.error or "without a word")


def follow(client: Client, start: ExperimentDetail) -> tuple[Experiment, bool]:
    """
    Watch an experiment from ``start`` to its end → (its last known state, whether a signal ended the watching).

    Raises ``Refused`` when it is deleted meanwhile, ``ServerProblem`` when its server stays away.
    """
    bars = Bars(start.wanted, start.had, "waiting for the server")
    watcher = Watcher(client, start, bars)
    if start.state in ENDS:
        return start, False
    try:
        with _interruptible(), bars, contextlib.closing(client.follow(start.id, start.revision)) as events:
            for event in events:
                watcher.hear(event)
                if watcher.experiment.state in ENDS:
                    return watcher.experiment, False
    except KeyboardInterrupt:
        pass
    return watcher.experiment, True


def measured(client: Client, start: ExperimentDetail) -> list[Cell]:
    """All cells of an experiment that has ended, when their last errors are there too."""
    deadline = time.monotonic() + MEASURE_SECONDS
    while True:
        cells = list(client.cells(start.id))
        drawn = {cell.cell for cell in cells if cell.role == "reference" and cell.state == "done"}
        missing = any(_unmeasured(cell) for cell in cells if cell.state == "done" and cell.reference in drawn)
        if not missing or time.monotonic() > deadline:
            return cells
        time.sleep(LOOK_SECONDS)


def _unmeasured(cell: Cell) -> bool:
    return max((n for _, _, n in cell.metrics.values()), default=0) < min(cell.had, cell.wanted)


@contextlib.contextmanager
def _interruptible() -> Iterator[None]:
    """SIGTERM is Ctrl-C, and Ctrl-C is heard also where a shell told its children to ignore it."""
    numbers = (signal.SIGINT, signal.SIGTERM)
    previous = {number: signal.signal(number, signal.default_int_handler) for number in numbers}
    try:
        yield
    finally:
        for number, handler in previous.items():
            signal.signal(number, handler)
