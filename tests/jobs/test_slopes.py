"""Exponents of curves: found where they are known, with intervals that hold the truth as often as they say."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from jobs.slopes import NORMAL_95, STUDENT_95, slope, student

TRIALS = 1500
# The share of intervals that hold the truth has a standard error of √(.95 · .05 / 1500) = 0.0056.
LEAST, MOST = 0.93, 0.995


def point(spp: int, mean: float, error: float | None = 1e-3, n: int = 4) -> dict[str, float | int | None]:
    return {"spp_actual": spp, "mean": mean, "error": None if error is None else error * mean, "n": n}


def exact_student(freedom: float) -> float:
    """The 97.5 % quantile of Student's t: its density, integrated and inverted."""
    norm = math.exp(math.lgamma((freedom + 1) / 2) - math.lgamma(freedom / 2)) / math.sqrt(math.pi)

    def mass(value: float) -> float:
        angle = np.linspace(0, math.atan(value / math.sqrt(freedom)), 20_001)
        return norm * float(np.trapezoid(np.cos(angle) ** (freedom - 1), angle))

    low, high = 0.0, 100.0
    while high - low > 1e-7:
        middle = (low + high) / 2
        low, high = (middle, high) if mass(middle) < 0.475 else (low, middle)
    return low


def test_the_table_of_student_is_right():
    for freedom, value in enumerate(STUDENT_95, start=1):
        assert value == pytest.approx(exact_student(freedom), abs=1e-4), freedom
        assert student(freedom) == pytest.approx(value, abs=1e-12)


@pytest.mark.parametrize("freedom", [1.1, 1.5, 2.5, 3.7, 7.3, 12.5, 29.5, 30, 31, 40, 99, 10_000])
def test_between_and_beyond_the_table_student_is_near(freedom):
    """Never too narrow by more than 0.3 %, and too wide by no more than a fifth."""
    exact = exact_student(freedom)
    assert exact * 0.997 < student(freedom) < exact * (1.2 if freedom < 2 else 1.03)


def test_student_falls_to_the_normal_distribution():
    values = [student(1 + step / 7) for step in range(2000)]
    assert values == sorted(values, reverse=True)
    assert values[0] == STUDENT_95[0]
    assert values[-1] == pytest.approx(NORMAL_95, abs=0.01)


@given(
    exponent=st.floats(-3, 1),
    factor=st.floats(1e-6, 1e6),
    spp=st.lists(st.integers(1, 10**6), min_size=3, max_size=9, unique=True),
    data=st.data(),
)
@settings(deadline=None, derandomize=True)
def test_a_power_law_is_recovered(exponent, factor, spp, data):
    """Whatever the weights: a line that fits is the line."""
    curve = [
        point(n, factor * n**exponent, data.draw(st.floats(0, 0.5)), data.draw(st.integers(2, 50))) for n in spp
    ]  # fmt: skip
    found = slope(curve)
    assert found is not None
    assert found.value == pytest.approx(exponent, abs=1e-6)
    assert found.low <= found.value <= found.high


@pytest.mark.parametrize("replicates", [2, 3, 4, 8, 32])
@pytest.mark.parametrize(
    ("spp", "spreads"),
    [
        ([4, 16, 64], [0.2, 0.2, 0.2]),
        ([16, 32, 64, 128, 256], [0.05, 0.08, 0.12, 0.18, 0.25]),
        ([4**i for i in range(8)], [0.37] * 8),
    ],
    ids=["three", "five with growing spread", "eight"],
)
def test_intervals_hold_the_truth_as_often_as_they_say(replicates, spp, spreads):
    """
    The errors of replicates are spread like gamma variables (science.md E.2); the interval is computed from their own
    means and standard errors, as the service does it.
    """
    rng = np.random.default_rng([replicates, len(spp)])
    held = 0
    for _ in range(TRIALS):
        curve = []
        for n, spread in zip(spp, spreads, strict=True):
            values = rng.gamma(spread**-2, spread**2, replicates) / n
            mean, error = values.mean(), values.std(ddof=1) / math.sqrt(replicates)
            curve.append(point(n, mean, error / mean, replicates))
        found = slope(curve)
        assert found is not None
        held += found.low <= -1 <= found.high
    assert LEAST < held / TRIALS < MOST, f"{held} of {TRIALS}"


def test_a_curve_that_is_no_line_has_a_wide_interval():
    """A noise floor: the points are well known, and no line goes through them."""
    straight = [point(n, 1 / n) for n in (1, 4, 16, 64, 256)]
    bent = [point(n, 1 / n + 0.1) for n in (1, 4, 16, 64, 256)]
    narrow, wide = slope(straight), slope(bent)
    assert narrow is not None and wide is not None
    assert wide.high - wide.low > 20 * (narrow.high - narrow.low)


def test_a_lucky_spread_does_not_rule():
    """Two replicates that happen to agree are not known a hundred times better than their neighbours."""
    curve = [point(n, 1 / n, 0.2, n=2) for n in (1, 4, 16, 64)]
    lucky = [*curve[:3], point(64, 1.3 / 64, 1e-9, n=2)]
    found = slope(lucky)
    assert found is not None
    assert found.low < -1 < found.high


@pytest.mark.parametrize(
    "curve",
    [
        [],
        [point(1, 1.0), point(4, 0.25)],
        [point(1, 1.0), point(4, 0.25), point(4, 0.25)],
        [point(1, 1.0), point(4, 0.25), point(16, -0.01)],
        [point(1, 1.0), point(4, 0.25), point(16, 0.0)],
        [point(1, 1.0), point(4, 0.25), point(16, 0.06, None, n=1)],
    ],
    ids=["nothing", "two", "two and one twice", "negative", "zero", "no error"],
)
def test_what_is_no_curve_has_no_slope(curve):
    assert slope(curve) is None


def test_one_spp_that_was_asked_twice_counts_once():
    """3 and 4 spp of a sampler that rounds up are one picture: they make nothing more certain."""
    curve = [point(n, m) for n, m in ((1, 1.0), (4, 0.3), (16, 0.06))]
    assert slope([*curve, curve[1]]) == slope(curve)


def test_equal_numbers_have_an_interval_all_the_same():
    """A replay draws the same picture again and again: nothing divides by zero."""
    found = slope([point(n, 1 / n, 0.0) for n in (1, 4, 16)])
    assert found is not None and found.value == pytest.approx(-1)
    assert found.low < found.high
