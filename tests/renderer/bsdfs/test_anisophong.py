"""The plugin: float32 against the table and the float64 model, and the contract of a Mitsuba BSDF."""

from __future__ import annotations

import math
import os
import subprocess
import sys
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scipy.stats import chi2

from renderer import devices
from renderer.bsdfs.formula import AnisoPhong
from tests.renderer.bsdfs.cases import (
    LIT,
    REFERENCE,
    ROWS,
    context,
    direction,
    drawn,
    facing,
    model,
    plugin,
    random_settings,
    red,
    vectors,
)

pytestmark = pytest.mark.usefixtures("variant")

RELATIVE = 2e-5
NOTHING = 1e-20  # per steradian: below it float32 keeps fewer digits of an exponential, and nobody sees them
FRESNEL = 1e-12  # the same of (1 − k·h)^5 near normal incidence, where it is all that a lobe with Rs = 0 has


def close(value: Any, exact: Any, allowed: Any = NOTHING) -> bool:
    return bool(np.all(np.abs(red(value) - exact) <= RELATIVE * np.abs(exact) + allowed))


# -- values --------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("row", ROWS, ids=lambda row: row["name"])
def test_every_row_of_the_table(row: dict[str, Any]) -> None:
    """The plugin in float32: 2e-5 relative, of the whole and of each lobe alone."""
    bsdf, si, wo = plugin(model(row)), facing(row["wi"]), vectors(row["wo"])
    cosine = max(row["wo"][2], 0)
    for ctx, value in ((context(), row["f_cos"]), (context(0), row["fd"] * cosine), (context(1), row["fs"] * cosine)):
        assert red(bsdf.eval(ctx, si, wo)) == pytest.approx(value, rel=RELATIVE, abs=0)
    if row["f"]:
        assert red(bsdf.pdf(context(0), si, wo)) == pytest.approx(row["pdf_diff"], rel=RELATIVE)
        assert red(bsdf.pdf(context(1), si, wo)) == pytest.approx(row["pdf_spec"], rel=RELATIVE)
    else:
        assert red(bsdf.pdf(context(), si, wo)) == 0


@pytest.mark.parametrize("normalization", ["as2000", "pbrt"])
def test_it_is_the_float64_model_at_random_settings(normalization: str) -> None:
    """Value and density at 10 000 settings and directions, grazing ones and exponents from 0 to 10 000 among them."""
    material, wi, wo = random_settings(10_000, seed=1)
    material = replace(material, normalization=normalization)
    bsdf, si = plugin(material), facing(wi)
    value, pdf = bsdf.eval_pdf(context(), si, vectors(wo))
    assert close(value, material.f(wi, wo) * wo[:, 2])
    assert close(pdf, material.pdf(wi, wo))
    lobe = bsdf.eval(context(1), si, vectors(wo))
    assert close(lobe, material.specular(wi, wo) * wo[:, 2], NOTHING + FRESNEL * material.pdf_specular(wi, wo))
    assert close(bsdf.eval(context(0), si, vectors(wo)), material.diffuse(wi, wo) * wo[:, 2])


def test_light_may_go_either_way() -> None:
    """Reciprocity on 10 000 pairs: f(a, b) = f(b, a)."""
    material, wi, wo = random_settings(10_000, seed=2)
    bsdf = plugin(material)
    there = red(bsdf.eval(context(), facing(wi), vectors(wo))) / wo[:, 2]
    back = red(bsdf.eval(context(), facing(wo), vectors(wi))) / wi[:, 2]
    assert np.all(np.abs(there - back) <= RELATIVE * there + NOTHING)


def test_a_quarter_turn_swaps_the_exponents() -> None:
    material, wi, wo = random_settings(2000, seed=3)
    turned = AnisoPhong(material.rd, material.rs, material.nv, material.nu)
    quarter = np.array([[0, 1, 0], [-1, 0, 0], [0, 0, 1]])
    one = plugin(material).eval_pdf(context(), facing(wi), vectors(wo))
    other = plugin(turned).eval_pdf(context(), facing(wi @ quarter), vectors(wo @ quarter))
    assert all(close(a, red(b)) for a, b in zip(one, other, strict=True))


