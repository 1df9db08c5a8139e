"""The camera model is the sensor's own rays, read backwards."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

pytestmark = pytest.mark.usefixtures("variant")

FILM = (40, 30)
WINDOWS = [(0, 0, *FILM), (3, 5, 20, 10)]
KINDS = ["perspective", "off-centre", "thinlens", "orthographic"]
COUNT = 1000


def sensor(kind: str, window: tuple[int, int, int, int]) -> Any:
    import mitsuba as mi

    t = mi.ScalarTransform4f().look_at([1, 2, 3], [0, 0.5, -0.2], [0, 1, 0.1])
    names = ("crop_offset_x", "crop_offset_y", "crop_width", "crop_height")
    film = {"type": "hdrfilm", "width": FILM[0], "height": FILM[1], **dict(zip(names, window, strict=True))}
    own: dict[str, Any] = {
        "perspective": {"type": "perspective", "fov": 50},
        "off-centre": {"type": "perspective", "fov": 50, "principal_point_offset_x": 0.1},
        "thinlens": {"type": "thinlens", "fov": 50, "aperture_radius": 0.2, "focus_distance": 2.0},
        "orthographic": {"type": "orthographic", "to_world": t @ mi.ScalarTransform4f().scale([2, 3, 1])},
    }
    return mi.load_dict({"to_world": t, "near_clip": 0.5, "film": film, **own[kind]})


def rays(made: Any) -> tuple[Any, Any, Any, Any]:
    """(rays, a point on each, window coordinates, lens samples)."""
    import mitsuba as mi

    rng = np.random.default_rng(1)
    uv, lens = (mi.Point2f(rng.random((2, COUNT)).astype(np.float32)) for _ in range(2))
    ray, _ = made.sample_ray(0.0, 0.5, uv, lens)
    return ray, ray(mi.Float(rng.uniform(1, 5, COUNT).astype(np.float32))), uv, lens


@pytest.mark.parametrize("window", WINDOWS)
@pytest.mark.parametrize("kind", KINDS)
def test_points_go_back_to_where_their_rays_came_from(kind: str, window: tuple[int, int, int, int]) -> None:
    """Position on the film, direction, near clipping plane and density of a connection are those of the ray."""
    import drjit as dr
    import mitsuba as mi

    from renderer.integrators.camera import Camera

    made = sensor(kind, window)
    camera = Camera(made, window[:2], window[2:])
    ray, p, uv, lens = rays(made)
    way = camera.connect(p, lens, mi.Bool(True))
    assert dr.all(way.active)
    assert dr.max(dr.norm(way.position - (uv * camera.size + camera.offset)))[0] < 1e-4
    assert dr.max(dr.norm(way.direction + ray.d))[0] < 1e-5
    assert dr.max(dr.norm(way.target - ray.o))[0] < 1e-5
    start, density = camera.start(ray)
    reach = 1 if camera.parallel else dr.squared_norm(p - start)
    assert dr.max(dr.abs(way.density * reach / density - 1))[0] < 1e-5


@pytest.mark.parametrize("window", WINDOWS)
@pytest.mark.parametrize("kind", ["perspective", "thinlens"])
def test_density_is_the_importance_that_mitsuba_gives(kind: str, window: tuple[int, int, int, int]) -> None:
    import drjit as dr
    import mitsuba as mi

    from renderer.integrators.camera import Camera

    made = sensor(kind, window)
    camera = Camera(made, window[:2], window[2:])
    _, p, _, lens = rays(made)
    it = dr.zeros(mi.Interaction3f, COUNT)
    it.p = p
    ds, importance = made.sample_direction(it, lens)
    way = camera.connect(p, lens, mi.Bool(True))
    assert dr.max(dr.abs(importance.x / way.density - 1))[0] < 1e-4
    assert dr.max(dr.norm(ds.uv + camera.offset - way.position))[0] < 1e-3


@pytest.mark.parametrize("kind", KINDS)
def test_density_of_a_plane_sums_to_one(kind: str) -> None:
    """∫ density · cos dA over a plane that the whole window sees is 1: one camera sample a lane."""
    import drjit as dr
    import mitsuba as mi

    from renderer.integrators.camera import Camera

    made = sensor(kind, WINDOWS[0])
    camera = Camera(made, (0, 0), FILM)
    side, cells = 24.0, 1500
    u, v = (mi.Float(axis.ravel().astype(np.float32)) for axis in np.mgrid[0:cells, 0:cells])
    across, along = ((axis + 0.5) / cells - 0.5 for axis in (u, v))
    p = camera.origin + side * (across * camera.right + along * camera.up) + 6 * camera.forward
    way = camera.connect(p, mi.Point2f(0.3, 0.6), mi.Bool(True))
    cos = dr.abs(dr.dot(way.direction, camera.forward))
    total = dr.sum(dr.select(way.active, way.density * cos, 0))[0] * (side / cells) ** 2
    assert total == pytest.approx(1, abs=5e-3)


def test_what_is_behind_or_clipped_is_not_seen() -> None:
    import mitsuba as mi

    from renderer.integrators.camera import Camera

    camera = Camera(sensor("perspective", WINDOWS[0]), (0, 0), FILM)
    for depth, seen in ((-1.0, False), (0.4, False), (0.6, True), (9999.0, True), (10001.0, False)):
        way = camera.connect(camera.origin + depth * camera.forward, mi.Point2f(0.5), mi.Bool(True))
        assert bool(way.active[0]) is seen, depth
        assert way.density[0] > 0 if seen else way.density[0] == 0


def test_other_sensors_are_refused_in_a_sentence() -> None:
    import mitsuba as mi

    from renderer.errors import SceneError
    from renderer.integrators.camera import Camera

    with pytest.raises(SceneError, match="perspective, thinlens and orthographic"):
        Camera(mi.load_dict({"type": "irradiancemeter"}), (0, 0), (1, 1))
