"""
How fast an error falls: the b of error ~ spp^b with its 95 % interval, from the means of a few replicates.

A line is fitted to logarithms by weighted least squares; a point weighs by how well its own mean is known
(science.md E.3). The spread of two or four replicates is itself hardly known. Taken at its word, it would give a point
with a lucky spread all the weight, and intervals that hold the truth in 65 to 90 % of all cases instead of 95. So every
spread is drawn towards the common one of its curve, and the interval is Student's for as many degrees of freedom as
that leaves (Welch 1947, Satterthwaite 1946). The test of this module counts how often the intervals hold the truth.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

NORMAL_95 = 1.959964
# Student's t, two-sided 95 %, for 1 … 30 degrees of freedom; beyond, 1.96 + 2.4/df is within 0.003.
STUDENT_95 = (
    12.7062, 4.3027, 3.1824, 2.7764, 2.5706, 2.4469, 2.3646, 2.3060, 2.2622, 2.2281, 2.2010, 2.1788, 2.1604, 2.1448,
    2.1314, 2.1199, 2.1098, 2.1009, 2.0930, 2.0860, 2.0796, 2.0739, 2.0687, 2.0639, 2.0595, 2.0555, 2.0518, 2.0484,
    2.0452, 2.0423,
)  # fmt: skip
LEAST_SPREAD = 1e-3  # relative standard error; a point that seems better known would rule the fit by luck
COMMON_FREEDOM = 4.0  # degrees of freedom that the common spread of a curve counts for, beside a point's own n − 1


@dataclass(frozen=True)
class Slope:
    """Exponent with its 95 % interval."""

    value: float
    low: float
    high: float


@functools.lru_cache(1024)  # thousands of points have the same few
def student(freedom: float) -> float:
    """Half-width of a 95 % interval in standard errors, for one degree of freedom or more; interpolated between two."""
    if freedom > len(STUDENT_95):
        return NORMAL_95 + 2.4 / freedom
    below = min(max(int(freedom), 1), len(STUDENT_95) - 1)
    here, there = STUDENT_95[below - 1], STUDENT_95[below]
    part = (1 / below - 1 / max(freedom, 1.0)) / (1 / below - 1 / (below + 1))  # the curve is nearly straight in 1/df
    return here + part * (there - here)


def slope(points: Iterable[Mapping[str, Any]], against: str = "spp_actual") -> Slope | None:
    """
    The exponent of a curve of points (spp_actual, mean, error, n). None for fewer than three different spp whose mean
    is positive and has an error.

    against  what the spp of a point is: "spp_actual", as rendered, or "spp", as asked
    """
    by_spp = {
        point[against]: point for point in points if point["error"] is not None and point["mean"] > 0
    }  # requests that were rounded to one spp are one point
    if len(by_spp) < 3:
        return None
    used = list(by_spp.values())
    x = [math.log(point[against]) for point in used]
    y = [math.log(point["mean"]) for point in used]
    own = [point["n"] - 1 for point in used]
    return _fit(x, y, _variances(used), own)


def _variances(points: Sequence[Mapping[str, Any]]) -> list[float]:
    """Of the logarithm of each mean: its own relative variance, drawn towards the common one of a single replicate."""
    single = [point["n"] * (point["error"] / point["mean"]) ** 2 for point in points]
    freedom = [point["n"] - 1 for point in points]
    common = math.fsum(f * s for f, s in zip(freedom, single, strict=True)) / sum(freedom)
    return [
        max((f * s + COMMON_FREEDOM * common) / (f + COMMON_FREEDOM) / (f + 1), LEAST_SPREAD**2)
        for f, s in zip(freedom, single, strict=True)
    ]


def _fit(x: Sequence[float], y: Sequence[float], variances: Sequence[float], freedom: Sequence[int]) -> Slope:
    """Weighted least squares of a line; the interval is widened where the line does not fit as well as it should."""
    weights = [1 / variance for variance in variances]
    total = math.fsum(weights)
    x_mean = math.fsum(w * a for w, a in zip(weights, x, strict=True)) / total
    y_mean = math.fsum(w * b for w, b in zip(weights, y, strict=True)) / total
    spread = math.fsum(w * (a - x_mean) ** 2 for w, a in zip(weights, x, strict=True))
    value = math.fsum(w * (a - x_mean) * (b - y_mean) for w, a, b in zip(weights, x, y, strict=True)) / spread
    left = math.fsum(
        w * (b - y_mean - value * (a - x_mean)) ** 2 for w, a, b in zip(weights, x, y, strict=True)
    ) / (len(x) - 2)  # fmt: skip
    # What each point adds to the variance of the exponent, as a share of all.
    shares = [w * (a - x_mean) ** 2 / spread for w, a in zip(weights, x, strict=True)]
    effective = 1 / math.fsum(share**2 / (f + COMMON_FREEDOM) for share, f in zip(shares, freedom, strict=True))
    half = student(min(effective, sum(freedom))) * math.sqrt(max(left, 1.0) / spread)
    return Slope(value, value - half, value + half)
