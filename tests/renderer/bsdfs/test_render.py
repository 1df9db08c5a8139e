"""The material in a render: one kernel for every value, back sides, and the same picture however it is sampled."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from scipy.stats import ttest_ind

pytestmark = pytest.mark.usefixtures("variant")

BALL = {"type": "anisophong", "rd": 0.4, "rs": 0.3, "nu": 100, "nv": 20}


def scene(material: dict[str, Any], size: int = 16) -> Any:
    """A ball over a plane under a wide lamp and a dim sky, seen without the lamp."""
    import mitsuba as mi

    transform = mi.ScalarTransform4f()
    return mi.load_dict({
        "type": "scene",
        "integrator": {"type": "path", "max_depth": 4},
        "ball": {"type": "sphere", "bsdf": material},
        "ground": {"type": "rectangle", "to_world": transform.translate([0, 0, -1]) @ transform.scale([9, 9, 1]),
                   "bsdf": {"type": "diffuse"}},
        "lamp": {"type": "sphere", "center": [2, -1, 4], "radius": 1.0,
                 "emitter": {"type": "area", "radiance": {"type": "rgb", "value": [8, 8, 8]}}},
        "sky": {"type": "constant", "radiance": {"type": "rgb", "value": [0.3, 0.3, 0.3]}},
        "sensor": {"type": "perspective", "fov": 35,
                   "to_world": transform.look_at([3, 3, 4.5], [0, 0, -0.3], [0, 0, 1]),
                   "film": {"type": "hdrfilm", "width": size, "height": size, "rfilter": {"type": "box"}}},
    })  # fmt: skip


def pictures(material: dict[str, Any], spp: int, count: int, seed: int, integrator: Any = None) -> Any:
    """(count, pixels) luminances of independent renders."""
    import mitsuba as mi

    loaded = scene(material)
    return np.array([
        np.array(mi.render(loaded, spp=spp, seed=seed + 7919 * k, integrator=integrator)).mean(-1).ravel()
        for k in range(count)
    ])  # fmt: skip


def test_pictures_are_the_same_with_and_without_importance_sampling() -> None:
    """Means of 4 × 4 blocks over 32 renders by Welch's test, at the level 0.01 by Šidák; and the variance falls."""
    with_it = pictures(BALL, 64, 32, seed=1)
    without = pictures({**BALL, "importance_sampling": False}, 64, 32, seed=500)
    blocks = [p.reshape(-1, 4, 4, 4, 4).mean((2, 4)).reshape(-1, 16) for p in (with_it, without)]
    p = ttest_ind(*blocks, equal_var=False).pvalue
    assert p.min() > 1 - (1 - 0.01) ** (1 / 16)
    assert with_it.var(0).mean() < without.var(0).mean()


def test_light_and_material_sampling_meet() -> None:
    """The picture of a path tracer, which weighs both, is that of material sampling alone: its density is true."""
    import mitsuba as mi

    blind: Any = mi.load_dict({"type": "direct", "emitter_samples": 0, "bsdf_samples": 1})
    both: Any = mi.load_dict({"type": "direct", "emitter_samples": 1, "bsdf_samples": 1})
    a, b = (pictures(BALL, 128, 24, seed, how).mean(1) for seed, how in ((1, blind), (900, both)))
    error = math.hypot(a.std(ddof=1), b.std(ddof=1)) / math.sqrt(24)
    assert abs(a.mean() - b.mean()) < 4 * error
    assert error < 0.01 * b.mean()


def test_two_sides() -> None:
    """Inside of the ball the front is away: black there, and as bright as the front by ``twosided``."""
    import drjit as dr
    import mitsuba as mi

    plain: Any = mi.load_dict(BALL)
    both: Any = mi.load_dict({"type": "twosided", "bsdf": BALL})
    si: Any = dr.zeros(mi.SurfaceInteraction3f)
    ctx = mi.BSDFContext()
    front = mi.Vector3f(0.6, 0, 0.8), mi.Vector3f(-0.48, 0.36, 0.8)
    back = mi.Vector3f(0.6, 0, -0.8), mi.Vector3f(-0.48, 0.36, -0.8)
    values = []
    for bsdf, (wi, wo) in ((plain, front), (both, front), (both, back), (plain, back)):
        si.wi = wi
        value, pdf = bsdf.eval_pdf(ctx, si, wo)
        values.append((float(value[0][0]), float(pdf[0])))
    assert values[0] == values[1] == values[2]
    assert values[3] == (0, 0)


@pytest.mark.parametrize("sides", [False, True])
def test_one_kernel_serves_every_value_of_a_sweep(sides: bool) -> None:
    """Exponents and reflectances are in memory, not in the code; two such materials in a scene share theirs too."""
    import drjit as dr
    import mitsuba as mi

    loaded = scene({"type": "twosided", "bsdf": BALL} if sides else BALL, size=4)
    parameters = mi.traverse(loaded)
    inner = "ball.bsdf.brdf_0." if sides else "ball.bsdf."

    def kernels(values: dict[str, float]) -> set[str]:
        for name, value in values.items():
            parameters[inner + name] = value
        parameters.update()
        with dr.scoped_set_flag(dr.JitFlag.KernelHistory, True):
            dr.kernel_history_clear()
            dr.eval(mi.render(loaded, spp=4, seed=1))
            return {str(kernel["hash"]) for kernel in dr.kernel_history([dr.KernelType.JIT])}

    first = kernels({})
    for nu, nv in ((100, 20), (0, 0), (10_000, 1), (3.5, 7)):
        assert kernels({"nu": float(nu), "nv": float(nv), "rd.value": 0.1 * (nu % 7), "rs.value": 0.3}) == first


def test_gradients_reach_the_parameters_through_a_render() -> None:
    """By ``prb`` as by central differences; directions that do not depend on the parameters make the noise common."""
    import drjit as dr
    import mitsuba as mi

    loaded = scene({**BALL, "nu": 20, "nv": 20, "importance_sampling": False}, size=8)
    parameters = mi.traverse(loaded)
    prb: Any = mi.load_dict({"type": "prb", "max_depth": 3})

    for name, centre, step in (("ball.bsdf.nu", 20.0, 2.0), ("ball.bsdf.rd.value", 0.4, 0.05)):
        around = []
        for value in (centre - step, centre + step, centre):
            parameters[name] = value
            parameters.update()
            around.append(float(np.array(dr.mean(mi.render(loaded, integrator=prb, spp=64, seed=3), axis=None))))
        dr.enable_grad(parameters[name])
        parameters.update()
        dr.backward(dr.mean(mi.render(loaded, parameters, integrator=prb, spp=64, seed=4, seed_grad=3), axis=None))
        gradient = float(np.array(dr.grad(parameters[name])).ravel()[0])
        dr.disable_grad(parameters[name])
        assert gradient == pytest.approx((around[1] - around[0]) / (2 * step), rel=0.02)
