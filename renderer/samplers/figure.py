"""
A point set at a glance: its points, its spectrum, and how far its points are from each other, as one PNG.

Dashed lines say what random points would have, so that each panel can be read by itself. The points are those of the
first set; all else is over all sets. Pillow draws it (``panels.py``); no Mitsuba here.
"""

from __future__ import annotations

from math import ceil, log10, sqrt
from typing import Any

import numpy as np
from numpy.typing import NDArray

from renderer.samplers.analysis import nearest_distances
from renderer.samplers.packing import hexagonal_bound
from renderer.samplers.panels import BAR, FAINT, GREY, LINE, RING, VIRIDIS, Axes, Canvas, colours
from renderer.samplers.spectrum import Radial, power_spectrum, radial

Floats = NDArray[np.float64]

WIDTH, HEIGHT = 1480, 870  # pixels
SIDE = 420  # of the square panels
LEFT, MIDDLE, RIGHT = 60, 540, 1040  # where the columns begin
TOP, BOTTOM = 130, 660  # where the rows begin
LOW = 150  # height of the second row
REACH = 2.5  # highest frequency in units of √N: peaks of even sets lie at 1 and 2
MAX_FREQUENCY = 128  # cycles per pixel; beyond, cells of the spectrum would be smaller than pixels of the figure
WAVES = 4e8  # products that a spectrum may take, about two seconds: beyond, it is of the first sets only


def figure_png(points: Floats, label: str, numbers: dict[str, Any]) -> bytes:
    """
    The figure of K sets of points (K, N, 2) as a PNG of WIDTH × HEIGHT pixels.

    label    how the sampler is called
    numbers  what ``analysis.summary`` says of the same points
    """
    count = points.shape[1]
    points = points[: numbers["sets"]]
    frequencies = min(ceil(REACH * sqrt(count)), MAX_FREQUENCY)
    affordable = max(1, int(WAVES / (2 * frequencies**2 * count)))
    power = power_spectrum(points[:affordable], frequencies)
    canvas = Canvas(WIDTH, HEIGHT)
    _headline(canvas, label, numbers)
    _points(canvas, points[0])
    _spectrum(canvas, power, count)
    _radial(canvas, radial(power), count, min(len(points), affordable))
    _distances(canvas, nearest_distances(points), count)
    return canvas.png()


def _headline(canvas: Canvas, label: str, numbers: dict[str, Any]) -> None:
    distance, void, discrepancy = (numbers[key] for key in ("min_distance", "coverage_radius", "l2_star"))
    canvas.text(LEFT, 46, label, 28)
    size = f"{numbers['points']} points, {numbers['sets']} set{'s' * (numbers['sets'] > 1)}"
    canvas.text(WIDTH - 30, 46, size, 20, FAINT, "rs")
    told = [
        f"minimum distance {distance['relative']:.3f} of the hexagonal bound",
        f"largest void {void['relative']:.2f} of the hexagonal one",
        *([f"L2 star discrepancy {discrepancy['relative']:.2f} of random"] if discrepancy else []),
        f"low-frequency power {numbers['low_frequency_power']:.3f}",
    ]
    canvas.text(LEFT, 78, "   ·   ".join(told), 15, FAINT)


def _points(canvas: Canvas, points: Floats) -> None:
    axes = Axes(canvas, (LEFT, TOP, LEFT + SIDE, TOP + SIDE), (0, 1), (0, 1))
    axes.heading("points", "the first set")
    axes.frame()
    count = len(points)
    order = VIRIDIS[:-1]  # without its last yellow, which is faint on white
    shades = colours(np.linspace(0, 1, count), order)
    radius = float(np.clip(0.2 * SIDE / sqrt(count), 0.8, 6))
    for (x, y), shade in zip(axes.places(points[:, 0], points[:, 1]), shades, strict=True):
        canvas.disc(x, y, radius, tuple(int(part) for part in shade))
    axes.scale(order, "1", "order of generation", f"{count}")


