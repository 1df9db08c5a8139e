"""
Measuring: every (replicate, reference) pair that lacks a metric gets it.

Order does not matter: a replicate is measured when its reference is complete, a new reference measures all
that waited for it, and a metric whose formula gets a new version fills itself in. Work is done in small steps,
so that the dispatcher can look after the renderer in between. A value that is not finite is stored as missing,
with the reason.
"""

from __future__ import annotations

import json
import math
import time
from collections import OrderedDict, deque

import numpy as np

from jobs.artifacts import Artifacts
from jobs.store import Row, Store, now
from renderer.errors import DartboardError
from renderer.images import read_picture
from renderer.metrics import METRICS, Reference, measure

REFERENCES_KEPT = 4  # in memory; a grid works on one scene at a time
VERSIONS = json.dumps({name: metric.version for name, metric in METRICS.items()})


class Measurer:
    """Knows which pairs are to be measured, and measures them a few at a time."""

    def __init__(self, store: Store, artifacts: Artifacts):
        self.store, self.artifacts = store, artifacts
        self.pending: deque[Row] = deque()
        self.references: OrderedDict[tuple[int, int], Reference | str] = OrderedDict()

    def look_for_gaps(self) -> None:
        """Everything in the data directory that lacks a metric: after a start, or a new version of a formula."""
        self.pending = deque(self.store.rows("pairs_with_gaps", versions=VERSIONS))

    def add(self, replicate_id: int) -> None:
        """A replicate was just committed: it can be measured, or it completes a reference."""
        replicate = self.store.one("replicate_by_id", id=replicate_id)
        assert replicate is not None
        if replicate["role"] == "reference":
            self.pending.extend(self.store.rows("pairs_of_reference", cell_id=replicate["cell_id"]))
        else:
            self.pending.extend(self.store.rows("pairs_of_replicate", replicate_id=replicate_id))

    def step(self, seconds: float) -> bool:
        """Measure for about ``seconds``, at least one pair; True if some are left."""
        end = time.monotonic() + seconds
        if self.pending:
            with self.store.transaction():
                while self.pending:
                    self._measure(self.pending.popleft())
                    if time.monotonic() >= end:
                        break
                self.store.insert("add_event", at=now(), what="measure", cell_id=None, experiment_id=None)
        return bool(self.pending)

    def _measure(self, pair: Row) -> None:
        reference = self._reference(pair["reference_id"], pair["reference_replicates"])
        values: dict[str, float] = {}
        reason: str | None = None
        if isinstance(reference, str):
            reason = reference
        else:
            try:
                values = measure(read_picture(self.artifacts.path(pair["image"])), reference)
            except (DartboardError, ValueError) as error:
                reason = str(error)
        for name, metric in METRICS.items():
            value = values.get(name, math.nan)
            finite = math.isfinite(value)
            self.store.run(
                "add_metric",
                replicate_id=pair["replicate_id"], reference_id=pair["reference_id"],
                reference_replicates=pair["reference_replicates"], name=name, version=metric.version,
                value=value if finite else None, reason=None if finite else reason or "the value is not finite",
            )  # fmt: skip

    def _reference(self, cell_id: int, replicates: int) -> Reference | str:
        """R1 and R2, the means of the even and the odd replicates; or why there are none."""
        key = (cell_id, replicates)
        if key not in self.references:
            while len(self.references) >= REFERENCES_KEPT:
                self.references.popitem(last=False)
            rows = self.store.rows("reference_images", cell_id=cell_id, replicates=replicates)
            try:
                pictures = [read_picture(self.artifacts.path(row["image"])) for row in rows]
                self.references[key] = Reference(
                    np.mean(pictures[0::2], axis=0, dtype=np.float64), np.mean(pictures[1::2], axis=0, dtype=np.float64)
                )
            except DartboardError as error:
                self.references[key] = f"the reference cannot be read: {error}"
        self.references.move_to_end(key)
        return self.references[key]
