"""``uniform``: every lamp with the same probability, as Mitsuba picks them. For scenes whose lamps are much alike."""

from __future__ import annotations

from typing import Any

import drjit as dr
import mitsuba as mi

from renderer.lightsamplers.base import ONE_BELOW, LightSampler


class Uniform(LightSampler):
    """p = 1 / number of lamps, at every point."""

    __slots__ = ()

    def pick(self, p: Any, n: Any, u: Any, active: Any = True) -> tuple[Any, Any, Any]:
        return self.pick_emission(u, active)

    def pmf(self, p: Any, n: Any, index: Any, active: Any = True) -> Any:
        return self.pmf_emission(index, active)

    def pick_emission(self, u: Any, active: Any = True) -> tuple[Any, Any, Any]:
        scaled = u * self.count
        index = dr.minimum(mi.UInt32(scaled), self.count - 1)
        return index, self.pmf_emission(index, active), dr.minimum(scaled - mi.Float(index), ONE_BELOW)

    def pmf_emission(self, index: Any, active: Any = True) -> Any:
        return mi.Float(1 / self.count)
