"""
Where light paths start: a point and a direction on any emitter, and the density of having started there.

Mitsuba's ``sample_ray`` gives no density, and for a rotated environment map a wrong ray. Here every kind of emitter
goes through its ``sample_position`` or ``sample_direction``, and one formula says how densely light paths start:

    p_em = P(emitter) · p_place · p_direction

    area       1 / A                   cos θ / π
    textured   p_ω cos θ / d²          cos θ / π       its own density of positions, as seen from the lit point
    point      1                       1 / Ω           Ω the solid angle that it shines into
    far away   1 / (π R²)              p_ω             places on the disc of the scene's bounding sphere; p_ω is its
                                                       own density of directions, 1 where there is but one

Where the scene has glass or mirrors, p_direction, or far away p_place, is the mean of that and of the density of paths
that are aimed at them (``aim``).
Kinds that are none of these start no light paths; camera paths still find them.

Source: Georgiev, "Implementing Vertex Connection and Merging" (2012), for what enters the weights; Veach (1997), 10.3.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np

from renderer.integrators.aim import Targets
from renderer.samplers.bits import floats_on_device, on_device

AREA, POINT, DIRECTION, ENVIRONMENT, TEXTURED, OTHER = range(6)  # kinds of emitters
KINDS = {
    "AreaLight": AREA,
    "PointLight": POINT,
    "SpotLight": POINT,
    "DirectionalEmitter": DIRECTION,
    "ConstantBackgroundEmitter": ENVIRONMENT,
    "EnvironmentMapEmitter": ENVIRONMENT,
    "SunskyEmitter": ENVIRONMENT,
}
MARGIN = 1 + 1e-3  # of the bounding sphere: what lies on it is still hit
RIM = (1.0, 0.5)  # of the square that is mapped to a disc


@dataclass
class Start:
    """
    The first segment of a light path.

    active      the emitter starts light paths, and this one carries light
    ray         from the emitter, in world space
    beta        light per density: Le cos θ / p_em, or intensity / p_em
    index       of the emitter in the scene
    emission    p_em
    cos         cos θ of an area lamp, else 1
    delta       no ray can hit the emitter, or none along its direction
    infinite    the emitter is at no distance
    position    of the emitter, where it has one
    normal      there
    uv          there
    """

    active: Any
    ray: Any
    beta: Any
    index: Any
    emission: Any
    cos: Any
    delta: Any
    infinite: Any
    position: Any
    normal: Any
    uv: Any


class Emission:
    """
    The emitters of ``scene`` as starts of light paths; ``lights`` picks among them (``renderer.lightsamplers``).

    ``kinds`` are those that the scene has: code for others is not generated. ``aim`` sends half of the light paths to
    glass and mirrors.
    """

    __slots__ = ("center", "constant", "kind", "kinds", "lights", "radius", "targets")

    def __init__(self, scene: Any, lights: Any, aim: bool = True):
        self.lights = lights
        self.targets = Targets(scene.shapes() if aim else ())
        emitters = scene.emitters()
        box = scene.bbox()
        sphere = box.bounding_sphere() if box.valid() else mi.BoundingSphere3f(mi.ScalarPoint3f(0), 1)
        radius = float(sphere.radius) * MARGIN
        kinds = [_kind(emitter) for emitter in emitters]
        self.kinds = frozenset(kinds)
        self.center, self.radius = mi.Point3f(sphere.center), mi.Float(radius)
        dr.make_opaque(self.center, self.radius)
        constants = [_constant(kind, emitter, radius) for kind, emitter in zip(kinds, emitters, strict=True)]
        self.kind = on_device(np.array([*kinds, OTHER], np.uint32))
        self.constant = floats_on_device(np.array([*constants, 0], np.float32))

    def density(
        self, index: Any, place: Any, direction: Any, cos: Any, p_direct: Any, squared_distance: Any, active: Any
    ) -> Any:
        """
        p_em of the emitter ``index`` for light that leaves it along ``direction``, at an angle of cosine ``cos`` (1
        unless it has an area). ``place`` is where on it, or of emitters far away any point on the ray.

        ``p_direct`` is the density, of solid angle, of finding the point by the emitter's own ``sample_direction`` from
        the lit point at ``squared_distance``, without the probability of picking the emitter.
        """
        kind = dr.gather(mi.UInt32, self.kind, index, active)
        constant = dr.gather(mi.Float, self.constant, index, active)
        value = self.lights.pmf_emission(index, active) * self._spread(kind, constant, place, direction, cos)
        if AREA in self.kinds:
            value = dr.select(kind == AREA, value * constant, value)
        if ENVIRONMENT in self.kinds:
            value = dr.select(kind == ENVIRONMENT, value * p_direct, value)
        if TEXTURED in self.kinds:
            value = dr.select(kind == TEXTURED, value * p_direct * cos / squared_distance, value)
        return dr.select(active & (constant > 0), value, 0)

    def _spread(self, kind: Any, constant: Any, place: Any, direction: Any, cos: Any) -> Any:
        """How densely rays leave a place into ``direction``, or places of an emitter far away."""
        own = constant
        if self.kinds & {AREA, TEXTURED}:
            own = dr.select((kind == AREA) | (kind == TEXTURED), cos * dr.inv_pi, own)
        if not self.targets:
            return own
        near, far = self.kinds & {AREA, TEXTURED, POINT}, self.kinds & {DIRECTION, ENVIRONMENT}
        along = self.targets.of_direction(place, direction, own) if near else own
        across = self.targets.of_line(place, direction, own) if far else own
        return dr.select((kind == DIRECTION) | (kind == ENVIRONMENT), across, along)

    def sample(self, pick: Any, where: Any, direction: Any, time: Any, wavelengths: Any) -> Start:
        """
        Start a light path: ``pick`` (1D) chooses the emitter, ``where`` and ``direction`` (2D) the ray.

        Infinite emitters take their direction from ``direction`` and its place on the disc from ``where``.
        """
        index, pmf, rest = self.lights.pick_emission(pick, mi.Bool(True))
        aim = self.targets.aim(rest) if self.targets else None
        emitter = dr.gather(mi.EmitterPtr, self.lights.emitters, index)
        kind = dr.gather(mi.UInt32, self.kind, index)
        constant = dr.gather(mi.Float, self.constant, index)
        origin, toward, normal = mi.Point3f(0), mi.Vector3f(0, 0, 1), mi.Normal3f(0, 0, 1)
        uv = mi.Point2f(0)
        light, density, cos = mi.Spectrum(0), mi.Float(0), mi.Float(1)

        if self.kinds & {AREA, TEXTURED}:
            surface = (kind == AREA) | (kind == TEXTURED)
            ps, _ = emitter.sample_position(time, where, surface)
            at = mi.SurfaceInteraction3f(ps, wavelengths)
            away = at.to_world(mi.warp.square_to_cosine_hemisphere(direction))
            away = aim.direction(ps.p, direction, away) if aim else away
            at.wi = at.to_local(away)
            leaving = dr.maximum(mi.Frame3f.cos_theta(at.wi), 0)
            origin = dr.select(surface, at.spawn_ray(away).o, origin)
            toward = dr.select(surface, away, toward)
            normal = dr.select(surface, ps.n, normal)
            uv = dr.select(surface, ps.uv, uv)
            cos = dr.select(surface, leaving, cos)
            density = dr.select(surface, ps.pdf, density)
            light = dr.select(surface, emitter.eval(at, surface) * leaving, light)
        if POINT in self.kinds:
            point = kind == POINT
            # Which of the two samples picks the direction differs from plugin to plugin.
            ray, _ = emitter.sample_ray(time, mi.Float(0.5), direction, direction, point)
            away = aim.direction(ray.o, direction, ray.d) if aim else ray.d
            beyond = dr.zeros(mi.Interaction3f)  # at distance 1, where the weight is the intensity
            beyond.p, beyond.time, beyond.wavelengths = ray.o + away, time, wavelengths
            _, intensity = emitter.sample_direction(beyond, direction, point)
            origin = dr.select(point, ray.o, origin)
            toward = dr.select(point, away, toward)
            density = dr.select(point, 1, density)
            light = dr.select(point, intensity, light)
        if self.kinds & {DIRECTION, ENVIRONMENT}:
            far = (kind == DIRECTION) | (kind == ENVIRONMENT)
            inside = dr.zeros(mi.Interaction3f)
            inside.p, inside.time, inside.wavelengths = self.center, time, wavelengths
            ds, weight = emitter.sample_direction(inside, direction, far)
            p_direct = dr.select(kind == DIRECTION, 1, ds.pdf)
            disc = mi.warp.square_to_uniform_disk_concentric(where)
            frame = mi.Frame3f(-ds.d)
            offset = frame.to_world(mi.Vector3f(self.radius * disc.x, self.radius * disc.y, 0))
            offset = aim.offset(frame, self.center, disc, offset) if aim else offset
            origin = dr.select(far, self.center + offset + ds.d * self.radius, origin)
            toward = dr.select(far, -ds.d, toward)
            density = dr.select(far, p_direct, density)
            light = dr.select(far, weight * p_direct, light)

        p_em = pmf * density * self._spread(kind, constant, origin, toward, cos)
        active = (p_em > 0) & dr.any(light != 0)
        ray = mi.Ray3f(origin, toward, time, wavelengths)
        return Start(
            active=active,
            ray=ray,
            beta=dr.select(active, light / p_em, 0),
            index=index,
            emission=p_em,
            cos=cos,
            delta=(kind == POINT) | (kind == DIRECTION),
            infinite=(kind == DIRECTION) | (kind == ENVIRONMENT),
            position=origin,
            normal=normal,
            uv=uv,
        )


def _kind(emitter: Any) -> int:
    kind = KINDS.get(emitter.class_name(), OTHER)
    textured = bool(mi.has_flag(emitter.flags(), mi.EmitterFlags.SpatiallyVarying))
    return TEXTURED if kind == AREA and textured else kind


def _constant(kind: int, emitter: Any, radius: float) -> float:
    """Density of positions of an area lamp, of a point lamp's directions, of the disc of one that is far away."""
    if kind == AREA:
        return 1 / _number(emitter.get_shape().surface_area())
    if kind == TEXTURED:
        return 1.0
    if kind == POINT:
        return _density_of_directions(emitter)
    return 0.0 if kind == OTHER else 1 / (math.pi * radius**2)


def _density_of_directions(emitter: Any) -> float:
    """How densely a point or spot lamp's own ``sample_ray`` covers its directions, evenly: 1 / their solid angle."""
    if emitter.class_name() == "PointLight":
        return 1 / (4 * math.pi)
    # The angle of a spot lamp is no parameter that a scene shows; its outermost ray does.
    ray, _ = emitter.sample_ray(mi.Float(0), mi.Float(0.5), mi.Point2f(*RIM), mi.Point2f(*RIM))
    axis = emitter.world_transform() @ mi.Vector3f(0, 0, 1)
    cos, sin = dr.dot(axis, ray.d), dr.norm(dr.cross(axis, ray.d))
    return 1 / (2 * math.pi * _number(dr.square(sin) / (1 + cos) if _number(cos) > 0 else 1 - cos))


def _number(value: Any) -> float:
    return float(value if isinstance(value, float) else value[0])