def _spectrum(canvas: Canvas, power: Floats, count: int) -> None:
    """Power as P / (1 + P): what random points have is the middle of the scale, and no peak is cut off."""
    frequencies = power.shape[0] // 2
    edge = frequencies + 0.5
    axes = Axes(canvas, (MIDDLE, TOP, MIDDLE + SIDE, TOP + SIDE), (-edge, edge), (-edge, edge))
    axes.heading("power spectrum", f"|kx|, |ky| to {frequencies} per pixel")
    shown = power / (1 + power)
    middle = slice(frequencies - 1, frequencies + 2)
    shown[frequencies, frequencies] = 0  # the number of points, not a property of theirs: as its neighbours are
    shown[frequencies, frequencies] = shown[middle, middle].sum() / 8
    canvas.picture(colours(shown[::-1], GREY), axes.box)
    axes.frame()
    if sqrt(count) <= frequencies:
        turn = np.linspace(0, 2 * np.pi, 361)
        canvas.line(axes.places(sqrt(count) * np.cos(turn), sqrt(count) * np.sin(turn)), RING, 1.5, dashed=True)
    axes.scale(GREY, "0", "power P / (1 + P); random: middle; ring: sqrt(N)", "1")


def _radial(canvas: Canvas, rings: Radial, count: int, sets: int) -> None:
    """Mean and anisotropy over the same frequencies, one below the other."""
    x = rings.radii / sqrt(count)
    reach = min(REACH, float(x[-1]))
    seen = x <= reach + 1e-9
    right = WIDTH - 30
    ticks = [value for value in (0, 0.5, 1, 1.5, 2, 2.5) if value <= reach] if reach >= 1 else [0, reach]

    high = 2.0 if np.nanmax(rings.mean) < 1.9 else 4.0
    mean = Axes(canvas, (RIGHT, TOP, right, TOP + SIDE), (0, reach), (0, high))
    mean.heading("radial mean power", "random 1")
    mean.ticks(ticks, np.linspace(0, high, 5).tolist(), "frequency |k| / sqrt(N)")
    mean.curve(np.array([0, reach]), np.ones(2), FAINT, 1.5, dashed=True)
    mean.curve(x[seen], rings.mean[seen], LINE, 2.5)
    mean.frame()

    white = 10 * log10(1 / sets)
    low = 10 * ((white - 5) // 10)
    anisotropy = Axes(canvas, (RIGHT, BOTTOM, right, BOTTOM + LOW), (0, reach), (low, 20))
    anisotropy.heading("anisotropy in dB", f"random {white:.0f}")
    anisotropy.ticks(ticks, np.arange(low, 21, 10).tolist(), "frequency |k| / sqrt(N)")
    anisotropy.curve(np.array([0, reach]), np.full(2, white), FAINT, 1.5, dashed=True)
    anisotropy.curve(x[seen], rings.anisotropy[seen], LINE, 2)
    anisotropy.frame()


def _distances(canvas: Canvas, distances: Floats, count: int) -> None:
    """Histogram of the distances of nearest neighbours; of random points they would be Rayleigh's."""
    bound = hexagonal_bound(count)
    edges = np.linspace(0, 1.5, 76)
    heights, _ = np.histogram(distances / bound, edges, density=True)
    middles = (edges[:-1] + edges[1:]) / 2
    scaled = 2 * np.pi * count * bound**2  # density of r / bound: 2πN r exp(−πN r²) bound, r = bound x
    random = scaled * middles * np.exp(-scaled / 2 * middles**2)
    high = 1.1 * max(float(heights.max()), float(random.max()))
    axes = Axes(canvas, (LEFT, BOTTOM, MIDDLE + SIDE, BOTTOM + LOW), (0, 1.5), (0, high))
    axes.heading("distance to the nearest neighbour", "all points of all sets")
    axes.ticks(np.arange(0, 1.51, 0.25).tolist(), [], "relative to the hexagonal bound")
    axes.bars(edges, heights, BAR)
    axes.curve(middles, random, FAINT, 1.5, dashed=True)
    axes.frame()
