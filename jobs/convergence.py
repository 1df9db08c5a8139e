"""
Convergence: the curves of an experiment, error against spp or seconds, with intervals and slopes.

A slope is the b of error ~ spp^b, fitted to logarithms by weighted least squares; a point weighs by how well its own
mean is known (science.md E.3). Intervals are 95 % of Student's t for n replicates, and normal for slopes.
"""

from __future__ import annotations

import json
import math
from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from typing import Any

from jobs.store import Row, Store
from renderer.errors import UnknownName
from renderer.metrics import METRICS

NORMAL_95 = 1.959964
# Student's t, two-sided 95 %, for 1 … 30 degrees of freedom; beyond, 1.96 + 2.4/df is within 0.001.
STUDENT_95 = (
    12.7062, 4.3027, 3.1824, 2.7764, 2.5706, 2.4469, 2.3646, 2.3060, 2.2622, 2.2281, 2.2010, 2.1788, 2.1604, 2.1448,
    2.1314, 2.1199, 2.1098, 2.1009, 2.0930, 2.0860, 2.0796, 2.0739, 2.0687, 2.0639, 2.0595, 2.0555, 2.0518, 2.0484,
    2.0452, 2.0423,
)  # fmt: skip
LEAST_SPREAD = 1e-3  # relative; a point with a smaller standard error would rule the fit by luck


@dataclass(frozen=True)
class Slope:
    """Exponent with its 95 % interval."""

    value: float
    low: float
    high: float


@dataclass
class Series:
    """
    One curve. Points have the names of ``Point`` on the wire.

    alike  all its renders were timed under the conditions that most of the experiment's were
    """

    scene: str
    integrator: str
    sampler: str
    sweep: dict[str, Any]
    points: list[Row] = field(default_factory=list)
    slope: Slope | None = None
    alike: bool = True


def curves(store: Store, experiment: int, metric: str, scene: str | None = None) -> list[Series]:
    """
    The curves of a metric, in the order of the plan, for all scenes or one. Raises ``UnknownName`` for a metric that
    does not exist.
    """
    if metric not in METRICS:
        raise UnknownName("metric", metric, "", METRICS)
    version = json.dumps({metric: METRICS[metric].version})
    found: dict[tuple[Any, ...], Series] = {}
    conditions: dict[tuple[Any, ...], set[str]] = {}
    for row in store.stream("points", experiment_id=experiment, versions=version, scene=scene):
        key = (row["scene"], row["integrator"], row["sampler"], row["sweep"])
        if key not in found:
            found[key] = Series(*key[:3], sweep=json.loads(row["sweep"]) if row["sweep"] else {})
            conditions[key] = set()
        found[key].points.append(_point(row))
        if row["conditions"]:
            conditions[key].add(row["conditions"])
    usual = Counter(text for texts in conditions.values() for text in texts).most_common(1)
    for key, series in found.items():
        series.alike = conditions[key] <= {usual[0][0]} if usual else True
        series.slope = slope(series.points)
    return list(found.values())


def student(n: int) -> float:
    """Half-width of the 95 % interval of a mean of n values, in standard errors."""
    freedom = n - 1
    return STUDENT_95[freedom - 1] if freedom <= len(STUDENT_95) else NORMAL_95 + 2.4 / freedom


def slope(points: Iterable[Row]) -> Slope | None:
    """
    The exponent of a curve; None for fewer than three different spp, or where a mean is not positive or has no error.
    """
    used = [point for point in points if point["error"] is not None and point["mean"] > 0]
    if len({point["spp_actual"] for point in used}) < 3:
        return None
    x = [math.log(point["spp_actual"]) for point in used]
    y = [math.log(point["mean"]) for point in used]
    weights = [1 / max(point["error"] / point["mean"], LEAST_SPREAD) ** 2 for point in used]
    return _fit(x, y, weights)


def _fit(x: Sequence[float], y: Sequence[float], weights: Sequence[float]) -> Slope:
    """Weighted least squares of a line; the interval is widened where the line does not fit as well as it should."""
    total = math.fsum(weights)
    x_mean = math.fsum(w * a for w, a in zip(weights, x, strict=True)) / total
    y_mean = math.fsum(w * b for w, b in zip(weights, y, strict=True)) / total
    spread = math.fsum(w * (a - x_mean) ** 2 for w, a in zip(weights, x, strict=True))
    value = math.fsum(w * (a - x_mean) * (b - y_mean) for w, a, b in zip(weights, x, y, strict=True)) / spread
    left = math.fsum(
        w * (b - y_mean - value * (a - x_mean)) ** 2 for w, a, b in zip(weights, x, y, strict=True)
    ) / (len(x) - 2)  # fmt: skip
    half = NORMAL_95 * math.sqrt(max(left, 1.0) / spread)
    return Slope(value, value - half, value + half)


def _point(row: Row) -> Row:
    mean, error, seconds = row["mean"], row["error"], row["seconds"]
    half = None if error is None else student(row["n"]) * error
    return {
        "cell": row["cell"], "spp": row["spp"], "spp_actual": row["spp_actual"], "n": row["n"], "mean": mean,
        "error": error, "low": None if half is None else _short(mean - half),
        "high": None if half is None else _short(mean + half), "seconds": None if seconds is None else _short(seconds),
    }  # fmt: skip


def _short(value: float) -> float:
    """Six digits: what is derived for display need not travel with seventeen."""
    return float(f"{value:.6g}")
