"""Light paths start as densely as they say, on every kind of lamp."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from tests.renderer.integrators.rooms import lamps, room

pytestmark = pytest.mark.usefixtures("variant")

KINDS = ["rectangle", "sphere", "mesh", "textured", "point", "spot", "directional", "constant", "envmap",
         "turned envmap", "several"]  # fmt: skip
COUNT = 2**18


AIMED = {"ball": {"type": "dielectric"}, "block": {"type": "conductor"}}  # light paths are aimed at both


def starts(kind: str, power: str = "uniform", made_of: dict[str, Any] | None = None) -> tuple[Any, Any]:
    """(the emission, ``COUNT`` starts of light paths)."""
    import mitsuba as mi

    from renderer.integrators.emission import Emission
    from renderer.lightsamplers import make

    loaded = room(lamps()[kind], made_of or {})
    emission = Emission(loaded.scene, make(power, loaded.scene))
    rng = np.random.default_rng(3)
    pick = mi.Float(rng.random(COUNT).astype(np.float32))
    where, direction = (mi.Point2f(rng.random((2, COUNT)).astype(np.float32)) for _ in range(2))
    start = emission.sample(pick, where, direction, mi.Float(0), mi.Color0f())
    start.scene = loaded.scene
    return emission, start


@pytest.mark.parametrize("made_of", [{}, AIMED], ids=["plain", "aimed"])
@pytest.mark.parametrize("kind", KINDS)
def test_the_density_of_a_start_is_the_one_found_from_its_first_vertex(kind: str, made_of: dict[str, Any]) -> None:
    """``density``, which hits and picks use, is what ``sample`` says of the same ray."""
    import drjit as dr
    import mitsuba as mi

    emission, start = starts(kind, made_of=made_of)
    si = start.scene.ray_intersect(start.ray, start.active)
    active = start.active & si.is_valid()
    emitter = dr.gather(mi.EmitterPtr, emission.lights.emitters, start.index)
    ds = dr.zeros(mi.DirectionSample3f)
    ds.p, ds.n, ds.uv, ds.d, ds.dist, ds.emitter = start.position, start.normal, start.uv, -start.ray.d, si.t, emitter
    direct = emitter.pdf_direction(si, ds, active & ~start.delta)
    place = dr.select(start.infinite, si.p, start.position)
    again = emission.density(start.index, place, start.ray.d, start.cos, direct, dr.square(si.t), active)
    error = np.abs(np.array(dr.select(active, again / start.emission, 1)) - 1)
    assert np.mean(np.array(active)) > 0.05
    assert np.quantile(error, 0.999) < 1e-4
    assert error.max() < 1e-2  # float32, at the pole of an environment map


@pytest.mark.parametrize(
    "power, made_of", [("uniform", {}), ("power", {}), ("uniform", AIMED)], ids=["uniform", "power", "aimed"]
)
@pytest.mark.parametrize("kind", KINDS)
def test_light_that_leaves_is_the_power_of_the_lamps(kind: str, power: str, made_of: dict[str, Any]) -> None:
    """The mean of beta is the power: in closed form, or for environments that of a sphere round the scene, π R² ∫ L."""
    emission, start = starts(kind, power, made_of)
    beta = np.array(start.beta).mean(0)
    mean, error = beta.mean(), beta.std() / np.sqrt(COUNT)
    assert abs(mean - total_power(start.scene, emission)) < 4 * error + 2e-3 * mean


def total_power(scene: Any, emission: Any) -> float:
    """Of all lamps, mean of the colour channels, by quadrature over directions or areas independent of the samplers."""
    import drjit as dr
    import mitsuba as mi

    total = 0.0
    n = 512
    u, v = np.mgrid[0:n, 0:n] / n + 0.5 / n
    grid = mi.Point2f(*(mi.Float(axis.ravel().astype(np.float32)) for axis in (u, v)))
    sphere = mi.warp.square_to_uniform_sphere(grid)
    for emitter in scene.emitters():
        name = emitter.class_name()
        si = dr.zeros(mi.SurfaceInteraction3f, n * n)
        if name == "AreaLight":
            si.uv, si.wi = grid, mi.Vector3f(0, 0, 1)
            area = float(np.array(emitter.get_shape().surface_area()).ravel()[0])
            total += np.pi * area * np.array(emitter.eval(si)).mean()
        elif name in ("PointLight", "SpotLight"):
            ray, _ = emitter.sample_ray(0.0, 0.5, mi.Point2f(0.5), mi.Point2f(0.5))
            beyond = dr.zeros(mi.Interaction3f, n * n)
            beyond.p = ray.o + sphere
            total += 4 * np.pi * np.array(emitter.sample_direction(beyond, grid)[1]).mean()
        else:
            disc = np.pi * float(np.array(emission.radius)[0]) ** 2
            if name == "DirectionalEmitter":
                inside = dr.zeros(mi.Interaction3f, 1)
                total += disc * np.array(emitter.sample_direction(inside, mi.Point2f(0.5))[1]).mean()
            else:
                si.wi = sphere
                total += 4 * np.pi * disc * np.array(emitter.eval(si)).mean()
    return total
