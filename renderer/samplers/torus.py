"""
The unit torus: its distance, and a grid that finds the points near a place at once for many sets.

Point sets are made for K sets together: numpy pays for a call, not for a set. Every set has a random generator of its
own, so that set k is the same however many sets are asked for.
"""

from __future__ import annotations

import math
from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Integers = NDArray[np.intp]
Flags = NDArray[np.bool_]

CHUNK = 4096  # places looked at together: their temporaries stay in the cache
NEAREST = 9  # cells looked at first: most places die there
SAFE = 1 + 1e-9  # keeps a cell's diagonal below the distance after rounding


class Streams:
    """One random generator for each set."""

    def __init__(self, generators: list[np.random.Generator]):
        self.generators = generators

    @classmethod
    def of(cls, kind: int, seed: int, numbers: Iterable[int]) -> Streams:
        """The streams of the sets with these numbers; ``kind`` keeps different constructions apart."""
        seeds = [np.random.SeedSequence(seed, spawn_key=(kind, number)) for number in numbers]
        return cls([np.random.Generator(np.random.PCG64(sequence)) for sequence in seeds])

    def __len__(self) -> int:
        return len(self.generators)

    def pick(self, sets: Integers) -> Streams:
        """The streams of some of the sets, in that order; they go on where they are."""
        return Streams([self.generators[number] for number in sets])

    def uniform(self, counts: Integers, width: int) -> Floats:
        """``counts[k]`` rows of ``width`` uniform numbers in [0, 1) from the stream of each set k, set after set."""
        return np.concatenate([self.generators[k].random((counts[k], width)) for k in range(len(self))])

    def blocks(self, *shape: int) -> Floats:
        """(K, *shape) uniform numbers in [0, 1)."""
        return np.stack([generator.random(shape) for generator in self.generators])


class Grid:
    """
    Points of K sets in square cells that are too small for two of them (Bridson 2007, section 2).

    Made for distances from ``smallest`` to ``largest``, 0 < smallest ≤ largest ≤ 1. The grid of each set has a margin
    as wide as the largest distance, where a torus has copies of the points across its seam: no index and no difference
    needs wrapping. Cells without a point hold one at infinity. With ``turns`` it keeps a number of each, for ``first``.
    """

    def __init__(self, sets: int, smallest: float, largest: float, *, periodic: bool = True, turns: bool = False):
        self.sets, self.smallest, self.largest, self.periodic = sets, smallest, largest, periodic
        self.cells = math.ceil(math.sqrt(2) / smallest * SAFE)
        margin = math.ceil(largest * self.cells)
        self.margin, self.side = margin, self.cells + 2 * margin
        self.x = np.full(sets * self.side**2, np.inf)
        self.y = np.full(sets * self.side**2, np.inf)
        self.turn = np.zeros(sets * self.side**2 if turns else 0, np.intp)
        self.empty = True

        step = np.arange(-margin, margin + 1)
        row, column = (axis.ravel() for axis in np.meshgrid(step, step, indexing="ij"))
        gap = np.maximum(np.abs(row) - 1, 0) ** 2 + np.maximum(np.abs(column) - 1, 0) ** 2
        near = np.flatnonzero(gap < (largest * self.cells) ** 2)
        near = near[np.argsort((row**2 + column**2)[near], kind="stable")]
        offsets = row[near] * self.side + column[near]
        self.rings = [offsets[:NEAREST], offsets[NEAREST:]]

        # Where a point of cell i goes along one axis: into the cell, and into its copies that fall in the margin.
        copies = np.arange(self.cells)[:, None] + np.array([0, self.cells, -self.cells] if periodic else [0])
        inside = (copies >= -margin) & (copies < self.cells + margin)
        shift = np.array([0.0, 1.0, -1.0] if periodic else [0.0])
        self._place = np.where(inside, copies, copies[:, :1]) + margin
        self._shift = np.where(inside, shift, 0.0)

    def axis(self, x: Floats) -> Integers:
        """The row or column of a coordinate in [0, 1)."""
        return np.minimum((x * self.cells).astype(np.intp), self.cells - 1)

    def home(self, owner: Integers, column: Integers, row: Integers) -> Integers:
        """The cell of set ``owner`` at that column and row, as an index."""
        return (owner * self.side + row + self.margin) * self.side + column + self.margin

    def add(self, owner: Integers, x: Floats, y: Floats, turn: Integers | None = None) -> None:
        """Puts points into their cells; of several in one cell the last one stays."""
        self.empty = self.empty and not len(owner)
        column, row = self.axis(x), self.axis(y)
        copy = (owner[:, None] * self.side + self._place[row])[:, :, None] * self.side + self._place[column][:, None, :]
        self.x[copy] = (x[:, None] + self._shift[column])[:, None, :]
        self.y[copy] = (y[:, None] + self._shift[row])[:, :, None]
        if turn is not None:
            self.turn[copy] = turn[:, None, None]

    def free(self, owner: Integers, x: Floats, y: Floats, distance: Floats) -> Flags:
        """Which of the places have no point of their set nearer than ``distance`` (one for each place)."""
        return self._unmet(self.home(owner, self.axis(x), self.axis(y)), x, y, distance, 0.0, None)

    def uncovered(self, home: Integers, x: Floats, y: Floats, half: float, distance: Floats) -> Flags:
        """Which of the squares round (x, y) with sides 2 ``half``, each within cell ``home``, lie in no one disc."""
        return self._unmet(home, x, y, distance, half, None)

    def first(self, owner: Integers, x: Floats, y: Floats, distance: Floats, turn: Integers) -> Flags:
        """Which of the places have no point of an earlier turn nearer than ``distance``."""
        return self._unmet(self.home(owner, self.axis(x), self.axis(y)), x, y, distance, 0.0, turn)

    def _unmet(
        self, home: Integers, x: Floats, y: Floats, distance: Floats, half: float, turn: Integers | None
    ) -> Flags:
        """Which places have no point whose disc holds all of the square round them (a place, if ``half`` is 0)."""
        unmet = np.ones(len(home), bool)
        if self.empty:
            return unmet
        for start in range(0, len(home), CHUNK):
            left = np.arange(start, min(start + CHUNK, len(home)))
            for ring in self.rings:
                cell = home[left, None] + ring
                dx = np.abs(self.x[cell] - x[left, None]) + half
                dy = np.abs(self.y[cell] - y[left, None]) + half
                met = dx * dx + dy * dy < (distance[left] ** 2)[:, None]
                if turn is not None:
                    met &= self.turn[cell] < turn[left, None]
                dead = met.any(axis=1)
                unmet[left[dead]] = False
                left = left[~dead]
        return unmet


