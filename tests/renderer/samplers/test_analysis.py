"""The measures of point sets against closed forms, brute force, and what a shift on the torus may change: nothing."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from renderer.samplers.analysis import (
    coverage_radius,
    elementary_intervals,
    l2_star_discrepancy,
    min_distance,
    nearest_distances,
    random_l2_star,
    relative_distance,
    summary,
)
from renderer.samplers.spectrum import power_spectrum, radial
from tests.renderer.samplers.patterns import hammersley, jittered, square_lattice

sets_of_points = st.builds(
    lambda seed, sets, count: np.random.default_rng(seed).random((sets, count, 2)),
    st.integers(0, 2**31), st.integers(1, 3), st.integers(1, 40),
)  # fmt: skip


def shifted(points, by):
    """Moved on the torus, and still below 1."""
    return np.minimum((points + by) % 1.0, np.nextafter(1.0, 0.0))


def distances_to(places, points):
    """Toroidal distances (places, points), each difference by itself."""
    difference = np.abs(places[:, None] - points[None])
    difference = np.minimum(difference, 1 - difference)
    return np.sqrt((difference**2).sum(axis=-1))


# ------------------------------------------------------------------------------------------ distances and voids


@given(sets_of_points)
@settings(max_examples=50, deadline=None)
def test_nearest_neighbours_are_those_of_all_pairs(points):
    for found, one in zip(nearest_distances(points), points, strict=True):
        pairs = distances_to(one, one)
        np.fill_diagonal(pairs, 1.0)  # a point meets its own copies at distance 1
        np.testing.assert_allclose(found, pairs.min(axis=1), atol=1e-12)


@given(sets_of_points)
@settings(max_examples=50, deadline=None)
def test_the_largest_void_is_where_a_fine_grid_says(points):
    """No place of the grid is farther from the points, and one is nearly as far: half a diagonal of its squares."""
    side = 64
    axis = np.arange(side) / side
    grid = np.stack(np.meshgrid(axis, axis), axis=-1).reshape(-1, 2)
    for found, one in zip(coverage_radius(points), points, strict=True):
        farthest = distances_to(grid, one).min(axis=1).max()
        assert farthest - 1e-9 <= found <= farthest + np.sqrt(0.5) / side


@given(sets_of_points, st.tuples(st.floats(0, 1), st.floats(0, 1)))
@settings(max_examples=30, deadline=None)
def test_a_shift_on_the_torus_changes_no_distance_void_or_power(points, by):
    moved = shifted(points, np.array(by))
    np.testing.assert_allclose(min_distance(moved), min_distance(points), atol=1e-9)
    np.testing.assert_allclose(coverage_radius(moved), coverage_radius(points), atol=1e-9)
    np.testing.assert_allclose(power_spectrum(moved, 3), power_spectrum(points, 3), atol=1e-9)


@pytest.mark.parametrize("side", [2, 3, 8, 16])
def test_a_square_lattice_has_known_distances(side):
    points = square_lattice(side)
    assert min_distance(points) == pytest.approx(1 / side)
    assert coverage_radius(points) == pytest.approx(np.sqrt(0.5) / side)
    assert relative_distance(points) == pytest.approx(np.sqrt(np.sqrt(3) / 2))


def test_a_lattice_that_is_nearly_hexagonal_is_nearly_the_bound():
    """30 rows of 26 points, every second one moved by half a step: 26 · 2/√3 = 30.02 rows would be exact."""
    rows, columns = 30, 26
    j, i = np.divmod(np.arange(rows * columns), columns)
    points = np.stack([(i + 0.5 * (j % 2)) / columns, j / rows], axis=-1)[None]
    assert 0.999 < relative_distance(points)[0] <= 1
    assert summary(points)["coverage_radius"]["relative"] == pytest.approx(1, abs=1e-3)


def test_few_points_have_known_voids():
    assert coverage_radius(np.array([[[0.3, 0.9]]])) == pytest.approx(np.sqrt(0.5))
    assert coverage_radius(np.array([[[0.0, 0.0], [0.5, 0.5]]])) == pytest.approx(0.5)
    assert min_distance(np.array([[[0.01, 0.5], [0.99, 0.5]]])) == pytest.approx(0.02)
    assert min_distance(np.array([[[0.25, 0.25], [0.25, 0.25], [0.5, 0.5]]])) == 0


# ------------------------------------------------------------------------------------------ discrepancy and strata


def warnock(points):
    """Warnock's closed form in double sums over one set."""
    count = len(points)
    single = np.prod(1 - points**2, axis=1).sum()
    double = sum(
        (1 - max(first[0], second[0])) * (1 - max(first[1], second[1])) for first in points for second in points
    )
    return np.sqrt(1 / 9 - single / (2 * count) + double / count**2)


@given(sets_of_points)
@settings(max_examples=20, deadline=None)
def test_l2_star_is_warnocks_closed_form(points):
    np.testing.assert_allclose(l2_star_discrepancy(points), [warnock(one) for one in points], rtol=1e-9)


def test_random_points_have_the_discrepancy_of_random_points():
    """z-test of the mean square over 1000 sets."""
    squares = l2_star_discrepancy(np.random.default_rng(5).random((1000, 16, 2))) ** 2
    z = (squares.mean() - random_l2_star(16) ** 2) / (squares.std(ddof=1) / np.sqrt(len(squares)))
    assert abs(z) < 3.3


