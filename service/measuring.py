"""Two picture files → every metric between them: ``dartboard measure``."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

from renderer import metrics
from renderer.errors import BadParameter
from renderer.images import read_picture


def measure_files(image: Path, reference: Path) -> dict[str, Any]:
    """
    Metrics of one EXR picture against another, with formulas; values that are not finite are None.

    Raises ``DartboardError`` for unreadable files and for sizes that differ: nothing is resized in silence.
    """
    picture, other = read_picture(image), read_picture(reference)
    if picture.shape != other.shape:
        raise BadParameter(
            f"cannot measure {image}: it is {metrics.shape(picture)}, {reference} is {metrics.shape(other)}; "
            f"give two pictures of one size"
        )
    values = metrics.measure(picture, metrics.Reference(other))
    return {
        "image": str(image),
        "reference": str(reference),
        "width": picture.shape[1],
        "height": picture.shape[0],
        "nonfinite_pixels": {"image": metrics.nonfinite(picture), "reference": metrics.nonfinite(other)},
        "metrics": {
            name: {
                "value": value if math.isfinite(value) else None,
                "formula": metrics.METRICS[name].formula,
                "epsilon": metrics.METRICS[name].epsilon,
                "version": metrics.METRICS[name].version,
                "lower_is_better": metrics.METRICS[name].lower_is_better,
            }
            for name, value in values.items()
        },
    }
