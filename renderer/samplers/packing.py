"""
How far apart N points can be: bounds on the smallest distance of a point set on the unit torus.

All distances are between centres, on the torus of side 1, so 0 < distance ≤ 1. The catalog checks ``min_dist`` against
these bounds; nothing but ``math`` is needed. Figures: the hexagonal lattice is the densest packing (Tóth 1943); darts
thrown until none fits cover 0.547 of the area with discs of that diameter (Feder 1980; Torquato, Uche and Stillinger
2006), which leaves 0.6965/distance² points.
"""

from __future__ import annotations

import math

from renderer.errors import BadParameter, shown

MAX_POINTS = 65536  # of one set: it is a table that a user waits for
JAMMING = 0.8346  # √N × the distance at which N darts jam, on average: √0.6965
THROWABLE = 0.82  # √N × the largest distance that darts are thrown at: short of jamming by some standard deviations


def hexagonal_bound(n: int) -> float:
    """
    The largest distance that n points can have on the torus, √(2/(√3 n)), never above 1: a point meets its own copies.

    A bound: reached only in the limit, because a hexagonal lattice does not fit a square torus.
    """
    return min(1.0, math.sqrt(2 / (math.sqrt(3) * n)))


def jammed_distance(n: int) -> float:
    """The distance at which n darts, thrown until no more fit, are what fits on average: 0.8346/√n."""
    return JAMMING / math.sqrt(n)


def largest_min_dist(n: int) -> float:
    """
    The largest distance at which n uniform darts are sure to find room, 0.82/√n; 1 for a single point.

    Room for 1.036 n darts on average, with a standard deviation of 0.25 √n: a set that jams is thrown again.
    """
    return 1.0 if n == 1 else THROWABLE / math.sqrt(n)


def check_min_dist(n: int, min_dist: float, where: str) -> None:
    """
    ``BadParameter`` unless n uniform darts find room at ``min_dist``; it names the largest value that is accepted.

    ``where`` names the sampler or the place in a grid, as in ``sampler 'poissondisk' in grid.toml``.
    """
    if not 0 < min_dist <= largest_min_dist(n):
        largest = math.floor(largest_min_dist(n) * 10**4) / 10**4  # rounded down: what the sentence says is allowed
        points = "one point" if n == 1 else f"{n} darts"
        raise BadParameter(
            f"min_dist = {shown(min_dist)} of {where} is not feasible for {points} on the torus; give a number above 0 "
            f"and up to {largest:.4f}, ask for fewer samples, or leave min_dist out for a maximal set"
        )