@pytest.mark.parametrize("height", [0.0, -0.0, -1e-6, 1e-6, 1e-12, 1e-25])
def test_the_horizon_is_finite(height: float) -> None:
    """At and just above the horizon nothing is infinite or not a number; below it is nothing."""
    flat = np.array([[1, 0, height], [0, 1, height], [-1, 0, height]])
    up = np.repeat([[0.0, 0.0, 1.0]], 3, axis=0)
    for material in (AnisoPhong(nu=0, nv=0), AnisoPhong(nu=10_000, nv=1), AnisoPhong(0, 0), AnisoPhong(1, 1, 3, 3)):
        bsdf = plugin(material)
        for wi, wo in ((flat, up), (up, flat), (flat, flat), (flat, flat[::-1])):
            value, pdf = (red(x) for x in bsdf.eval_pdf(context(), facing(wi), vectors(wo)))
            assert np.isfinite(value).all() and np.isfinite(pdf).all()
            assert (value >= 0).all() and (pdf >= 0).all()
            assert height > 0 or not (value.any() or pdf.any())
        _, bs, weight = drawn(bsdf, flat[0], 1000, seed=1)
        assert np.isfinite(red(weight)).all() and np.isfinite(np.array(bs.wo)).all()
        assert height > 0 or not red(weight).any()


# -- sampling ------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("component", [None, 0, 1])
@pytest.mark.parametrize("importance", [True, False])
def test_sample_pdf_and_eval_agree(component: int | None, importance: bool) -> None:
    """weight · pdf = eval at the sampled wo, eval_pdf = (eval, pdf), and no weight is above what its lobe allows."""
    for nu, nv in ((0, 0), (10, 1000), (10_000, 10_000)):
        bsdf = plugin(AnisoPhong(0.4, 0.3, nu, nv), importance_sampling=importance)
        for degrees in (0, 45, 85, 89.9):
            ctx = context(component)
            si, bs, weight = drawn(bsdf, direction(np.radians(degrees), 0.7), 2000, seed=nu + nv, ctx=ctx)
            value, pdf = bsdf.eval_pdf(ctx, si, bs.wo)
            assert np.array_equal(red(value), red(bsdf.eval(ctx, si, bs.wo)))
            assert np.array_equal(red(pdf), red(bsdf.pdf(ctx, si, bs.wo)))
            lit = red(weight) > 0
            assert lit.mean() > 0.2 or not importance  # a cosine misses a sharp lobe
            assert np.allclose(red(bs.pdf)[lit], red(pdf)[lit], rtol=1e-4)
            assert np.allclose((red(weight) * red(bs.pdf))[lit], red(value)[lit], rtol=1e-4)
            assert np.allclose(np.linalg.norm(np.array(bs.wo), axis=0), 1, atol=2e-6)
            if importance:
                assert red(weight).max() <= 10


@pytest.mark.parametrize("row", LIT, ids=lambda row: row["name"])
def test_mean_weights_are_the_albedos_of_the_table(row: dict[str, Any]) -> None:
    """Within 4 standard errors, of each lobe and of the mixture; none reflects more than it gets."""
    total = row["albedo_spec"] + row["albedo_diff"]
    for component, albedo in ((0, row["albedo_diff"]), (1, row["albedo_spec"]), (None, total)):
        _, _, weight = drawn(plugin(model(row)), row["wi"], 200_000, seed=4, ctx=context(component))
        weights = red(weight)
        assert abs(weights.mean() - albedo) < 4 * weights.std() / math.sqrt(len(weights)) + 1e-4 * albedo
        assert weights.mean() < 1


def test_the_brightest_surface_gives_no_more_than_it_gets() -> None:
    worst = REFERENCE["max_albedo"]
    for degrees in (0, 45, 85):
        bsdf = plugin(AnisoPhong(1, worst["Rs"], worst["nu"], worst["nv"]))
        _, _, weight = drawn(bsdf, direction(np.radians(degrees), 0.0), 100_000, seed=5)
        assert red(weight).mean() <= worst["value"] + 1e-3


