"""Poisson-disk sets keep their distance, cover the torus, come in the number asked for, and are the same every time."""

from __future__ import annotations

import hashlib
import itertools
import math
import re

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from renderer.errors import BadParameter
from renderer.samplers import elimination, relaxation
from renderer.samplers.packing import (
    MAX_POINTS,
    check_min_dist,
    hexagonal_bound,
    jammed_distance,
    largest_min_dist,
)
from renderer.samplers.point_sets import PointSets, eliminated, poissondisk, relaxedpoissondisk
from renderer.samplers.torus import Streams, min_distance, neighbours

Floats = NDArray[np.float64]

COUNTS = (1, 2, 3, 5, 7, 16, 33, 64, 200, 256)
MAKERS = {"poissondisk": poissondisk, "relaxedpoissondisk": relaxedpoissondisk, "eliminated": eliminated}
LEAST_RHO = {"poissondisk": 0.70, "relaxedpoissondisk": 0.58, "eliminated": 0.65}  # of the hexagonal bound
ROUNDING = 1e-9
COPIES = np.array(list(itertools.product((0, -1, 1), repeat=2)))


def nearest(points: Floats) -> Floats:
    """The smallest distance in each set, by comparing every point with every periodic copy of every other."""
    out = []
    for one in points:
        copies = (one[None] + COPIES[:, None]).reshape(-1, 2)
        distance = np.hypot(*np.moveaxis(one[:, None] - copies[None], 2, 0))
        distance[np.arange(len(one)), np.arange(len(one))] = np.inf  # itself
        out.append(distance.min())
    return np.array(out)


def coverage(points: Floats) -> Floats:
    """The largest distance of a place from its nearest point in each set: at a corner of a Voronoi cell."""
    from scipy.spatial import Voronoi

    out = []
    for one in points:
        copies = (one[None] + COPIES[:, None]).reshape(-1, 2)
        corners = Voronoi(copies).vertices
        corners = corners[((corners > -0.01) & (corners < 1.01)).all(axis=1)]
        out.append(max(np.hypot(*(copies - corner).T).min() for corner in corners))
    return np.array(out)


def power(points: Floats, *waves: tuple[int, int]) -> float:
    """Mean of |Σ exp(−2πi k·x)|² / N over the sets and waves k; 1 for random points."""
    phase = points @ (2 * np.pi * np.array(waves).T)
    return float(np.mean(np.abs(np.exp(-1j * phase).sum(axis=1)) ** 2) / points.shape[1])


def digest(sets: PointSets) -> str:
    """Of the points to a millionth: what may differ between processors is rounded away."""
    return hashlib.sha256(np.floor(sets.points * 2**20).astype("<u4").tobytes()).hexdigest()[:16]


def test_the_yardsticks_measure_lattices() -> None:
    axis = np.arange(4) / 4 + 0.1
    lattice = np.stack(np.meshgrid(axis, axis), axis=-1).reshape(1, 16, 2)
    assert nearest(lattice)[0] == pytest.approx(1 / 4) and coverage(lattice)[0] == pytest.approx(math.sqrt(2) / 8)
    assert coverage(lattice[:, 1:])[0] == pytest.approx(1 / 4)  # without one of its points
    assert power(lattice, (4, 0)) == pytest.approx(16) and power(lattice, (1, 0)) == pytest.approx(0)


# -- the laws of each construction -----------------------------------------------------------------------------------


@pytest.mark.parametrize("name", MAKERS)
@pytest.mark.parametrize("n", COUNTS)
def test_sets_have_their_number_their_distance_and_no_holes(name: str, n: int) -> None:
    sets = MAKERS[name](n, 16, 7)
    assert sets.points.shape == (16, n, 2) and sets.radius.shape == (16,)
    assert sets.points.min() >= 0 and sets.points.max() < 1
    found = nearest(sets.points)
    assert (found >= sets.radius - ROUNDING).all()
    assert (found >= LEAST_RHO[name] * hexagonal_bound(n)).all()
    assert (found <= hexagonal_bound(n) + ROUNDING).all()
    assert sets.maximal == (name == "poissondisk")
    if sets.maximal:
        assert (coverage(sets.points[:4]) <= sets.radius[:4] + ROUNDING).all()
        np.testing.assert_allclose(found, sets.radius, atol=ROUNDING)  # and no larger radius would do


