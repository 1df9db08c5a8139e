"""
What the pass loop asks of an integrator: the (sum, weight) of one pass.

``CameraPaths`` adapts every integrator that estimates light along one camera ray. ``LightPaths`` is Mitsuba's particle
tracer, ``TwoSided`` our bidirectional one: both land their light anywhere on the film, as splats.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Protocol

import mitsuba as mi

from renderer import catalog
from renderer.errors import SceneError
from renderer.frame import Frame, PassSum, Splats
from renderer.integrators.bdpt import Bidirectional, Options
from renderer.integrators.camera import ORTHOGRAPHIC, Camera
from renderer.integrators.path_lights import PathLights, equal_weights, plugin_for
from renderer.spec import CellSpec

UNIFORM = "uniform"  # what a choice without a light sampler means


class IntegratorAdapter(Protocol):
    """
    Made once per cell; ``render_pass`` may start asynchronous work and must not wait for it.

    streams  how many samplers each lane draws from
    """

    streams: int

    def render_pass(self, frame: Frame, samplers: Sequence[Any]) -> PassSum:
        """Draw ``frame.samples`` samples per pixel from ``samplers``."""
        ...


class CameraPaths:
    """One camera ray a lane through ``integrator.sample`` (Mitsuba's ``SamplingIntegrator``)."""

    streams = 1

    def __init__(self, integrator: Any):
        self.integrator = integrator

    def render_pass(self, frame: Frame, samplers: Sequence[Any]) -> PassSum:
        (sampler,) = samplers
        rays, weights, position = frame.camera_rays(sampler)
        light, _, _ = self.integrator.sample(frame.scene, sampler, rays)
        sampler.schedule_state()  # computed in the same kernel as the light, not traced again by the next pass
        return frame.gather(position, light * weights, rays.wavelengths)


class TwoSided:
    """A subpath from the camera and one from a lamp in each lane, and all their connections (``bdpt``)."""

    streams = 2

    def __init__(self, estimator: Any):
        self.estimator = estimator

    def render_pass(self, frame: Frame, samplers: Sequence[Any]) -> PassSum:
        from_camera, from_lamp = samplers
        rays, weights, position = frame.camera_rays(from_camera)
        splats = Splats(frame)

        def splat(where: Any, light: Any, active: Any) -> None:
            splats.put(where, light, rays.wavelengths, active)

        light = self.estimator.estimate(rays, weights, from_camera, from_lamp, splat)
        for sampler in samplers:
            sampler.schedule_state()
        return frame.gather(position, light * weights, rays.wavelengths).with_splats(splats)


class LightPaths:
    """Paths from the lamps alone, each vertex joined to the camera (Mitsuba's ``AdjointIntegrator``: ``ptracer``)."""

    streams = 1

    def __init__(self, integrator: Any):
        self.integrator = integrator

    def render_pass(self, frame: Frame, samplers: Sequence[Any]) -> PassSum:
        (sampler,) = samplers
        splats = Splats(frame)
        self.integrator.sample(frame.scene, frame.sensor, sampler, splats.block, 1.0)
        sampler.schedule_state()
        return frame.from_splats(splats)


def adapter(spec: CellSpec, frame: Frame) -> IntegratorAdapter:
    """
    The adapter of a cell's integrator, for the scene of ``frame`` as it is set for the cell.

    ``max_depth`` and ``hide_emitters`` come from the estimand: what paths count is not the integrator's choice. Raises
    ``SceneError`` for a scene that the integrator cannot render.
    """
    entry = catalog.find("integrator", spec.integrator.name)
    parameters = dict(spec.integrator.parameters)
    if entry.name == "bdpt":
        return _bidirectional(spec, frame, parameters)
    plugin: dict[str, Any] = {"type": entry.plugin, **parameters, "hide_emitters": spec.estimand.hide_emitters}
    if entry.depth is None:
        plugin["max_depth"] = spec.estimand.max_depth
    equal_weights(frame.scene)  # of lamps, for Mitsuba's own integrators: a scene's file may say otherwise
    if entry.name == "path":
        return CameraPaths(_path(spec, frame, plugin))
    made = mi.load_dict(plugin)
    if entry.name != "ptracer":
        return CameraPaths(made)
    if frame.sensor.class_name() == ORTHOGRAPHIC:
        raise SceneError("Mitsuba's ptracer cannot join light paths to an orthographic sensor; bdpt can")
    return LightPaths(made)


def _path(spec: CellSpec, frame: Frame, plugin: dict[str, Any]) -> Any:
    """Mitsuba's own path tracer, or ours where lamps are not picked as by Mitsuba's."""
    light_sampler = plugin.pop("light_sampler", UNIFORM)
    plugin["type"] = plugin_for(light_sampler, frame.scene, spec.estimand.hide_emitters)
    made: Any = mi.load_dict(plugin)
    if isinstance(made, PathLights):
        made.use(frame.scene, frame.lights.get(light_sampler, spec.estimand.sweep))
    return made


def _bidirectional(spec: CellSpec, frame: Frame, parameters: dict[str, Any]) -> TwoSided:
    pair, _, alone = spec.estimand.strategy.partition(" ")
    options = Options(
        max_depth=spec.estimand.max_depth,
        heuristic=parameters["heuristic"],
        aim=parameters["aim"],
        hide_emitters=spec.estimand.hide_emitters,
        rr_depth=parameters.get("rr_depth"),
        strategy=tuple(map(int, pair.split("-"))) if pair else None,  # type: ignore[arg-type]  # two
        weighted=not alone,
    )
    lights = frame.lights.get(parameters.get("light_sampler", UNIFORM), spec.estimand.sweep)
    return two_sided(frame, lights, options)


def two_sided(frame: Frame, lights: Any, options: Options) -> TwoSided:
    """
    ``bdpt`` for the scene of ``frame``, whose lamps ``lights`` picks. Raises ``SceneError`` for a scene that it cannot
    render.
    """
    if any(shape.is_medium_transition() for shape in frame.scene.shapes()):
        raise SceneError("bdpt does not know smoke and fog, and this scene has some: take volpath")
    camera = Camera(frame.sensor, frame.offset, (frame.width, frame.height))
    return TwoSided(Bidirectional(frame.scene, camera, lights, options))
