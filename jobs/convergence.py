"""
Convergence: the curves of an experiment, error against spp or seconds, with intervals and slopes (``slopes.py``).

The interval of a point is the 95 % of Student's t for the mean of its n replicates.
"""

from __future__ import annotations

import json
from collections import Counter
from dataclasses import dataclass, field
from typing import Any

from jobs.slopes import Slope, slope, student
from jobs.store import Row, Store
from renderer import catalog
from renderer.errors import UnknownName
from renderer.metrics import METRICS


@dataclass
class Series:
    """
    One curve. Points have the names of ``Point`` on the wire.

    alike   all its renders were timed under the conditions that most of the experiment's were
    floor   what an exact picture would measure: the reference's own noise. None where the metric has none, or where it
            is not measured yet
    replay  its sampler shows a published mistake: it is read against the spp that were asked, as its authors read it
    """

    scene: str
    integrator: str
    sampler: str
    sweep: dict[str, Any]
    points: list[Row] = field(default_factory=list)
    slope: Slope | None = None
    alike: bool = True
    floor: float | None = None
    replay: bool = False


def curves(store: Store, experiment: int, metric: str, scene: str | None = None) -> list[Series]:
    """
    The curves of a metric, in the order of the plan, for all scenes or one. Raises ``UnknownName`` for a metric that
    does not exist.
    """
    if metric not in METRICS:
        raise UnknownName("metric", metric, "", METRICS)
    version = json.dumps({metric: METRICS[metric].version})
    floors = {
        row["reference"]: row["value"]
        for row in store.rows(
            "floors_of_experiment", experiment_id=experiment, name=metric, version=METRICS[metric].version
        )
    }
    found: dict[tuple[Any, ...], Series] = {}
    conditions: dict[tuple[Any, ...], set[str]] = {}
    for row in store.stream("points", experiment_id=experiment, versions=version, scene=scene):
        key = (row["scene"], row["integrator"], row["sampler"], row["sweep"])
        if key not in found:
            sweep = json.loads(row["sweep"]) if row["sweep"] else {}
            found[key] = Series(*key[:3], sweep=sweep, floor=floors.get(row["reference"]))
            found[key].replay = catalog.is_replay(row["sampler"])
            conditions[key] = set()
        found[key].points.append(_point(row))
        if row["conditions"]:
            conditions[key].add(row["conditions"])
    usual = Counter(text for texts in conditions.values() for text in texts).most_common(1)
    for key, series in found.items():
        series.alike = conditions[key] <= {usual[0][0]} if usual else True
        if METRICS[metric].lower_is_better is not None:  # a brightness falls towards nothing
            series.slope = slope(series.points, "spp" if series.replay else "spp_actual")
    return list(found.values())


def _point(row: Row) -> Row:
    mean, error = row["mean"], row["error"]
    half = None if error is None else student(row["n"] - 1) * error
    return {
        "cell": row["cell"], "spp": row["spp"], "spp_actual": row["spp_actual"], "n": row["n"], "mean": mean,
        "error": error, "low": None if half is None else _short(mean - half),
        "high": None if half is None else _short(mean + half), "seconds": row["seconds"],
    }  # fmt: skip


def _short(value: float) -> float:
    """Six digits: what is derived for display need not travel with seventeen."""
    return float(f"{value:.6g}")
