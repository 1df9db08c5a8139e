"""
The light samplers of one loaded scene, made once for each state of it.

A grid of a table may take longer to make than a small cell to draw, so cells that see the same scene share it. What a
sweep has set in the scene is the state: when that changes, the samplers of the state before are forgotten.
"""

from __future__ import annotations

from collections.abc import Hashable
from typing import TYPE_CHECKING, Any

from renderer.lightsamplers import make

if TYPE_CHECKING:
    from renderer.lightsamplers.base import LightSampler


class Prepared:
    """Belongs to a loaded scene and lives as long."""

    def __init__(self, scene: Any):
        self.scene = scene
        self.state: Hashable = None
        self.made: dict[str, LightSampler] = {}

    def get(self, name: str, state: Hashable) -> LightSampler:
        """
        The light sampler ``name`` of the scene, which is in ``state``: the estimand's sweep, as it was applied.

        Raises ``UnknownName``.
        """
        if state != self.state:
            self.made.clear()
            self.state = state
        if name not in self.made:
            self.made[name] = make(name, self.scene)
        return self.made[name]
