"""
``power``: lamps in proportion to the light that they send out, wherever the lit point is.

The power of a lamp is the mean weight of the rays that it samples itself: Mitsuba's ``sample_ray`` gives emitted light
divided by density. For plain lamps every ray has the same weight and the mean is exact: πAL of a lamp of area A, 4πI
of a point. Textures, spots and skies are integrated at fixed points. What is infinitely far lights the scene's
bounding sphere of radius R: πR² times its irradiance.
"""

from __future__ import annotations

from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from renderer.lightsamplers.base import LightSampler, radical_inverses
from renderer.lightsamplers.rows import Rows, running_sums
from renderer.samplers.bits import floats_on_device

POINTS = 1024  # rays a lamp; RGB lamps in a spectral variant scatter by 10 % about the mean, a spot's edge by 60 %
CHUNK = 2**22  # lanes at once
FLOOR = 0.01  # of the probability goes to all lamps alike: what the points missed in a texture is still found


class Power(LightSampler):
    """p = 0.99 · power / sum of powers + 0.01 / number of lamps. Luminance stands for a colour's power."""

    __slots__ = ("_rows",)

    def __init__(self, scene: Any):
        super().__init__(scene)
        self._rows = Rows(running_sums(power_pmf(scene)[None]))

    def pick(self, p: Any, n: Any, u: Any, active: Any = True) -> tuple[Any, Any, Any]:
        return self._rows.pick(mi.UInt32(0), u, active)

    def pmf(self, p: Any, n: Any, index: Any, active: Any = True) -> Any:
        return self._rows.pmf(mi.UInt32(0), index, active)

    def pick_emission(self, u: Any, active: Any = True) -> tuple[Any, Any, Any]:
        return self._rows.pick(mi.UInt32(0), u, active)

    def pmf_emission(self, index: Any, active: Any = True) -> Any:
        return self._rows.pmf(mi.UInt32(0), index, active)


def power_pmf(scene: Any) -> NDArray[np.float64]:
    """The distribution of ``power``, one probability a lamp of ``scene``; all > 0."""
    power = powers(scene)
    return FLOOR / len(power) + (1 - FLOOR) * shares(power)


def shares(weights: NDArray[np.float64]) -> NDArray[np.float64]:
    """Weights ≥ 0 as parts of their sum; equal ones where all are 0."""
    total = weights.sum()
    return weights / total if total > 0 else np.full(len(weights), 1 / len(weights))


def powers(scene: Any) -> NDArray[np.float64]:
    """Luminous power of each lamp of ``scene``, in one unit for all; 0 where it is not a finite number."""
    emitters = scene.emitters_dr()
    infinite = np.array([mi.has_flag(e.flags(), mi.EmitterFlags.Infinite) for e in scene.emitters()])
    points = [floats_on_device(column) for column in radical_inverses(POINTS, 5).T]
    box = scene.bbox()
    radius = float(box.bounding_sphere().radius) if box.valid() else 1.0
    section = np.pi * radius**2
    out = np.empty(len(emitters))
    at_once = CHUNK // POINTS
    for first in range(0, len(out), at_once):
        some = slice(first, min(first + at_once, len(out)))
        lane = dr.arange(mi.UInt32, (some.stop - first) * POINTS)
        emitter = dr.gather(mi.EmitterPtr, emitters, dr.opaque(mi.UInt32, first) + lane // POINTS)
        a, b, c, d, e = (dr.gather(mi.Float, column, lane % POINTS) for column in points)
        far = mi.has_flag(emitter.flags(), mi.EmitterFlags.Infinite)
        centre, weight = lit_point(mi.Point3f(box.center() if box.valid() else 0), a)
        _, arriving = emitter.sample_direction(centre, mi.Point2f(b, c), far)
        ray, sent = emitter.sample_ray(0, a, mi.Point2f(b, c), mi.Point2f(d, e), ~far)
        light = dr.select(far, mi.luminance(arriving * weight, centre.wavelengths), mi.luminance(sent, ray.wavelengths))
        out[some] = dr.block_sum(dr.select(dr.isfinite(light), light, 0), POINTS).numpy()
    out *= np.where(infinite, section, 1) / POINTS
    return np.maximum(np.nan_to_num(out, posinf=0, neginf=0), 0)


def lit_point(p: Any, wavelength: Any) -> tuple[Any, Any]:
    """
    The point ``p`` as an interaction without a normal → (interaction, weight of its wavelengths).

    In spectral variants the random number ``wavelength`` in [0, 1) says which; light that arrives there, times the
    weight, has the luminance of the whole spectrum on average.
    """
    it = dr.zeros(mi.Interaction3f, dr.width(wavelength))
    it.p = p
    weight = mi.Spectrum(1)
    if mi.is_spectral:
        it.wavelengths, weight = mi.sample_rgb_spectrum(mi.sample_shifted(wavelength))
    return it, weight