@pytest.mark.parametrize("exponents", [(1000, 1000), (10_000, 10_000), (10_000, 1000)])
@pytest.mark.parametrize("degrees", [0, 60])
def test_sharp_lobes_have_the_half_vectors_of_their_density(exponents: tuple[int, int], degrees: float) -> None:
    """
    No grid resolves these lobes, but in terms of the two uniform numbers that the density integrates to they are flat:
    χ² over 16 × 16 equal parts, at the level 0.01 by Šidák. Reflections below the horizon are none here.
    """
    nu, nv = exponents
    wi = direction(np.radians(degrees), 0.4)
    _, bs, weight = drawn(plugin(AnisoPhong(0.5, 0.5, nu, nv)), wi, 100_000, seed=6, ctx=context(1))
    assert (red(weight) > 0).all()
    h = np.array(bs.wo, np.float64).T + wi
    h /= np.linalg.norm(h, axis=1, keepdims=True)
    u1 = np.arctan2(h[:, 1] * math.sqrt(nv + 1), h[:, 0] * math.sqrt(nu + 1)) / (2 * np.pi) % 1
    tangential = h[:, 0] ** 2 + h[:, 1] ** 2
    exponent = (nu * h[:, 0] ** 2 + nv * h[:, 1] ** 2) / tangential
    u2 = -np.expm1((exponent + 1) * 0.5 * np.log1p(-tangential))
    counts = np.histogram2d(u1, u2, bins=16, range=((0, 1), (0, 1)))[0]
    assert counts.sum() == len(h)
    expected = len(h) / counts.size
    statistic = ((counts - expected) ** 2 / expected).sum()
    assert chi2.sf(statistic, counts.size - 1) > 1 - (1 - 0.01) ** (1 / 6)


# -- the contract --------------------------------------------------------------------------------------------------


def test_components_are_two_lobes_of_the_front_side() -> None:
    import mitsuba as mi

    bsdf, flags = plugin(), mi.BSDFFlags
    assert bsdf.component_count() == 2
    assert bsdf.flags(0) == flags.DiffuseReflection | flags.FrontSide
    assert bsdf.flags(1) == flags.GlossyReflection | flags.FrontSide | flags.Anisotropic
    assert bsdf.flags() == bsdf.flags(0) | bsdf.flags(1)
    mapped = plugin(nu={"type": "checkerboard"})
    assert mapped.flags() & flags.SpatiallyVarying


def test_a_context_chooses_lobes_by_number_or_by_type() -> None:
    import mitsuba as mi

    bsdf, si, wo = plugin(), facing(direction(0.5, 0.0)), vectors(direction(0.6, 3.0))
    for component, kind in ((0, mi.BSDFFlags.DiffuseReflection), (1, mi.BSDFFlags.GlossyReflection)):
        by_number = bsdf.eval_pdf(context(component), si, wo)
        by_type = bsdf.eval_pdf(context(mask=int(kind)), si, wo)
        assert [red(x) for x in by_number] == [red(x) for x in by_type]
        _, bs, _ = drawn(bsdf, direction(0.5, 0.0), 100, seed=7, ctx=context(component))
        assert (np.array(bs.sampled_component) == component).all()
        assert (np.array(bs.sampled_type) == int(kind)).all()
    whole = red(bsdf.eval(context(), si, wo))
    assert whole == pytest.approx(sum(red(bsdf.eval(context(i), si, wo)) for i in (0, 1)), rel=1e-6)
    nothing = bsdf.eval_pdf(context(mask=int(mi.BSDFFlags.DeltaReflection)), si, wo)
    assert not red(nothing[0]).any() and not red(nothing[1]).any()
    _, _, weight = drawn(bsdf, direction(0.5, 0.0), 100, seed=7, ctx=context(mask=int(mi.BSDFFlags.DeltaReflection)))
    assert not red(weight).any()


