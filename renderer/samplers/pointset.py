"""The pointset sampler: points that somebody brings along."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from renderer.samplers import pointfile
from renderer.samplers.base import Lanes
from renderer.samplers.bits import mix, scramble, stir
from renderer.samplers.tabled import TableSampler

LEAST_SETS = 64  # fewer are repeated, each time in another order, so that dimensions are paired at random


class PointSet(TableSampler):
    """
    Your own points: the sets in a file, decorrelated for each pixel and dimension like our own tables.

    What it does: the file holds ``points`` (K, N, 2) in [0, 1), as ``dartboard points`` writes it. A pixel takes a set
    for each dimension, in an order that is shuffled once. ``scramble=shift`` adds a symmetry of the square and a
    toroidal shift, so that any set gives an unbiased picture; ``owen`` scrambles instead, which keeps the elementary
    intervals of nets; ``none`` takes the points as they are: unbiased only if they are uniform themselves and there are
    very many sets, so its curves are marked as a replay. 1D samples are stratified. Fewer samples than N take the first
    of each set.

    When it wins: that is yours to find out.

    When it loses: shifting breaks nets (choose owen), scrambling breaks distances (choose shift).

    Source: the file.
    """

    def __init__(self, props: mi.Properties):
        super().__init__(props)
        self.path = props.get("path", "")
        self.scramble = props.get("scramble", "shift")

    def properties(self) -> mi.Properties:
        props = super().properties()
        props["path"], props["scramble"] = self.path, self.scramble
        return props

    def identity(self) -> tuple[Any, ...]:
        return (self.path,)

    def sets(self, n: int) -> NDArray[np.float64]:
        points = pointfile.read(Path(self.path)).points[:, :n]
        if points.shape[1] < n:
            raise RuntimeError(f"{Path(self.path).name} holds {points.shape[1]} points a set, and {n} are asked for")
        wanted = 1 << (max(LEAST_SETS, len(points)) - 1).bit_length()
        copies = points[np.arange(wanted) % len(points)]
        order = np.random.default_rng(wanted).permuted(np.tile(np.arange(n), (wanted, 1)), axis=1)
        return np.take_along_axis(copies, order[:, :, None], axis=1)

    def fraction_2d(self, lanes: Lanes, dimension: Any) -> tuple[Any, Any]:
        key = self.key(dimension, 0)
        if self.scramble == "shift":
            return super().fraction_2d(lanes, dimension)
        x, y = self.point(lanes, dimension, key)
        if self.scramble == "owen":
            return scramble(x, stir(key)), scramble(y, mix(key ^ 0x5BD1E995))
        return x, y
