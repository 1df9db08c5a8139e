"""
Pictures that a pbrt file names: whether they are pictures, and their pixels for textures that have to be computed.

8-bit ones by Pillow, OpenEXR by our own reader. Both raise a dozen kinds of errors for what is no picture; each is the
same sentence here.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from renderer.errors import SceneError, shown
from renderer.scenes.pbrt.lexer import Place

PIXELS_MAX = 2**26
EIGHT_BIT = ("PNG", "JPEG", "TGA", "BMP")  # Pillow's names
STARTS = {".hdr": (b"#?",), ".rgbe": (b"#?",), ".pfm": (b"PF", b"Pf")}  # of files that Mitsuba alone reads


def check(path: Path, place: Place) -> None:
    """Raises ``SceneError`` for a file that is not what its name says, or is damaged as far as a look can tell."""
    suffix = path.suffix.lower()
    with _explained(path, place):
        if suffix == ".exr":
            from renderer.images import read_header

            read_header(path)
        elif suffix in STARTS:
            with path.open("rb") as file:
                if file.read(2) not in STARTS[suffix]:
                    raise ValueError
        else:
            from PIL import Image

            with Image.open(path, formats=EIGHT_BIT) as image:
                _check_size(image.width * image.height, path, place)
                image.verify()


def read(path: Path, srgb: bool, place: Place) -> NDArray[np.float64]:
    """
    (H, W, 3) linear, the first row on top; ``srgb``: 8-bit values are made linear. Raises ``SceneError`` for what is
    neither 8-bit nor OpenEXR.
    """
    with _explained(path, place):
        if path.suffix.lower() == ".exr":
            from renderer.images import read_picture

            return read_picture(path).astype(np.float64)
        from PIL import Image

        with Image.open(path, formats=EIGHT_BIT) as image:
            _check_size(image.width * image.height, path, place)
            pixels = np.asarray(image.convert("RGB"), np.float64) / 255
    return np.where(pixels <= 0.04045, pixels / 12.92, ((pixels + 0.055) / 1.055) ** 2.4) if srgb else pixels


def _check_size(pixels: int, path: Path, place: Place) -> None:
    if pixels > PIXELS_MAX:
        raise SceneError(f"{place}: the picture {shown(path.name)} has more than {PIXELS_MAX} pixels")


@contextmanager
def _explained(path: Path, place: Place) -> Iterator[None]:
    try:
        yield
    except SceneError:
        raise
    except Exception:
        raise SceneError(
            f"{place}: the picture {shown(path.name)} cannot be read here; make it a PNG or OpenEXR file"
        ) from None