def min_distance(points: Floats) -> Floats:
    """
    The smallest toroidal distance within each of the sets, (K, N, 2) → (K,); 1 for a single point, to its own copy.

    Sorted along x, a point is compared with its next neighbour, the one after, and so on, until all are too far in x.
    """
    n = points.shape[1]
    order = np.argsort(points[..., 0], axis=1)
    points = np.take_along_axis(points, order[..., None], axis=1)
    best = np.ones(len(points))
    for lag in range(1, n):
        across = np.abs(np.roll(points, -lag, axis=1) - points)
        ahead = across[..., 0].copy()
        ahead[:, n - lag :] = 1 - ahead[:, n - lag :]  # these went round: their difference is negative
        across = np.minimum(across, 1 - across)
        best = np.minimum(best, np.sqrt((across**2).sum(axis=2).min(axis=1)))
        if (ahead.min(axis=1) >= best).all():
            break
    return best


def neighbours(points: Floats, reach: float) -> tuple[Integers, Integers, Floats]:
    """
    The pairs of points of a set that are nearer than ``reach`` on the torus, each once: indices into the flat list of
    all points of all sets (K·N), and their distance.

    Points are sorted into cells at least as wide as the reach; a point is compared with the later ones of its cell and
    with four of the eight cells round it. On a torus of fewer than three cells it is compared with all.
    """
    sets, n, _ = points.shape
    flat = points.reshape(-1, 2)
    cells = min(int(1 / reach), math.isqrt(n))
    cells = cells if cells >= 3 else 1
    column, row = np.minimum((flat * cells).astype(np.intp), cells - 1).T
    owner = np.repeat(np.arange(sets), n)
    cell = (owner * cells + row) * cells + column
    order = np.argsort(cell, kind="stable")
    start = np.searchsorted(cell[order], np.arange(sets * cells**2 + 1))
    owner, column, row, x, y = owner[order], column[order], row[order], flat[order, 0], flat[order, 1]

    found = []
    for across, down in ((0, 0), (1, 0), (-1, 1), (0, 1), (1, 1)) if cells > 1 else ((0, 0),):
        near = (owner * cells + (row + down) % cells) * cells + (column + across) % cells
        first = np.arange(len(order)) + 1 if across == down == 0 else start[near]
        count = start[near + 1] - first
        one = np.repeat(np.arange(len(order)), count)
        other = np.arange(len(one)) + np.repeat(first - (np.cumsum(count) - count), count)
        dx, dy = np.abs(x[one] - x[other]), np.abs(y[one] - y[other])
        squared = np.minimum(dx, 1 - dx) ** 2 + np.minimum(dy, 1 - dy) ** 2
        close = np.flatnonzero(squared < reach**2)
        found.append((order[one[close]], order[other[close]], np.sqrt(squared[close])))
    one, other, distance = (np.concatenate(column) for column in zip(*found, strict=True))
    return one, other, distance
