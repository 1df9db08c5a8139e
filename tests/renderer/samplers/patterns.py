"""Point sets whose properties are known, (K, N, 2): tests measure the measures with them."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


def jittered(rng: np.random.Generator, sets: int, side: int) -> Floats:
    """One uniform point in each cell of a side × side grid."""
    cells = np.stack(np.meshgrid(np.arange(side), np.arange(side)), axis=-1).reshape(-1, 2)
    return (cells + rng.random((sets, side * side, 2))) / side


def square_lattice(side: int) -> Floats:
    """The middles of a side × side grid."""
    axis = (np.arange(side) + 0.5) / side
    return np.stack(np.meshgrid(axis, axis), axis=-1).reshape(1, -1, 2)


def hammersley(power: int) -> Floats:
    """(i / N, radical inverse of i in base 2): a (0, m, 2)-net of N = 2^m points."""
    count = 2**power
    inverse = np.array([int(f"{i:0{power}b}"[::-1], 2) if power else 0 for i in range(count)])
    return np.stack([np.arange(count), inverse], axis=-1)[None] / count
