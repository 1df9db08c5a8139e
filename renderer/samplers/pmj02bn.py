"""The pmj02bn sampler: progressive multi-jittered (0,2)-sequences, chosen for blue noise."""

from __future__ import annotations

from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from renderer.samplers import store
from renderer.samplers.base import Lanes
from renderer.samplers.bits import mix, scramble, scramble_reversed, stir
from renderer.samplers.sobol import van_der_corput
from renderer.samplers.tabled import TableSampler

SETS = 32  # a path asks for about 20 2D samples; each gets a table of its own


class PMJ02BN(TableSampler):
    """
    Progressive (0,2)-sequences whose scrambling was chosen so that points keep away from each other.

    What it does: 32 tables of our own hold sequences whose every prefix of 2^m points fills all elementary intervals;
    the one freedom that leaves, Owen's digit flips, was spent on distance. A pixel takes another table for each
    dimension and an Owen scrambling of its own, which keeps every elementary interval. 1D samples are Owen-scrambled
    radical inverses.

    When it wins: where sobol wins: at powers of two, on edges above all. The two have the same error within noise, as
    Christensen et al. found.

    When it loses: at other spp, as sobol. The scrambling that makes each pixel unbiased takes the blue noise of the
    tables away: compare ``pointset`` with a file of these points and ``scramble=none``. At most 16384 samples a pixel.

    Source: Christensen, Kensler and Kilpatrick 2018, "Progressive Multi-Jittered Sample Sequences"; the tables are made
    by renderer/samplers/pmj.py, which says how.
    """

    def sets(self, n: int) -> NDArray[np.float64]:
        """Up to the next power of two: the shuffle of ``point`` takes n of those."""
        return store.load("pmj02bn", 1 << (n - 1).bit_length(), SETS).points

    def fraction_1d(self, lanes: Lanes, dimension: Any) -> Any:
        return van_der_corput(lanes.index, self.key(dimension, 1))

    def fraction_2d(self, lanes: Lanes, dimension: Any) -> tuple[Any, Any]:
        key = self.key(dimension, 0)
        x, y = self.point(lanes, dimension, key)
        return scramble(x, stir(key)), scramble(y, mix(key ^ 0x5BD1E995))

    def point(self, lanes: Lanes, dimension: Any, key: Any) -> Any:
        """
        The sequences share the order of Sobol', in which equal indices of two dimensions would be correlated: a nested
        shuffle of the index, which keeps aligned blocks together, makes the pairing random.
        """
        shuffled = dr.brev(scramble_reversed(dr.brev(lanes.index), key)) & (self.table.count - 1)
        return dr.gather(mi.Vector2u, self.table.points, self.row(lanes, dimension) + shuffled)