@pytest.mark.parametrize("name", MAKERS)
def test_low_frequencies_are_quiet(name: str) -> None:
    """A front that stops, or a set that is not periodic, has P(|k| = 1) of 1 to 30 (science.md A.2)."""
    points = MAKERS[name](256, 64, 3).points
    assert power(points, (1, 0), (0, 1)) < 0.2
    assert power(points, (1, 1), (1, -1), (2, 0), (0, 2)) < 0.2


@pytest.mark.parametrize("name", MAKERS)
def test_every_place_of_the_torus_is_as_likely(name: str) -> None:
    points = MAKERS[name](5, 2000, 1).points.reshape(-1, 2)
    counts = np.histogram2d(*points.T, bins=4, range=((0, 1), (0, 1)))[0]
    expected = len(points) / 16
    assert ((counts - expected) ** 2).sum() / expected < 37.7  # chi-square of 15 degrees at 0.1 %


def test_the_order_is_random() -> None:
    """A prefix of a Poisson-disk set is a random part of it: the mean of its first half is that of its last half."""
    for make in (poissondisk, relaxedpoissondisk):
        points = make(64, 64, 2).points
        assert min_distance(points[:, :8]).mean() == pytest.approx(min_distance(points[:, -8:]).mean(), rel=0.15)


@pytest.mark.parametrize("n", (16, 64, 256))
def test_prefixes_of_eliminated_sets_are_spread_well(n: int) -> None:
    points = eliminated(n, 32, 5).points
    for part in (n // 2, n // 4):
        assert (nearest(points[:, :part]) >= 0.5 * hexagonal_bound(part)).all()
    random_part = min_distance(poissondisk(n, 32, 5).points[:, : n // 2]).mean()
    assert min_distance(points[:, : n // 2]).mean() > 1.1 * random_part


def test_elimination_at_once_is_elimination_one_by_one() -> None:
    """Yuksel's algorithm with the heaviest point first, on one set after the other."""
    size, given = 24, 120
    points = Streams.of(9, 0, range(4)).blocks(given, 2)
    reach = 2 * math.sqrt(1 / (2 * math.sqrt(3) * size))
    closest = reach * 0.65 * (1 - (size / given) ** 1.5)
    for one, order in zip(points, elimination._elimination(points, size), strict=True):
        apart = np.abs(one[:, None] - one[None])
        apart = np.hypot(*np.moveaxis(np.minimum(apart, 1 - apart), 2, 0))
        share = np.where(apart < reach, (1 - np.maximum(apart, closest) / reach) ** 8, 0)
        np.fill_diagonal(share, 0)
        weight, gone = share.sum(axis=1), []
        while len(gone) < given - size:
            heaviest = int(np.argmax(weight))
            weight -= share[heaviest]
            weight[heaviest] = -np.inf
            gone.append(heaviest)
        assert list(order[size:]) == gone[::-1]


# -- min_dist --------------------------------------------------------------------------------------------------------


@settings(max_examples=40, deadline=None)
@given(n=st.integers(1, 60), part=st.floats(0.001, 1), seed=st.integers(0, 2**63))
def test_a_feasible_distance_is_kept_and_not_called_maximal(n: int, part: float, seed: int) -> None:
    distance = part * largest_min_dist(n)
    sets = poissondisk(n, 2, seed, min_dist=distance)
    assert sets.points.shape == (2, n, 2) and not sets.maximal
    assert (nearest(sets.points) >= distance - ROUNDING).all()


@settings(max_examples=40, deadline=None)
@given(n=st.integers(1, 60), start=st.floats(1e-6, 1), seed=st.integers(0, 2**63))
def test_relaxed_darts_take_any_distance_and_report_what_they_reach(n: int, start: float, seed: int) -> None:
    sets = relaxedpoissondisk(n, 2, seed, min_dist=start)
    assert sets.points.shape == (2, n, 2)
    assert (nearest(sets.points) >= sets.radius - ROUNDING).all()
    shrunk = np.log(sets.radius / start) / math.log(0.99)
    np.testing.assert_allclose(shrunk, np.round(shrunk), atol=1e-6)  # a whole number of steps, none upwards
    assert (np.round(shrunk) >= 0).all()


def test_uniform_darts_at_a_distance_leave_more_power_than_a_maximal_set() -> None:
    """At half of the largest distance darts are nearly random: P(|k| = 1) is far above the 0.06 of jammed ones."""
    assert power(poissondisk(64, 64, 1, min_dist=0.05).points, (1, 0), (0, 1)) > 0.3
    assert power(poissondisk(64, 64, 1).points, (1, 0), (0, 1)) < 0.2


@settings(max_examples=60)
@given(n=st.integers(1, MAX_POINTS), min_dist=st.floats(-1, 2))
def test_an_infeasible_distance_is_refused_with_one_that_is_accepted(n: int, min_dist: float) -> None:
    if 0 < min_dist <= largest_min_dist(n):
        check_min_dist(n, min_dist, "here")
        return
    with pytest.raises(BadParameter, match="in my grid is not feasible") as caught:
        check_min_dist(n, min_dist, "my sampler in my grid")
    named = re.search(r"up to (\S+),", str(caught.value))
    assert named
    check_min_dist(n, float(named[1]), "here")


def test_the_reports_distance_is_infeasible_and_bounds_are_in_order() -> None:
    """√n/n holds 0.70 n points (science.md A.1)."""
    for n in range(2, 400):
        assert largest_min_dist(n) < jammed_distance(n) < math.sqrt(n) / n < 1.0001 * max(hexagonal_bound(n), 0.7072)
        with pytest.raises(BadParameter):
            poissondisk(n, 1, 0, min_dist=math.sqrt(n) / n)
    assert hexagonal_bound(1) == largest_min_dist(1) == 1


@pytest.mark.parametrize("n", (2, 3, 4, 5, 6, 7, 8, 9, 12, 1000))
def test_the_largest_distance_is_reached(n: int) -> None:
    sets = poissondisk(n, 8, 4, min_dist=largest_min_dist(n))
    assert (min_distance(sets.points) >= largest_min_dist(n)).all()


@pytest.mark.parametrize("make", (poissondisk, relaxedpoissondisk))
@pytest.mark.parametrize("min_dist", (0.0, -0.1, 1.01, math.nan))
def test_distances_outside_the_torus_are_refused(make: type, min_dist: float) -> None:
    with pytest.raises(BadParameter, match="min_dist"):
        make(16, 1, 0, min_dist=min_dist)


@pytest.mark.parametrize(("n", "sets", "lloyd"), ((0, 1, 0), (MAX_POINTS + 1, 1, 0), (4, 0, 0), (4, 1, -1)))
def test_impossible_numbers_are_refused(n: int, sets: int, lloyd: int) -> None:
    with pytest.raises(BadParameter):
        poissondisk(n, sets, 0, lloyd_iterations=lloyd)


# -- Lloyd relaxation ------------------------------------------------------------------------------------------------


def test_points_move_to_the_centroids_of_their_cells() -> None:
    """Against a fine raster of the torus, each place belonging to its nearest point."""
    side = 500
    axis = (np.arange(side) + 0.5) / side
    places = np.stack(np.meshgrid(axis, axis), axis=-1).reshape(-1, 2)
    points = Streams.of(9, 1, range(2)).blocks(7, 2)
    for one, moved in zip(points, relaxation.lloyd(points, 1), strict=True):
        towards = (places[:, None] - one + 0.5) % 1 - 0.5
        owner = (towards**2).sum(axis=2).argmin(axis=1)
        for k in range(len(one)):
            difference = moved[k] - one[k] - towards[owner == k, k].mean(axis=0)
            np.testing.assert_allclose(difference - np.round(difference), 0, atol=1e-3)


@pytest.mark.parametrize("n", (1, 2, 3, 4, 9, 64))
def test_lloyd_relaxation_makes_sets_more_even(n: int) -> None:
    for make in (poissondisk, relaxedpoissondisk):
        before, after = make(n, 8, 3), make(n, 8, 3, lloyd_iterations=5)
        assert after.points.shape == before.points.shape and not after.maximal
        assert after.points.min() >= 0 and after.points.max() < 1
        assert after.radius.mean() >= before.radius.mean() - ROUNDING
        np.testing.assert_allclose(nearest(after.points), after.radius, atol=ROUNDING)


# -- determinism -----------------------------------------------------------------------------------------------------

PINNED = {
    "poissondisk": "f13aa426edcdab5e",
    "poissondisk at a distance": "9e94865968648fc5",
    "relaxedpoissondisk": "3b82765303d39807",
    "eliminated": "8124b442cd39553c",
    "lloyd": "9f36f6a7bed7142d",
}


def test_the_numbers_are_those_that_tables_were_made_with() -> None:
    """A change here needs a new version in ``store.GENERATORS``: old tables would be read as if they were new."""
    assert {
        "poissondisk": digest(poissondisk(33, 3, 5)),
        "poissondisk at a distance": digest(poissondisk(33, 3, 5, min_dist=0.1)),
        "relaxedpoissondisk": digest(relaxedpoissondisk(33, 3, 5)),
        "eliminated": digest(eliminated(33, 3, 5)),
        "lloyd": digest(poissondisk(33, 3, 5, lloyd_iterations=2)),
    } == PINNED


@pytest.mark.parametrize("name", MAKERS)
@settings(max_examples=15, deadline=None)
@given(n=st.integers(1, 40), seed=st.integers(0, 2**32))
def test_a_set_does_not_depend_on_how_many_are_asked_for(name: str, n: int, seed: int) -> None:
    few, many = MAKERS[name](n, 2, seed), MAKERS[name](n, 5, seed)
    np.testing.assert_array_equal(few.points, many.points[:2])
    np.testing.assert_array_equal(few.radius, many.radius[:2])
    assert not np.array_equal(many.points[0], many.points[1])
    assert not np.array_equal(few.points, MAKERS[name](n, 2, seed + 1).points)


# -- distances on the torus ------------------------------------------------------------------------------------------


@settings(max_examples=40, deadline=None)
@given(n=st.integers(1, 30), seed=st.integers(0, 2**32), reach=st.floats(0.01, 0.7))
def test_distances_and_neighbours_are_those_of_all_pairs(n: int, seed: int, reach: float) -> None:
    points = np.random.default_rng(seed).random((3, n, 2))
    np.testing.assert_allclose(min_distance(points), nearest(points), atol=ROUNDING)
    one, other, distance = neighbours(points, reach)
    pairs = {}
    for k, a, b in itertools.product(range(3), range(n), range(n)):
        apart = np.abs(points[k, a] - points[k, b])
        if a < b and (d := float(np.hypot(*np.minimum(apart, 1 - apart)))) < reach:
            pairs[k * n + a, k * n + b] = d
    names = np.stack([np.minimum(one, other), np.maximum(one, other)], axis=1)
    found = dict(zip(map(tuple, names.tolist()), distance, strict=True))
    assert found.keys() == pairs.keys() and len(one) == len(pairs)
    assert all(found[pair] == pytest.approx(pairs[pair]) for pair in pairs)


@pytest.mark.slow
@pytest.mark.parametrize("name", MAKERS)
@pytest.mark.parametrize("n", (4096, MAX_POINTS))
def test_large_sets_keep_the_laws(name: str, n: int) -> None:
    """But for the distance of relaxed darts, which falls slowly with n."""
    sets = MAKERS[name](n, 2, 1)
    assert sets.points.shape == (2, n, 2)
    assert (min_distance(sets.points) >= sets.radius - ROUNDING).all()
    least = 0.5 if name == "relaxedpoissondisk" else LEAST_RHO[name]
    assert (sets.radius >= least * hexagonal_bound(n)).all()
    assert power(sets.points, (1, 0), (0, 1)) < 0.3
    if sets.maximal:
        from scipy.spatial import cKDTree

        places = np.random.default_rng(0).random((10**6, 2))
        assert cKDTree(sets.points[0], boxsize=1).query(places)[0].max() <= sets.radius[0]
