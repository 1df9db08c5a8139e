"""
Lamps that are not seen: rays of the camera go on through them.

Mitsuba has such a function of its own. The distance that it returns is that from the last lamp, not from the camera, so
that a ball behind a hidden lamp is met in the wrong place; ours hands back the rays that go with the distances.

This module names the variant's types: import it when a variant has been set.
"""

from __future__ import annotations

from typing import Any

import drjit as dr
import mitsuba as mi


@dr.syntax  # type: ignore[untyped-decorator]
def past_lamps(scene: Any, ray: Any, active: Any) -> tuple[Any, Any]:
    """The first thing on each ray that is no lamp → (rays, from behind the lamps; their preliminary intersections)."""
    ray = mi.Ray3f(ray)
    pi = scene.ray_intersect_preliminary(ray, coherent=True, active=active)
    through = active & pi.is_valid() & (pi.shape.emitter() != None)  # noqa: E711 - a comparison of lanes
    while dr.hint(through, label="hidden lamps"):
        lamp = pi.compute_surface_interaction(ray, mi.RayFlags.Minimal, through)
        ray.maxt = dr.select(through, ray.maxt - pi.t, ray.maxt)
        ray.o = dr.select(through, lamp.spawn_ray(ray.d).o, ray.o)
        pi = dr.select(through, scene.ray_intersect_preliminary(ray, active=through), pi)
        through &= pi.is_valid() & (pi.shape.emitter() != None)  # noqa: E711
    return ray, pi
