"""What is aimed at glass and mirrors meets them, as densely as it says."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from tests.renderer.scene_of import scene_of

pytestmark = pytest.mark.usefixtures("variant")

COUNT = 2**18
BALLS = [([0, 0, 0], 1.0), ([3, 0, 1], 0.5), ([0, 1.5, 0], 0.75)]  # the first and the last one overlap
PLACES = {"outside": [0, -4, 2], "near": [0, 0, 1.05], "within one": [0, 0.2, 0.3], "within two": [0, 0.9, 0]}


def targets(balls: Any = BALLS, material: str = "dielectric") -> Any:
    from renderer.integrators.aim import Targets

    shapes = {
        f"ball_{k}": {"type": "sphere", "center": list(center), "radius": radius, "bsdf": {"type": material}}
        for k, (center, radius) in enumerate(balls)
    }
    return Targets(scene_of(shapes).shapes())


def random(seed: int, *shape: int) -> Any:
    import mitsuba as mi

    numbers = np.random.default_rng(seed).random((*shape, COUNT), np.float32)
    return mi.Float(numbers) if numbers.ndim == 1 else mi.Point2f(numbers)


@pytest.mark.parametrize("place", PLACES)
def test_densities_of_directions_integrate_to_one(place: str) -> None:
    """Over all directions; from within a sphere, too, where there is no cone."""
    import drjit as dr
    import mitsuba as mi

    direction = mi.warp.square_to_uniform_sphere(random(1, 2))
    own = dr.inv_four_pi
    values = np.array(targets().of_direction(mi.Point3f(*PLACES[place]), direction, own)) / own
    assert abs(values.mean() - 1) < 4 * values.std() / np.sqrt(COUNT) + 1e-4


@pytest.mark.parametrize("place", PLACES)
def test_directions_are_as_dense_as_they_say(place: str) -> None:
    """What is sampled has the moments of the density: mean direction and its products, by weighting uniform ones."""
    import drjit as dr
    import mitsuba as mi

    aims, x, uniform = targets(), mi.Point3f(*PLACES[place]), mi.warp.square_to_uniform_sphere(random(2, 2))
    sampled = aims.aim(random(3)).direction(x, random(4, 2), uniform)
    weights = np.array(aims.of_direction(x, uniform, dr.inv_four_pi)) * 4 * np.pi

    def moments(directions: Any) -> Any:
        d = np.array(directions)
        return np.concatenate([d, d[[0, 0, 1]] * d[[1, 2, 2]], d**2])

    ours, expected = moments(sampled), moments(uniform) * weights
    error = np.sqrt((ours.var(1) + expected.var(1)) / COUNT)
    assert (np.abs(ours.mean(1) - expected.mean(1)) < 4.5 * error + 2e-4).all()


def test_rays_from_far_away_are_as_dense_as_they_say() -> None:
    """Half of them in the shadows of the spheres, evenly; densities over the plane integrate to one."""
    import drjit as dr
    import mitsuba as mi

    aims, radius = targets(), 6.0
    frame = mi.Frame3f(dr.normalize(mi.Vector3f(0.3, -1, 0.2)))
    disc = mi.warp.square_to_uniform_disk_concentric(random(5, 2))
    uniform = frame.to_world(mi.Vector3f(radius * disc.x, radius * disc.y, 0))
    origin = mi.Point3f(1, 0, 0)
    own = 1 / (np.pi * radius**2)
    weights = np.array(aims.of_line(origin + uniform, frame.n, own)) / own
    assert abs(weights.mean() - 1) < 4 * weights.std() / np.sqrt(COUNT) + 2e-3  # discs are wider by a rounding
    aim = aims.aim(random(6))
    sampled = aim.offset(frame, origin, mi.warp.square_to_uniform_disk_concentric(random(7, 2)), uniform)
    assert np.abs(np.array(dr.dot(sampled, frame.n))).max() < 1e-5
    ours, expected = np.array(sampled), np.array(uniform) * weights
    error = np.sqrt((ours.var(1) + expected.var(1)) / COUNT)
    assert (np.abs(ours.mean(1) - expected.mean(1)) < 4.5 * error + 2e-3).all()


@pytest.mark.parametrize("distance", [1.5, 30, 1e3, 1e5])
def test_what_is_aimed_is_never_thought_to_miss(distance: float) -> None:
    """However small the cone is: a ray at its rim that counted as missing would be worth a thousand others."""
    import drjit as dr
    import mitsuba as mi

    aims, x = targets([([0, 0, 0], 1.0)]), mi.Point3f(0.6 * distance, 0, 0.8 * distance)
    direction = aims.aim(mi.Float(0.2)).direction(x, random(8, 2), mi.Vector3f(0, 1, 0))
    assert not np.array(aims.all[0].misses(x, direction)).any()
    density = np.array(aims.of_direction(x, direction, 0.0))
    assert np.allclose(density * 2 * np.pi * np.array(aims.all[0].cone(x)), 0.5)
    angle = np.arcsin(1.01 / distance)
    assert np.allclose(np.array(aims.all[0].cone(x)), 1 - np.cos(angle) if distance < 100 else angle**2 / 2, rtol=1e-3)
    assert np.array(dr.dot(direction, -x) > 0).all()


@pytest.mark.parametrize("count", [0, 1, 8, 9, 100])
def test_many_objects_share_spheres_that_hold_them_all(count: int) -> None:
    from renderer.integrators.aim import MOST

    rng = np.random.default_rng(count)
    balls = [(rng.uniform(-5, 5, 3).tolist(), float(rng.uniform(0.1, 0.5))) for _ in range(count)]
    aims = targets(balls)
    found = [(np.array(one.center).ravel(), float(np.array(one.radius).ravel()[0])) for one in aims.all]
    assert len(found) == min(count, MOST) and bool(aims) == (count > 0)
    for center, radius in balls:
        assert any(np.linalg.norm(at - center) + radius <= around for at, around in found)


@pytest.mark.parametrize(
    "bsdf, aimed",
    [
        ({"type": "dielectric"}, True), ({"type": "thindielectric"}, True), ({"type": "conductor"}, True),
        ({"type": "twosided", "bsdf": {"type": "conductor"}}, True), ({"type": "null"}, False),
        ({"type": "plastic"}, False), ({"type": "roughdielectric"}, False), ({"type": "diffuse"}, False),
        ({"type": "mask", "opacity": 0.5, "bsdf": {"type": "diffuse"}}, False),
    ],
    ids=lambda value: value["type"] if isinstance(value, dict) else "",
)  # fmt: skip
def test_light_is_aimed_at_what_has_dirac_lobes_alone(bsdf: dict[str, Any], aimed: bool) -> None:
    from renderer.integrators.aim import Targets

    assert bool(Targets(scene_of({"ball": {"type": "sphere", "bsdf": bsdf}}).shapes())) == aimed


def test_nothing_is_aimed_at_what_has_no_size() -> None:
    import mitsuba as mi

    from renderer.integrators.aim import Targets

    point = {"type": "cube", "to_world": mi.ScalarTransform4f().scale(0), "bsdf": {"type": "conductor"}}
    assert not Targets([mi.load_dict(point)])


def test_a_sphere_round_a_mesh_holds_its_corners() -> None:
    from renderer.integrators.aim import ROOM, Targets

    (found,) = Targets(scene_of({"cube": {"type": "cube", "bsdf": {"type": "dielectric"}}}).shapes()).all
    assert np.allclose(np.array(found.center).ravel(), 0)
    assert np.allclose(np.array(found.radius), np.sqrt(3) * ROOM)
