"""
Poisson-disk sets of exactly N points, for K sets at once: maximal ones, uniform darts at a distance, relaxed darts.

Each function gives points (K, N, 2) in [0, 1)², set k from stream k, in the order in which they were thrown.
"""

from __future__ import annotations

import math

import numpy as np

from renderer.samplers.darts import fill
from renderer.samplers.packing import hexagonal_bound, jammed_distance
from renderer.samplers.torus import Floats, Grid, Streams, neighbours

SPREAD = 0.2  # / √n of the distance: that changes how many darts fit by 0.4 √n, between one and two standard deviations
VOIDS = 2.5  # · n · (−change of the distance): how many more fit into a set that was maximal, roughly
STUCK = 1e-5  # of the distance: a bisection that is so near finds no void any more that opens alone
LEAST = 0.71  # of the hexagonal bound: a set that would be worse is thrown again
SPARSE = 0.25  # / √n: at smaller distances darts rarely meet, and the grid would have many more cells than points

MISSES = 30  # in a row, before relaxed darts lower their distance (McCool and Fiume 1992)
RELAX = 0.99  # what they lower it by
SLACK = 0.8  # how far distances may fall before the relaxed darts' grid is made anew
DRAWN = 2**7  # steps whose darts are drawn together, at most


def maximal_darts(n: int, streams: Streams) -> Floats:
    """
    Maximal sets of n points: no place of the torus is farther from all points than the two nearest points are apart.

    By chance, darts jam at a few more or fewer points than n. A set that has too few is kept, and darts are thrown at
    it with a smaller distance; one that gets too many is taken back, and the distance raised. That bisection ends with
    n points, because a falling distance opens one void after the other, the largest first.
    """
    sets = len(streams)
    spread = SPREAD / math.sqrt(n)
    most = 0.45 if n == 3 else 1.0  # above 0.5 two points may be maximal, and their voids are equal: a third never is
    least = LEAST * hexagonal_bound(n)
    start = min(most, jammed_distance(n) * (1 + spread))
    points, count, distance = np.zeros((sets, n + 1, 2)), np.zeros(sets, np.intp), np.full(sets, start)
    low, high = np.zeros(sets), np.full(sets, np.inf)  # with the points so far: too many fit; none fits
    todo = np.arange(sets)
    while todo.size:
        tried = points[todo]
        got = fill(tried, count[todo], distance[todo], least, n + 1, streams.pick(todo))
        kept, grown = got <= n, (got <= n) & (got > count[todo])
        points[todo[kept]], count[todo[kept]] = tried[kept], got[kept]
        low[todo[grown]], high[todo[kept]] = 0, distance[todo[kept]]
        low[todo[~kept]] = distance[todo[~kept]]

        todo = todo[count[todo] < n]
        lower = np.where(low > 0, (low + high) / 2, distance * (1 - (n - count) / (VOIDS * n)))
        distance = np.where(np.isinf(high), np.minimum(most, distance * (1 + spread)), lower)
        again = todo[(high - low < STUCK * distance)[todo] | (distance < least)[todo]]
        count[again], distance[again], low[again], high[again] = 0, start, 0, np.inf
    return points[:, :n]


def uniform_darts(n: int, min_dist: float, streams: Streams) -> Floats:
    """n uniform darts at ``min_dist``, not maximal. A set that jams is thrown again (see ``largest_min_dist``)."""
    if min_dist < SPARSE / math.sqrt(n):
        return _sparse_darts(n, min_dist, streams)
    points, count = np.zeros((len(streams), n, 2)), np.zeros(len(streams), np.intp)
    while (todo := np.flatnonzero(count < n)).size:
        tried = np.zeros((len(todo), n, 2))
        nothing, distance = np.zeros(len(todo), np.intp), np.full(len(todo), min_dist, np.float64)
        count[todo] = fill(tried, nothing, distance, min_dist, n, streams.pick(todo))
        points[todo] = tried
    return points


def _sparse_darts(n: int, min_dist: float, streams: Streams) -> Floats:
    """n uniform darts at a distance so small that few meet: of two that do, the later one is thrown again."""
    sets = len(streams)
    points = streams.blocks(n, 2)
    while True:
        one, other, _ = neighbours(points, min_dist)
        again = np.unique(np.maximum(one, other))
        if not again.size:
            return points
        points.reshape(-1, 2)[again] = streams.uniform(np.bincount(again // n, minlength=sets), 2)


def relaxed_darts(n: int, start: float, streams: Streams) -> tuple[Floats, Floats]:
    """
    n uniform darts at distances that begin with ``start`` and fall by 1 % whenever 30 darts in a row have missed; and
    the distances (K,) that they end with.

    A step throws 30 darts at each set that is not full: the first that hits stays and ends the row, or the distance
    falls.
    """
    sets = len(streams)
    if start < SPARSE / math.sqrt(n):  # 30 darts in a row would miss once in 10^20 rows
        return _sparse_darts(n, start, streams), np.full(sets, start, np.float64)
    points, count, distance = np.zeros((sets, n, 2)), np.zeros(sets, np.intp), np.full(sets, start, np.float64)
    todo = np.arange(sets)
    grid = Grid(sets, start * SLACK, start)
    drawn = np.zeros((sets, min(2 * n, DRAWN), MISSES, 2))
    used = drawn.shape[1]
    while todo.size:
        if distance[todo].min() < grid.smallest:
            grid = Grid(sets, distance[todo].min() * SLACK, distance[todo].max())
            owner, index = np.nonzero(np.arange(n) < count[:, None])
            grid.add(owner, *points[owner, index].T)
        if used == drawn.shape[1]:
            drawn[todo], used = streams.pick(todo).blocks(*drawn.shape[1:]), 0
        darts = drawn[todo, used].reshape(-1, 2)
        used += 1
        owner = np.repeat(todo, MISSES)
        free = grid.free(owner, darts[:, 0], darts[:, 1], distance[owner]).reshape(-1, MISSES)
        hit = free.any(axis=1)
        who, dart = todo[hit], np.flatnonzero(hit) * MISSES + free[hit].argmax(axis=1)
        grid.add(who, darts[dart, 0], darts[dart, 1])
        points[who, count[who]] = darts[dart]
        count[who] += 1
        distance[todo[~hit]] *= RELAX
        todo = todo[count[todo] < n]
    return points, distance
