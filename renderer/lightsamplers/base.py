"""
What a light sampler answers, and what all of them have in common: lamps by number, and directions towards them.

A light sampler is made for one scene and never changes. It is no Dr.Jit structure, so loops leave it alone, and its
tables are memory, not code: one kernel serves every colour and power of the lamps.

Lamps are numbered as ``scene.emitters()`` lists them, the environment among them. All arrays have one value a lane.
"""

from __future__ import annotations

from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from renderer.samplers.bits import on_device

ONE_BELOW = 1 - 2**-24  # the largest float32 below 1


class LightSampler:
    """
    emitters  mi.EmitterPtr of all lamps; a null pointer where there is none
    count     how many lamps the scene has
    """

    __slots__ = ("_numbers", "count", "emitters")

    def __init__(self, scene: Any):
        self.count = len(scene.emitters())
        self.emitters = scene.emitters_dr() if self.count else dr.zeros(mi.EmitterPtr, 1)
        # Dr.Jit numbers the objects of a class as they are made: not as the scene lists them, and not from 0.
        ids = dr.reinterpret_array(mi.UInt32, self.emitters).numpy()
        numbers = np.zeros(int(ids.max()) + 1, np.uint32)
        numbers[ids] = np.arange(len(ids), dtype=np.uint32)
        self._numbers = on_device(numbers)

    # -- what a subclass says ----------------------------------------------------------------------------------

    def pick(self, p: Any, n: Any, u: Any, active: Any = True) -> tuple[Any, Any, Any]:
        """
        A lamp for the lit point ``p`` with geometric normal ``n`` (zero where there is none), by the random number
        ``u`` in [0, 1) → (its number, the probability of that, what is left of u: again uniform in [0, 1)).
        """
        raise NotImplementedError

    def pmf(self, p: Any, n: Any, index: Any, active: Any = True) -> Any:
        """The probability that ``pick`` picks lamp ``index`` at ``p``."""
        raise NotImplementedError

    def pick_emission(self, u: Any, active: Any = True) -> tuple[Any, Any, Any]:
        """A lamp for a path that starts at the light, where no lit point is known → as ``pick``."""
        raise NotImplementedError

    def pmf_emission(self, index: Any, active: Any = True) -> Any:
        """The probability that ``pick_emission`` picks lamp ``index``."""
        raise NotImplementedError

    # -- what follows from it ----------------------------------------------------------------------------------

    def index(self, emitter: Any) -> Any:
        """The number of a lamp of this scene, given as mi.EmitterPtr; 0 for a null pointer."""
        return dr.gather(mi.UInt32, self._numbers, dr.reinterpret_array(mi.UInt32, emitter))

    def sample_direction(self, it: Any, u2: Any, active: Any = True) -> tuple[Any, Any, Any, Any]:
        """
        A direction from the interaction ``it`` to a point of a picked lamp → (ds, weight, number of the lamp, pmf).

        ``ds.pdf`` is pmf × density per steradian (delta lamps: the pmf), and 0 where the lamp sends nothing there;
        ``weight`` is the radiance that arrives divided by it. What stands between is not tested.
        """
        index, pmf, rest = self.pick(it.p, it.n, u2.x, active)
        emitter = dr.gather(mi.EmitterPtr, self.emitters, index, active)
        ds, weight = emitter.sample_direction(it, mi.Point2f(rest, u2.y), active)
        ds.pdf *= pmf
        ds.emitter = emitter
        return ds, weight * dr.select(pmf > 0, dr.rcp(pmf), 0), index, pmf

    def pdf_direction(self, it: Any, ds: Any, active: Any = True) -> Any:
        """
        The density, per steradian, of ``sample_direction`` at ``it`` for a direction ``ds`` that hit ``ds.emitter``,
        its pmf included. 0 for delta lamps, which nothing hits.
        """
        pmf = self.pmf(it.p, it.n, self.index(ds.emitter), active)
        return ds.emitter.pdf_direction(it, ds, active) * pmf


class Darkness(LightSampler):
    """For a scene without lamps: everything is 0, so whatever asks for light stays black."""

    __slots__ = ()

    def pick(self, p: Any, n: Any, u: Any, active: Any = True) -> tuple[Any, Any, Any]:
        return self.pick_emission(u, active)

    def pmf(self, p: Any, n: Any, index: Any, active: Any = True) -> Any:
        return mi.Float(0)

    def pick_emission(self, u: Any, active: Any = True) -> tuple[Any, Any, Any]:
        return mi.UInt32(0), mi.Float(0), mi.Float(u)

    def pmf_emission(self, index: Any, active: Any = True) -> Any:
        return mi.Float(0)

    def sample_direction(self, it: Any, u2: Any, active: Any = True) -> tuple[Any, Any, Any, Any]:
        return dr.zeros(mi.DirectionSample3f), mi.Spectrum(0), mi.UInt32(0), mi.Float(0)

    def pdf_direction(self, it: Any, ds: Any, active: Any = True) -> Any:
        return mi.Float(0)


def radical_inverses(count: int, dimensions: int) -> NDArray[np.float64]:
    """The first ``count`` points of the Halton sequence, moved off 0 by 1/(2 count); shape (count, dimensions ≤ 6)."""
    points = np.empty((count, dimensions))
    for dimension, base in enumerate((2, 3, 5, 7, 11, 13)[:dimensions]):
        left, weight = np.arange(count), 1.0
        points[:, dimension] = 0.5 / count
        while left.any():
            weight /= base
            left, digit = np.divmod(left, base)
            points[:, dimension] += digit * weight
    return points % 1
