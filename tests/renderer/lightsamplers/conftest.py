"""Scenes with every kind of lamp, and points in them."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from tests.renderer.scene_of import scene_of

RED, BLUE, WHITE = [3, 0.4, 0.1], [0.1, 0.5, 4], [1, 1, 1]


def mixed_scene(environment: str = "constant", **more: Any) -> dict[str, Any]:
    """A box without lid that is lit by a lamp of each kind, its pictures 16 × 16."""
    import mitsuba as mi

    place = mi.ScalarTransform4f
    rng = np.random.default_rng(1)
    light = lambda value: {"type": "rgb", "value": value}  # noqa: E731 - a name for a word of Mitsuba's
    area = lambda value: {"type": "area", "radiance": value}  # noqa: E731
    picture = mi.Bitmap(rng.random((4, 4, 3)).astype(np.float32) ** 4)
    sky = mi.Bitmap(0.2 * rng.random((4, 8, 3)).astype(np.float32))
    environments = {
        "constant": {"type": "constant", "radiance": light([0.05, 0.06, 0.1])},
        "envmap": {"type": "envmap", "bitmap": sky, "to_world": place().rotate([0.6, 0.8, 0], 40)},
    }
    return {
        "type": "scene",
        "sensor": {
            "type": "perspective", "fov": 60, "to_world": place().look_at([0, 0.5, 3.6], [0, 0, 0], [0, 1, 0]),
            "film": {"type": "hdrfilm", "width": 16, "height": 16, "rfilter": {"type": "box"}},
        },
        "floor": {"type": "rectangle", "to_world": place().translate([0, -1, 0]).rotate([1, 0, 0], -90).scale(3)},
        "wall": {"type": "rectangle", "to_world": place().translate([0, 0, -1.5]).scale(3),
                 "bsdf": {"type": "roughconductor", "alpha": 0.3}},
        "glass": {"type": "sphere", "center": [0.8, -0.6, 0.5], "radius": 0.4, "bsdf": {"type": "dielectric"}},
        "panel": {"type": "rectangle", "emitter": area(light(WHITE)),
                  "to_world": place().translate([0, 1.4, 0]).rotate([1, 0, 0], 90).scale(0.3)},
        "picture": {"type": "rectangle", "emitter": area({"type": "bitmap", "bitmap": picture, "raw": mi.is_rgb}),
                    "to_world": place().translate([-1.4, 0, 0]).rotate([0, 1, 0], 90).scale(0.3)},
        "ball": {"type": "sphere", "center": [1, 0.8, -0.6], "radius": 0.15, "emitter": area(light(RED))},
        "cube": {"type": "cube", "emitter": area(light(BLUE)),
                 "to_world": place().translate([-0.8, -0.7, 0.3]).rotate([0.6, 0.8, 0], 30).scale(0.12)},
        "disk": {"type": "disk", "emitter": area(light(WHITE)),
                 "to_world": place().translate([1.3, 0, 0.8]).rotate([0, 1, 0], -90).scale(0.2)},
        "point": {"type": "point", "position": [0.3, 0.3, 0.9], "intensity": light(WHITE)},
        "spot": {"type": "spot", "intensity": light(RED), "cutoff_angle": 35,
                 "to_world": place().look_at([-0.5, 1.2, 1], [0, -1, 0], [0, 1, 0.1])},
        "sun": {"type": "directional", "direction": [0.3, -1, -0.4], "irradiance": light([0.3, 0.3, 0.2])},
        "environment": environments[environment],
        **more,
    }  # fmt: skip


@pytest.fixture(params=["constant", "envmap"])
def mixed(request: pytest.FixtureRequest, variant: str) -> Any:
    """The scene with a lamp of each kind, and each kind of environment."""
    return scene_of(mixed_scene(request.param))


def points_in(scene: Any, count: int, seed: int) -> tuple[Any, Any]:
    """Random points of the scene's bounding box and its surroundings, with random normals."""
    import mitsuba as mi

    rng = np.random.default_rng(seed)
    box = scene.bbox()
    low, high = (np.array([corner.x, corner.y, corner.z]) for corner in (box.min, box.max))
    p = rng.uniform(low - 0.1, high + 0.1, (count, 3)).T
    n = rng.standard_normal((3, count))
    return mi.Point3f(p.astype(np.float32)), mi.Normal3f((n / np.linalg.norm(n, axis=0)).astype(np.float32))
