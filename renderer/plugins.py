"""
The list of our plugins. ``register_all`` after every ``set_variant``: Mitsuba forgets them with the variant.

Mitsuba ignores in silence a name that is taken already, so ours are names that it does not have, and a test asks each
of them for its class.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any


def samplers() -> Mapping[str, Any]:
    """Name → class of our samplers. Imported here, not before: they derive from the variant that is set."""
    from renderer.samplers.halton import Halton
    from renderer.samplers.pmj02bn import PMJ02BN
    from renderer.samplers.pointset import PointSet
    from renderer.samplers.poissondisk import Eliminated, PoissonDisk, RelaxedPoissonDisk
    from renderer.samplers.sobol import Sobol
    from renderer.samplers.zsobol import ZSobol

    return {
        "poissondisk": PoissonDisk,
        "relaxedpoissondisk": RelaxedPoissonDisk,
        "eliminated": Eliminated,
        "halton": Halton,
        "sobol": Sobol,
        "zsobol": ZSobol,
        "pmj02bn": PMJ02BN,
        "pointset": PointSet,
    }


def bsdfs() -> Mapping[str, Any]:
    """Name → class of our BSDFs. Imported here, not before: they derive from the variant that is set."""
    from renderer.bsdfs.anisophong import AnisoPhong

    return {"anisophong": AnisoPhong}


def integrators() -> Mapping[str, Any]:
    """Name → class of our integrators. Imported here, not before: they derive from the variant that is set."""
    from renderer.integrators.bdpt_integrator import BDPT
    from renderer.integrators.path_lights import PathLights

    return {"path_lights": PathLights, "bdpt": BDPT}


def register_all() -> None:
    """Make our plugins known to the variant that is set."""
    import mitsuba as mi

    for name, plugin in samplers().items():
        mi.register_sampler(name, plugin)
    for name, plugin in bsdfs().items():
        mi.register_bsdf(name, plugin)
    for name, plugin in integrators().items():
        mi.register_integrator(name, plugin)
