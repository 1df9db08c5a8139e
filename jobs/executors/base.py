"""
The seam between the dispatcher and whatever renders: orders in, events out, and a way to cancel.

An executor never touches the database. It may hold a few orders ahead (``room`` says how many more it takes),
so that the next cell is under way while the last one is written and measured. Whatever happens to its
processes, every order ends in exactly one of Done, Failed or Released.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol

DISK_FULL = "disk_full"  # an error class that blames no cell: there was no space for its picture


@dataclass(frozen=True)
class Order:
    """
    One cell to render.

    order       a number of the dispatcher's, unique in its life
    spec        canonical text of the CellSpec
    colour      colour mode, decides the process together with ``trust``
    scene       folder of the scene's snapshot; ``main`` its XML file
    trust       "builtin" or the scene's digest: a process serves one trust class and is never reused for another
    replicates  (role, k) to draw, in this order
    out         folder that gets the pictures
    preview     file (.npy, float16, see render_process.Previews) that refines while the cell renders
    points      folder of the point files, by digest, that a ``pointset`` sampler reads
    """

    order: int
    spec: str
    colour: str
    scene: Path
    main: str
    trust: str
    replicates: tuple[tuple[str, int], ...]
    out: Path
    preview: Path | None = None
    points: Path | None = None


@dataclass(frozen=True)
class Started:
    order: int


@dataclass(frozen=True)
class Passed:
    """
    Progress inside a replicate: ``done`` of ``passes``, ``seconds`` since its start. ``preview`` grows with every
    preview that was written for the order.
    """

    order: int
    role: str
    k: int
    done: int
    passes: int
    seconds: float
    preview: int = 0


@dataclass(frozen=True)
class Finished:
    """A finished replicate: ``file`` lies in the order's out folder."""

    order: int
    role: str
    k: int
    file: str
    seed: int
    render_seconds: float
    compile_seconds: float
    threads: int
    device: str
    neighbours: int


@dataclass(frozen=True)
class Done:
    order: int


@dataclass(frozen=True)
class Failed:
    """
    The order ended without all its replicates; ``error_class`` is one of the queue's, or DISK_FULL, ``log`` the tail
    of its process's.
    """

    order: int
    error_class: str
    message: str
    log: str


@dataclass(frozen=True)
class Released:
    """The order was given back unharmed: cancelled, or its process ended on account of another order."""

    order: int


Event = Started | Passed | Finished | Done | Failed | Released


class Executor(Protocol):
    """Where cells render."""

    def room(self) -> int:
        """How many more orders it takes now."""
        ...

    def submit(self, order: Order) -> None: ...

    def cancel(self, order: int) -> None:
        """Stop it now, by force; it ends as Released."""
        ...

    def events(self, timeout: float) -> list[Event]:
        """What happened, waiting up to ``timeout`` seconds for something to happen."""
        ...

    def wake(self) -> None:
        """End a wait in ``events`` early; safe in a signal handler."""
        ...

    def rest(self) -> None:
        """End processes that have nothing to do; the next order starts them again."""
        ...

    def close(self) -> None:
        """End every process now. Orders under way are forgotten: the queue's ``recover`` knows them."""
        ...


def as_json(order: Order) -> dict[str, Any]:
    """What a render process is sent (jobs/render_process.py)."""
    return {
        "order": order.order,
        "spec": order.spec,
        "scene": str(order.scene),
        "main": order.main,
        "replicates": list(order.replicates),
        "out": str(order.out),
        "preview": str(order.preview) if order.preview else None,
        "points": str(order.points) if order.points else None,
    }