def test_colours_are_their_channels() -> None:
    """Value and weight per channel are those of three grey materials, whatever lobe was drawn."""
    import mitsuba as mi

    rd, rs = (0.1, 0.5, 0.9), (0.7, 0.2, 0.4)
    coloured: Any = mi.load_dict({
        "type": "anisophong", "rd": {"type": "rgb", "value": rd}, "rs": {"type": "rgb", "value": rs}, "nu": 30,
    })  # fmt: skip
    _, wi, wo = random_settings(500, seed=8)
    value = coloured.eval(context(), facing(wi), vectors(wo))
    for channel in range(3):
        grey = plugin(AnisoPhong(rd[channel], rs[channel], 30, 100))
        assert np.allclose(np.array(value[channel]), red(grey.eval(context(), facing(wi), vectors(wo))), rtol=1e-6)


def test_the_base_s_albedo_is_exact() -> None:
    k1 = direction(np.linspace(0, 1.5, 20), 0.0)
    assert close(plugin().eval_diffuse_reflectance(facing(k1)), AnisoPhong().albedo_diffuse(k1))


def test_inactive_lanes_are_black() -> None:
    import mitsuba as mi

    si, wo = facing([0, 0, 1]), vectors([0, 0, 1])
    value, pdf = plugin().eval_pdf(context(), si, wo, mi.Bool(False))
    assert red(value) == 0 and red(pdf) == 0
    assert red(plugin().sample(context(), si, mi.Float(0.5), mi.Point2f(0.5), mi.Bool(False))[1]) == 0


# -- parameters ----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("parameters", "said"),
    [
        ({"nu": -1}, "nu = -1 is no exponent; give a finite number of at least 0"),
        ({"nv": math.nan}, "nv = nan is no exponent"),
        ({"nu": math.inf}, "nu = inf is no exponent"),
        ({"nu": "10"}, "nu = '10' is no exponent; give a number of at least 0, or a texture"),
        ({"rs": 1.5}, "rs = 1.5 is no reflectance; give a number from 0 to 1"),
        ({"rd": -0.1}, "rd = -0.1 is no reflectance"),
        ({"rd": math.nan}, "rd = nan is no reflectance"),
        ({"normalization": "as"}, "normalization = 'as' is unknown; it is one of as2000, pbrt"),
    ],
)
def test_bad_parameters_are_one_sentence(parameters: dict[str, Any], said: str) -> None:
    with pytest.raises(RuntimeError, match=said):
        plugin(**parameters)


def test_more_diffuse_than_light_is_warned_of() -> None:
    with pytest.warns(UserWarning, match="rd = 1.5 is above 1: more energy may leave than arrives"):
        plugin(rd=1.5)


def test_traverse_names_the_parameters_and_checks_what_they_become() -> None:
    import mitsuba as mi

    bsdf = plugin()
    parameters = mi.traverse(bsdf)
    assert {"rd.value", "rs.value", "nu", "nv"} == set(parameters.keys())
    si, wi, wo = facing([0, 0, 1]), np.array([0, 0, 1.0]), direction(0.1, 0.2)
    parameters["nu"], parameters["nv"], parameters["rd.value"] = 7.0, 3000.0, 0.2
    parameters.update()
    assert close(bsdf.eval(context(), si, vectors(wo)), AnisoPhong(0.2, 0.5, 7, 3000).f(wi, wo) * wo[2])
    parameters["nv"] = -2.0
    with pytest.raises(RuntimeError, match="nv = -2.0 is no exponent"):
        parameters.update()


def test_exponents_may_be_textures() -> None:
    """A checkerboard of exponents; negative ones count as 0."""
    import drjit as dr
    import mitsuba as mi

    def board(dark: float, light: float) -> dict[str, Any]:
        return {"type": "checkerboard", "color0": {"type": "uniform", "value": dark},
                "color1": {"type": "uniform", "value": light}}  # fmt: skip

    bsdf = plugin(nu=board(10, 500), nv=board(-4, -4))
    si: Any = dr.zeros(mi.SurfaceInteraction3f, 2)
    si.wi, si.uv = mi.Vector3f(0, 0, 1), mi.Point2f([0.25, 0.75], [0.25, 0.25])
    wo = direction(0.4, 0.2)
    exact = [AnisoPhong(0.5, 0.5, nu, 0).f(np.array([0, 0, 1.0]), wo) * wo[2] for nu in (500, 10)]
    assert close(bsdf.eval(context(), si, vectors(wo)), exact)


