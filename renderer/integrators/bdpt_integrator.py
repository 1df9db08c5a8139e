"""
``bdpt`` as a Mitsuba integrator, for scripts of one's own:

    mi.render(scene, integrator=mi.load_dict({"type": "bdpt"}))

It draws by the pass loop, as cells do, so any number of samples fits into memory. It is not differentiable.

This module derives from ``mi.CppADIntegrator``: import it when a variant has been set.
"""

from __future__ import annotations

from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np

from renderer.catalog_integrators import BDPT_DEPTH, pair_of
from renderer.integrators.adapter import TwoSided, two_sided
from renderer.integrators.bdpt import Options
from renderer.integrators.mis import HEURISTICS
from renderer.lightsamplers import NAMES
from renderer.scenes.load import LoadedScene


class BDPT(mi.CppADIntegrator):
    """
    max_depth       edges of the longest path, 1 … 66 (6)
    light_sampler   how a lamp is picked: uniform, power, spatial, bvh (uniform)
    heuristic       how ways to make the same path are weighed: power, balance (power)
    aim             half of the light paths go to glass and mirrors, where there are any (true)
    rr_depth        edges of a subpath before Russian roulette; 0 for none (0)
    hide_emitters   lamps and sky are not seen directly (false)
    debug_strategy  "s-t": only paths of s vertices from a lamp and t from the camera; empty for all ("")
    debug_weighted  these by their weight; false: in full (true)

    Raises ``RuntimeError`` with one sentence for a value that is not allowed.
    """

    def __init__(self, props: mi.Properties):
        super().__init__(props)
        self.light_sampler = _one_of(NAMES, props, "light_sampler", "uniform")
        pair = str(props.get("debug_strategy", ""))
        if pair and pair_of(pair) is None:
            raise RuntimeError(f"bdpt: debug_strategy = {pair!r} is no strategy; write s-t, as in 2-1")
        depth, roulette = int(props.get("max_depth", 6)), int(props.get("rr_depth", 0))
        if not 1 <= depth <= BDPT_DEPTH:
            raise RuntimeError(f"bdpt: max_depth = {depth} is not offered; give 1 to {BDPT_DEPTH} edges")
        s, t = map(int, pair.split("-")) if pair else (0, 0)
        self.options = Options(
            max_depth=depth,
            heuristic=_one_of(HEURISTICS, props, "heuristic", "power"),
            aim=bool(props.get("aim", True)),
            hide_emitters=bool(props.get("hide_emitters", False)),
            rr_depth=roulette or None,
            strategy=(s, t) if pair else None,
            weighted=bool(props.get("debug_weighted", True)),
        )

    def render(
        self, scene: Any, sensor: Any = 0, seed: Any = 0, spp: int = 0, develop: bool = True, evaluate: bool = True
    ) -> Any:
        """The picture of ``sensor`` (or its number) as a tensor (H, W, 3). ``evaluate`` is always on."""
        from renderer.frame import Frame
        from renderer.render import draw, samples_per_pass

        if isinstance(sensor, int):
            sensor = scene.sensors()[sensor]
        if not develop:
            raise RuntimeError("bdpt: develop = False is not offered; it gives the picture, not a film")
        film, spp = sensor.film(), spp or sensor.sampler().sample_count()
        size, window = film.size(), (*film.crop_offset(), *film.crop_size())
        loaded = LoadedScene(scene, sensor, int(size.x), int(size.y), window)
        samplers = []
        for _ in range(TwoSided.streams):
            sampler = sensor.sampler().fork()
            sampler.set_sample_count(spp)
            samplers.append(sampler)
        k = samples_per_pass(window[2] * window[3], spp)
        frame = Frame(loaded, k, spp)
        method = two_sided(frame, loaded.lights.get(self.light_sampler, None), self.options)
        picture = draw(frame, method, samplers, _number(seed), spp // k)
        return mi.TensorXf(np.ascontiguousarray(picture))

    def aov_names(self) -> list[str]:
        return []

    def to_string(self) -> str:
        return f"BDPT[\n  light_sampler = {self.light_sampler},\n  {self.options}\n]"


def _one_of(known: tuple[str, ...], props: mi.Properties, name: str, default: str) -> str:
    value = str(props.get(name, default))
    if value not in known:
        raise RuntimeError(f"bdpt: {name} = {value!r} is unknown; it is one of {', '.join(known)}")
    return value


def _number(seed: Any) -> int:
    return seed if isinstance(seed, int) else int(dr.detach(seed)[0])
