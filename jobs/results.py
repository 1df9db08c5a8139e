"""
Results: the one reading of an experiment that the table, the CSV and every plot share, so they cannot disagree.

One row per wanted replicate of a cell, in the order of the plan, with the errors against this experiment's own
reference. Nothing is averaged away here; ``summary`` does that, and says over how many.
"""

from __future__ import annotations

import csv
import json
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import Any, TextIO

from jobs.points import VERSIONS
from jobs.store import Row, Store
from renderer.metrics import METRICS

KEYS = ("experiment", "scene", "integrator", "sampler", "spp", "spp_actual", "replicate")
TAIL = ("render_seconds", "compile_seconds", "state")


@dataclass(frozen=True)
class Point:
    """
    One point of a curve: the mean of a metric over n replicates.

    error  standard error of the mean; None for fewer than two replicates
    sweep  (parameter, value) pairs that tell apart cells with the same labels
    """

    scene: str
    integrator: str
    sampler: str
    spp: int
    spp_actual: int
    metric: str
    n: int
    mean: float
    error: float | None
    sweep: tuple[tuple[str, Any], ...] = ()


def columns(store: Store, experiment: int) -> list[str]:
    """The names of a row's values, in order: KEYS, a column per sweep, a column per metric, TAIL."""
    return [*KEYS, *_sweeps(store, experiment), *METRICS, *TAIL]


def rows(store: Store, experiment: int) -> Iterator[Row]:
    """
    One row per wanted replicate, in the order of the plan, with the values that ``columns`` names.

    A missing picture has its cell's state and None for every number; so has a metric that is not measured yet, or
    that has no value (docs/storage.md says when).
    """
    nothing = dict.fromkeys(METRICS)
    measured: dict[int, dict[str, float | None]] = {}
    for row in store.stream("metrics", experiment_id=experiment, versions=VERSIONS):
        measured.setdefault(row["replicate_id"], nothing.copy())[row["name"]] = row["value"]
    sweeps = dict.fromkeys(_sweeps(store, experiment))
    for row in store.stream("results", experiment_id=experiment):
        head = {key: row[key] for key in KEYS}
        if sweeps:
            head |= sweeps | json.loads(row["sweep"] or "{}")
        yield head | measured.get(row["replicate_id"], nothing) | {key: row[key] for key in TAIL}


def summary(store: Store, experiment: int) -> list[Point]:
    """Mean and standard error of every metric for every cell that has values, in the order of the plan."""
    found: dict[tuple[Any, ...], Point] = {}
    for row in store.stream("points", experiment_id=experiment, versions=VERSIONS, scene=None):
        sweep = tuple(json.loads(row["sweep"]).items()) if row["sweep"] else ()
        cell = (row["scene"], row["integrator"], row["sampler"], row["spp"], row["spp_actual"])
        found[row["position"], row["name"]] = Point(*cell, row["name"], row["n"], row["mean"], row["error"], sweep)
    return list(found.values())


def write_csv(found: Iterable[Row], file: TextIO) -> None:
    """CSV with a header; empty for what is missing, and numbers that read back as the same double."""
    writer: csv.DictWriter[str] | None = None
    for row in found:
        if writer is None:
            writer = csv.DictWriter(file, list(row), lineterminator="\n")
            writer.writeheader()
        writer.writerow(row)
    if writer is None:
        csv.writer(file, lineterminator="\n").writerow([*KEYS, *METRICS, *TAIL])


def write_json(found: Iterable[Row], file: TextIO) -> None:
    """A JSON list of the same rows, one a line; null for what is missing."""
    before = "[\n"
    for row in found:
        file.write(before + json.dumps(row, ensure_ascii=False, allow_nan=False))
        before = ",\n"
    file.write("[]\n" if before == "[\n" else "\n]\n")


def _sweeps(store: Store, experiment: int) -> list[str]:
    return [row["name"] for row in store.rows("sweep_parameters", experiment_id=experiment)]
