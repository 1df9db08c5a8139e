"""
Many discrete distributions over the same lamps, as one flat table.

A row is a running sum of probabilities in units of 2⁻²³, the step of the random numbers that most samplers give. The
probability of a lamp *is* the difference of two neighbours, so what ``pick`` reports is how often it picks, to the
last bit, rows sum to 1 exactly, and no lamp has less than one unit. Half the memory of a table of both.
"""

from __future__ import annotations

from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from renderer.errors import SceneError
from renderer.lightsamplers.base import ONE_BELOW
from renderer.samplers.bits import floats_on_device

UNITS = 2**23


class Rows:
    """
    ``columns`` lamps a row. The table has columns + 1 entries a row, from 0 to 1, as ``running_sums`` makes them.

    Not a Dr.Jit structure, so that loops leave it alone.
    """

    __slots__ = ("columns", "sums")

    def __init__(self, sums: NDArray[np.float32]):
        self.columns = sums.shape[1] - 1
        self.sums = floats_on_device(sums)

    def pick(self, row: Any, u: Any, active: Any = True) -> tuple[Any, Any, Any]:
        """The lamp of ``row`` whose interval holds ``u`` → (number, probability, u stretched to [0, 1) again)."""
        first = row * (self.columns + 1)
        # The last entry that is not above u; it has a successor, as u is below 1.
        found = dr.binary_search(
            0, self.columns - 1, lambda i: dr.gather(mi.Float, self.sums, first + i + 1, active) <= u
        )
        index = dr.minimum(found, self.columns - 1)
        low = dr.gather(mi.Float, self.sums, first + index, active)
        pmf = dr.gather(mi.Float, self.sums, first + index + 1, active) - low
        return index, pmf, dr.clip((u - low) / pmf, 0, ONE_BELOW)

    def pmf(self, row: Any, index: Any, active: Any = True) -> Any:
        """The probability of lamp ``index`` in ``row``."""
        at = row * (self.columns + 1) + index
        return dr.gather(mi.Float, self.sums, at + 1, active) - dr.gather(mi.Float, self.sums, at, active)


def running_sums(weights: NDArray[np.floating[Any]]) -> NDArray[np.float32]:
    """
    The table of ``weights``, shape (rows, columns): finite, ≥ 0, in any unit; a row of zeros becomes uniform.

    Multiples of 2⁻²³ that grow from 0 to 1 along each row, shape (rows, columns + 1). Raises ``SceneError`` above 2²²
    columns.
    """
    rows, columns = weights.shape
    if columns > UNITS // 2:
        raise SceneError(f"the scene has {columns} lamps; lamps are picked among at most {UNITS // 2}")
    sums = np.zeros((rows, columns + 1))
    np.cumsum(weights, axis=1, out=sums[:, 1:], dtype=np.float64)
    total = sums[:, -1:].copy()
    ranks = np.arange(columns + 1)
    np.divide(sums, total, out=sums, where=total > 0)
    sums = np.where(total > 0, sums, ranks / columns)
    return ((ranks + np.floor((UNITS - columns) * sums)) / UNITS).astype(np.float32)
