"""
Point sets with blue noise on the unit torus: Poisson-disk sets, their relaxed variant, weighted sample elimination.

All functions make K sets of N points in [0, 1)², the same for the same arguments, and set k the same however many sets
are asked for (after Lloyd relaxation: but for rounding). Sets are made together, as many as do the processor's cache no
harm: numpy pays for a call, not for a set. No Mitsuba here; ``store`` keeps sets on disk.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from renderer.errors import BadParameter, shown
from renderer.samplers.elimination import eliminate
from renderer.samplers.packing import MAX_POINTS, check_min_dist, hexagonal_bound
from renderer.samplers.poisson import maximal_darts, relaxed_darts, uniform_darts
from renderer.samplers.relaxation import lloyd
from renderer.samplers.torus import Streams, min_distance

BATCH = 2**15  # points that are made together, in whole sets

# What each construction keeps of the hexagonal bound. A set that falls short, one of fifty or fewer, is made again.
KEPT_RELAXED = 0.58
KEPT_ELIMINATED = 0.65
KEPT_RELAXED_UP_TO = 256  # points: the larger a set, the more rows of 30 misses are chance, and the nearer its points

Made = tuple[NDArray[np.float64], NDArray[np.float64]]  # points (K, N, 2) and what they keep, (K,)


@dataclass(frozen=True)
class PointSets:
    """
    K sets of N points.

    points   (K, N, 2) in [0, 1)
    radius   (K,) a distance that no two points of a set are nearer than, on the torus; 1 for a single point
    maximal  True if moreover every place of the torus is within the radius of some point
    """

    points: NDArray[np.float64]
    radius: NDArray[np.float64]
    maximal: bool


def poissondisk(n: int, sets: int, seed: int, min_dist: float | None = None, lloyd_iterations: int = 0) -> PointSets:
    """
    Dart throwing on the torus (Cook 1986), in random order.

    Without ``min_dist`` the sets are maximal with exactly n points, at the largest radius that darts reach: 0.77 of the
    hexagonal bound, at least 0.70. With it they are n uniform darts at that distance, and there is room for more.
    ``poisson`` and ``darts`` explain how (Ebeida et al. 2012: an active list of squares). Raises ``BadParameter`` where
    ``min_dist`` has no room for n darts; it names the largest that has.
    """
    _check(n, sets, lloyd_iterations)
    if min_dist is not None:
        check_min_dist(n, min_dist, "poissondisk")

    def make(streams: Streams) -> Made:
        points = maximal_darts(n, streams) if min_dist is None else uniform_darts(n, min_dist, streams)
        return points, min_distance(points)

    return _relaxed_by_lloyd(_made(1, make, n, sets, seed), lloyd_iterations, maximal=min_dist is None)


def relaxedpoissondisk(
    n: int, sets: int, seed: int, min_dist: float | None = None, lloyd_iterations: int = 0
) -> PointSets:
    """
    Relaxed dart throwing on the torus (McCool and Fiume 1992), in random order: exactly n points.

    Starts at ``min_dist`` in (0, 1], by default the hexagonal bound, and lowers it by 1 % after 30 misses in a row; the
    radius is where it ends: at 0.69 of the bound for 16 points, 0.61 for 256. Raises ``BadParameter`` outside (0, 1].
    """
    _check(n, sets, lloyd_iterations)
    if min_dist is not None and not 0 < min_dist <= 1:
        raise BadParameter(
            f"min_dist = {shown(min_dist)} of relaxedpoissondisk is not allowed; give a number above 0 and up to 1, "
            "the width of the torus"
        )
    start = hexagonal_bound(n) if min_dist is None else min_dist
    least = KEPT_RELAXED if min_dist is None and n <= KEPT_RELAXED_UP_TO else 0

    def make(streams: Streams) -> Made:
        return relaxed_darts(n, start, streams)

    return _relaxed_by_lloyd(_made(2, make, n, sets, seed, least), lloyd_iterations, maximal=False)


def eliminated(n: int, sets: int, seed: int) -> PointSets:
    """
    Weighted sample elimination on the torus (Yuksel 2015), from 5 n random points, in progressive order.

    All n keep at least 0.65 of the hexagonal bound (0.70 is usual), the first n/2, n/4, … 0.58 of their own.
    """
    _check(n, sets)

    def make(streams: Streams) -> Made:
        points = eliminate(n, streams)
        return points, min_distance(points)

    points, radius = _made(3, make, n, sets, seed, KEPT_ELIMINATED, shuffle=False)
    return PointSets(points, radius, maximal=False)


def _made(
    kind: int, make: Callable[[Streams], Made], n: int, sets: int, seed: int, least: float = 0, *, shuffle: bool = True
) -> Made:
    """``make`` for all sets; what keeps less than ``least`` of the hexagonal bound is made again."""
    together = max(1, BATCH // n)
    batches: list[Made] = []
    for first in range(0, sets, together):
        streams = Streams.of(kind, seed, range(first, min(first + together, sets)))
        points, radius = make(streams)
        while (short := np.flatnonzero(radius < least * hexagonal_bound(n))).size:
            points[short], radius[short] = make(streams.pick(short))
        if shuffle:
            order = np.stack([generator.permutation(n) for generator in streams.generators])
            points = np.take_along_axis(points, order[..., None], axis=1)
        batches.append((points, radius))
    return np.concatenate([points for points, _ in batches]), np.concatenate([radius for _, radius in batches])


def _relaxed_by_lloyd(made: Made, iterations: int, *, maximal: bool) -> PointSets:
    points, radius = made
    if iterations == 0:
        return PointSets(points, radius, maximal)
    points = lloyd(points, iterations)
    return PointSets(points, min_distance(points), maximal=False)


def _check(n: int, sets: int, lloyd_iterations: int = 0) -> None:
    if not 1 <= n <= MAX_POINTS:
        raise BadParameter(
            f"n = {shown(n)} points in a set is not allowed; give an integer from 1 to {MAX_POINTS}, or take the sobol "
            "sampler, which has no table"
        )
    if sets < 1:
        raise BadParameter(f"sets = {shown(sets)} is not allowed; give an integer of at least 1")
    if lloyd_iterations < 0:
        raise BadParameter(
            f"lloyd_iterations = {shown(lloyd_iterations)} is not allowed; give an integer of at least 0"
        )
