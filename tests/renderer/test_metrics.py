"""Metrics against closed forms, and what their names promise."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays

from renderer.metrics import METRICS, RELMSE_EPSILON, Reference, floors, measure, nonfinite, shape

radiance = st.floats(0, 1e4, width=32)
pictures = arrays.arrays(np.float32, (3, 4, 3), elements=radiance)


def flat(value, height=4, width=5):
    """A picture of one colour."""
    return np.full((height, width, 3), value, np.float32)


def test_flat_pictures_have_known_errors():
    values = measure(flat(3), Reference(flat(1), flat(2)))
    assert values["mse"] == pytest.approx((3 - 1.5) ** 2)
    assert values["mse_cross"] == pytest.approx((3 - 1) * (3 - 2))
    assert values["relmse"] == pytest.approx((3 - 1.5) ** 2 / (1.5**2 + RELMSE_EPSILON))
    assert values["mean_ratio"] == pytest.approx(3 / 1.5)


def test_black_references_leave_a_finite_relmse():
    """Epsilon is a radiance squared, not a radiance."""
    assert measure(flat(0.1), Reference(flat(0)))["relmse"] == pytest.approx(0.01 / 0.01, rel=1e-6)
    assert np.isnan(measure(flat(0.1), Reference(flat(0)))["mean_ratio"])


def test_one_picture_is_a_reference_without_halves():
    assert set(METRICS) - set(measure(flat(3), Reference(flat(1)))) == {"mse_cross"}


@given(pictures, pictures, pictures)
def test_a_map_has_the_pictures_shape_and_its_mean_is_the_value(picture, first, second):
    reference = Reference(first, second)
    for metric in METRICS.values():
        with np.errstate(invalid="ignore"):
            drawn = metric.error_map(picture, reference)
            assert drawn.shape == picture.shape and drawn.dtype == np.float64
            np.testing.assert_equal(np.mean(drawn), metric.value(picture, reference))


@given(pictures, pictures)
def test_errors_are_zero_for_equal_pictures_and_never_negative(picture, other):
    """Except mse_cross, whose expectation is what must not be negative."""
    equal, unequal = measure(picture, Reference(picture, picture)), measure(picture, Reference(other, picture))
    for name in ("mse", "relmse"):
        assert equal[name] == 0 <= unequal[name]


@given(pictures, pictures, pictures, st.permutations(range(3)))
def test_errors_do_not_depend_on_the_order_of_rows(picture, first, second, order):
    order = list(order)
    turned = measure(picture[order], Reference(first[order], second[order]))
    assert turned == pytest.approx(measure(picture, Reference(first, second)), nan_ok=True)


@given(pictures, st.floats(0.25, 4))
@settings(max_examples=30)
def test_mse_scales_with_the_square_of_exposure(picture, exposure):
    reference = Reference(flat(1, 3, 4), flat(2, 3, 4))
    exposed = Reference(reference.first * exposure, flat(2, 3, 4) * exposure)
    before, after = measure(picture, reference), measure(picture * np.float32(exposure), exposed)
    assert after["mse"] == pytest.approx(before["mse"] * exposure**2, rel=1e-4)
    assert after["mean_ratio"] == pytest.approx(before["mean_ratio"], rel=1e-4)


def test_cross_error_is_unbiased_and_plain_error_is_not():
    """
    z-test over 400 seeds: with a bias of 0.1 and noise of known variance, mse_cross is bias² + Var(I) on average,
    and mse adds the reference's own variance, Var(R) of the mean of both halves.
    """
    bias, spread, reference_spread, seeds = 0.1, 0.3, 0.5, 400
    rng = np.random.default_rng(7)
    truth = rng.uniform(0, 2, (16, 16, 3))

    def draw(offset, deviation):
        return (truth + offset + rng.normal(0, deviation, truth.shape)).astype(np.float32)

    found = {"mse": [], "mse_cross": []}
    for _ in range(seeds):
        values = measure(draw(bias, spread), Reference(draw(0, reference_spread), draw(0, reference_spread)))
        for name, list_ in found.items():
            list_.append(values[name])
    expected = {"mse_cross": bias**2 + spread**2, "mse": bias**2 + spread**2 + reference_spread**2 / 2}
    for name, values in found.items():
        error = np.std(values, ddof=1) / np.sqrt(seeds)
        z = (np.mean(values) - expected[name]) / error
        assert abs(z) < 3.3, f"{name}: mean {np.mean(values):.5f}, expected {expected[name]:.5f}, z = {z:.1f}"
    assert np.mean(found["mse_cross"]) < expected["mse"] - 5 * np.std(found["mse"]) / np.sqrt(seeds)


def test_the_floor_is_what_an_exact_picture_measures():
    """z-test over 400 noisy references of one truth: a metric of the truth and its floor have the same mean."""
    rng = np.random.default_rng(11)
    truth = rng.gamma(2.0, 0.5, (16, 16, 3)).astype(np.float32)
    differences: dict[str, list[float]] = {}
    for _ in range(400):
        reference = Reference(*(truth + rng.normal(0, 0.02, truth.shape).astype(np.float32) for _ in "ab"))
        exact = measure(truth, reference)
        for name, floor in floors(reference).items():
            differences.setdefault(name, []).append(exact[name] - floor)
            assert 0.5 * exact[name] < floor < 2 * exact[name]
    assert set(differences) == {"mse", "relmse"}
    for name, found in differences.items():
        z = np.mean(found) / (np.std(found, ddof=1) / np.sqrt(len(found)))
        assert abs(z) < 3.3, f"{name}: z = {z:.1f}"
    assert floors(Reference(truth)) == {}


def test_sums_are_kept_in_double_precision():
    """A bright constant error over many pixels: float32 sums would lose its last digits."""
    picture, reference = flat(1000.125, 512, 512), Reference(flat(1000, 512, 512), flat(1000, 512, 512))
    assert measure(picture, reference)["mse"] == 0.125**2
    assert measure(picture, reference)["mse_cross"] == 0.125**2


@pytest.mark.parametrize("bad", [np.nan, np.inf])
def test_a_pixel_that_is_no_number_shows_in_the_value(bad):
    picture = flat(1)
    picture[1, 2, 0] = bad
    assert nonfinite(picture) == 1
    assert nonfinite(flat(1)) == 0
    assert not np.isfinite(measure(picture, Reference(flat(1)))["mse"])


@pytest.mark.parametrize(
    "reference", [Reference(flat(1, 5, 4)), Reference(flat(1), flat(1, 5, 4)), Reference(flat(1, 1, 1))]
)
def test_pictures_of_different_size_are_never_compared(reference):
    """Not even where numpy would stretch one over the other."""
    with pytest.raises(ValueError, match=r"the picture is 5×4, the reference (4×5|1×1)"):
        measure(flat(1), reference)


def test_every_metric_says_what_it_computes():
    for name, metric in METRICS.items():
        assert metric.name == name and metric.formula and metric.line and metric.version >= 1
        assert (metric.epsilon > 0) == ("ε" in metric.formula)
        assert str(metric.epsilon) in metric.formula or not metric.epsilon


def test_sizes_are_written_width_first():
    assert shape(np.zeros((256, 512, 3))) == "512×256"
