"""
An executor that draws at once, without Mitsuba: noise that depends on the cell's name only.

It draws as many pictures as it is allowed to, so that a test stops the world between any two of them: no clocks.
"""

from __future__ import annotations

import itertools
import threading
from collections import deque
from dataclasses import dataclass, field

import numpy as np

from jobs.executors.base import Done, Event, Finished, Order, Passed, Released, Started
from renderer.images import write_picture
from renderer.spec import CellSpec

FOR_EVER = 1 << 60


def noise(digest: str, role: str, k: int, size: tuple[int, int], spp: int) -> np.ndarray:
    """Radiance of mean 1 and of variance 1 / spp: a picture whose mean squared error is known."""
    rng = np.random.default_rng([int(digest[:8], 16), k, role == "reference"])
    return rng.gamma(spp, 1 / spp, (size[1], size[0], 3)).astype(np.float32)


@dataclass
class Drawing:
    """An order under way, and what of it is still to be drawn."""

    order: Order
    left: deque[tuple[str, int]]
    started: bool = False


@dataclass
class Painter:
    """
    allowed   pictures that it may still draw
    seconds   what it says that a picture took, times spp
    drawn     (digest, role, k) in the order of drawing, ever
    """

    allowed: int = FOR_EVER
    seconds: float = 1e-4
    drawn: list[tuple[str, str, int]] = field(default_factory=list)
    held: deque[Drawing] = field(default_factory=deque)
    happened: list[Event] = field(default_factory=list)
    bell: threading.Event = field(default_factory=threading.Event)
    numbers: itertools.count[int] = field(default_factory=itertools.count)
    closed: bool = False

    def allow(self, pictures: int) -> None:
        """Draw so many more. From any thread."""
        self.allowed += pictures
        self.wake()

    def room(self) -> int:
        return 2 - len(self.held)

    def submit(self, order: Order) -> None:
        self.held.append(Drawing(order, deque(order.replicates)))

    def cancel(self, order: int) -> None:
        for drawing in list(self.held):
            if drawing.order.order == order:
                self.held.remove(drawing)
                self.happened.append(Released(order))

    def events(self, timeout: float) -> list[Event]:
        if not self.happened and self.held:
            self._draw(self.held[0])
        if not self.happened:
            self.bell.wait(timeout)
            self.bell.clear()
        happened, self.happened = self.happened, []
        return happened

    def wake(self) -> None:
        self.bell.set()

    def rest(self) -> None:
        pass

    def close(self) -> None:
        self.held.clear()
        self.closed = True

    def _draw(self, drawing: Drawing) -> None:
        order = drawing.order
        if not drawing.started:
            drawing.started = True
            self.happened.append(Started(order.order))
        elif drawing.left and self.allowed <= 0:
            return
        elif drawing.left:
            role, k = drawing.left.popleft()
            self.allowed -= 1
            spec = CellSpec.parse(order.spec)
            file = f"painted-{next(self.numbers)}.exr"
            write_picture(order.out / file, noise(spec.digest, role, k, spec.estimand.size, spec.spp), {})
            self.drawn.append((spec.digest, role, k))
            seconds = self.seconds * spec.spp
            self.happened += [
                Passed(order.order, role, k, 1, 1, seconds),
                Finished(order.order, role, k, file, k, seconds, 0.0, 1, "paint", 0),
            ]
        else:
            self.held.popleft()
            self.happened.append(Done(order.order))
