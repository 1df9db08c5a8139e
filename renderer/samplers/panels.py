"""
Plots with Pillow alone: a ``Canvas`` to draw on, and ``Axes``, a rectangle of it with scales.

Enough for one printed figure, and no more: matplotlib is no dependency of the core. All coordinates are in pixels of
the finished picture, from the top left; everything is drawn SCALE times as large and made smaller at the end, which
smooths it. Texts keep to ASCII and the middle dot: Pillow's own font, the same on every machine, has little else.
"""

from __future__ import annotations

import io
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont

SCALE = 2
INK, FAINT, RULE = "#1a1a1a", "#6b6b6b", "#d9d9d9"  # text and frames, second text, grid lines
DASH = 6.0  # pixels on, and as many off

Floats = NDArray[np.float64]
Bytes = NDArray[np.uint8]
Box = tuple[float, float, float, float]  # left, top, right, bottom

# Viridis (van der Walt and Smith 2015), nine of its colours; what lies between two is interpolated.
VIRIDIS = ("440154", "472d7b", "3b528b", "2c728e", "21918c", "28ae80", "5ec962", "addc30", "fde725")
GREY = ("000000", "ffffff")
RING, LINE, BAR = "#e6550d", "#2c728e", "#7fb3c8"  # what is marked, what is measured, and what it fills


def colours(values: Floats, stops: Sequence[str]) -> Bytes:
    """Values from 0 to 1 as colours (…, 3) of a map, given by stops at equal distances."""
    table = np.array([[int(text[i : i + 2], 16) for i in (0, 2, 4)] for text in stops], float)
    place = np.clip(values, 0, 1) * (len(table) - 1)
    below = np.minimum(place.astype(int), len(table) - 2)
    part = (place - below)[..., None]
    return np.asarray(np.round(table[below] * (1 - part) + table[below + 1] * part), np.uint8)


class Canvas:
    """A white picture of width × height pixels."""

    def __init__(self, width: int, height: int):
        self.size = width, height
        self.image = Image.new("RGB", (width * SCALE, height * SCALE), "white")
        self.draw = ImageDraw.Draw(self.image)

    def text(self, x: float, y: float, text: str, size: float = 14, colour: str = INK, anchor: str = "ls") -> None:
        """``anchor``: as Pillow has it; "ls" puts the left end of the base line at (x, y)."""
        self.draw.text((x * SCALE, y * SCALE), text, fill=colour, font=_font(size), anchor=anchor)

    def line(self, places: Floats, colour: str = INK, width: float = 1, dashed: bool = False) -> None:
        """Through places (n, 2)."""
        for piece in _dashes(places) if dashed else [places]:
            self.draw.line([tuple(p) for p in piece * SCALE], colour, round(width * SCALE), joint="curve")

    def disc(self, x: float, y: float, radius: float, fill: tuple[int, ...]) -> None:
        box = [value * SCALE for value in (x - radius, y - radius, x + radius, y + radius)]
        self.draw.ellipse(box, fill)

    def rectangle(self, box: Box, fill: str | None = None, outline: str | None = None, width: float = 1) -> None:
        self.draw.rectangle([value * SCALE for value in box], fill, outline, round(width * SCALE))

    def picture(self, pixels: Bytes, box: Box) -> None:
        """(h, w, 3) stretched over a box, each of them a sharp rectangle."""
        left, top, right, bottom = (round(value * SCALE) for value in box)
        large = Image.fromarray(pixels).resize((right - left, bottom - top), Image.Resampling.NEAREST)
        self.image.paste(large, (left, top))

    def png(self) -> bytes:
        """The finished picture, with a palette: a quarter of the size, and nobody sees a difference."""
        small = self.image.resize(self.size, Image.Resampling.LANCZOS)
        file = io.BytesIO()
        small.quantize(palette=_palette(), dither=Image.Dither.NONE).save(file, "PNG", optimize=True)
        return file.getvalue()


