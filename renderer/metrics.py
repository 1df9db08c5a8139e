"""
Errors of a picture against a reference: what each one is called, computes, and may be compared with.

A metric takes (H, W, 3) float arrays of linear radiance and gives a map of the same shape whose mean is the
value, so a number and its picture cannot disagree. Every metric carries its formula and epsilon; the version
is part of a stored value's key, so that a new formula fills itself in instead of mixing with the old one.
Source of relMSE: Rousselle et al. 2011. mse_cross is unbiased because the errors of R1 and R2 are independent.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

Picture = NDArray[np.floating]  # (H, W, 3), linear radiance

RELMSE_EPSILON = 0.01  # radiance², keeps dark pixels from ruling; scenes have a mean luminance near 0.2


@dataclass(frozen=True)
class Reference:
    """Two independent unbiased halves R1 and R2, or one picture of any origin (``second`` is None)."""

    first: Picture
    second: Picture | None = None

    @cached_property
    def mean(self) -> Picture:
        """mean(R1, R2) in float64, or the one picture."""
        first = self.first.astype(np.float64)
        return first if self.second is None else (first + self.second) / 2


@dataclass(frozen=True)
class Metric:
    """
    One way to measure a picture.

    error_map        (picture, reference) → (H, W, 3) float64 whose mean is the metric
    epsilon          the regulariser in the formula, 0 where there is none
    lower_is_better  None where neither direction is better
    needs_halves     True if two independent halves are required
    floor            reference → what an exact picture would measure against it, from the difference of its halves; None
                     for metrics that the reference's noise does not raise
    """

    name: str
    version: int
    formula: str
    error_map: Callable[[Picture, Reference], Picture]
    line: str
    epsilon: float = 0.0
    lower_is_better: bool | None = True
    needs_halves: bool = False
    floor: Callable[[Reference], float] | None = None

    def value(self, picture: Picture, reference: Reference) -> float:
        """The mean of the map, in float64. NaN and infinities in the pictures show in the value."""
        return float(np.mean(self.error_map(picture, reference)))


def _mse(picture: Picture, reference: Reference) -> Picture:
    return (picture - reference.mean) ** 2


def _mse_cross(picture: Picture, reference: Reference) -> Picture:
    assert reference.second is not None, "mse_cross needs two halves"
    picture = picture.astype(np.float64)
    return (picture - reference.first) * (picture - reference.second)


def _relmse(picture: Picture, reference: Reference) -> Picture:
    mean = reference.mean
    return (picture - mean) ** 2 / (mean**2 + RELMSE_EPSILON)


def _noise(reference: Reference) -> Picture:
    """The variance of mean(R1, R2), pixel by pixel: (R1 − R2)² / 4 has it as its expectation."""
    assert reference.second is not None, "noise needs two halves"
    return (reference.first.astype(np.float64) - reference.second) ** 2 / 4


def _mse_floor(reference: Reference) -> float:
    return float(np.mean(_noise(reference)))


def _relmse_floor(reference: Reference) -> float:
    return float(np.mean(_noise(reference) / (reference.mean**2 + RELMSE_EPSILON)))


def _mean_ratio(picture: Picture, reference: Reference) -> Picture:
    # The map is I / mean(R): flat where a picture is right, and its mean is the ratio of the two means.
    scale = float(np.mean(reference.mean))
    return picture.astype(np.float64) / scale if scale else np.full(picture.shape, np.nan)


METRICS: dict[str, Metric] = {
    metric.name: metric
    for metric in (
        Metric("mse", 1, "mean((I − R)²), R = mean(R1, R2)", _mse,
               "plain mean squared error; includes the reference's noise", floor=_mse_floor),
        Metric("mse_cross", 1, "mean((I − R1)·(I − R2))", _mse_cross,
               "unbiased for bias² + variance: no floor from the reference; may be negative when tiny",
               needs_halves=True),
        Metric("relmse", 1, "mean((I − R)² / (R² + ε)), ε = 0.01", _relmse,
               "squared error relative to the reference: a visible lamp does not rule it", RELMSE_EPSILON,
               floor=_relmse_floor),
        Metric("mean_ratio", 1, "mean(I) / mean(R)", _mean_ratio,
               "brightness against the reference: far from 1 is a bias, whatever the other errors say",
               lower_is_better=None),
    )
}  # fmt: skip


def measure(picture: Picture, reference: Reference) -> dict[str, float]:
    """
    Every metric that the reference allows, by name.

    Raises ``ValueError`` if the shapes differ: metrics never compare, crop or resize in silence.
    """
    for half in (reference.first, reference.second):
        if half is not None and half.shape != picture.shape:
            raise ValueError(f"the picture is {shape(picture)}, the reference {shape(half)}")
    return {
        name: metric.value(picture, reference)
        for name, metric in METRICS.items()
        if reference.second is not None or not metric.needs_halves
    }


def floors(reference: Reference) -> dict[str, float]:
    """The noise floor of every metric that has one, by name; empty for a reference without halves."""
    if reference.second is None:
        return {}
    return {name: metric.floor(reference) for name, metric in METRICS.items() if metric.floor}


def nonfinite(picture: Picture) -> int:
    """How many pixels have a NaN or infinite channel."""
    return int(np.count_nonzero(~np.isfinite(picture).all(axis=-1)))


def shape(picture: Picture) -> str:
    """``512×256``: width × height, as people say it."""
    return f"{picture.shape[1]}×{picture.shape[0]}"
