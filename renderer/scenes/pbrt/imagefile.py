"""Pictures as arrays, for textures that have to be computed: (H, W, 3) linear, the first row on top."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from renderer.errors import DartboardError, SceneError, shown
from renderer.scenes.pbrt.lexer import Place

PIXELS_MAX = 2**26


def read(path: Path, srgb: bool, place: Place) -> NDArray[np.float64]:
    """8-bit pictures by Pillow (``srgb``: made linear), and OpenEXR. Raises ``SceneError`` for others."""
    try:
        if path.suffix.lower() == ".exr":
            from renderer.images import read_picture

            return read_picture(path).astype(np.float64)
        from PIL import Image

        with Image.open(path, formats=("PNG", "JPEG", "TGA", "BMP")) as image:
            if image.width * image.height > PIXELS_MAX:
                raise SceneError(f"{place}: the picture {shown(path.name)} has more than {PIXELS_MAX} pixels")
            pixels = np.asarray(image.convert("RGB"), np.float64) / 255
    except (OSError, ValueError, SyntaxError, DartboardError) as error:
        if isinstance(error, SceneError):
            raise
        raise SceneError(
            f"{place}: the picture {shown(path.name)} cannot be read here; make it a PNG or OpenEXR file"
        ) from None
    return np.where(pixels <= 0.04045, pixels / 12.92, ((pixels + 0.055) / 1.055) ** 2.4) if srgb else pixels
