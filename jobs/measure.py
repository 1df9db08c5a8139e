"""
Measuring: every (replicate, reference) pair that lacks a metric gets it.

Order does not matter: a replicate is measured when its reference is complete, a new reference measures all
that waited for it, and a metric whose formula gets a new version fills itself in. Work is done in small steps,
so that the dispatcher can look after the renderer in between, and only what is measured next is in memory.

A value that does not exist is stored as missing, with the reason: pixels that are NaN or infinite, a picture of
another size, a reference without halves. A file that cannot be read is logged and tried again by the next owner.
"""

from __future__ import annotations

import json
import logging
import math
import time
from collections import OrderedDict, deque
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from jobs import points
from jobs.artifacts import Artifacts
from jobs.points import VERSIONS
from jobs.store import Row, Store, now
from renderer.errors import DartboardError
from renderer.images import read_picture
from renderer.metrics import METRICS, Reference, floors, measure, nonfinite

KEPT_BYTES = 256 * 2**20  # of references in memory; a grid works on one scene at a time
FLOOR_VERSIONS = json.dumps({name: metric.version for name, metric in METRICS.items() if metric.floor})
PAGE = 200  # cells that are looked through for gaps at a time, some milliseconds

log = logging.getLogger("dartboard")


class Measurer:
    """Knows which pairs are to be measured, and measures them a few at a time."""

    def __init__(self, store: Store, artifacts: Artifacts):
        self.store, self.artifacts = store, artifacts
        self.pairs: deque[Row] = deque()
        self.searches: deque[tuple[int, int]] = deque()  # (reference, last cell that was looked at)
        self.references: OrderedDict[tuple[int, int], Reference] = OrderedDict()
        self.unfloored: deque[tuple[int, int]] = deque()  # references whose own noise is not measured

    def look_for_gaps(self) -> None:
        """Everything in the data directory that lacks a metric: after a start, or a new version of a formula."""
        points.fill_gaps(self.store)
        references = [row["reference_id"] for row in self.store.rows("reference_ids")]
        self.searches.extend((reference, 0) for reference in references)
        self._look_for_floors(references)

    def look_into(self, experiment: int) -> None:
        """What an experiment shares with others and nobody has measured against its references."""
        rows = self.store.rows("references_of_experiment", experiment_id=experiment)
        self.searches.extend((row["reference_id"], 0) for row in rows)
        self._look_for_floors([row["reference_id"] for row in rows])

    def add(self, replicate_id: int) -> None:
        """A replicate was just committed: it can be measured, or it completes a reference."""
        replicate = self.store.one("replicate_by_id", id=replicate_id)
        assert replicate is not None, f"no replicate {replicate_id}"
        if replicate["role"] == "cell":
            self.pairs.extend(self.store.rows("pairs_of_replicate", replicate_id=replicate_id))
        elif self.store.value("completes_reference", cell_id=replicate["cell_id"], k=replicate["k"]):
            self.searches.append((replicate["cell_id"], 0))
            self._look_for_floors([replicate["cell_id"]])

    def step(self, seconds: float) -> bool:
        """Search or measure for about ``seconds``, and get on in any case; True if there may be more."""
        end = time.monotonic() + seconds
        while self.searches and not self.pairs:
            self._search()
            if time.monotonic() >= end:
                break
        if self.unfloored:
            self._measure_floor(*self.unfloored.popleft())
        if self.pairs:
            with self.store.transaction():
                self._measure_until(end)
        return bool(self.pairs or self.searches or self.unfloored)

    def _look_for_floors(self, references: Sequence[int]) -> None:
        """Those of these references whose own noise is not measured."""
        rows = self.store.rows("without_floors", cells=json.dumps(references), versions=FLOOR_VERSIONS)
        self.unfloored.extend((row["reference_id"], row["reference_replicates"]) for row in rows)

    def _measure_floor(self, cell_id: int, replicates: int) -> None:
        """What an exact picture would measure against a reference. One that is not finite has no floor."""
        try:
            found = floors(self._reference(cell_id, replicates))
        except DartboardError as error:
            log.warning("the noise of reference %s is not measured: %s", cell_id, error)
            return
        rows = [
            {
                "reference_id": cell_id, "reference_replicates": replicates, "name": name,
                "version": METRICS[name].version, "value": value,
            }
            for name, value in found.items()
            if math.isfinite(value)
        ]  # fmt: skip
        with self.store.transaction():
            self.store.run_many("add_floor", rows)
            self.store.insert("add_event", at=now(), what="measure", cell_id=None, experiment_id=None)  # it is news

    def _search(self) -> None:
        """One page of the cells of one reference."""
        reference, after = self.searches.popleft()
        rows = self.store.rows("cells_of_reference", reference_id=reference, after=after, limit=PAGE)
        cells = [row["cell_id"] for row in rows]
        if len(cells) == PAGE:
            self.searches.appendleft((reference, cells[-1]))
        self.pairs.extend(
            self.store.rows("gaps_of_cells", reference_id=reference, cells=json.dumps(cells), versions=VERSIONS)
        )

    def _measure_until(self, end: float) -> None:
        measured = set()
        while self.pairs:
            pair = self.pairs.popleft()
            if self._measure(pair):
                measured.add(pair["cell_id"])
            if time.monotonic() >= end:
                break
        if measured:
            revision = self.store.insert("add_event", at=now(), what="measure", cell_id=None, experiment_id=None)
            for cell in measured:
                self.store.run("touch", cell_id=cell, revision=revision)
            points.refresh(self.store, measured)

    def _measure(self, pair: Row) -> bool:
        """All metrics of one pair; False if a file could not be read."""
        try:
            picture = read_picture(self.artifacts.path(pair["image"]))
            reference = self._reference(pair["reference_id"], pair["reference_replicates"])
        except DartboardError as error:
            log.warning("replicate %s is not measured: %s", pair["replicate_id"], error)
            return False
        values, reason = values_of(picture, reference)
        self.store.run_many(
            "add_metric",
            [
                {
                    "replicate_id": pair["replicate_id"], "reference_id": pair["reference_id"],
                    "reference_replicates": pair["reference_replicates"], "name": name, "version": metric.version,
                    "value": values.get(name), "reason": None if name in values else reason,
                }
                for name, metric in METRICS.items()
            ],
        )  # fmt: skip
        return True

    def _reference(self, cell_id: int, replicates: int) -> Reference:
        """R1 and R2, the means of the even and the odd replicates. Raises ``DartboardError`` if one is unreadable."""
        key = (cell_id, replicates)
        if key not in self.references:
            rows = self.store.rows("reference_images", cell_id=cell_id, replicates=replicates)
            images = [str(row["image"]) for row in rows]
            odd = self._mean(images[1::2]) if len(images) > 1 else None
            self.references[key] = Reference(self._mean(images[0::2]), odd)
        self.references.move_to_end(key)
        while len(self.references) > 1 and sum(map(_bytes, self.references.values())) > KEPT_BYTES:
            self.references.popitem(last=False)
        return self.references[key]

    def _mean(self, images: Sequence[str]) -> NDArray[np.float64]:
        """The mean of pictures, one in memory at a time."""
        total = read_picture(self.artifacts.path(images[0])).astype(np.float64)
        for image in images[1:]:
            picture = read_picture(self.artifacts.path(image))
            if picture.shape != total.shape:
                raise DartboardError(f"{image} has another size than {images[0]}, which belongs to the same reference")
            total += picture
        return total / len(images)


def catch_up(store: Store, artifacts: Artifacts) -> None:
    """Measure whatever is missing, to the end: for an owner with nothing to render."""
    measurer = Measurer(store, artifacts)
    measurer.look_for_gaps()
    while measurer.step(1.0):
        pass


def values_of(picture: NDArray[np.floating], reference: Reference) -> tuple[dict[str, float], str]:
    """Every metric that exists, by name, and why the others do not."""
    for name, pixels in (("picture", picture), ("reference", reference.mean)):
        if bad := nonfinite(pixels):
            return {}, f"{bad} pixels of the {name} are NaN or infinite"
    try:
        values = measure(picture, reference)
    except ValueError as error:  # another size
        return {}, str(error)
    finite = {name: value for name, value in values.items() if math.isfinite(value)}
    return finite, "the value is not finite" if len(finite) < len(values) else "the reference has no two halves"


def _bytes(reference: Reference) -> int:
    return reference.first.nbytes + (0 if reference.second is None else reference.second.nbytes)