@dataclass(frozen=True)
class Axes:
    """A rectangle of a canvas with scales: x runs from left to right, y from bottom to top."""

    canvas: Canvas
    box: Box
    x: tuple[float, float]
    y: tuple[float, float]

    def places(self, x: Floats, y: Floats) -> Floats:
        """Data → pixels, (n, 2)."""
        left, top, right, bottom = self.box
        across = left + (np.asarray(x) - self.x[0]) / (self.x[1] - self.x[0]) * (right - left)
        up = bottom - (np.asarray(y) - self.y[0]) / (self.y[1] - self.y[0]) * (bottom - top)
        return np.stack(np.broadcast_arrays(across, up), axis=-1)

    def heading(self, title: str, rest: str = "") -> None:
        """Over the rectangle: what it shows, and in what unit."""
        left, top, right, _ = self.box
        self.canvas.text(left, top - 12, title, 16)
        self.canvas.text(right, top - 12, rest, 13, FAINT, "rs")

    def ticks(self, x: Sequence[float], y: Sequence[float], x_label: str = "", grid: bool = True) -> None:
        """Numbers along the axes, with faint lines across the rectangle; ``x_label`` below them."""
        left, top, right, bottom = self.box
        for value in x:
            ((at, _),) = self.places(np.array([value]), np.array([self.y[0]]))
            if grid:
                self.canvas.line(np.array([[at, top], [at, bottom]]), RULE)
            self.canvas.text(at, bottom + 8, f"{value:g}", 13, FAINT, "mt")
        for value in y:
            ((_, at),) = self.places(np.array([self.x[0]]), np.array([value]))
            if grid:
                self.canvas.line(np.array([[left, at], [right, at]]), RULE)
            self.canvas.text(left - 8, at, f"{value:g}", 13, FAINT, "rm")
        self.canvas.text((left + right) / 2, bottom + 26, x_label, 13, FAINT, "mt")

    def frame(self) -> None:
        self.canvas.rectangle(self.box, outline=INK)

    def curve(self, x: Floats, y: Floats, colour: str = INK, width: float = 1.5, dashed: bool = False) -> None:
        """A line through data, at the edge where it leaves the scale, with gaps where y is NaN."""
        known = np.isfinite(y)
        for run in np.split(np.arange(len(y)), np.flatnonzero(np.diff(known)) + 1):
            if len(run) > 1 and known[run[0]]:
                inside = np.clip(y[run], *self.y)
                self.canvas.line(self.places(x[run], inside), colour, width, dashed)

    def bars(self, edges: Floats, heights: Floats, fill: str) -> None:
        """A histogram: n + 1 edges, n heights."""
        feet = self.places(edges[:-1], np.zeros(len(heights)))
        heads = self.places(edges[1:], np.minimum(heights, self.y[1]))
        for (left, bottom), (right, top), height in zip(feet, heads, heights, strict=True):
            if height > 0:
                self.canvas.rectangle((left, top, right - 1, bottom), fill)

    def scale(self, stops: Sequence[str], low: str, middle: str, high: str) -> None:
        """The colour map as a bar below the rectangle, with words at both ends and in the middle."""
        left, _, right, bottom = self.box
        self.canvas.picture(colours(np.linspace(0, 1, 256)[None], stops), (left, bottom + 14, right, bottom + 22))
        for at, text, anchor in ((left, low, "lt"), ((left + right) / 2, middle, "mt"), (right, high, "rt")):
            self.canvas.text(at, bottom + 28, text, 13, FAINT, anchor)


@cache
def _palette() -> Image.Image:
    """256 colours: greys, the colour map in full and half faded, and the marks as they fade at their edges."""
    marks = np.array([[int(text[i : i + 2], 16) for i in (1, 3, 5)] for text in (RING, LINE, BAR)])
    full = colours(np.linspace(0, 1, 100), VIRIDIS).astype(int)
    half = [255 - (255 - colour) // 2 for colour in full[::2]]
    faded = [255 - (255 - colour) * share // 6 for share in range(1, 7) for colour in marks]
    # Pillow compares in steps of 4: more greys would not be told apart, and one near white would take white's place.
    greys = colours(np.append(np.linspace(0, 0.96, 62), 1), GREY)
    palette = Image.new("P", (1, 1))
    palette.putpalette([int(part) for colour in [*greys, *full, *half, *faded] for part in colour])
    return palette


@cache
def _font(size: float) -> ImageFont.FreeTypeFont | ImageFont.ImageFont:
    return ImageFont.load_default(size * SCALE)


def _dashes(places: Floats) -> list[Floats]:
    """A line cut into dashes of equal length along it."""
    along = np.concatenate([[0], np.cumsum(np.hypot(*np.diff(places, axis=0).T))])
    starts = np.arange(0, along[-1], 2 * DASH)
    pieces = []
    for start in starts:
        within = along[(along > start) & (along < start + DASH)]
        at = np.concatenate([[start], within, [min(start + DASH, along[-1])]])
        pieces.append(np.stack([np.interp(at, along, places[:, axis]) for axis in (0, 1)], axis=-1))
    return pieces
