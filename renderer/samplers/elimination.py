"""
Weighted sample elimination: of 5 N random points those with the closest neighbours go, until N are left.

A point weighs the sum of its neighbours' closeness, (1 − d/2r)⁸ for distances d below 2r; the heaviest point goes and
its neighbours lose what it added to their weights, again and again. Source: Yuksel 2015, "Sample Elimination for
Generating Poisson Disk Sample Sets", also for the progressive order and the constants α = 8, β = 0.65, γ = 1.5.

All points that outweigh their neighbours go at once here, for all sets together. The outcome is that of one at a
time: weights only fall, so nothing can make such a point lighter before its turn, and turns come in order of weight.
"""

from __future__ import annotations

import math

import numpy as np

from renderer.samplers.torus import Floats, Integers, Streams, neighbours

CANDIDATES = 5  # random points for each that is kept
ALPHA, BETA, GAMMA = 8, 0.65, 1.5


def eliminate(n: int, streams: Streams) -> Floats:
    """
    (K, n, 2) points in progressive order: the first n/2, n/4, … were left over from an elimination of their own.

    Its weights are those of the smaller number, so that each of these prefixes is spread as a set of its size, and the
    ones between them nearly so.
    """
    points = streams.blocks(CANDIDATES * n, 2)
    size, order = n, []
    gone = _elimination(points, size)
    points = _take(points, gone[:, :size])
    while size > 1:
        size //= 2
        ranked = _take(points, _elimination(points, size))
        order.append(ranked[:, size:])
        points = ranked[:, :size]
    return np.concatenate([points, *reversed(order)], axis=1)


def _take(points: Floats, index: Integers) -> Floats:
    return np.take_along_axis(points, index[..., None], axis=1)


def _elimination(points: Floats, size: int) -> Integers:
    """
    The order of elimination down to ``size`` points, reversed: (K, M) indices, the first ``size`` of each row stay.

    The survivors come in their given order; of the others, the last that went comes first.
    """
    sets, given, _ = points.shape
    reach = 2 * math.sqrt(1 / (2 * math.sqrt(3) * size))
    nearest = reach * BETA * (1 - (size / given) ** GAMMA)  # closer pairs weigh no more than this
    one, other, distance = neighbours(points, reach)
    share = (1 - np.maximum(distance, nearest) / reach) ** ALPHA
    total = sets * given
    weight = np.bincount(one, share, total) + np.bincount(other, share, total)

    turn = np.full((sets, given), -1.0)  # the weight with which a point went
    here, wanted = np.ones((sets, given), bool), np.ones(sets, bool)
    while True:
        # Enough has gone if all that went down to the size was heavier than anything that is left.
        ready = np.flatnonzero(wanted & (here.sum(axis=1) <= size))
        lightest = np.partition(turn[ready], size, axis=1)[:, size]
        heaviest = np.where(here[ready], weight.reshape(sets, -1)[ready], -1.0).max(axis=1)
        wanted[ready] = lightest <= heaviest
        if not wanted.any():
            break
        stays = np.where((weight[one] > weight[other]) | ((weight[one] == weight[other]) & (one < other)), other, one)
        go = here & wanted[:, None]
        go.ravel()[stays] = False
        turn[go], here[go] = weight.reshape(sets, -1)[go], False
        first, second = go.ravel()[one], go.ravel()[other]
        lost = first | second
        weight -= np.bincount(np.where(first, other, one)[lost], share[lost], total)
        one, other, share = one[~lost], other[~lost], share[~lost]
    return np.argsort(turn, axis=1, kind="stable")
