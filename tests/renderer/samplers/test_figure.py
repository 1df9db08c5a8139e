"""The figure of a point set: any number of points makes a picture, always the same one, that shows what it is told."""

from __future__ import annotations

import io

import numpy as np
import pytest
from PIL import Image

from renderer.samplers.analysis import summary
from renderer.samplers.figure import HEIGHT, LEFT, MIDDLE, SIDE, TOP, WIDTH, figure_png
from renderer.samplers.panels import GREY, VIRIDIS, colours
from tests.renderer.samplers.patterns import jittered, square_lattice


def draw(points, label="stratified"):
    return figure_png(points, label, summary(points))


def opened(png):
    picture = Image.open(io.BytesIO(png))
    assert picture.format == "PNG" and picture.size == (WIDTH, HEIGHT)
    return np.asarray(picture.convert("RGB")).astype(int)


@pytest.mark.parametrize(("sets", "count"), [(1, 1), (3, 2), (2, 7), (64, 16), (1, 5000)])
def test_any_number_of_points_makes_a_small_picture_on_white(sets, count):
    png = draw(np.random.default_rng(1).random((sets, count, 2)))
    assert len(png) < 300_000
    assert (opened(png)[:4] == 255).all()


def test_equal_sets_that_lie_at_one_place_are_drawn():
    """Distances of 0 and powers of N everywhere."""
    opened(draw(np.full((2, 9, 2), 0.5)))


def test_the_same_points_make_the_same_bytes():
    points = jittered(np.random.default_rng(2), 8, 8)
    assert draw(points) == draw(points)
    assert draw(points) != draw(points, "independent")


def test_points_are_where_they_are():
    """One disc: its middle is coloured, and is at (x, 1 − y) of the first panel."""
    pixels = opened(draw(np.array([[[0.25, 0.75]]])))
    panel = pixels[TOP + 3 : TOP + SIDE - 3, LEFT + 3 : LEFT + SIDE - 3]
    rows, columns = np.nonzero(panel.min(axis=-1) < 200)
    assert columns.mean() + 3 == pytest.approx(0.25 * SIDE, abs=1)
    assert rows.mean() + 3 == pytest.approx(0.25 * SIDE, abs=1)


def test_a_spectrum_without_power_is_black_and_a_peak_is_white():
    """A lattice of 4 × 4 points: power 16 at multiples of 4, nothing elsewhere; frequencies reach 10."""
    pixels = opened(draw(square_lattice(4)))
    cell = SIDE / 21

    def at(kx, ky):
        return pixels[round(TOP + SIDE / 2 - ky * cell), round(MIDDLE + SIDE / 2 + kx * cell)].mean()

    assert at(8, 8) > 230 and at(-8, 4) > 230
    assert at(1, 0) < 10 and at(3, -2) < 10 and at(0, 0) < 10


def test_colour_maps_run_from_end_to_end():
    assert colours(np.array([-1.0, 0.0, 0.5, 1.0, 2.0]), GREY)[:, 0].tolist() == [0, 0, 128, 255, 255]
    assert colours(np.array([0.0, 1.0]), VIRIDIS).tolist() == [[0x44, 0x01, 0x54], [0xFD, 0xE7, 0x25]]
