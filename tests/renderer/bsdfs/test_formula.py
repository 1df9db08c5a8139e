"""The float64 model against the table of 50-digit values, and the laws that it follows by itself."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from renderer.bsdfs.formula import AnisoPhong
from tests.renderer.bsdfs.cases import LIT, ROWS, direction, model, random_settings

QUADRATURE = 1e-4  # of albedos, relative: what tensor Gauss points reach


def named(row: dict[str, Any]) -> str:
    return str(row["name"])


@pytest.mark.parametrize("row", ROWS, ids=named)
def test_every_row_of_the_table(row: dict[str, Any]) -> None:
    """1e-9 relative; 1e-6 at 89.9 degrees, where the cosines themselves have 13 digits."""
    material, wi, wo = model(row), np.array(row["wi"]), np.array(row["wo"])
    close = {"rel": 1e-6 if "89p9" in row["name"] else 1e-9, "abs": 0}
    assert material.specular(wi, wo) == pytest.approx(row["fs"], **close)
    assert material.diffuse(wi, wo) == pytest.approx(row["fd"], **close)
    assert material.f(wi, wo) * wo[2] == pytest.approx(row["f_cos"], **close)
    if row["f"]:
        assert material.pdf_specular(wi, wo) == pytest.approx(row["pdf_spec"], **close)
        assert material.pdf(wi, wo, p=0.5) == pytest.approx(row["pdf_mix"], **close)
    else:
        assert material.pdf(wi, wo) == 0


@pytest.mark.parametrize("row", LIT, ids=named)
def test_albedos_of_the_table(row: dict[str, Any]) -> None:
    material, wi = model(row), np.array(row["wi"])
    assert material.albedo_diffuse(wi) == pytest.approx(row["albedo_diff"], rel=1e-12)
    assert material.albedo_specular(wi) == pytest.approx(row["albedo_spec"], rel=QUADRATURE)


@pytest.mark.parametrize(("nu", "nv"), [(0, 0), (1, 1), (10, 0), (100, 7)])
def test_half_vectors_have_a_density(nu: float, nv: float) -> None:
    """Its integral over the hemisphere is 1."""
    x, w = np.polynomial.legendre.leggauss(400)
    cosine, phi = np.meshgrid((x + 1) / 2, np.linspace(0, 2 * np.pi, 400, endpoint=False))
    density = AnisoPhong(nu=nu, nv=nv).pdf_half(direction(np.arccos(cosine), phi))
    assert (density @ (w / 2)).mean() * 2 * np.pi == pytest.approx(1, abs=1e-6)


def test_sampling_is_the_paper_s_four_quadrants() -> None:
    """Equations 9 and 10 with their arctangent, quadrant by quadrant: the same half vectors to 1e-9."""
    random = np.random.default_rng(3)
    material = AnisoPhong(nu=10_000, nv=7)
    u1, u2 = random.random((2, 4000))
    quadrant = (4 * u1).astype(int)
    within = np.choose(quadrant, [4 * u1, 4 * (0.5 - u1), 4 * (u1 - 0.5), 4 * (1 - u1)])
    phi = np.arctan(np.sqrt((material.nu + 1) / (material.nv + 1)) * np.tan(np.pi / 2 * within))
    phi = np.choose(quadrant, [phi, np.pi - phi, np.pi + phi, 2 * np.pi - phi])
    cosine = (1 - u2) ** (1 / (material.nu * np.cos(phi) ** 2 + material.nv * np.sin(phi) ** 2 + 1))
    assert np.abs(material.sample_half(u1, u2) - direction(np.arccos(cosine), phi)).max() < 1e-8


def test_light_may_go_either_way() -> None:
    """Reciprocity: f(a, b) = f(b, a) on 10 000 pairs."""
    material, wi, wo = random_settings(10_000, seed=5)
    assert np.allclose(material.f(wi, wo), material.f(wo, wi), rtol=1e-13, atol=0)


def test_a_quarter_turn_swaps_the_exponents() -> None:
    material, wi, wo = random_settings(2000, seed=6)
    turned = AnisoPhong(material.rd, material.rs, material.nv, material.nu)
    quarter = np.array([[0, 1, 0], [-1, 0, 0], [0, 0, 1]])
    assert np.allclose(material.f(wi, wo), turned.f(wi @ quarter, wo @ quarter), rtol=1e-10, atol=0)


def test_no_surface_gives_more_than_it_gets() -> None:
    """Also with Rd + Rs > 1: the base takes only what Fresnel reflection leaves."""
    for exponent in (0, 1, 10, 100, 10_000):
        for rs in (0, 0.05, 0.5, 1):
            material = AnisoPhong(1, rs, exponent, exponent)
            for degrees in (0, 30, 60, 85, 89):
                k1 = direction(np.radians(degrees), 0.3)
                assert material.albedo_specular(k1, nodes=20) + material.albedo_diffuse(k1) < 1


@pytest.mark.parametrize("degrees", [0, 30, 60, 75])
def test_a_sharp_lobe_is_a_mirror(degrees: float) -> None:
    """
    At exponents e = 10 000 the lobe reflects Fresnel's part, less what max(cos1, cos2) takes: cos2 is normal about
    cos1 with a deviation of 2 sin θ / √e, so 2 tan θ / √(2πe) is lost (1.4 % at 60 degrees).
    """
    material = AnisoPhong(0.5, 0.3, 10_000, 10_000)
    k1 = direction(np.radians(degrees), 0.0)
    lost = 2 * np.tan(np.radians(degrees)) / np.sqrt(2 * np.pi * 10_000)
    assert material.albedo_specular(k1) == pytest.approx(material.fresnel(k1[2]) * (1 - lost), rel=1e-3)


def test_pbrt_s_normalisation_is_brighter_by_a_factor() -> None:
    material, wi, wo = random_settings(100, seed=7)
    brighter = AnisoPhong(material.rd, material.rs, material.nu, material.nv, "pbrt")
    factor = np.sqrt((material.nu + 2) * (material.nv + 2) / ((material.nu + 1) * (material.nv + 1)))
    assert np.allclose(brighter.specular(wi, wo), factor * material.specular(wi, wo), rtol=1e-12, atol=0)
    assert np.allclose(brighter.pdf(wi, wo), material.pdf(wi, wo))
