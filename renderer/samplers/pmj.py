"""
Progressive multi-jittered (0,2) points with blue-noise properties: every power-of-two prefix is stratified in all
elementary intervals, and the points of a prefix keep away from each other. No Mitsuba here.

Which freedom there is (Christensen, Kensler & Kilpatrick 2018, "Progressive Multi-Jittered Sample Sequences"; Pharr
2019; Helmer, Christensen & Kensler 2021). Let the first N = 2^m points be a (0,2)-net. An interval of 2^-a × 2^-(m-a)
holds exactly one of them, in one of its halves; the point that comes to it in the next N must go into the other half.
Going through a = m/2 … m fixes one binary digit of x after the other, and a = m/2 … 0 those of y: once its cell is
known, a new point has *one* possible column and *one* possible row of width 1/(2N). Best-candidate search among the
positions that are left moves a point by 1/(2N) while its neighbours are 1/√N away, which soon is nothing.

The freedom that matters is in the digits *below* those, which bind the points that come later. Counting them shows
that they are Owen's nested scrambling, no more and no less: every sequence of this kind is a scrambled Sobol' sequence,
up to the order inside a doubling. So we choose the scrambling well instead of at random. Its digit number d is one flip
for each strip of width 2^-(d-1), which exchanges the halves of the strip with all points in them. Digit after digit we
start from random flips of all columns and rows, and flip each strip that lowers the repulsion between neighbouring
points, for all the prefixes of 4^k points (one to each of 2^k × 2^k cells) that this digit matters to. It is a descent
in integers, in lockstep over all sets and over strips too far apart to interact: O(N) a digit, the same on every
machine. Flips never undo a net, so the strata hold by construction.

Uniformity. If the descent preferred one half of a strip, single points would not be uniform (cells of 1/16 differ by up
to 25 %). So the repulsion is the mean over the four ways of flipping this digit in *all* columns and in *all* rows: the
descent then cannot tell these ways apart, the random start decides between them, and each digit of each point is 0 or 1
with probability 1/2 given all digits before it. That costs a quarter of the distance.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import NDArray

from renderer.errors import BadParameter, shown

DIGITS = 14  # binary digits of x and of y that the nets bind; those below are plain random
MAX_POINTS = 2**DIGITS
TUNED = 11  # digits whose flips are chosen; the finer ones move a point by less than 2^-11
FINEST = 6  # the largest k: 4^6 = 4096 points keep away from each other
REACH = 6  # digit d is chosen for the first 4^k points with k = d-1 … d-6: it moves them by 1/2 … 1/64 of a cell
SWEEPS = 2  # over all strips, per digit; more gain nothing
LOCKSTEP = 16  # sets that are tuned together: their arrays stay in the cache

Integers = NDArray[np.intp]

# To the 8 cells around one, (2, 8)
_STEPS: Integers = np.array([(x, y) for x in (-1, 0, 1) for y in (-1, 0, 1) if (x, y) != (0, 0)], np.intp).T


def pmj02bn(n: int, sets: int, seed: int) -> NDArray[np.uint32]:
    """
    ``sets`` independent sets of ``n`` points as 0.32 fixed-point numbers (value · 2^32), shape (sets, n, 2).

    Every prefix of 2^m points has one point in each elementary interval 2^-a × 2^-(m-a), as has every aligned block of
    2^m. Prefixes of 4^k points, up to 4096, keep farther apart on the torus than if scrambled at random: the smallest
    distance is 1.3 times as large for 16 points, 1.8 times for 256, 2.6 times for 1024. Each point is uniform over the
    seeds. Set number k depends on ``seed`` and k alone, and fewer points are a prefix of more.

    Raises ``BadParameter`` for n outside 1 … 16384, sets < 1 or a negative seed.
    """
    if not 1 <= n <= MAX_POINTS:
        raise BadParameter(f"n = {shown(n)} of pmj02bn is not allowed; give an integer from 1 to {MAX_POINTS}")
    if sets < 1:
        raise BadParameter(f"sets = {shown(sets)} of pmj02bn is not allowed; give an integer of at least 1")
    if seed < 0:
        raise BadParameter(f"seed = {shown(seed)} of pmj02bn is not allowed; give an integer of at least 0")
    points = np.empty((sets, n, 2), np.uint32)
    for first in range(0, sets, LOCKSTEP):
        numbers = range(first, min(first + LOCKSTEP, sets))
        noise = np.stack([_noise(seed, number, MAX_POINTS) for number in numbers])
        below = noise[:, :n] >> np.uint32(DIGITS)
        for axis, strips in enumerate(scrambling(noise, DIGITS)):
            top = strips[:, _sobol()[axis][:n]].astype(np.uint32)
            points[first : numbers.stop, :, axis] = top << np.uint32(32 - DIGITS) | below[..., axis]
    return points


def scrambling(noise: NDArray[np.uint32], digits: int) -> tuple[Integers, Integers]:
    """
    Well-chosen scramblings of x and of y, each (K, 2^digits): where Sobol' strip s of width 2^-digits goes.

    noise  (K, at least 2^digits, 2) random bits; their lowest bits are the flips that the descent starts from
    """
    strips = [np.zeros((len(noise), 1), np.intp) for _ in range(2)]
    for digit in range(1, digits + 1):
        half = 2 ** (digit - 1)
        flips = (noise[:, half : 2 * half] & 1).astype(np.intp)  # half + s numbers the nodes of a binary tree
        halves = [_halve(strips[axis], flips[..., axis]) for axis in range(2)]
        if digit <= TUNED:
            chosen = _choose(halves, digit)
            halves = [_halve(strips[axis], flips[..., axis] ^ chosen[axis]) for axis in range(2)]
        strips = halves
    return strips[0], strips[1]


def _noise(seed: int, number: int, size: int) -> NDArray[np.uint32]:
    """The random bits of one set, (size, 2)."""
    return np.random.default_rng([seed, number]).integers(0, 2**32, (size, 2), np.uint32)


def _halve(strips: Integers, flips: Integers) -> Integers:
    """One digit more: the halves of each strip, exchanged where its flip is set. Flips count strips as they lie."""
    left = 2 * strips + np.take_along_axis(flips, strips, axis=1)
    return np.stack([left, left ^ 1], axis=2).reshape(len(strips), -1)


@cache
def _sobol() -> tuple[Integers, Integers]:
    """
    The Sobol' (0,2)-sequence, DIGITS binary digits of x and of y as integers, each (MAX_POINTS,).

    x mirrors the digits of the index; y mirrors those of its product with Pascal's triangle modulo 2.
    """
    index = np.arange(MAX_POINTS)
    pascal = index.copy()
    for shift, mask in ((1, 0xAAAA), (2, 0xCCCC), (4, 0xF0F0), (8, 0xFF00)):
        pascal ^= (pascal & mask) >> shift
    return _mirrored(index), _mirrored(pascal)


def _mirrored(digits: Integers) -> Integers:
    """The first binary digit becomes the last of DIGITS."""
    ones = digits[:, None] >> np.arange(DIGITS) & 1
    return ones @ (1 << np.arange(DIGITS)[::-1])


def _choose(halves: list[Integers], digit: int) -> list[Integers]:
    """Which strips of width 2^-(digit-1) to flip, of x and of y, each (K, 2^(digit-1)) of 0 and 1."""
    strips = 2 ** (digit - 1)
    chosen = [np.zeros((len(halves[0]), strips), np.intp) for _ in range(2)]
    coarsest = max(digit - REACH, digit // 2, 1)  # from 4^(digit//2) points on there is one in each strip
    grids = [_Grid(halves, digit, k) for k in range(coarsest, min(digit - 1, FINEST) + 1)]
    if not grids:
        return chosen
    apart = min(2 * grids[0].parts, strips)  # strips two cells of the coarsest grid apart do not interact
    for _ in range(SWEEPS):
        for axis in range(2):
            for first in range(apart):
                offers = [grid.offer(axis, slice(first, None, apart)) for grid in grids]
                gain = np.sum([offer.change for offer in offers], axis=0) < 0
                for grid, offer in zip(grids, offers, strict=True):
                    grid.take(offer, gain)
                chosen[axis][:, first::apart] ^= gain
    return chosen


@dataclass(frozen=True)
class _Offer:
    """What it would do to a grid to flip some of the strips, each alone."""

    cells: Integers  # (K, C, M) where the M points of C strips lie
    codes: Integers  # (K, C, M) their codes after the flip
    change: Integers  # (K, C) of the repulsion


class _Grid:
    """
    The first N = 4^k points in their n × n cells, n = 2^k, known to ``digit`` digits.

    parts  strips of width 2^-(digit-1) in a cell: 1, 2, … 2^(REACH-1)
    codes  (K · N,) x · side + y by cell. A place x or y is 3 · strip + half, counted from the edge of the cell, so that
           the difference of two codes, as an index into the table of repulsions, tells strips and halves apart
    cells  for each axis, (K, strips, M): the cells of the points of each strip, M = N / strips of them
    """

    def __init__(self, halves: list[Integers], digit: int, k: int):
        sets, strips = len(halves[0]), 2 ** (digit - 1)
        self.n, self.parts = 2**k, 2 ** (digit - 1 - k)
        self.side = 12 * self.parts + 1
        sobol = [axis[: self.n**2] >> (DIGITS - digit) for axis in _sobol()]
        x, y = (halves[axis][:, sobol[axis]] for axis in range(2))
        cell = 2 * self.parts
        cells = (np.arange(sets)[:, None] * self.n + x // cell) * self.n + y // cell
        self.codes = np.empty(cells.size, np.intp)
        self.codes[cells] = _place(x % cell) * self.side + _place(y % cell)
        self.cells = []
        for axis in range(2):
            members = np.argsort(sobol[axis] >> 1, kind="stable").reshape(strips, -1)  # of Sobol' strips
            lying = np.argsort(halves[axis][:, ::2] >> 1, axis=1)  # which Sobol' strip lies in each place
            self.cells.append(cells[np.arange(sets)[:, None, None], members[lying]])

    def offer(self, axis: int, strips: slice) -> _Offer:
        """Flip these strips of an axis. None may be the neighbour of another."""
        cells = self.cells[axis][:, strips]
        near = self.around(cells)
        codes = self.codes[cells]
        place = codes // self.side if axis == 0 else codes % self.side
        flipped = codes + (1 - 2 * (place % 3)) * (self.side if axis == 0 else 1)
        before = self.repulsion(near, codes)
        self.codes[cells] = flipped
        change = self.repulsion(near, flipped) - before
        self.codes[cells] = codes
        return _Offer(cells, flipped, change)

    def take(self, offer: _Offer, gain: NDArray[np.bool_]) -> None:
        """Flip the offered strips for which ``gain`` (K, C) is set."""
        self.codes[offer.cells] = np.where(gain[..., None], offer.codes, self.codes[offer.cells])

    def around(self, cells: Integers) -> Integers:
        """The 8 cells around each cell, on the torus: (8, …)."""
        first, column, row = cells & -(self.n**2), cells // self.n, cells
        steps = _STEPS.reshape(2, 8, *[1] * cells.ndim)
        return first + (column + steps[0] & self.n - 1) * self.n + (row + steps[1] & self.n - 1)

    def repulsion(self, near: Integers, codes: Integers) -> Integers:
        """Between points with ``codes`` (K, C, M) and those in the cells ``near`` them, summed per strip: (K, C)."""
        table = _repulsion(self.parts)
        away = 3 * self.parts * (_STEPS[0] * self.side + _STEPS[1]) + len(table) // 2
        between = self.codes[near] - codes + away.reshape(8, 1, 1, 1)
        return np.asarray(table[between].sum(axis=(0, 3)))


def _place(halves: Integers) -> Integers:
    """Half-strips counted from the edge of a cell → the place in a code."""
    return 3 * (halves // 2) + halves % 2


@cache
def _repulsion(parts: int) -> Integers:
    """
    Repulsion of two points by the difference of their codes, (side²,) integers.

    It is d^-6, with d in cells and at least 1/16, times parts^3: what is a fine digit to few points is the last that
    can still part them, while the many points to which it is a coarse one have other digits to come. A difference
    tells how many strips apart two points are and whether their halves differ; the mean is over both ways to flip all.
    """
    places = np.arange(-6 * parts, 6 * parts + 1)
    halves = (places + 1) % 3 - 1
    strips = (places - halves) // 3
    ways = [4 * strips + 2 * halves, 4 * strips - 2 * halves]  # in quarters of a strip
    total = np.zeros((places.size, places.size), np.intp)
    for x, y in itertools.product(ways, repeat=2):
        squared = np.maximum(x[:, None] ** 2 + y**2, max(parts**2 // 16, 1))
        total += 2**14 * (4 * parts) ** 6 // squared**3 * parts**3
    return total.ravel()
