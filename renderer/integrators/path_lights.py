"""
``path_lights``: Mitsuba's path tracer, with the lamp of each vertex picked by a light sampler of ours.

The walk, its order of random numbers and its weights are those of Mitsuba's ``path`` (src/integrators/path.cpp of
3.9.1); only the lamp is picked otherwise, from where the vertex is. A lamp that a path hits by itself is weighed
against the pmf at the *previous* vertex, where it could have been picked.

What picks like Mitsuba need not be walked by us: ``plugin_for`` names Mitsuba's own ``path`` for ``uniform``, and for
any light sampler where there is one lamp or none. It is compiled code: less time to trace each pass. Two faults of it
are not copied (``plugin_for`` names them).

This module derives from ``mi.SamplingIntegrator``: import it when a variant has been set.
"""

from __future__ import annotations

from typing import Any

import drjit as dr
import mitsuba as mi

from renderer.integrators.hiding import past_lamps
from renderer.lightsamplers import make

MAX_SURVIVAL = 0.95  # of Russian roulette, as Mitsuba's


class PathLights(mi.SamplingIntegrator):
    """
    light_sampler  how a lamp is picked: uniform, power, spatial, bvh (uniform)
    max_depth      edges of the longest path, 1 shows lamps alone; −1 for no bound (−1)
    rr_depth       edges after which Russian roulette may end a path (5)
    hide_emitters  lamps and sky are not seen directly (false)

    The light sampler is made when a scene is first seen, and again for another scene. For a scene whose parameters
    were changed since, make a new integrator, or give it a light sampler by ``use``. Raises ``RuntimeError`` with one
    sentence for a value out of range, ``UnknownName`` for a light sampler that there is not.
    """

    def __init__(self, props: mi.Properties):
        super().__init__(props)
        self.light_sampler = str(props.get("light_sampler", "uniform"))
        self.max_depth, self.rr_depth = int(props.get("max_depth", -1)), int(props.get("rr_depth", 5))
        if self.max_depth < -1:
            raise RuntimeError(f"path_lights: max_depth = {self.max_depth} is no number of edges; give −1 or more")
        if self.rr_depth < 1:
            raise RuntimeError(f"path_lights: rr_depth = {self.rr_depth} is no number of edges; give 1 or more")
        self._lights = _Lights()

    def use(self, scene: Any, lights: Any) -> None:
        """Pick the lamps of ``scene`` with ``lights``, a light sampler that was made of it as it is now."""
        self._lights.scene, self._lights.sampler = scene, lights

    def sample(
        self, scene: Any, sampler: Any, ray: Any, medium: Any = None, active: Any = True
    ) -> tuple[Any, Any, list[Any]]:
        """Radiance along ``ray`` → (spectrum, whether anything was met, no further channels)."""
        if self.max_depth == 0:
            return mi.Spectrum(0), mi.Bool(False), []
        if self._lights.scene is not scene:
            self.use(scene, make(self.light_sampler, scene))
        ray, active = mi.Ray3f(ray), mi.Bool(active)
        if self.hide_emitters:
            ray, first = past_lamps(scene, ray, active)
        else:
            first = scene.ray_intersect_preliminary(ray, coherent=True, active=active)
        seen = mi.Bool(not self.hide_emitters and scene.environment() is not None)
        most = 2**32 - 1 if self.max_depth == -1 else self.max_depth
        light, seen = _walk(scene, sampler, self._lights.sampler, ray, first, seen, most, self.rr_depth, active)
        if self.hide_emitters:
            light = dr.select(first.is_valid(), light, 0)  # nor is the sky
        return light, seen, []

    def to_string(self) -> str:
        return (
            f"PathLights[\n  light_sampler = {self.light_sampler},\n  max_depth = {self.max_depth},\n"
            f"  rr_depth = {self.rr_depth}\n]"
        )


def plugin_for(light_sampler: str, scene: Any, hide_emitters: bool = False) -> str:
    """
    The plugin that traces paths through ``scene`` with this light sampler: ``path`` where Mitsuba's own draws the same
    picture to the last bit, ``path_lights`` elsewhere. Mitsuba must pick uniformly by then (``equal_weights``).

    Where Mitsuba 3.9.1 is wrong, ours is taken, too: behind hidden lamps (``hiding``), and where a camera ray has
    passed a semi-transparent mask and then leaves the scene, for which it drops what the mask itself reflected.

    ``power`` could be written into Mitsuba's weights. It is not: it would be no faster, and the scene stays as it is.
    """
    if hide_emitters or any(_is_mask(shape.bsdf()) for shape in scene.shapes()):
        return "path_lights"
    return "path" if light_sampler == "uniform" or len(scene.emitters()) < 2 else "path_lights"


