"""
Light picking: which lamp of the scene a path asks for its light.

    uniform   every lamp alike                                        any scene; blind to power and distance
    power     in proportion to the light that a lamp sends out        a few strong lamps seen from everywhere
    spatial   by what each lamp brings to the voxel of the lit point  many lamps, of which a place sees few
    bvh       down a tree of lamps, by distance and direction         very many lamps, or one that faces away

The names live here, without Mitsuba; ``make`` imports the rest when a variant has been set. Formulas and figures:
docs/integrators/light-picking.md.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from renderer.errors import UnknownName

if TYPE_CHECKING:
    from renderer.lightsamplers.base import LightSampler

NAMES = ("uniform", "power", "spatial", "bvh")


def make(name: str, scene: Any) -> LightSampler:
    """
    The light sampler ``name`` for an ``mi.Scene`` as it is now: what is changed in the scene later, it does not see.

    A scene without lamps gets one that finds only darkness, whatever the name. Raises ``UnknownName``.
    """
    if name not in NAMES:
        raise UnknownName("light sampler", name, "", NAMES)
    from renderer.lightsamplers.base import Darkness
    from renderer.lightsamplers.bvh import LightTree
    from renderer.lightsamplers.power import Power
    from renderer.lightsamplers.spatial import Spatial
    from renderer.lightsamplers.uniform import Uniform

    if not scene.emitters():
        return Darkness(scene)
    kinds: dict[str, type[LightSampler]] = {"uniform": Uniform, "power": Power, "spatial": Spatial, "bvh": LightTree}
    return kinds[name](scene)
