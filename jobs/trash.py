"""
Deleting an experiment, with a way back: it vanishes at once and is gone for good some minutes later.

What goes with it are the cells that no other experiment has, with their pictures, numbers and logs. Snapshots of
scenes stay: they are small, and another grid may name them.
"""

from __future__ import annotations

import contextlib
import datetime
import json
from dataclasses import dataclass

from jobs import queue
from jobs.artifacts import Artifacts
from jobs.store import Store

UNDO_SECONDS = 600  # between a deletion and its end
KEY_SECONDS = 86_400  # how long a submission's key is remembered


@dataclass(frozen=True)
class Loss:
    """What a deletion takes: cells that nobody else wants, their pictures, and the bytes of those."""

    cells: int
    pictures: int
    disk_bytes: int


def loss(store: Store, artifacts: Artifacts, experiment: int) -> Loss:
    """What deleting an experiment would take."""
    cells = _doomed(store, experiment)
    images = [row["image"] for row in store.rows("images_of_cells", cells=json.dumps(cells))]
    size = 0
    for image in images:
        with contextlib.suppress(OSError):
            size += artifacts.path(image).stat().st_size
    return Loss(len(cells), len(images), size)


def empty(store: Store, artifacts: Artifacts, *, seconds: float = UNDO_SECONDS) -> int:
    """For the owner, now and then: end what was deleted more than ``seconds`` ago; how many experiments."""
    store.run("forget_submissions", before=_ago(KEY_SECONDS))
    gone = [row["id"] for row in store.rows("deleted_before", before=_ago(seconds))]
    for experiment in gone:
        _purge(store, artifacts, experiment)
    return len(gone)


def final_at(deleted_at: str) -> str:
    """When a deletion becomes final: UTC, ISO 8601."""
    moment = datetime.datetime.fromisoformat(deleted_at) + datetime.timedelta(seconds=UNDO_SECONDS)
    return moment.isoformat(timespec="milliseconds")


def _purge(store: Store, artifacts: Artifacts, experiment: int) -> None:
    """Rows first, in one transaction, then files: a file without its row harms nobody."""
    cells = json.dumps(_doomed(store, experiment))
    files = [row["image"] for row in store.rows("images_of_cells", cells=cells)]
    files += [row["log"] for row in store.rows("logs_of_cells", cells=cells)]
    # Deleting a row makes SQLite look for its children, table by table and row by row: minutes for a large grid. Here
    # the children go first, a table at a time.
    with store.without_foreign_keys(), store.transaction():
        for step in ("purge_metrics", "purge_floors", "purge_replicates", "purge_attempts"):
            store.run(step, cells=cells)
        store.run("purge_events", cells=cells, experiment_id=experiment)
        for step in ("purge_points", "purge_submissions", "purge_wanted"):
            store.run(step, experiment_id=experiment)
        store.run("purge_cells", cells=cells)
        store.run("purge_experiment", experiment_id=experiment)
        queue.note(store, "purge")
    for name in files:
        path = artifacts.path(name)
        with contextlib.suppress(OSError):
            path.unlink()
            path.parent.rmdir()  # of a digest, when its last picture is gone


def _doomed(store: Store, experiment: int) -> list[int]:
    return [row["id"] for row in store.rows("doomed", experiment_id=experiment)]


def _ago(seconds: float) -> str:
    moment = datetime.datetime.now(datetime.UTC) - datetime.timedelta(seconds=seconds)
    return moment.isoformat(timespec="milliseconds")
