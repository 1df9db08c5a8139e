"""
Samplers that look their points up: K sets of N points, made beforehand, decorrelated anew for each pixel and dimension.

A pixel walks through the sets with a step of its own, so that its first K dimensions come from K different sets: they
are paired at random without any permutation. What makes every sample uniform, and so the picture unbiased, is the
toroidal shift (or the Owen scrambling) by a hash of pixel and dimension; the symmetries of the square only multiply the
sets. One gather of 8 bytes and two hashes a sample.
"""

from __future__ import annotations

from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from renderer.samplers.base import Lanes, PixelSampler
from renderer.samplers.bits import GOLDEN, below, on_device, stir

RANKS_SEED = 0x1D  # of the permutations behind 1D samples
KEPT_TABLES = 8  # on the device, of the cells before: a grid comes back to the same few
TABLES: dict[tuple[Any, ...], Table] = {}


class Table:
    """
    Point sets on the device. Not a Dr.Jit structure, so that loops leave it alone.

    points  uint32 fractions (K, N, 2), flat; K is a power of two
    ranks   K random permutations of 0 … N − 1, flat: the strata of 1D samples
    """

    __slots__ = ("count", "mask", "points", "ranks", "stratum")

    def __init__(self, points: NDArray[np.float64]):
        sets, n, _ = points.shape
        if sets & (sets - 1):
            raise ValueError(f"{sets} sets of points: their number has to be a power of two")
        fractions = np.minimum(np.floor(points * 2.0**32), 2.0**32 - 1).astype(np.uint32)
        random = np.random.default_rng(RANKS_SEED)
        ranks = random.permuted(np.tile(np.arange(n, dtype=np.uint32), (sets, 1)), axis=1)
        self.points, self.ranks = on_device(fractions), on_device(ranks)
        self.count, self.mask = dr.opaque(mi.UInt32, n), dr.opaque(mi.UInt32, sets - 1)
        self.stratum = dr.opaque(mi.UInt32, min(2**32 // n, 2**32 - 1))


class TableSampler(PixelSampler):
    """Base of the samplers with tables. A subclass says which sets; ``progressive`` keeps the order of their points."""

    progressive = False

    def __init__(self, props: mi.Properties):
        super().__init__(props)
        self.table: Any = None  # a Table, once it is prepared
        self.prepared = 0  # samples per pixel that the table is for

    def sets(self, n: int) -> NDArray[np.float64]:
        """(K, n, 2) points in [0, 1) for n samples per pixel, K a power of two."""
        raise NotImplementedError

    def identity(self) -> tuple[Any, ...]:
        """What its sets depend on, beside their size."""
        return ()

    def prepare(self) -> None:
        n = self.sample_count()
        if self.table is None or self.prepared != n:
            key = (type(self), n, self.identity())
            if key not in TABLES:
                if len(TABLES) >= KEPT_TABLES:
                    del TABLES[next(iter(TABLES))]
                TABLES[key] = Table(self.sets(n))
            self.table, self.prepared = TABLES[key], n

    def adopt(self, other: Any) -> None:
        self.table, self.prepared = other.table, other.prepared

    def fraction_1d(self, lanes: Lanes, dimension: Any) -> Any:
        """Stratified at any N: a random permutation of N strata, a random place in each."""
        key = self.key(dimension, 1)
        at = self.row(lanes, dimension) + self.turned(lanes.index, below(key, self.table.count))
        place = dr.mul_hi(stir(stir(key ^ lanes.index * GOLDEN)), self.table.stratum)
        return dr.gather(mi.UInt32, self.table.ranks, at) * self.table.stratum + place

    def fraction_2d(self, lanes: Lanes, dimension: Any) -> tuple[Any, Any]:
        key = self.key(dimension, 0)
        return shifted(self.point(lanes, dimension, key), key)

    def point(self, lanes: Lanes, dimension: Any, key: Any) -> Any:
        """The point of the lane's set and sample as it stands in the table, two fractions."""
        turn = below(key, self.table.count)
        if self.progressive:  # the first K dimensions have sets of their own and keep their order
            turn = dr.select(dimension > self.table.mask, turn, 0)
        at = self.row(lanes, dimension) + self.turned(lanes.index, turn)
        return dr.gather(mi.Vector2u, self.table.points, at)

    def row(self, lanes: Lanes, dimension: Any) -> Any:
        """Where the set of a pixel and dimension begins: an odd step visits every set before one comes again."""
        step = (lanes.key >> 16) | 1
        return ((lanes.key + dimension * step) & self.table.mask) * self.table.count

    def turned(self, index: Any, turn: Any) -> Any:
        """(index + turn) mod N: the stored order is random, so that is as good as a permutation."""
        index = index + turn
        return dr.select(index >= self.table.count, index - self.table.count, index)


def shifted(point: Any, key: Any) -> tuple[Any, Any]:
    """One of the 8 symmetries of the square, then a uniform toroidal shift, both decided by ``key``."""
    x, y = point
    swap = (key & 1) != 0
    x, y = dr.select(swap, y, x), dr.select(swap, x, y)
    x, y = x ^ (0 - ((key >> 1) & 1)), y ^ (0 - ((key >> 2) & 1))  # all bits or none: x or 1 − x
    shift = stir(key)
    return x + shift, y + stir(shift + GOLDEN)
