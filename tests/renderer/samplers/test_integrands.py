"""
Test functions: exact values against quadrature, and the published errors of samplers that are simple enough to be
written here (``independent`` and ``stratified``): pbrt-4ed, Fig. 8.46, and Christensen et al. 2018.
"""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from renderer.samplers.integrands import INTEGRANDS, half_plane_area, mse
from tests.renderer.samplers.patterns import jittered, square_lattice

# Mean squared errors of jittered points in pbrt-4ed's data, by the number of points.
PUBLISHED = {
    "gaussian": {16: 0.0072761, 64: 4.5973e-4, 144: 9.4205e-5, 196: 5.0638e-5, 256: 2.9549e-5},
    "checkerboard": {16: 0.062206, 64: 0.015411, 144: 0.0058091, 196: 0.0048974, 256: 0.0025353},
}
# Root mean squared errors of random and jittered points at 16, 64 and 256.
CHRISTENSEN_RANDOM = {"quarter_disc": (0.126, 0.0628, 0.0313), "gauss": (0.0548,)}
CHRISTENSEN = {
    "quarter_disc": (0.0504, 0.0207, 0.00742), "triangle": (0.0627, 0.0221, 0.0077), "gauss": (0.0135, 0.00331, 8.7e-4),
}  # fmt: skip


@pytest.mark.parametrize("name", INTEGRANDS)
def test_exact_values_are_those_of_quadrature(name):
    """Midpoints of 500 × 500 cells; a discontinuity of length L costs at most about L/500."""
    integrand = INTEGRANDS[name]
    points = np.repeat(square_lattice(500), 6 if integrand.members(np.random.default_rng(0), 1) else 1, axis=0)
    assert np.abs(integrand.errors(points)).max() < 2e-3


@pytest.mark.parametrize("name", INTEGRANDS)
def test_random_points_have_the_error_that_the_variance_says(name):
    """z-test over 8000 sets: mean squared error = variance / N, and no bias."""
    integrand = INTEGRANDS[name]
    for count in (4, 16):
        errors = integrand.errors(np.random.default_rng(count).random((8000, count, 2)))
        for values, expected in ((errors, 0.0), (errors**2, integrand.variance / count)):
            z = (values.mean() - expected) / (values.std(ddof=1) / np.sqrt(len(values)))
            assert abs(z) < 3.3, f"{name} at {count}: {values.mean()} for {expected}, z = {z:.1f}"


def test_random_points_have_the_published_errors():
    for count, published in ((16, 0.032669), (64, 0.0081589), (256, 0.0020330)):
        assert INTEGRANDS["gaussian"].variance / count == pytest.approx(published, rel=0.01)
    for name, published in CHRISTENSEN_RANDOM.items():
        for count, value in zip((16, 64, 256), published, strict=False):
            assert np.sqrt(INTEGRANDS[name].variance / count) == pytest.approx(value, rel=0.02)


@pytest.mark.parametrize("name", CHRISTENSEN)
def test_jittered_points_have_nearly_the_errors_of_christensen(name):
    for count, value in zip((16, 64, 256), CHRISTENSEN[name], strict=True):
        points = jittered(np.random.default_rng(count), 20_000, round(count**0.5))
        assert np.sqrt(mse(INTEGRANDS[name], points)) == pytest.approx(value, rel=0.05)


@pytest.mark.parametrize("name", PUBLISHED)
@pytest.mark.parametrize("count", [16, 64, 144, 196, 256])
def test_jittered_points_have_the_published_errors(name, count):
    points = jittered(np.random.default_rng(count), 20_000, round(count**0.5))
    assert mse(INTEGRANDS[name], points) == pytest.approx(PUBLISHED[name][count], rel=0.04)


@given(st.floats(-4, 4), st.floats(-1, 1))
def test_the_two_sides_of_a_line_share_the_pixel(theta, s):
    areas = half_plane_area(np.cos(theta), np.sin(theta), np.array([s, -s, s + 0.01]))
    assert areas[0] + areas[1] == pytest.approx(1)
    assert 0 <= areas[0] <= areas[2] + 1e-12 <= 1 + 1e-12


@pytest.mark.parametrize("normal", [(1, 0), (0, 1), (-1, 0), (0, -1), (1, 1e-9)])
def test_a_line_along_an_axis_cuts_a_rectangle(normal):
    s = np.array([-0.7, -0.5, -0.25, 0, 0.1, 0.5, 0.9])
    np.testing.assert_allclose(half_plane_area(*map(np.float64, normal), s), np.clip(0.5 + s, 0, 1), atol=1e-8)


def test_the_checkerboard_is_antisymmetric():
    """So its integral is exactly 0."""
    x, y = np.random.default_rng(1).random((2, 1, 10_000))
    value = INTEGRANDS["checkerboard"].value
    assert np.isin(value(x, y), (-1, 1)).all()
    np.testing.assert_array_equal(value(x, y), -value(y, x))


def test_members_of_a_family_come_from_the_seed():
    points = np.random.default_rng(1).random((10, 16, 2))
    edge = INTEGRANDS["edge"]
    np.testing.assert_array_equal(edge.errors(points, 3), edge.errors(points, 3))
    assert (edge.errors(points, 3) != edge.errors(points, 4)).any()


def test_other_shapes_are_refused():
    with pytest.raises(ValueError, match=r"\(16, 2\)"):
        mse(INTEGRANDS["step"], np.zeros((16, 2)))
