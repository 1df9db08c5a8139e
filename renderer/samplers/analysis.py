"""
What can be measured of point sets: distances, voids, discrepancy, strata.

All functions take K sets of N points, (K, N, 2) in [0, 1), and measure on the torus, as a pixel's points are shifted
there: what leaves the pixel on one side comes back on the other. ``summary`` gathers what people compare. Spectra are
in ``spectrum.py``, test functions in ``integrands.py``. SciPy is imported where it is used; no Mitsuba here.
"""

from __future__ import annotations

from math import sqrt
from typing import Any

import numpy as np
from numpy.typing import NDArray

from renderer.samplers.packing import hexagonal_bound
from renderer.samplers.spectrum import power_spectrum

Floats = NDArray[np.float64]
FARTHEST = sqrt(0.5)  # no two places of the torus are farther apart
SUMMARY_POINTS = 2**16  # that a summary looks at, about two seconds; it takes whole sets, and at least one
ROUNDING = 1e-3  # share of boxes that are empty because single precision put a point over an edge: 1 in 10⁵ or fewer
DISCREPANCY_PAIRS = 2**30  # of points, likewise; larger sets go without


def nearest_distances(points: Floats) -> Floats:
    """Distance of each point to its nearest neighbour: (K, N). One point alone meets its own copies, at distance 1."""
    from scipy.spatial import cKDTree

    sets, count = points.shape[:2]
    if count == 1:
        return np.ones((sets, 1))
    return np.stack([cKDTree(one, boxsize=1.0).query(one, k=2)[0][:, 1] for one in points])


def min_distance(points: Floats) -> Floats:
    """The smallest distance of two points of each set: (K,)."""
    return np.asarray(nearest_distances(points).min(axis=1))


def relative_distance(points: Floats) -> Floats:
    """
    ρ: ``min_distance`` divided by that of a hexagonal lattice of N points, the largest there is: (K,), 0 to 1.

    Lagae and Dutré 2008, "A Comparison of Methods for Generating Poisson Disk Distributions": 0.65 to 0.85 is good,
    more is too regular.
    """
    return min_distance(points) / hexagonal_bound(points.shape[1])


def coverage_radius(points: Floats) -> Floats:
    """
    The radius of the largest disc on the torus that has no point inside: (K,).

    Exact: the middle of the largest void is a vertex of the Voronoi diagram of the points and their copies. How far a
    vertex is from its nearest point is measured, so that the badly conditioned ones of near-regular sets do no harm.
    """
    return np.array([_largest_void(one) for one in points])


def _largest_void(points: Floats) -> float:
    from scipy.spatial import Voronoi, cKDTree

    count = len(points)
    if count == 1:
        return FARTHEST
    tree = cKDTree(points, boxsize=1.0)
    # A grid bounds the answer from above: nowhere is farther from a grid place than half the diagonal of its square.
    side = int(sqrt(count)) + 1
    axis = (np.arange(side) + 0.5) / side
    grid = np.stack(np.meshgrid(axis, axis), axis=-1).reshape(-1, 2)
    bound = min(float(tree.query(grid)[0].max()) + FARTHEST / side, FARTHEST)
    # So only copies within that bound of the square can touch a void whose middle is in it.
    shifts = np.stack(np.meshgrid([-1.0, 0.0, 1.0], [-1.0, 0.0, 1.0]), axis=-1).reshape(-1, 1, 2)
    copies = (points[None] + shifts).reshape(-1, 2)
    near = copies[((copies >= -bound) & (copies <= 1 + bound)).all(axis=1)]
    vertices = Voronoi(near).vertices
    inside = vertices[((vertices >= 0) & (vertices < 1)).all(axis=1)]
    return float(tree.query(inside)[0].max())


def l2_star_discrepancy(points: Floats) -> Floats:
    """
    L2-star discrepancy of each set: (K,), 0 to 1.

    The root mean square, over all boxes [0, u) × [0, v), of their share of the points minus their area (Warnock 1972).
    Not a quantity of the torus: the boxes begin at the origin. For random points see ``random_l2_star``.
    """
    from scipy.stats import qmc  # takes O(N²)

    return np.array([qmc.discrepancy(one, method="L2-star") for one in points])


def random_l2_star(count: int) -> float:
    """Root mean square of the L2-star discrepancy of ``count`` random points: ∫ uv (1 − uv) = 1/4 − 1/9, over N."""
    return sqrt((1 / 4 - 1 / 9) / count)


def elementary_intervals(points: Floats) -> dict[tuple[int, int], int]:
    """
    Empty boxes of every grid of a × b = N boxes, over all sets: {(columns, rows): how many}; 0 means one point in each.

    For N = 2^m these are the elementary intervals in base 2, and a (0,2)-net has 0 everywhere (Niederreiter 1992).
    N × 1 and 1 × N are the strata of a Latin hypercube; √N × √N is the grid of jittered points.
    """
    sets, count = points.shape[:2]
    first = (np.arange(sets) * count)[:, None]  # boxes are numbered through all sets
    empty = {}
    for columns in (a for a in range(1, count + 1) if count % a == 0):
        rows = count // columns
        box = (points[..., 1] * rows).astype(np.intp) * columns + (points[..., 0] * columns).astype(np.intp)
        empty[columns, rows] = sets * count - int(np.count_nonzero(np.bincount((first + box).ravel())))
    return empty


def summary(points: Floats) -> dict[str, Any]:
    """
    The numbers that people compare, as plain values; those of a set are means over the sets.

    sets                how many of the first were measured: all, up to SUMMARY_POINTS
    min_distance        smallest on the torus; ``relative``: to the hexagonal bound; ``worst``: of the worst set, so
    coverage_radius     of the largest void; ``relative``: to that of the hexagonal lattice, so 1 is best
    l2_star             root mean square over the sets; ``relative``: to that of random points. None for very large N
    low_frequency_power mean of P(k) over 0 < |k| < 1.5: 1 for random points, 0 is best
    intervals           grids of N boxes, "columns×rows", and in what share of their boxes a point is missing
    """
    count = points.shape[1]
    points = points[: max(SUMMARY_POINTS // count, 1)]
    sets, bound = len(points), hexagonal_bound(count)
    distance, coverage = min_distance(points), coverage_radius(points)
    compared = points[: DISCREPANCY_PAIRS // count**2]
    star = float(np.sqrt(np.mean(l2_star_discrepancy(compared) ** 2))) if len(compared) else None
    power = power_spectrum(points, 1)
    return {
        "sets": sets,
        "points": count,
        "min_distance": {
            "value": float(distance.mean()), "relative": float(distance.mean()) / bound,
            "worst": float(distance.min()) / bound,
        },
        "coverage_radius": {
            "value": float(coverage.mean()), "relative": float(coverage.mean()) / (bound / sqrt(3)),
        },
        "l2_star": {"value": star, "relative": star / random_l2_star(count)} if star is not None else None,
        "low_frequency_power": float((power.sum() - power[1, 1]) / 8),
        "intervals": {
            f"{columns}×{rows}": empty / (sets * count)
            for (columns, rows), empty in elementary_intervals(points).items()
        },
    }  # fmt: skip


def full_grids(numbers: dict[str, Any]) -> list[str]:
    """Of a summary's intervals, the grids "columns×rows" with one point in each box, up to rounding of the points."""
    return [shape for shape, missing in numbers["intervals"].items() if missing < ROUNDING]