def _is_mask(bsdf: Any) -> bool:
    """Whether a material lets light pass straight, and does something else with it as well."""
    flags = bsdf.flags() if bsdf is not None else mi.UInt32(0)
    return bool(mi.has_flag(flags, mi.BSDFFlags.Null)) and bool(mi.has_flag(flags, mi.BSDFFlags.Smooth))


def equal_weights(scene: Any) -> None:
    """
    Make Mitsuba's own integrators pick the lamps of ``scene`` uniformly, whatever ``sampling_weight`` its file has.

    To be called for every cell, after a sweep has set what it sets. Costs 2 ms where there is anything to do.
    """
    uneven = [emitter for emitter in scene.emitters() if emitter.sampling_weight() != 1]
    for emitter in uneven:
        parameters = mi.traverse(emitter)
        parameters["sampling_weight"] = 1.0
        parameters.update()
    if uneven:
        scene.parameters_changed([])


class _Lights:
    """The light sampler in use and its scene. No Dr.Jit structure, so that loops and Mitsuba's traversal pass it by."""

    __slots__ = ("sampler", "scene")

    def __init__(self) -> None:
        self.sampler: Any = None
        self.scene: Any = None


@dr.syntax  # type: ignore[untyped-decorator]
def _walk(
    scene: Any, sampler: Any, lights: Any, ray: Any, pi: Any, seen: Any, max_depth: int, rr_depth: int, active: Any
) -> tuple[Any, Any]:
    """
    Light along ``ray``, whose first intersection is ``pi`` → (radiance, whether a surface that is not null was met).

    One turn of the loop is a vertex: what it emits, what a picked lamp sends it, and where the path goes on.
    """
    throughput, light, eta = mi.Spectrum(1), mi.Spectrum(0), mi.Float(1)
    depth = mi.UInt32(0)
    previous = dr.zeros(mi.Interaction3f)  # the vertex before, and how its direction was sampled
    previous_pdf, previous_delta = mi.Float(1), mi.Bool(True)
    context = mi.BSDFContext()

    while active:
        si = pi.compute_surface_interaction(ray, mi.RayFlags.All)

        # -- what the vertex emits
        hit = mi.DirectionSample3f(scene, si, previous)
        pickable = ~previous_delta & (hit.emitter != None)  # noqa: E711 - a comparison of lanes
        weight = _power_heuristic(previous_pdf, lights.pdf_direction(previous, hit, pickable))
        light = dr.fma(throughput, hit.emitter.eval(si, previous_pdf > 0) * weight, light)

        # -- what a picked lamp sends
        active_next = (depth + 1 < max_depth) & si.is_valid()
        bsdf = si.bsdf(ray)
        lit = active_next & mi.has_flag(bsdf.flags(), mi.BSDFFlags.Smooth)
        ds, arriving, _, _ = lights.sample_direction(si, sampler.next_2d(), lit)
        lit &= ds.pdf != 0
        lit &= ~scene.ray_test(si.spawn_ray_to(ds.p), lit)
        wo = si.to_local(ds.d)
        value, pdf, bs, bsdf_weight = bsdf.eval_pdf_sample(context, si, wo, sampler.next_1d(), sampler.next_2d())
        weight = dr.select(ds.delta, 1, _power_heuristic(ds.pdf, pdf))
        light[lit] = dr.fma(throughput, value * arriving * weight, light)

        # -- where the path goes on
        ray = si.spawn_ray(si.to_world(bs.wo))
        throughput *= bsdf_weight
        eta *= bs.eta
        seen |= si.is_valid() & ~mi.has_flag(bs.sampled_type, mi.BSDFFlags.Null)
        previous = mi.Interaction3f(si)
        previous_pdf, previous_delta = bs.pdf, mi.has_flag(bs.sampled_type, mi.BSDFFlags.Delta)

        # -- Russian roulette; eta² cancels the compression of radiance in glass, which is no loss of light
        depth[si.is_valid()] += 1
        brightest = dr.max(throughput)
        survival = dr.minimum(brightest * dr.square(eta), MAX_SURVIVAL)
        roulette = depth >= rr_depth
        survives = sampler.next_1d() < survival
        throughput[roulette] *= dr.rcp(survival)
        active = active_next & (~roulette | survives) & (brightest != 0)
        pi = scene.ray_intersect_preliminary(ray, coherent=False, active=active)

    return light, seen


def _power_heuristic(pdf: Any, other: Any) -> Any:
    """The weight of a sample that had density ``pdf`` where another strategy has ``other`` (Veach 1997, β = 2)."""
    pdf, other = dr.square(pdf), dr.square(other)
    weight = pdf / (pdf + other)
    return dr.select(dr.isfinite(weight), weight, 0)
