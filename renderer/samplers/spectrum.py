"""
The power spectrum of point sets on the torus, its radial mean and its anisotropy.

P(k) = |Σ exp(−2πi k·x)|² / N on the integer lattice, averaged over sets; random points have P = 1 at every k but 0. It
decides the error: for sets that are shifted at random, Var = (1/N) Σ P(k) |f̂(k)|² over k ≠ 0 (Durand 2011; Pilleboue
et al. 2015). Radial mean and anisotropy as in PSA (Schlömer and Deussen 2011, "Accurate Spectral Analysis of
Two-Dimensional Point Sets", after Ulichney 1987). No Mitsuba here.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
NOTHING = 1e-9  # power below which a ring is empty up to rounding: its anisotropy would be that of the rounding


@dataclass(frozen=True)
class Radial:
    """
    A spectrum by frequency, in rings of width 1.

    radii       |k| in the middle of each ring, 1 … m: cycles per pixel
    mean        of P in the ring; 1 for random points
    anisotropy  variance over mean² of P in the ring, in dB; NaN where a ring has no power. A spectrum without a
                preferred direction, averaged over K sets, has −10 log₁₀ K
    """

    radii: Floats
    mean: Floats
    anisotropy: Floats


def power_spectrum(points: Floats, frequencies: int) -> Floats:
    """
    Mean over K sets of |Σ exp(−2πi k·x)|² / N for |kx|, |ky| ≤ m: (K, N, 2) → (2m + 1, 2m + 1).

    ``frequencies`` is m. Element [ky + m, kx + m] belongs to (kx, ky); the middle one, the count of the points, is N.
    The sum factors into one over x and one over y, so that a set costs a matrix product: O(N m²).
    """
    sets, count = points.shape[:2]
    wave = -2j * np.pi * np.arange(-frequencies, frequencies + 1)
    total = np.zeros((2 * frequencies + 1, frequencies + 1))
    for x, y in points.transpose(0, 2, 1):
        rows = np.exp(wave[:, None] * y[None, :])
        columns = np.exp(x[:, None] * wave[None, frequencies:])  # kx ≥ 0; the other half mirrors it, P(−k) = P(k)
        amplitude = rows @ columns
        total += amplitude.real**2 + amplitude.imag**2
    total /= sets * count
    return np.concatenate([total[::-1, :0:-1], total], axis=1)


def radial(power: Floats) -> Radial:
    """The rings of a ``power_spectrum``, up to the largest that fits into it."""
    frequencies = power.shape[0] // 2
    k = np.arange(-frequencies, frequencies + 1)
    # One half of the plane: the other repeats it, and values that are counted twice vary less than they seem to.
    half = (k[None, :] > 0) | ((k[None, :] == 0) & (k[:, None] > 0))
    ring = np.rint(np.hypot(k[None, :], k[:, None])).astype(int)
    chosen = half & (ring <= frequencies)
    ring, values = ring[chosen], power[chosen]
    number = np.bincount(ring, minlength=frequencies + 1)[1:]
    mean = np.bincount(ring, values, frequencies + 1)[1:] / number
    deviation = (values - mean[ring - 1]) ** 2
    variance = np.bincount(ring, deviation, frequencies + 1)[1:] / np.maximum(number - 1, 1)
    with np.errstate(divide="ignore", invalid="ignore"):
        anisotropy = np.where(mean > NOTHING, 10 * np.log10(variance / mean**2), np.nan)
    return Radial(np.arange(1.0, frequencies + 1), mean, anisotropy)
