"""
Pictures as people see them in a browser: made smaller, tone-mapped, as PNG; and as float16 rows for the viewer.

Making smaller averages linear radiance, before the tone map, so that a thumbnail is as bright as its picture. What is
NaN or infinite is shown in magenta and never hidden. No Mitsuba here.
"""

from __future__ import annotations

import io
from typing import Any

import numpy as np
from numpy.typing import NDArray

from renderer.errors import BadParameter, UnknownName

TONES = ("srgb", "gamma22", "falsecolour")
LARGEST_HALF = 65504.0
MAX_EV = 20.0  # stops, either way
MAGENTA = (255, 0, 255)
# Inferno (Smith and van der Walt 2015), ten of its colours; what lies between two is interpolated.
INFERNO = ("000004", "1b0c41", "4a0c6b", "781c6d", "a52c60", "cf4446", "ed6925", "fb9b06", "f7d13d", "fcffa4")

Floats = NDArray[np.floating[Any]]
Bytes = NDArray[np.uint8]


def shrink(picture: Floats, side: int) -> Floats:
    """(H, W, C) made smaller, so that its longer side has at most ``side`` pixels; means of whole pixels."""
    height, width = picture.shape[:2]
    if max(height, width) <= side:
        return picture
    scale = side / max(height, width)
    rows, columns = (_edges(count, max(1, round(count * scale))) for count in (height, width))
    sums = np.add.reduceat(np.add.reduceat(picture.astype(np.float64), rows, axis=0), columns, axis=1)
    counts = np.diff(rows, append=height)[:, None] * np.diff(columns, append=width)[None, :]
    return np.asarray(sums / counts[:, :, None], np.promote_types(picture.dtype, np.float32))


def to_half(picture: Floats) -> NDArray[np.float16]:
    """float16, with what is too large for it at its largest value; NaN stays."""
    return np.clip(picture, -LARGEST_HALF, LARGEST_HALF).astype("<f2")


def preview_png(picture: Floats, *, ev: float = 0.0, tone: str = "srgb", maximum: float = 1.0) -> bytes:
    """
    A (H, W, 3) picture of linear radiance as an 8-bit PNG.

    ev       exposure in stops, −20 to 20: radiance × 2^ev
    tone     one of TONES; "falsecolour" shows luminance from 0 to ``maximum`` in inferno
    Raises ``UnknownName`` or ``BadParameter``.
    """
    if tone not in TONES:
        raise UnknownName("tone", tone, "", TONES)
    if not -MAX_EV <= ev <= MAX_EV:
        raise BadParameter(f"ev = {ev} is not allowed; give a number from {-MAX_EV:g} to {MAX_EV:g}")
    finite = np.isfinite(picture)
    exposed = np.where(finite, picture, 0.0).astype(np.float64) * 2.0**ev  # radiance of float32 times 2²⁰ fits
    if tone == "falsecolour":
        shown = _inferno(exposed @ np.array([0.2126, 0.7152, 0.0722]), maximum)
    else:
        light = np.clip(exposed, 0.0, 1.0)
        curve = np.where(light <= 0.0031308, 12.92 * light, 1.055 * light ** (1 / 2.4) - 0.055)
        shown = np.round((curve if tone == "srgb" else light ** (1 / 2.2)) * 255).astype(np.uint8)
    shown[~finite.all(axis=-1)] = MAGENTA
    return _png(shown)


def error_png(error: Floats, maximum: float) -> bytes:
    """An error map (H, W, 3), as a metric gives it: the mean of its channels from 0 to ``maximum`` in inferno."""
    mean = error.astype(np.float64).mean(axis=-1)
    finite = np.isfinite(mean)
    shown = _inferno(np.where(finite, mean, 0.0), maximum)
    shown[~finite] = MAGENTA
    return _png(shown)


def _edges(count: int, parts: int) -> NDArray[np.intp]:
    """Where each of ``parts`` runs of pixels begins."""
    return np.arange(parts) * count // parts


def _inferno(values: Floats, maximum: float) -> Bytes:
    """The colours of values from 0 to ``maximum``; all of them are finite. Raises ``BadParameter``."""
    if not (maximum > 0 and np.isfinite(maximum)):
        raise BadParameter(f"max = {maximum} is not allowed; give a positive number")
    colours = np.array([[int(text[i : i + 2], 16) for i in (0, 2, 4)] for text in INFERNO], float)
    place = np.clip(values, 0.0, maximum) / maximum * (len(colours) - 1)  # clipped first: no quotient is too large
    below = np.minimum(place.astype(int), len(colours) - 2)
    part = (place - below)[..., None]
    return np.asarray(np.round(colours[below] * (1 - part) + colours[below + 1] * part), np.uint8)


def _png(pixels: Bytes) -> bytes:
    from PIL import Image

    file = io.BytesIO()
    Image.fromarray(pixels).save(file, "PNG", compress_level=1)  # noise hardly shrinks: speed counts
    return file.getvalue()
