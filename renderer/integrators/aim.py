"""
Where light paths are worth sending: at glass and mirrors.

Only light paths make caustics, and of those that leave a lamp evenly few meet the glass, the fewer the smaller or the
farther it is. So a share of them is aimed: at the bounding sphere of an object all of whose lobes are Dirac deltas,
evenly over the cone it fills as seen from the lamp, or of lamps far away over the disc of its shadow. The density of a
start is that of the whole mixture, so nothing else changes: what is aimed counts by as much less.

From inside a sphere there is no cone; what was to be aimed at it then goes where the lamp sends it. Above ``MOST``
objects spheres hold several.

Source: Jensen, "Realistic Image Synthesis Using Photon Mapping" (2001), 5.4, aims photons by a map of where specular
objects are; here it is one of two techniques of a one-sample mixture (Veach 1997, 9.2.4).
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

SHARE = 0.5  # of all light paths is aimed
MOST = 8  # spheres
ROOM = 1.01  # round an object: nothing is right at the rim of a cone
RIM, ROUNDING = 5e-4, 5e-7  # of the radius, of the distance: what was sampled at the rim is inside, however rounded


@dataclass
class Target:
    """A sphere, in world space."""

    center: Any
    radius: Any

    def cone(self, x: Any) -> Any:
        """1 − cos of half the angle it fills as seen from ``x``; negative from within."""
        sin2 = dr.square(self.radius) / dr.squared_norm(self.center - x)
        return dr.select(sin2 < 1, sin2 / (1 + dr.safe_sqrt(1 - sin2)), -1)

    def misses(self, x: Any, direction: Any) -> Any:
        """Whether the whole line through ``x`` does."""
        there = self.center - x
        return dr.norm(dr.cross(there, direction)) > self.radius * (1 + RIM) + dr.norm(there) * ROUNDING


@dataclass
class Aim:
    """At most one target a lane. ``active``: there is one."""

    active: Any
    target: Target

    def direction(self, x: Any, sample: Any, own: Any) -> Any:
        """From ``x`` to it, evenly over its cone; ``own`` where nothing is aimed at."""
        size = self.target.cone(x)
        down = sample.x * size  # 1 − cos of the angle to its axis, exact for small cones
        across = dr.safe_sqrt(down * (2 - down))
        sin, cos = dr.sincos(dr.two_pi * sample.y)
        frame = mi.Frame3f(dr.normalize(self.target.center - x))
        aimed = frame.to_world(mi.Vector3f(across * cos, across * sin, 1 - down))
        return dr.select(self.active & (size > 0), aimed, own)

    def offset(self, frame: Any, origin: Any, on_disc: Any, own: Any) -> Any:
        """A point of its shadow along ``frame.n``, in the plane through ``origin``; ``own`` where there is none."""
        x, y = self.target.radius * on_disc.x, self.target.radius * on_disc.y
        place = self.target.center - origin + frame.to_world(mi.Vector3f(x, y, 0))
        return dr.select(self.active, place - frame.n * dr.dot(place, frame.n), own)


class Targets:
    """Those among ``shapes``; false where there are none. No Dr.Jit structure: loops take its numbers as they are."""

    __slots__ = ("all",)

    def __init__(self, shapes: Iterable[Any]):
        spheres = [_sphere(shape) for shape in shapes if _is_mirror(shape.bsdf())]
        solid = [at for at in spheres if np.isfinite(at).all() and at[3] > 0]  # nothing can be aimed at a point
        self.all = [Target(mi.Point3f(*map(float, at[:3])), mi.Float(float(at[3]))) for at in _grouped(solid)]
        for target in self.all:
            dr.make_opaque(target.center, target.radius)

    def __bool__(self) -> bool:
        return bool(self.all)

    def aim(self, u: Any) -> Aim:
        """At one of them for ``u`` below ``SHARE``, each as often, else at nothing. There must be one."""
        number = mi.UInt32(u * (len(self.all) / SHARE))
        center, radius = self.all[0].center, self.all[0].radius
        for k, target in enumerate(self.all[1:], 1):
            center = dr.select(number == k, target.center, center)
            radius = dr.select(number == k, target.radius, radius)
        return Aim(u < SHARE, Target(center, radius))

    def of_direction(self, x: Any, direction: Any, own: Any) -> Any:
        """Density of solid angle of the mixture, for a lamp that has ``own`` by itself. There must be a target."""
        aimed = mi.Float(0)
        for target in self.all:
            size = target.cone(x)
            there = dr.dot(target.center - x, direction) > 0
            inside = dr.select(there & ~target.misses(x, direction), dr.rcp(dr.two_pi * size), 0)
            aimed += dr.select(size > 0, inside, own)
        return self._mixed(own, aimed)

    def of_line(self, p: Any, direction: Any, own: Any) -> Any:
        """The same for parallel rays: per area of a plane across ``direction``, of the ray through ``p``."""
        aimed = mi.Float(0)
        for target in self.all:
            aimed += dr.select(target.misses(p, direction), 0, dr.rcp(dr.pi * dr.square(target.radius)))
        return self._mixed(own, aimed)

    def _mixed(self, own: Any, aimed: Any) -> Any:
        return (1 - SHARE) * own + SHARE / len(self.all) * aimed


def _is_mirror(bsdf: Any) -> bool:
    """Whether all its lobes are Dirac deltas, and not all go straight on."""
    if bsdf is None or mi.has_flag(bsdf.flags(), mi.BSDFFlags.Smooth):
        return False
    return any(
        mi.has_flag(bsdf.flags(), flag) for flag in (mi.BSDFFlags.DeltaReflection, mi.BSDFFlags.DeltaTransmission)
    )


def _sphere(shape: Any) -> NDArray[np.float64]:
    """x, y, z and radius of a sphere round a shape."""
    box = shape.bbox()
    low, high = np.array(box.min, float).ravel(), np.array(box.max, float).ravel()
    half = (high - low) / 2
    radius = half.max() if shape.class_name() == "Sphere" else np.linalg.norm(half)
    return np.array([*(low + high) / 2, radius * ROOM])


def _grouped(spheres: list[NDArray[np.float64]]) -> list[NDArray[np.float64]]:
    """At most ``MOST`` spheres that hold them all: the largest group is halved where its centres lie farthest apart."""
    groups = [np.array(spheres)] if spheres else []
    while len(groups) < MOST and any(len(group) > 1 for group in groups):
        widest = max((group for group in groups if len(group) > 1), key=lambda group: _around(group)[3])
        axis = np.ptp(widest[:, :3], axis=0).argmax()
        order = widest[np.argsort(widest[:, axis], kind="stable")]
        groups = [group for group in groups if group is not widest]
        groups += [order[: len(order) // 2], order[len(order) // 2 :]]
    return [_around(group) for group in groups]


def _around(group: NDArray[np.float64]) -> NDArray[np.float64]:
    """A sphere round several."""
    if len(group) == 1:
        return group[0]
    low, high = (group[:, :3] - group[:, 3:]).min(0), (group[:, :3] + group[:, 3:]).max(0)
    center = (low + high) / 2
    return np.array([*center, (np.linalg.norm(group[:, :3] - center, axis=1) + group[:, 3]).max()])
