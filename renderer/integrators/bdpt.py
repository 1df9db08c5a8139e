"""
Bidirectional path tracing: every way to make a path from both of its ends, each counted for what it is worth.

A lane traces one subpath from a lamp and one from the camera. Paths come about in four ways, by s vertices from the
lamp and t from the camera:

    s = 0         the camera's subpath hits a lamp
    s = 1         a vertex of it is connected to a point of a lamp that is picked for it
    s > 1, t > 1  it is connected to a vertex of the lamp's subpath
    t = 1         a vertex of the lamp's subpath is connected to the camera, and lands somewhere else on the film

and are weighed by ``mis``. Paths of the same length that differ in s all estimate the same light, so that sums of them
with weights that add up to one do too (Veach and Guibas 1995; Lafortune and Willems 1993).

Depth, hidden lamps and shading normals mean what they mean to Mitsuba's ``path``: both have the same expected picture,
but for light of Dirac lamps by way of mirrors and glass, which no path tracer finds.

This module names the variant's types: import it when a variant has been set.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import drjit as dr
import mitsuba as mi

from renderer.integrators.camera import Camera
from renderer.integrators.emission import Emission
from renderer.integrators.hiding import past_lamps
from renderer.integrators.mis import Heuristic, weight
from renderer.integrators.subpath import LightVertex, capacity, store

Splat = Callable[[Any, Any, Any], None]  # (position on the film in pixels, spectrum, active)


@dataclass(frozen=True)
class Options:
    """
    max_depth      edges of the longest path, at least 1; the catalog says how many there is room for
    heuristic      "balance" or "power"
    aim            half of the light paths are sent to glass and mirrors
    hide_emitters  lamps with an area, and environments, are not seen directly
    rr_depth       edges of a subpath before Russian roulette; None for none
    strategy       (s, t): only paths that are made that way; None for all
    weighted       False: each path counts in full, whatever else could have made it
    """

    max_depth: int = 6
    heuristic: str = "power"
    aim: bool = True
    hide_emitters: bool = False
    rr_depth: int | None = None
    strategy: tuple[int, int] | None = None
    weighted: bool = True


class Bidirectional:
    """The estimator for one scene, camera and light sampler."""

    def __init__(self, scene: Any, camera: Camera, lights: Any, options: Options):
        self.scene, self.camera, self.lights, self.options = scene, camera, lights, options
        self.emission = Emission(scene, lights, options.aim)
        self.h = Heuristic(options.heuristic)
        self.capacity = capacity(options.max_depth)
        self.max_depth = dr.opaque(mi.UInt32, options.max_depth)
        self.rr_depth = dr.opaque(mi.UInt32, options.rr_depth or 0)
        self.strategy = [dr.opaque(mi.UInt32, number) for number in options.strategy or ()]

    def estimate(self, rays: Any, weights: Any, camera_sampler: Any, light_sampler: Any, splat: Splat) -> Any:
        """
        The light along ``rays`` of the camera, a spectrum a lane, but for what light subpaths bring to the camera:
        that goes to ``splat``, times the rays' ``weights``.

        Light subpaths have a sampler of their own, so that dimensions of both stay aligned from lane to lane.
        """
        vertices = store(self.capacity)
        count, vertices = self._light_subpath(rays, weights, light_sampler, vertices, splat)
        return self._camera_subpath(rays, camera_sampler, vertices, count)

    # -- from the lamp ---------------------------------------------------------------------------------------------

    @dr.syntax
    def _light_subpath(self, rays, weights, sampler, vertices, splat):  # type: ignore[no-untyped-def]
        """Traces it, stores its vertices, connects them to the camera → how many were stored, and the store."""
        scene, camera, h = self.scene, self.camera, self.h
        context = mi.BSDFContext(mi.TransportMode.Importance)
        start = self.emission.sample(
            sampler.next_1d(), sampler.next_2d(), sampler.next_2d(), rays.time, rays.wavelengths
        )
        ray, beta = start.ray, start.beta
        active = start.active & (self.max_depth > 1)
        pi = scene.ray_intersect_preliminary(ray, active=active)
        active &= pi.is_valid()
        first = pi.compute_surface_interaction(ray, mi.RayFlags.Minimal, active)
        direct = self._density_of_picking(first, start, ray, active)
        vcm, vc = h.leave_lamp(direct, start.cos, start.emission, dr.square(pi.t), start.delta)
        beta = mi.Spectrum(beta)
        lit = dr.max(beta)
        depth, count = mi.UInt32(1), mi.UInt32(0)

        while dr.hint(active, label="light subpath"):
            si = pi.compute_surface_interaction(ray, mi.RayFlags.All, active)
            vcm, vc = h.arrive(vcm, vc, dr.square(pi.t), dr.abs(dr.dot(si.n, ray.d)))
            bsdf = si.bsdf(ray)
            smooth = active & mi.has_flag(bsdf.flags(), mi.BSDFFlags.Smooth)

            keep = active & (depth + 1 < self.max_depth) & (depth <= self.capacity)  # at one place in all lanes
            vertices.write(LightVertex.of(si, bsdf, dr.select(smooth, beta, 0), vcm, vc), depth - 1, keep)
            count = dr.select(keep, depth, count)

            # t = 1
            lens = sampler.next_2d() if camera.has_lens else mi.Point2f(0.5)
            way = camera.connect(si.p, lens, smooth)
            seen = way.active & self._wanted(depth + 1, mi.UInt32(1))
            toward = si.to_local(way.direction)
            value, reverse = bsdf.eval_pdf(mi.BSDFContext(), _turned(si, toward), si.wi, seen)
            value = value * _adjoint(si, toward)
            seen &= dr.any(value != 0)
            others = h(way.density * dr.abs(dr.dot(si.n, way.direction))) * h.rest(vcm, vc, reverse)
            seen &= self._sees_camera(si, way, seen)
            splat(way.position, weights * beta * value * (way.density * self._weight(others)), seen)

            # on
            bs, value = bsdf.sample(context, si, sampler.next_1d(), sampler.next_2d(), active)
            delta = mi.has_flag(bs.sampled_type, mi.BSDFFlags.Delta)
            back, reverse = bsdf.eval_pdf(mi.BSDFContext(), _turned(si, bs.wo), si.wi, active & ~delta)
            back = dr.select(bs.pdf > 0, back * (_adjoint(si, bs.wo) / bs.pdf), 0)
            value = dr.select(delta, value, back)
            away = si.to_world(bs.wo)
            vcm, vc = h.scatter(vcm, vc, bs.pdf, reverse, dr.abs(dr.dot(si.n, away)), delta)
            beta *= value
            depth += 1
            active &= dr.any(beta != 0) & (depth < self.max_depth)
            if dr.hint(self.options.rr_depth is not None, mode="scalar"):
                survival = dr.minimum(dr.max(beta) / lit, 0.95)
                late = depth > self.rr_depth
                active &= ~late | (sampler.next_1d() < survival)
                beta = dr.select(late, beta / survival, beta)
            ray = si.spawn_ray(away)
            pi = scene.ray_intersect_preliminary(ray, active=active)
            active &= pi.is_valid()
        return count, vertices

    def _density_of_picking(self, si: Any, start: Any, ray: Any, active: Any) -> Any:
        """Of the start of a light path, by ``sample_direction`` from its first vertex; of directions, by convention."""
        emitter = dr.gather(mi.EmitterPtr, self.lights.emitters, start.index)
        ds = dr.zeros(mi.DirectionSample3f)
        ds.p, ds.n, ds.uv, ds.d, ds.dist, ds.emitter = start.position, start.normal, start.uv, -ray.d, si.t, emitter
        p_direct = emitter.pdf_direction(si, ds, active & ~start.delta)
        p_direct = dr.select(start.delta, dr.select(start.infinite, 1, dr.square(si.t)), p_direct)
        return p_direct * self.lights.pmf(si.p, si.n, start.index, active)

    def _sees_camera(self, si: Any, way: Any, active: Any) -> Any:
        """Whether nothing stands between a vertex and the camera; hidden lamps do not, nor are they seen."""
        ray = si.spawn_ray_to(way.target)
        if not self.options.hide_emitters:
            return ~self.scene.ray_test(ray, active)
        return self._clear_of_all_but_lamps(ray, way.target, active & (si.shape.emitter() == None))  # noqa: E711

    @dr.syntax
    def _clear_of_all_but_lamps(self, ray, target, active):  # type: ignore[no-untyped-def]
        clear, ray = mi.Bool(active), mi.Ray3f(ray)
        while dr.hint(active, label="past lamps"):
            pi = self.scene.ray_intersect_preliminary(ray, active=active)
            active &= pi.is_valid()
            lamp = pi.shape.emitter() != None  # noqa: E711 - lane by lane
            clear &= ~active | lamp
            active &= lamp
            ray = pi.compute_surface_interaction(ray, mi.RayFlags.Minimal, active).spawn_ray_to(target)
        return clear

    # -- from the camera -------------------------------------------------------------------------------------------

    @dr.syntax
    def _camera_subpath(self, rays, sampler, vertices, count):  # type: ignore[no-untyped-def]
        """Traces it and connects it to lamps and to the light subpath → the light that arrives, a spectrum a lane."""
        scene, lights, h = self.scene, self.lights, self.h
        context = mi.BSDFContext()
        ray = mi.Ray3f(rays)
        light, beta, eta = mi.Spectrum(0), mi.Spectrum(1), mi.Float(1)
        last = dr.zeros(mi.SurfaceInteraction3f)  # the vertex before; its point and normal are all that is used
        last.p, density = self.camera.start(ray)
        vcm, vc = h.leave_camera(density)
        depth, active = mi.UInt32(1), mi.Bool(True)
        if dr.hint(self.options.hide_emitters, mode="scalar"):
            ray, pi = past_lamps(scene, ray, active)
        else:
            pi = scene.ray_intersect_preliminary(ray, coherent=True)
        last_p, last_n = mi.Point3f(last.p), mi.Normal3f(0)

        while dr.hint(active, label="camera subpath"):
            si = pi.compute_surface_interaction(ray, mi.RayFlags.All, active)
            last = dr.zeros(mi.SurfaceInteraction3f)
            last.p, last.n, last.time, last.wavelengths = last_p, last_n, ray.time, ray.wavelengths

            # s = 0
            emitter = si.emitter(scene, active)
            hit = active & (emitter != None) & self._wanted(mi.UInt32(0), depth + 1)  # noqa: E711
            if dr.hint(self.options.hide_emitters, mode="scalar"):
                hit &= (depth > 1) | si.is_valid()
            ds = mi.DirectionSample3f(scene, si, last)
            radiance = emitter.eval(si, hit)
            hit &= dr.any(radiance != 0)
            index = lights.index(emitter)
            indirect = hit & (depth > 1)
            p_direct = emitter.pdf_direction(last, ds, indirect)
            p_lamp = lights.pmf(last_p, last_n, index, indirect)
            cos = dr.select(si.is_valid(), dr.abs(mi.Frame3f.cos_theta(si.wi)), 1)
            emission = self.emission.density(
                index, dr.select(si.is_valid(), si.p, last_p), -ray.d, cos, p_direct, dr.square(ds.dist), indirect
            )
            others = h(p_direct * p_lamp) * vcm + h(emission / cos) * vc
            light += dr.select(hit, beta * radiance * self._weight(dr.select(indirect, others, 0)), 0)

            active &= si.is_valid() & (depth < self.max_depth)
            away = dr.squared_norm(si.p - last_p)
            if dr.hint(self.camera.parallel, mode="scalar"):
                away = dr.select(depth == 1, 1, away)
            vcm, vc = h.arrive(vcm, vc, away, dr.abs(dr.dot(si.n, ray.d)))
            bsdf = si.bsdf(ray)
            smooth = active & mi.has_flag(bsdf.flags(), mi.BSDFFlags.Smooth)

            # s = 1
            ds, received, index, pmf = lights.sample_direction(si, sampler.next_2d(), smooth)
            lit = smooth & (ds.pdf > 0) & self._wanted(mi.UInt32(1), depth + 1)
            wo = si.to_local(ds.d)
            value, forward = bsdf.eval_pdf(context, si, wo, lit)
            value = value * received
            lit &= dr.any(value != 0)
            reverse = bsdf.pdf(context, _turned(si, wo), si.wi, lit)
            others = self._others_of_picking(
                si.p, ds, index, pmf, forward, dr.abs(dr.dot(si.n, ds.d)), h.rest(vcm, vc, reverse), lit
            )
            lit &= ~scene.ray_test(si.spawn_ray_to(ds.p), lit)
            light += dr.select(lit, beta * value * self._weight(others), 0)

            # s > 1
            number = mi.UInt32(0)
            connecting = smooth & (number < count) & (depth + 2 <= self.max_depth)
            while dr.hint(connecting, label="connections"):
                light += beta * self._connection(
                    si,
                    bsdf,
                    vertices.read(number, connecting),
                    vcm,
                    vc,
                    connecting,
                    self._wanted(number + 2, depth + 1),
                )
                number += 1
                connecting &= (number < count) & (depth + number + 2 <= self.max_depth)

            # on
            bs, value = bsdf.sample(context, si, sampler.next_1d(), sampler.next_2d(), active)
            delta = mi.has_flag(bs.sampled_type, mi.BSDFFlags.Delta)
            reverse = bsdf.pdf(context, _turned(si, bs.wo), si.wi, active & ~delta)
            onward = si.to_world(bs.wo)
            vcm, vc = h.scatter(vcm, vc, bs.pdf, reverse, dr.abs(dr.dot(si.n, onward)), delta)
            beta *= value
            eta *= bs.eta
            depth += 1
            active &= dr.any(beta != 0)
            if dr.hint(self.options.rr_depth is not None, mode="scalar"):
                survival = dr.minimum(dr.max(beta) * dr.square(eta), 0.95)
                late = depth > self.rr_depth
                active &= ~late | (sampler.next_1d() < survival)
                beta = dr.select(late, beta / survival, beta)
            last_p, last_n = si.p, si.n
            ray = si.spawn_ray(onward)
            pi = scene.ray_intersect_preliminary(ray, active=active)
        return light

    def _others_of_picking(self, at, ds, index, pmf, forward, cos, rest, active):  # type: ignore[no-untyped-def]
        """The other ways to make a path from the point ``at`` to a picked point of a lamp, relative to that one."""
        flags = ds.emitter.flags()
        infinite = mi.has_flag(flags, mi.EmitterFlags.Infinite)
        squared_distance = dr.square(ds.dist)
        cos_lamp = dr.select(ds.delta | infinite, 1, dr.abs(dr.dot(ds.n, ds.d)))
        p_direct = dr.select(ds.delta, dr.select(infinite, 1, squared_distance), ds.pdf / pmf)
        place = dr.select(infinite, at, ds.p)
        emission = self.emission.density(index, place, -ds.d, cos_lamp, p_direct, squared_distance, active)
        direct = p_direct * pmf
        hit = dr.select(ds.delta, 0, self.h(forward / direct))
        return hit + self.h(emission * cos / (direct * cos_lamp)) * rest

    def _connection(self, si, bsdf, vertex, vcm, vc, active, wanted):  # type: ignore[no-untyped-def]
        """What a connection of a camera vertex to a stored light vertex brings, but for the camera's ``beta``."""
        h, camera_side, light_side = self.h, mi.BSDFContext(), mi.BSDFContext(mi.TransportMode.Importance)
        other = vertex.interaction(si.time, si.wavelengths)
        between = vertex.p - si.p
        inverse = dr.rcp(dr.squared_norm(between))
        direction = between * dr.sqrt(inverse)
        wo, other_wo = si.to_local(direction), other.to_local(-direction)
        active = active & wanted & dr.any(vertex.beta != 0) & dr.isfinite(inverse)
        value, forward = bsdf.eval_pdf(camera_side, si, wo, active)
        active &= dr.any(value != 0)
        turned = _turned(other, other_wo)
        other_value, other_reverse = vertex.bsdf.eval_pdf(camera_side, turned, vertex.wi, active)
        value = value * other_value * vertex.beta * (inverse * _adjoint(other, other_wo))
        active &= dr.any(value != 0)
        active &= ~self.scene.ray_test(si.spawn_ray_to(vertex.p), active)
        reverse = bsdf.pdf(camera_side, _turned(si, wo), si.wi, active)
        other_forward = vertex.bsdf.pdf(light_side, other, other_wo, active)
        reach = forward * dr.abs(dr.dot(vertex.n, direction)) * inverse
        other_reach = other_forward * dr.abs(dr.dot(si.n, direction)) * inverse
        others = h(reach) * h.rest(vertex.vcm, vertex.vc, other_reverse) + h(other_reach) * h.rest(vcm, vc, reverse)
        return dr.select(active, value * self._weight(others), 0)

    # -- both --------------------------------------------------------------------------------------------------------

    def _wanted(self, s: Any, t: Any) -> Any:
        """Whether paths are made that way."""
        return (s == self.strategy[0]) & (t == self.strategy[1]) if self.strategy else mi.Bool(True)

    def _weight(self, others: Any) -> Any:
        return weight(others) if self.options.weighted else mi.Float(1)


def _turned(si: Any, wi: Any) -> Any:
    """An interaction with light, or importance, from ``wi``."""
    turned = mi.SurfaceInteraction3f(si)
    turned.wi = wi
    return turned


def _adjoint(si: Any, wo: Any) -> Any:
    """
    What a BSDF that is evaluated as the camera does it, with light from ``si.wi`` scattered to ``wo``, is to be
    multiplied with where light is followed: |wo · n| / |wi · n| of the geometric normal (Veach 1997, 5.3.2). So
    whatever a material does to its normal, and whether it is reciprocal, both ways to make a path bring the same.
    """
    to_light, to_camera = dr.dot(si.n, si.to_world(si.wi)), dr.dot(si.n, si.to_world(wo))
    return dr.select(to_light != 0, dr.abs(to_camera / to_light), 0)
