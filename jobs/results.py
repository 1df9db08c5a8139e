"""
Results: the one reading of an experiment that the table, the CSV and every plot share, so they cannot disagree.

One row per wanted replicate of a cell, in the order of the plan, with the errors against this experiment's own
reference. Nothing is averaged away here; ``summary`` does that, and says over how many.
"""

from __future__ import annotations

import csv
import json
import math
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from statistics import fmean, stdev
from typing import Any, TextIO

from jobs.store import Row, Store
from renderer.metrics import METRICS

KEYS = ("experiment", "scene", "integrator", "sampler", "spp", "spp_actual", "replicate")
TAIL = ("render_seconds", "compile_seconds", "state")


@dataclass(frozen=True)
class Point:
    """
    One point of a curve: the mean of a metric over n replicates.

    error  standard error of the mean; None for fewer than two replicates
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


def rows(store: Store, experiment: int) -> Iterator[Row]:
    """
    One row per wanted replicate: KEYS, a column per sweep, a column per metric, TAIL.

    A missing picture has its cell's state and None for every number; a missing metric is None.
    """
    values: dict[int, dict[str, float]] = {}
    for row in store.rows("metrics", experiment_id=experiment):
        if METRICS.get(row["name"]) and METRICS[row["name"]].version == row["version"]:
            values.setdefault(row["replicate_id"], {})[row["name"]] = row["value"]
    for row in store.rows("results", experiment_id=experiment):
        measured = values.get(row["replicate_id"], {})
        yield (
            {key: row[key] for key in KEYS}
            | json.loads(row["sweep"] or "{}")
            | {name: measured.get(name) for name in METRICS}
            | {key: row[key] for key in TAIL}
        )


def summary(store: Store, experiment: int) -> list[Point]:
    """Mean and standard error of every metric for every cell that has values, in the order of the plan."""
    groups: dict[tuple[Any, ...], list[float]] = {}
    for row in rows(store, experiment):
        for name in METRICS:
            if row[name] is not None:
                key = (row["scene"], row["integrator"], row["sampler"], row["spp"], row["spp_actual"], name)
                groups.setdefault(key, []).append(row[name])
    return [
        Point(*key, len(found), fmean(found), stdev(found) / math.sqrt(len(found)) if len(found) > 1 else None)
        for key, found in groups.items()
    ]


def write_csv(found: Iterable[Row], file: TextIO) -> None:
    """CSV with a header; empty for what is missing, and numbers that read back as the same double."""
    writer: csv.DictWriter[str] | None = None
    for row in found:
        if writer is None:
            writer = csv.DictWriter(file, list(row), lineterminator="\n")
            writer.writeheader()
        writer.writerow({key: "" if value is None else value for key, value in row.items()})
    if writer is None:
        csv.writer(file, lineterminator="\n").writerow([*KEYS, *METRICS, *TAIL])


def write_json(found: Iterable[Row], file: TextIO) -> None:
    """A JSON list of the same rows, one a line."""
    lines = (json.dumps(row, ensure_ascii=False) for row in found)
    file.write("[\n" + ",\n".join(lines) + "\n]\n")