@pytest.mark.parametrize("power", range(9))
def test_a_net_has_a_point_in_every_elementary_interval(power):
    points = np.repeat(hammersley(power), 3, axis=0)
    assert elementary_intervals(points) == {(2**a, 2 ** (power - a)): 0 for a in range(power + 1)}


def test_a_point_that_left_its_interval_is_missed():
    points = hammersley(6)
    points[0, 5] = points[0, 6]
    assert all(empty == 1 for shape, empty in elementary_intervals(points).items())


def test_jittered_points_fill_their_grid_and_no_other():
    points = jittered(np.random.default_rng(2), 20, 6)
    empty = elementary_intervals(points)
    assert set(empty) == {(1, 36), (2, 18), (3, 12), (4, 9), (6, 6), (9, 4), (12, 3), (18, 2), (36, 1)}
    assert empty[6, 6] == 0
    assert all(missing > 0 for shape, missing in empty.items() if shape != (6, 6))


# ------------------------------------------------------------------------------------------ spectrum


def test_a_spectrum_is_the_sum_that_defines_it():
    points = np.random.default_rng(3).random((2, 7, 2))
    found = power_spectrum(points, 2)
    for ky in range(-2, 3):
        for kx in range(-2, 3):
            waves = np.exp(-2j * np.pi * (kx * points[..., 0] + ky * points[..., 1])).sum(axis=1)
            assert found[ky + 2, kx + 2] == pytest.approx((np.abs(waves) ** 2).mean() / 7)


def test_random_points_are_white():
    """P = 1 ± 1/√K everywhere, and no direction stands out: −10 log₁₀ K dB."""
    sets = 400
    power = power_spectrum(np.random.default_rng(4).random((sets, 64, 2)), 12)
    rings = radial(power)
    assert list(rings.radii) == list(range(1, 13))
    assert power[12, 12] == pytest.approx(64)
    values = np.delete(power.ravel(), power.size // 2)
    assert np.abs(values - 1).max() < 5 / np.sqrt(sets)
    np.testing.assert_allclose(rings.mean[4:], 1, atol=0.05)
    np.testing.assert_allclose(rings.anisotropy[4:], -10 * np.log10(sets), atol=3)


def test_jittered_points_have_the_spectrum_of_their_cells():
    """P(k) = 1 − sinc²(kx/s) sinc²(ky/s) on an s × s grid: points are independent and uniform in their cells."""
    side, sets, frequencies = 8, 1000, 12
    power = power_spectrum(jittered(np.random.default_rng(6), sets, side), frequencies)
    k = np.sinc(np.arange(-frequencies, frequencies + 1) / side) ** 2
    expected = 1 - k[:, None] * k[None, :]
    expected[frequencies, frequencies] = side**2
    np.testing.assert_allclose(power, expected, atol=5 / np.sqrt(sets))


def test_a_ring_that_prefers_directions_is_anisotropic():
    """Power c² in one of n places of a ring and c elsewhere: mean and variance by hand."""
    power = np.ones((5, 5))
    power[2, 4] = power[2, 0] = 9.0  # k = (±2, 0); (±1, ±2), (±2, ±1) and (0, ±2) are in its ring too: 6 places a half
    rings = radial(power)
    values = np.array([9.0, 1, 1, 1, 1, 1])
    assert rings.mean == pytest.approx([1, values.mean()])
    assert rings.anisotropy[1] == pytest.approx(10 * np.log10(values.var(ddof=1) / values.mean() ** 2))


def test_a_lattice_has_power_on_its_reciprocal_lattice_only():
    rings = radial(power_spectrum(square_lattice(8), 10))
    np.testing.assert_allclose(rings.mean[:7], 0, atol=1e-9)
    assert np.isnan(rings.anisotropy[:7]).all()
    assert rings.mean[7] > 1 and rings.anisotropy[7] > 10


# ------------------------------------------------------------------------------------------ what people read


def test_a_summary_of_very_many_points_measures_some_sets_and_no_discrepancy():
    points = np.random.default_rng(9).random((3, 2**15 + 1, 2))
    told = summary(points)
    assert (told["sets"], told["points"], told["l2_star"]) == (1, 2**15 + 1, None)


def test_a_summary_tells_random_points_from_jittered_ones():
    rng = np.random.default_rng(8)
    plain, even = summary(rng.random((200, 64, 2))), summary(jittered(rng, 200, 8))
    assert (plain["sets"], plain["points"]) == (200, 64)
    assert plain["l2_star"]["relative"] == pytest.approx(1, abs=0.15)
    assert plain["low_frequency_power"] == pytest.approx(1, abs=0.15)
    for key in ("coverage_radius", "l2_star"):
        assert even[key]["relative"] < plain[key]["relative"]
    assert even["low_frequency_power"] < 0.1
    assert plain["min_distance"]["worst"] <= plain["min_distance"]["relative"] < even["min_distance"]["relative"]
    assert even["intervals"]["8×8"] == 0 < even["intervals"]["16×4"] < plain["intervals"]["8×8"]
