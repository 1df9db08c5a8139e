"""
``spatial``: lamps by what they bring to the voxel of the lit point (pbrt-v3's SpatialLightDistribution).

The scene's bounding box is cut into voxels, at most 64 along its longest side. In each, 32 fixed points ask every lamp
for its light, each at a fixed place of the lamp: no test of what stands between, no angle at the receiver. What comes
is the lamp's weight. A tenth of the probability goes by power (pbrt has a floor of 8e-6 of the mean weight
in its place): a lamp that the points underestimate is then a bit of noise, not a firefly.
"""

from __future__ import annotations

import math
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from renderer.lightsamplers.base import LightSampler, radical_inverses
from renderer.lightsamplers.power import lit_point, power_pmf
from renderer.lightsamplers.rows import Rows, running_sums
from renderer.samplers.bits import floats_on_device

RESOLUTION = 64  # voxels along the longest side
POINTS = 32  # in a voxel, for each lamp; pbrt has 128, but the same time is better spent on smaller voxels
TABLE_BYTES = 64 * 2**20  # of all voxels together
EVALUATIONS = 2**25  # of a lamp at a point, all together: a quarter of a second on two cores
CHUNK = 2**23  # evaluations at once: 32 MB
DEFENSIVE = 0.1  # of the probability goes by power


class Spatial(LightSampler):
    """p = 0.9 · (what the lamp brings to the voxel / what all bring) + 0.1 · p of ``power``."""

    __slots__ = ("_cells", "_low", "_per_length", "_power", "_rows")

    def __init__(self, scene: Any):
        super().__init__(scene)
        low, size = bounds(scene)
        shape = voxels(size, self.count)
        power = power_pmf(scene)
        self._power = Rows(running_sums(power[None]))
        self._rows = Rows(voxel_table(scene, low, size, shape, power))
        self._low = mi.Point3f(dr.opaque(mi.Float, x) for x in low)
        self._per_length = mi.Vector3f(dr.opaque(mi.Float, n / x) for n, x in zip(shape, size, strict=True))
        self._cells = mi.Vector3u(dr.opaque(mi.UInt32, n) for n in shape)

    def pick(self, p: Any, n: Any, u: Any, active: Any = True) -> tuple[Any, Any, Any]:
        return self._rows.pick(self._voxel(p), u, active)

    def pmf(self, p: Any, n: Any, index: Any, active: Any = True) -> Any:
        return self._rows.pmf(self._voxel(p), index, active)

    def pick_emission(self, u: Any, active: Any = True) -> tuple[Any, Any, Any]:
        return self._power.pick(mi.UInt32(0), u, active)

    def pmf_emission(self, index: Any, active: Any = True) -> Any:
        return self._power.pmf(mi.UInt32(0), index, active)

    def _voxel(self, p: Any) -> Any:
        """The row of the voxel that holds ``p``, or of the nearest one."""
        at = mi.Vector3u(dr.maximum((p - self._low) * self._per_length, 0))
        at = dr.minimum(at, self._cells - 1)
        return (at.x * self._cells.y + at.y) * self._cells.z + at.z


def bounds(scene: Any) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Lowest corner and size of the scene's bounding box, a unit cube where there is nothing; no side is 0."""
    box = scene.bbox()
    if not box.valid():
        return np.full(3, -0.5), np.ones(3)
    low, high = (np.array([corner.x, corner.y, corner.z], np.float64) for corner in (box.min, box.max))
    return low, np.maximum(high - low, 1e-4 * max((high - low).max(), 1e-4))


def voxels(size: NDArray[np.float64], lamps: int) -> tuple[int, int, int]:
    """How many voxels along x, y and z: cubes as nearly as may be, within the bounds on memory and time."""
    limit = min(TABLE_BYTES // (4 * (lamps + 1)), EVALUATIONS // (POINTS * lamps))
    for longest in range(RESOLUTION, 0, -1):
        x, y, z = (max(1, round(longest * side / size.max())) for side in size)
        if x * y * z <= limit:
            return x, y, z
    return 1, 1, 1


def voxel_table(
    scene: Any, low: NDArray[np.float64], size: NDArray[np.float64], shape: tuple[int, int, int],
    power: NDArray[np.float64],
) -> NDArray[np.float32]:  # fmt: skip
    """The running sums of all voxels, x slowest, one row each."""
    lamps, cells = len(power), math.prod(shape)
    light = arriving(scene, low, size, shape).reshape(cells, lamps)
    out = np.empty((cells, lamps + 1), np.float32)
    at_once = max(1, CHUNK // (8 * lamps))
    for first in range(0, cells, at_once):
        some = slice(first, first + at_once)
        total = light[some].sum(axis=1, keepdims=True, dtype=np.float64)
        share = np.divide(light[some], total, out=np.tile(power, (len(total), 1)), where=total > 0)
        out[some] = running_sums((1 - DEFENSIVE) * share + DEFENSIVE * power)
    return out


def arriving(
    scene: Any, low: NDArray[np.float64], size: NDArray[np.float64], shape: tuple[int, int, int]
) -> NDArray[np.float32]:
    """Luminance that arrives from each lamp in each voxel, lamps fastest; a sum over the points, finite and ≥ 0."""
    lamps = len(scene.emitters())
    points = [floats_on_device(column) for column in radical_inverses(POINTS, 6).T]
    corner = mi.Point3f(dr.opaque(mi.Float, x) for x in low)
    side = mi.Vector3f(dr.opaque(mi.Float, x / n) for x, n in zip(size, shape, strict=True))
    rows, columns, count = (dr.opaque(mi.UInt32, n) for n in (shape[1], shape[2], lamps))
    out = np.empty(math.prod(shape) * lamps, np.float32)
    at_once = CHUNK // POINTS
    for first in range(0, len(out), at_once):
        some = slice(first, min(first + at_once, len(out)))
        lane = dr.arange(mi.UInt32, (some.stop - first) * POINTS)
        pair, point = dr.opaque(mi.UInt32, first) + lane // POINTS, lane % POINTS
        voxel = pair // count
        emitter = dr.gather(mi.EmitterPtr, scene.emitters_dr(), pair - voxel * count)
        slab = voxel // columns
        place = mi.Vector3u(slab // rows, slab % rows, voxel % columns)
        x, y, z, u, v, wavelength = (dr.gather(mi.Float, column, point) for column in points)
        it, weight = lit_point(corner + (mi.Vector3f(place) + mi.Vector3f(x, y, z)) * side, wavelength)
        _, radiance = emitter.sample_direction(it, mi.Point2f(u, v))
        light = mi.luminance(radiance * weight, it.wavelengths)
        out[some] = dr.block_sum(dr.select(dr.isfinite(light), dr.maximum(light, 0), 0), POINTS).numpy()
    return out
