"""
What the pass loop asks of an integrator: the (sum, weight) of one pass.

``CameraPaths`` adapts every integrator of Mitsuba that estimates light along one camera ray. An integrator
that also splats (light tracing, bidirectional) gets an adapter of its own with the same one method: its
splats, divided by the light paths per pixel, are added to the sum in proportion to the weight.
"""

from __future__ import annotations

from typing import Any, Protocol

import mitsuba as mi

from renderer.frame import Frame, PassSum
from renderer.spec import CellSpec


class IntegratorAdapter(Protocol):
    """Made once per cell; ``render_pass`` may start asynchronous work and must not wait for it."""

    def render_pass(self, frame: Frame, sampler: Any) -> PassSum:
        """Draw ``frame.samples`` samples per pixel from ``sampler``."""
        ...


class CameraPaths:
    """One camera ray a lane through ``integrator.sample`` (Mitsuba's ``SamplingIntegrator``)."""

    def __init__(self, integrator: Any):
        self.integrator = integrator

    def render_pass(self, frame: Frame, sampler: Any) -> PassSum:
        rays, weights, position = frame.camera_rays(sampler)
        light, _, _ = self.integrator.sample(frame.scene, sampler, rays)
        sampler.schedule_state()  # computed in the same kernel as the light, not traced again by the next pass
        return frame.gather(position, light * weights, rays.wavelengths)


def adapter(spec: CellSpec) -> IntegratorAdapter:
    """
    The adapter of a cell's integrator.

    ``max_depth`` and ``hide_emitters`` come from the estimand: what paths count is not the integrator's choice.
    """
    from renderer import catalog

    entry = catalog.find("integrator", spec.integrator.name)
    plugin: dict[str, Any] = {"type": entry.plugin, **dict(spec.integrator.parameters)}
    plugin["hide_emitters"] = spec.estimand.hide_emitters
    if entry.depth is None:
        plugin["max_depth"] = spec.estimand.max_depth
    return CameraPaths(mi.load_dict(plugin))
