"""
The constructions of the seed report, as published: what its flat and rising curves were drawn with.

An active list on the unit square, without wrapping: a random parent is taken off the list and throws 30 darts, at a
distance uniform in [r, 2r] from it; *all* that hit stay and join the list; it stops at n points, wherever its front is
by then. At r = 1/√n only 0.66 n to 0.85 n points find room, and what filled the gap decided the curve. Not to be used
for anything but showing the mistake: ``point_sets`` has the correct sampler.

An empty list begins again with a random point that is there, at most 30 times: the report's loop, which has no such
guard, does not end for n ≥ 25 or so.
"""

from __future__ import annotations

import math
from typing import Literal

import numpy as np

from renderer.errors import BadParameter, shown
from renderer.samplers.packing import MAX_POINTS
from renderer.samplers.torus import Floats, Grid, Integers, Streams

Fill = Literal["zeros", "random_fill", "truncated"]

DARTS = 30  # of one parent
RESTARTS = 30
RELAX = 0.99  # what the relaxed version multiplies its distance with when a parent has no child
SPARSE = 0.2  # / √n: the smallest first distance of the relaxed version
SLACK = 0.8  # how far distances may fall before the grid is made anew
BATCH = 2**21  # cells of the grids of sets that are made together
DRAWN = 8  # steps whose random numbers are drawn together


def basic(n: int, sets: int, seed: int, fill: Fill) -> Floats:
    """
    The report's dart throwing at r = 1/√n: (K, n, 2) points in [0, 1), in the order of generation.

    fill  what the slots hold that no point was found for: ``zeros`` (as the report's vectors do) or ``random_fill``; or
          ``truncated``: r = 0.5/√n, at which n points are found, long before the front has covered the square
    """
    _check(n, sets)
    if fill not in ("zeros", "random_fill", "truncated"):
        raise BadParameter(f"fill = {shown(fill)} is not known; it is zeros, random_fill or truncated")
    distance = (0.5 if fill == "truncated" else 1) / math.sqrt(n)
    made = []
    for streams in _batches(4, distance, sets, seed):
        points, count = _grow(n, distance, streams, relax=1.0, restarts=RESTARTS)
        if fill == "random_fill":
            rest = np.arange(n) >= count[:, None]
            points[rest] = streams.uniform(n - count, 2)
        made.append(points)
    return np.concatenate(made)


def relaxed(n: int, sets: int, seed: int, min_dist: float | None = None) -> Floats:
    """
    The report's relaxed version, (K, n, 2) in the order of generation: its distance, at first ``min_dist`` in (0, 1] or
    1/√n, falls by 1 % whenever a parent has no child. n points are found, before the front has covered the square.
    """
    _check(n, sets)
    least = SPARSE / math.sqrt(n)
    if min_dist is not None and not least <= min_dist <= 1:
        raise BadParameter(
            f"min_dist = {shown(min_dist)} of the relaxed replay at {n} points is not allowed; give "
            f"{least:.2g} to 1: points that are nearer cover a thirtieth of the pixel"
        )
    start = 1 / math.sqrt(n) if min_dist is None else min_dist
    batches = _batches(5, start, sets, seed)
    return np.concatenate([_grow(n, start, streams, relax=RELAX, restarts=None)[0] for streams in batches])


def _grow(n: int, start: float, streams: Streams, *, relax: float, restarts: int | None) -> tuple[Floats, Integers]:
    """Points (K, n, 2), zero where there are none, and their numbers (K,)."""
    sets = len(streams)
    points, count = np.zeros((sets, n, 2)), np.ones(sets, np.intp)
    points[:, 0] = streams.blocks(2)
    active, waiting = (
        np.zeros((sets, n), np.intp),
        np.ones(sets, np.intp),
    )  # the lists, by index of the point; their lengths
    distance, left = np.full(sets, start, np.float64), np.full(sets, math.inf if restarts is None else restarts)
    grid = Grid(sets, start * (SLACK if relax < 1 else 1), start, periodic=False)
    grid.add(np.arange(sets), *points[:, 0].T)
    drawn = np.zeros((sets, DRAWN, 2 * DARTS + 1))
    used = DRAWN
    todo = np.flatnonzero(count < n)
    while todo.size:
        if distance[todo].min() < grid.smallest:
            grid = Grid(sets, distance[todo].min() * SLACK, distance[todo].max(), periodic=False)
            owner, index = np.nonzero(np.arange(n) < count[:, None])
            grid.add(owner, *points[owner, index].T)
        if used == DRAWN:
            drawn[todo], used = streams.pick(todo).blocks(*drawn.shape[1:]), 0
        chance = drawn[todo, used]
        used += 1

        empty = waiting[todo] == 0
        left[todo[empty]] -= 1
        place = (chance[:, 0] * np.where(empty, count[todo], waiting[todo])).astype(np.intp)
        parent = np.where(empty, place, active[todo, place])
        last = np.maximum(waiting[todo] - 1, 0)
        active[todo, np.where(empty, 0, place)] = active[todo, last]  # the last of the list takes the place
        waiting[todo] = last

        r = distance[todo, None]
        angle, away = 2 * np.pi * chance[:, 1 : 1 + DARTS], r * (1 + chance[:, 1 + DARTS :])
        x = points[todo, parent, 0][:, None] + away * np.cos(angle)
        y = points[todo, parent, 1][:, None] + away * np.sin(angle)
        free = (x >= 0) & (x < 1) & (y >= 0) & (y < 1)
        which, dart = np.nonzero(free)
        free[which, dart] = grid.free(todo[which], x[which, dart], y[which, dart], distance[todo[which]])
        childless = ~free.any(axis=1)

        while (
            row := np.flatnonzero(free.any(axis=1))
        ).size:  # the first dart that hits, the next that is far from it, …
            dart, who = free[row].argmax(axis=1), todo[row]
            child_x, child_y = x[row, dart], y[row, dart]
            grid.add(who, child_x, child_y)
            points[who, count[who]] = np.stack([child_x, child_y], axis=1)
            active[who, waiting[who]] = count[who]
            count[who] += 1
            waiting[who] += 1
            near = (x[row] - child_x[:, None]) ** 2 + (y[row] - child_y[:, None]) ** 2 < r[row] ** 2
            free[row] &= ~near & (count[who] < n)[:, None]
            free[row, dart] = False

        distance[todo[childless]] *= relax
        todo = todo[(count[todo] < n) & ((waiting[todo] > 0) | (left[todo] > 0))]
    return points, count


def _batches(kind: int, start: float, sets: int, seed: int) -> list[Streams]:
    """The streams of sets that are made together, which begin with that distance."""
    together = max(1, int(BATCH * (start * SLACK) ** 2 / 2))
    return [Streams.of(kind, seed, range(first, min(first + together, sets))) for first in range(0, sets, together)]


def _check(n: int, sets: int) -> None:
    if not 1 <= n <= MAX_POINTS or sets < 1:
        raise BadParameter(
            f"{shown(sets)} sets of {shown(n)} points are not allowed; give 1 to {MAX_POINTS} points and at least one "
            "set"
        )
