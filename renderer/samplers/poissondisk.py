"""The Poisson-disk samplers: dart throwing, relaxed dart throwing, weighted sample elimination."""

from __future__ import annotations

from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from renderer.samplers import store
from renderer.samplers.base import Lanes
from renderer.samplers.bits import below, mix, stir
from renderer.samplers.tabled import TableSampler

REPLAYS = ("ignore_spp", "zeros", "truncated", "random_fill", "four_dimensions")
SERVED_DIMENSIONS = 4  # of each kind, by a PixelSampler of pbrt-v3
REPLAY_SETS = 256  # published sets are used as they are, without shift or symmetry: more of them are needed


class _Darts(TableSampler):
    """
    What the two dart throwers share: their parameters, and the replays of published mistakes.

    A replay takes its sets from the construction as it was published (renderer/samplers/replays.py) and uses them as
    they are: no shift, no symmetry, every dimension in the order of generation. ``four_dimensions`` alone keeps the
    correct sets, and stops serving them after the fourth dimension of each kind.
    """

    kind = ""
    published = ""

    def __init__(self, props: mi.Properties):
        super().__init__(props)
        self.min_dist = props.get("min_dist", 0.0)
        self.lloyd_iterations = props.get("lloyd_iterations", 0)
        self.replay = props.get("replay", "")
        if self.replay and self.replay not in REPLAYS:
            raise RuntimeError(f"replay = {self.replay!r} is not known; it is one of {', '.join(REPLAYS)}")

    def properties(self) -> mi.Properties:
        props = super().properties()
        props["min_dist"], props["replay"] = self.min_dist, self.replay
        props["lloyd_iterations"] = self.lloyd_iterations
        return props

    def identity(self) -> tuple[Any, ...]:
        return self.min_dist, self.lloyd_iterations, self.replay

    @property
    def as_published(self) -> bool:
        return self.replay not in ("", "four_dimensions")

    def sets(self, n: int) -> NDArray[np.float64]:
        asked: dict[str, Any] = {"min_dist": self.min_dist or None}
        if self.as_published:
            fill = "random_fill" if self.replay == "ignore_spp" else self.replay
            sets = max(4, min(REPLAY_SETS, store.MAX_TABLE_POINTS // (1 << (n - 1).bit_length())))
            return store.load(self.published, n, sets, fill=fill, **asked).points
        return store.load(self.kind, n, store.sets_for(n), lloyd_iterations=self.lloyd_iterations, **asked).points

    def fraction_1d(self, lanes: Lanes, dimension: Any) -> Any:
        value = super().fraction_1d(lanes, dimension)
        if self.replay == "four_dimensions":
            plain = mix(self.key(dimension, 1) ^ mix(lanes.index))
            value = dr.select(dimension < SERVED_DIMENSIONS, value, plain)
        return value

    def fraction_2d(self, lanes: Lanes, dimension: Any) -> tuple[Any, Any]:
        key = self.key(dimension, 0)
        if self.as_published:
            at = below(key, self.table.mask + 1) * self.table.count + lanes.index
            x, y = dr.gather(mi.Vector2u, self.table.points, at)
            return x, y
        x, y = super().fraction_2d(lanes, dimension)
        if self.replay == "four_dimensions":
            served, plain = dimension < SERVED_DIMENSIONS, mix(key ^ mix(lanes.index))
            x, y = dr.select(served, x, plain), dr.select(served, y, mix(stir(plain) ^ key))
        return x, y


class PoissonDisk(_Darts):
    """
    Dart throwing with an active list on the torus: N points, as far apart as darts can be when N of them fill it.

    What it does: uniform darts are thrown into an active list of squares that no disc covers yet, until none is left:
    the set is maximal. The radius is the one at which exactly N points fit. With ``min_dist`` the N darts are uniform
    at that distance and there is room left: not maximal. 64 such sets are made once and kept on disk; a pixel takes a
    set, a symmetry of the square and a toroidal shift of its own for every dimension. 1D samples are stratified.

    When it wins: at 16 samples and below on round, periodic or soft shapes, and to the eye: its error has no grain at
    low frequencies and no lattice that could alias.

    When it loses: nothing in the set is denser at larger scales, so its squared error falls as N^-1 like that of random
    points, 8 to 17 times below them at 256; jittered points pass it between 16 and 150 samples, Owen-scrambled Sobol'
    points by 64. Where a pattern repeats at the distance of the points it is worse than random, by up to 1.7 times:
    there its spectrum has its peak. The checkerboard of the tables does so between 28 and 56 samples.

    Replays: the report's sampler asked for a distance of 1/√N, at which only 0.70 N darts fit, and what filled the gap
    decided its curve. ``replay=zeros`` leaves the missing points at (0, 0); ``random_fill`` draws them; ``truncated``
    stops a front of half that distance at N points, which leaves the pixel half covered; ``ignore_spp`` renders 16
    samples whatever is asked (random_fill's points); ``four_dimensions`` takes correct sets for the first four
    dimensions and plain random numbers from the fifth on, as a PixelSampler of pbrt-v3 does.

    Source: Cook 1986; Bridson 2007, "Fast Poisson Disk Sampling in Arbitrary Dimensions" (grid and active list); the
    list holds squares, not points, after Ebeida et al. 2012, "A Simple Algorithm for Maximal Poisson-Disk Sampling in
    High Dimensions".
    """

    kind, published = "poissondisk", "replay_basic"


class RelaxedPoissonDisk(_Darts):
    """
    Dart throwing that lowers its distance when it misses: exactly N points, at the distance that it ends with.

    What it does: uniform darts on the torus, first at ``min_dist`` (the hexagonal bound √(2/(√3 N)) unless given, which
    no random set reaches); after 30 misses in a row the distance shrinks by 1 %. It ends at 0.6 of the bound or a
    little above: less even than a maximal set, because 30 misses are impatient. Sets, shifts and 1D samples as for
    poissondisk.

    When it wins: where poissondisk does, by less; it needs no radius to be found, which is why it was popular.

    When it loses: it has more power at low frequencies than poissondisk and hence a larger constant, with the same
    N^-1.

    Replays: the report's version shrinks the distance whenever one parent has no child, on a square without wrapping,
    so its front stops before it has covered the pixel: 1.3 to 1.9 times worse than random points at 256 samples. That
    set always has N points, so ``zeros``, ``random_fill`` and ``truncated`` are one and the same here; ``ignore_spp``
    and ``four_dimensions`` as for poissondisk.

    Source: McCool and Fiume 1992, "Hierarchical Poisson Disk Sampling Distributions".
    """

    kind, published = "relaxedpoissondisk", "replay_relaxed"


class Eliminated(TableSampler):
    """
    Weighted sample elimination: N of 5 N random points, after those with the closest neighbours have gone.

    What it does: every point weighs what its neighbours within a radius make it weigh, and the heaviest goes, until N
    are left, on the torus. The order of elimination, reversed, is the order of the samples: each prefix is well spread
    too. Sets, shifts and 1D samples as for poissondisk.

    When it wins: the smoothest of the three at high frequencies and the one to take if pictures are looked at while
    they refine, because its prefixes are good sets.

    When it loses: as all Poisson-disk sets do, with N^-1 against N^-1.5 and better of stratified and Sobol' points.

    Source: Yuksel 2015, "Sample Elimination for Generating Poisson Disk Sample Sets".
    """

    progressive = True

    def sets(self, n: int) -> NDArray[np.float64]:
        return store.load("eliminated", n, store.sets_for(n)).points