@pytest.mark.parametrize(("name", "step"), [("nu", 0.5), ("nv", 0.5), ("rd.value", 0.02), ("rs.value", 0.02)])
def test_values_can_be_differentiated(name: str, step: float) -> None:
    """By automatic differentiation as by central differences, and finite at h = n."""
    import drjit as dr
    import mitsuba as mi

    bsdf = plugin(AnisoPhong(0.5, 0.4, 50, 80))
    parameters = mi.traverse(bsdf)
    wi = np.array([direction(0.5, 0.3)] * 3)
    wo = np.array([direction(0.45, 3.3), direction(0.5, 0.3 + np.pi), direction(0.2, 1.0)])

    def value() -> Any:
        return dr.sum(bsdf.eval(context(), facing(wi), vectors(wo))[0])

    centre = float(np.array(parameters[name]).ravel()[0])
    around = []
    for at in (centre - step, centre + step):
        parameters[name] = at
        parameters.update()
        around.append(float(value()[0]))
    parameters[name] = centre
    parameters.update()
    dr.enable_grad(parameters[name])
    parameters.update()
    dr.backward(value())
    gradient = float(np.array(dr.grad(parameters[name])).ravel()[0])
    assert gradient == pytest.approx((around[1] - around[0]) / (2 * step), rel=2e-3)


# -- spectral mode -------------------------------------------------------------------------------------------------

SPECTRAL = """
import sys
import numpy as np
from renderer.variant import use

use(sys.argv[1])
import drjit as dr
import mitsuba as mi

bsdf = mi.load_dict({"type": "anisophong", "rd": {"type": "rgb", "value": [0.1, 0.5, 0.9]}, "rs": 0.25, "nu": 20})
grey = mi.load_dict({"type": "anisophong", "rd": 0.4, "rs": 0.25, "nu": 20})
si = dr.zeros(mi.SurfaceInteraction3f, 20000)
si.wi = mi.Vector3f(0.6, 0, 0.8)
si.wavelengths = mi.UnpolarizedSpectrum(450, 520, 580, 650)
random = np.random.default_rng(1).random((3, 20000)).astype(np.float32)
ctx = mi.BSDFContext()
for one in (bsdf, grey):
    bs, weight = one.sample(ctx, si, mi.Float(random[0]), mi.Point2f(random[1], random[2]))
    value, pdf = one.eval_pdf(ctx, si, bs.wo)
    error = dr.max(dr.abs(weight * bs.pdf - value), axis=None)
    print(*[float(dr.mean(channel)[0]) for channel in weight], float(error[0]))
"""


def test_it_reflects_in_spectral_mode() -> None:
    """Four wavelengths at once: grey is grey with the model's albedo, and red is darker than blue."""
    device = devices.pick("llvm")
    said = subprocess.run(
        [sys.executable, "-c", SPECTRAL, "llvm_ad_spectral"], capture_output=True, text=True, check=False,
        env={**os.environ, **device.environment},
    )  # fmt: skip
    assert said.returncode == 0, said.stderr
    coloured, grey = (np.array(line.split(), float) for line in said.stdout.splitlines())
    material, k1 = AnisoPhong(0.4, 0.25, 20, 100), np.array([0.6, 0, 0.8])
    albedo = material.albedo_diffuse(k1) + material.albedo_specular(k1)
    assert np.allclose(grey[:4], albedo, rtol=0.02) and np.ptp(grey[:4]) == 0
    assert coloured[3] < coloured[1] - 0.02 and coloured[1] < coloured[0] - 0.02
    assert max(coloured[4], grey[4]) < 1e-4
