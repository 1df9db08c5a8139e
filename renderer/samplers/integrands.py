"""
Test functions over the unit square with exact integrals: what a point set is judged by before anything is rendered.

A pixel with an edge, a disc that hides in it, a smooth bump, a checkerboard: an ``Integrand`` says its value at points,
its exact integral, and the variance of one random sample, so that the mean squared error of ``independent`` points is
known: variance / N. Some are families: each of K sets of points gets a random member of its own (a line, a disc),
because a sampler that happens to like one line must not win by it. ``gaussian`` and ``checkerboard`` are those of
pbrt-4ed, Fig. 8.46; edges are what Mitchell 1996 ("Consequences of Stratified Sampling in Graphics") studies; the last
five are those of Christensen, Kensler and Kilpatrick 2018 ("Progressive Multi-Jittered Sample Sequences"). No Mitsuba
here.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from math import erf, pi, sqrt
from typing import Any

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Members = tuple[Floats, ...]  # the parameters of a family, an array of K each

CHUNK = 2**18  # points that are evaluated at once: temporaries stay in the cache
EDGE_REACH = 0.3  # largest distance of a random edge from the middle of the pixel, in pixels
EDGE_VARIANCE = 0.2142858  # E[a (1 − a)] for the area a of ``edge``, by quadrature over angle and distance
DISC_RADIUS = 0.3  # pixels


@dataclass(frozen=True)
class Integrand:
    """
    A function over [0, 1)², or a family of them.

    variance  of its value at a uniform random point, the mean over a family; divided by exact² if ``relative``
    value     (x, y, *members) → values; x and y are (K, N), each member's parameters (K, 1)
    exact     (*members) → integrals, (K,) or one number
    members   (generator, K) → parameters of K random members, (K,) each; none for a single function
    relative  True: errors are divided by the exact value, as the published numbers of this function are
    """

    name: str
    line: str
    variance: float
    value: Callable[..., NDArray[Any]]
    exact: Callable[..., Floats | float]
    members: Callable[[np.random.Generator, int], Members] = lambda generator, sets: ()
    relative: bool = False

    def errors(self, points: Floats, seed: int = 0) -> Floats:
        """
        Mean over the points of a set minus the exact integral, for each of K sets: (K, N, 2) → (K,).

        ``seed`` draws the members of a family: the same for every sampler that is compared. Raises ``ValueError`` for
        another shape.
        """
        if points.ndim != 3 or points.shape[2] != 2:
            raise ValueError(f"points are (K, N, 2), these are {points.shape}")
        sets, count = points.shape[:2]
        members = self.members(np.random.default_rng(seed), sets)
        exact = np.broadcast_to(np.asarray(self.exact(*members), np.float64), (sets,))
        means = np.empty(sets)
        step = max(CHUNK // count, 1)
        for first in range(0, sets, step):
            part = slice(first, first + step)
            x, y = points[part, :, 0], points[part, :, 1]
            means[part] = self.value(x, y, *(member[part, None] for member in members)).mean(axis=1, dtype=np.float64)
        return (means - exact) / exact if self.relative else means - exact


def mse(integrand: Integrand, points: Floats, seed: int = 0) -> float:
    """The mean squared error of ``integrand`` over K sets of points (K, N, 2)."""
    return float(np.mean(integrand.errors(points, seed) ** 2))


# ------------------------------------------------------------------------------------------ pbrt-4ed, Fig. 8.46


def _gaussian(x: Floats, y: Floats) -> Floats:
    return np.asarray(np.exp(-8 * ((x - 0.5) ** 2 + (y - 0.5) ** 2)))


def _checkerboard(x: Floats, y: Floats) -> NDArray[Any]:
    """
    ±1 in cells of side 1/10, turned by 45° about the origin, which is a corner of four cells.

    The phase is pbrt's: jittered points have its published errors within 0.5 %. The integral is exactly 0: a swap of x
    and y turns the column u into −u − 1, and so each value into its opposite.
    """
    u = np.floor((x - y) * (10 / sqrt(2))).astype(np.int8)
    v = np.floor((x + y) * (10 / sqrt(2))).astype(np.int8)
    return (((u ^ v) & 1) << 1) - 1


# ------------------------------------------------------------------------------------------ families


def _edges(generator: np.random.Generator, sets: int) -> Members:
    """Half-planes (x − ½) cos θ + (y − ½) sin θ < s: θ uniform, s uniform in ±EDGE_REACH."""
    theta = generator.uniform(0, 2 * pi, sets)
    return np.cos(theta), np.sin(theta), generator.uniform(-EDGE_REACH, EDGE_REACH, sets)


def _edge(x: Floats, y: Floats, cosine: Floats, sine: Floats, s: Floats) -> NDArray[np.bool_]:
    return (x - 0.5) * cosine + (y - 0.5) * sine < s


def half_plane_area(cosine: Floats, sine: Floats, s: Floats) -> Floats:
    """
    Area of the unit square on the side (x − ½) cosine + (y − ½) sine < s of a line.

    By symmetry the normal may be taken as (a, b) with a ≥ b ≥ 0, and the smaller side be measured: its deepest corner
    is t = (a + b)/2 − |s| before the line, and it is a triangle up to t = b, then a trapezoid.
    """
    a = np.maximum(np.abs(cosine), np.abs(sine))
    b = np.minimum(np.abs(cosine), np.abs(sine))
    t = np.maximum((a + b) / 2 - np.abs(s), 0)
    triangle = t**2 / (2 * a * np.maximum(b, 1e-300))  # unused where b is 0, but numpy divides
    smaller = np.where(t <= b, triangle, (t - b / 2) / a)
    return np.where(s <= 0, smaller, 1 - smaller)


def _discs(generator: np.random.Generator, sets: int) -> Members:
    """Centres of discs that lie inside the pixel."""
    x, y = generator.uniform(DISC_RADIUS, 1 - DISC_RADIUS, (2, sets))
    return x, y


def _disc(x: Floats, y: Floats, centre_x: Floats, centre_y: Floats) -> NDArray[np.bool_]:
    return (x - centre_x) ** 2 + (y - centre_y) ** 2 < DISC_RADIUS**2


# ------------------------------------------------------------------------------------------ the list

_BUMP = pi / 8 * erf(sqrt(8) / 2) ** 2  # ∫ gaussian
_BUMP_2 = pi / 16 * erf(2) ** 2  # ∫ gaussian²
_BELL = pi / 4 * erf(1) ** 2  # ∫ gauss
_BELL_2 = pi / 8 * erf(sqrt(2)) ** 2  # ∫ gauss²
_DISC_AREA = pi * DISC_RADIUS**2

INTEGRANDS: dict[str, Integrand] = {
    integrand.name: integrand
    for integrand in (
        Integrand("gaussian", "exp(−8 |p − (½, ½)|²): smooth, errors relative to the integral", _BUMP_2 / _BUMP**2 - 1,
                  _gaussian, lambda: _BUMP, relative=True),
        Integrand("checkerboard", "±1 in cells of side 1/10, turned by 45°: edges finer than the strata", 1.0,
                  _checkerboard, lambda: 0.0),
        Integrand("edge", "random half-planes: what antialiasing integrates", EDGE_VARIANCE,
                  _edge, half_plane_area, _edges),
        Integrand("disc", "discs of radius 0.3, anywhere inside the pixel", _DISC_AREA * (1 - _DISC_AREA),
                  _disc, lambda *_: _DISC_AREA, _discs),
        Integrand("quarter_disc", "x² + y² < 2/π: a curved edge", 0.25,
                  lambda x, y: x * x + y * y < 2 / pi, lambda: 0.5),
        Integrand("triangle", "y > x: an edge along the diagonal", 0.25, lambda x, y: y > x, lambda: 0.5),
        Integrand("step", "x < 1/π: an edge along an axis", (1 - 1 / pi) / pi,
                  lambda x, y: x < 1 / pi, lambda: 1 / pi),
        Integrand("gauss", "exp(−x² − y²): smooth, not periodic", _BELL_2 - _BELL**2,
                  lambda x, y: np.exp(-x * x - y * y), lambda: _BELL),
        Integrand("bilinear", "x y: smooth, not periodic", 1 / 9 - 1 / 16, lambda x, y: x * y, lambda: 0.25),
    )
}  # fmt: skip
