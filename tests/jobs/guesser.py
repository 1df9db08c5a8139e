"""A measurer that reads no pictures: its numbers come from a test. All else about it is the real one."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

from jobs.artifacts import Artifacts
from jobs.measure import Measurer
from jobs.store import Row, Store
from renderer.metrics import METRICS

Value = Callable[[Row, str], float | None]  # (pair, name of a metric) → number, None where it has none


class Guesser(Measurer):
    def __init__(self, store: Store, value: Value):
        super().__init__(store, Artifacts(store.path.parent))
        self.value = value

    def _measure(self, pair: Row) -> bool:
        self.store.run_many("add_metric", self._rows(pair))
        return True

    def _rows(self, pair: Row) -> Iterator[dict[str, Any]]:
        for name, metric in METRICS.items():
            value = self.value(pair, name)
            yield {
                "replicate_id": pair["replicate_id"], "reference_id": pair["reference_id"],
                "reference_replicates": pair["reference_replicates"], "name": name, "version": metric.version,
                "value": value, "reason": None if value is not None else "for a test",
            }  # fmt: skip


def guess(store: Store, value: Value, *, steps: int = 1 << 30) -> None:
    """Measure what lacks a metric, up to so many pairs."""
    guesser = Guesser(store, value)
    guesser.look_for_gaps()
    while steps > 0 and guesser.step(0.0):
        steps -= 1


def by_name(pair: Row, name: str) -> float:
    """A number that tells what was measured: different for every replicate, reference and metric."""
    return pair["replicate_id"] + pair["reference_replicates"] / 16 + (1 + list(METRICS).index(name)) / 1024
