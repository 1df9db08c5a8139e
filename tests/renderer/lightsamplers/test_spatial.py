"""What the voxel grid of ``spatial`` promises beyond the laws of all light samplers."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from renderer.lightsamplers import make
from tests.renderer.scene_of import scene_of

LAMP = {"type": "rgb", "value": [1, 1, 1]}


def test_voxels_are_cubes_within_bounds(variant: str) -> None:
    """64 along the longest side, fewer where the table or the time to fill it would grow too large, at least one."""
    from renderer.lightsamplers.spatial import EVALUATIONS, POINTS, TABLE_BYTES, voxels

    assert voxels(np.array([3.2, 2.85, 49.2]), 64) == (4, 4, 64)
    assert voxels(np.array([1, 1, 1]), 1) == (64, 64, 64)
    assert voxels(np.array([5, 1e-3, 5]), 8) == (64, 1, 64)
    for lamps in (2, 10, 100, 1000, 10**5, 10**6):
        for size in ([1, 1, 1], [1, 10, 100]):
            shape = voxels(np.array(size), lamps)
            cells = math.prod(shape)
            assert min(shape) == 1 or max(shape) <= 64
            assert cells == 1 or (4 * cells * lamps <= TABLE_BYTES and cells * lamps * POINTS <= EVALUATIONS)


def test_equal_lamps_count_by_the_square_of_their_distance(variant: str) -> None:
    """Two points far from a small voxel: 0.9 of the probability goes by 1/d², 0.1 by their equal power."""
    import mitsuba as mi

    scene = scene_of({
        "box": {"type": "cube"},
        "a": {"type": "point", "position": [0, 0, 3], "intensity": LAMP},
        "b": {"type": "point", "position": [0, 0, -9], "intensity": LAMP},
    })  # fmt: skip
    sampler = make("spatial", scene)
    for z in (-0.98, 0.01, 0.7):
        z_voxel = (math.floor((z + 1) * 32) + 0.5) / 32 - 1
        for index, distance, other in ((0, 3 - z_voxel, 9 + z_voxel), (1, 9 + z_voxel, 3 - z_voxel)):
            pmf = sampler.pmf(mi.Point3f(0.01, 0.01, z), mi.Normal3f(0), mi.UInt32(index))[0]
            assert np.isclose(pmf, 0.9 * other**2 / (distance**2 + other**2) + 0.05, atol=1e-3)


def test_a_lamp_that_faces_away_keeps_the_share_of_its_power(variant: str) -> None:
    import mitsuba as mi

    place = mi.ScalarTransform4f
    area = {"type": "area", "radiance": LAMP}
    scene = scene_of({
        "box": {"type": "cube"},
        "to": {"type": "rectangle", "to_world": place().translate([0, 0, -2]), "emitter": area},
        "away": {"type": "rectangle", "to_world": place().translate([0, 0, 2]), "emitter": dict(area)},
    })  # fmt: skip
    sampler = make("spatial", scene)
    pmf = [sampler.pmf(mi.Point3f(0.1, 0.1, 0.1), mi.Normal3f(0), mi.UInt32(k))[0] for k in range(2)]
    assert np.allclose(sorted(pmf), [0.05, 0.95], atol=1e-5)


@pytest.mark.parametrize("place", [[0, 0, 0], [50, -50, 1e9], [-1e30, 0, 1e30]])
def test_points_outside_belong_to_the_nearest_voxel(place: list[float], mixed: Any) -> None:
    import drjit as dr
    import mitsuba as mi

    sampler = make("spatial", mixed)
    box = mixed.bbox()
    inside = mi.Point3f(np.clip(place, np.array(box.min) * 0.999, np.array(box.max) * 0.999))
    lamps = dr.arange(mi.UInt32, sampler.count)
    for far, near in zip(sampler.pmf(mi.Point3f(place), None, lamps), sampler.pmf(inside, None, lamps), strict=True):
        assert far == near


def test_a_scene_without_shapes_or_extent_has_a_voxel(variant: str) -> None:
    import mitsuba as mi

    lamps = {name: {"type": "point", "position": [0, 0, 0], "intensity": LAMP} for name in "ab"}
    for shapes in ({}, {"flat": {"type": "rectangle"}}):
        scene = scene_of({**lamps, **shapes})
        assert make("spatial", scene).pmf(mi.Point3f(0.2, 0.2, 0), None, mi.UInt32(0))[0] == 0.5


def test_the_same_table_every_time(mixed: Any) -> None:
    """No random seeds: a cell is the same picture everywhere."""
    import drjit as dr
    import mitsuba as mi

    p = mi.Point3f(0.3, 0.1, -0.4)
    tables = [make("spatial", mixed).pmf(p, None, dr.arange(mi.UInt32, 9)).numpy() for _ in range(2)]
    assert np.array_equal(*tables)
