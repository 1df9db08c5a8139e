"""The Halton sampler: one Halton sequence over the whole picture, scrambled."""

from __future__ import annotations

from functools import cache, lru_cache
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np

from renderer.samplers.base import Lanes, PixelSampler
from renderer.samplers.bits import GOLDEN, below, mix, on_device, stir, unit

TILE = 128  # pixels a side of the square that one sequence serves; the next one is another scrambling of it
COLUMNS, ROWS = 2**7, 3**5  # the smallest powers of 2 and 3 that cut the square into single pixels
STRIDE = COLUMNS * ROWS  # from one sample of a pixel to its next, in the sequence
BASES = 512  # primes in the table; dimensions beyond use them again with other digits
MAX_SPP = 2**31 // STRIDE  # an index below 2^31 is divided exactly by one multiplication
PERMUTATIONS_SEED = 0x4A


class Halton(PixelSampler):
    """
    A Halton sequence over the picture: the first two dimensions place samples on the film, prime bases serve the rest.

    What it does: sample i of a pixel is the point of the sequence that falls into that pixel for the i-th time, found
    by the Chinese remainder theorem in tiles of 128 × 128 pixels. Dimension d is the radical inverse in the d-th prime,
    its digits permuted: by one random permutation a base, and by a random rotation for each node of the digit tree,
    which is Owen's scrambling with rotations. Every tile and seed has its own.

    When it wins: at counts that are no power of two it is level with Sobol' (within 10 % on edges at 100 and at 200
    samples), and it has no favourite counts at all, so a picture may stop anywhere.

    When it loses: at powers of two Sobol' is ahead, by far on smooth integrands. Late dimensions have large bases, and
    a pixel sees few of a base's digits: there it is about random. The slowest of ours: a division for each digit.

    Source: Halton 1960; film tiles and global index as in pbrt (Pharr, Jakob and Humphreys, "Physically Based
    Rendering", 8.3, HaltonSampler); random digit scrambling after Owen 1995. At most 69042 samples a pixel: the index
    has 31 bits.
    """

    def __init__(self, props: mi.Properties):
        super().__init__(props)
        self.digits: Any = None  # Digits, once it is prepared
        self.turn = 0, 1

    def prepare(self) -> None:
        if self.picture is None:
            raise RuntimeError(
                "halton needs the width of the picture, which mi.render does not tell a sampler: call "
                "sampler.frame(width, height, crop, spp_per_pass, first_sample) before seed(), or render with Dartboard"
            )
        if self.sample_count() > MAX_SPP:
            raise RuntimeError(f"halton counts with 31 bits: at most {MAX_SPP} samples per pixel; take sobol for more")
        if self.digits is None or self.digits.spp != self.sample_count():
            self.digits = digits(self.sample_count())

    def adopt(self, other: Any) -> None:
        self.digits, self.turn = other.digits, other.turn

    def stream(self, number: int, of: int) -> None:
        """Samplers of the same lanes take turns: two bases each, so that no base serves two dimensions of a path."""
        self.turn = number, of

    def fraction_1d(self, lanes: Lanes, dimension: Any) -> Any:
        return self._inverse(lanes, self._number(self.ones + self.twos * 2))

    def fraction_2d(self, lanes: Lanes, dimension: Any) -> tuple[Any, Any]:
        number = self.ones + self.twos * 2
        return self._inverse(lanes, self._number(number)), self._inverse(lanes, self._number(number + 1))

    def _number(self, number: Any) -> Any:
        """The base of this sampler's dimension ``number``."""
        turn, of = self.turn
        return number if of == 1 else ((number >> 1) * of + turn) * 2 + (number & 1)

    def _inverse(self, lanes: Lanes, number: Any) -> Any:
        """The scrambled radical inverse of each lane's index in the base of dimension ``number``."""
        tile = mix((lanes.x >> 7) * GOLDEN ^ mix((lanes.y >> 7) ^ self.base_seed))
        column, row = lanes.x & (TILE - 1), lanes.y & (TILE - 1)
        index = first_index(column, row) + lanes.index * STRIDE
        key = mix(tile + number * GOLDEN)
        film = number < 2
        # On the film the leading digits choose the pixel; those behind them are scrambled for each column and row.
        index = dr.select(number == 0, index // COLUMNS, dr.select(number == 1, index // ROWS, index))
        key = dr.select(film, mix(key ^ dr.select(number == 0, column, row) * GOLDEN), key)
        return self.digits.inverse(index, number, key)


class Digits:
    """
    What the digits of an index in prime bases need, on the device.

    bases         the primes
    magic, shift  q = mul_hi(n, magic) >> shift is n // base, exactly, for n < 2^31 (Granlund and Montgomery 1994)
    counts        digits that tell the samples of a pixel apart: STRIDE shares no factor with a base, so their indices
                  differ in the first digits that spp different numbers need (on the film after the pixel's own)
    starts        where the permutation of a base begins in ``permutations``
    """

    __slots__ = ("bases", "counts", "magic", "permutations", "shift", "spp", "starts")

    def __init__(self, spp: int):
        primes, permutations, starts = tables()
        bits = np.array([int(prime - 1).bit_length() for prime in primes])
        magic = [-(-(2 ** (31 + int(bit))) // int(prime)) for bit, prime in zip(bits, primes, strict=True)]
        counts = [digits_for(spp, int(prime)) for prime in primes]
        self.spp = spp
        self.bases, self.starts, self.permutations = on_device(primes), on_device(starts), on_device(permutations)
        self.magic, self.shift = on_device(np.array(magic, np.uint32)), on_device((bits - 1).astype(np.uint32))
        self.counts = on_device(np.array(counts, np.uint32))

    @dr.syntax  # type: ignore[untyped-decorator]
    def inverse(self, index: Any, number: Any, key: Any) -> Any:
        """The scrambled radical inverse of ``index`` in base number ``number``, as a 0.32 fixed-point fraction."""
        row = dr.select(number < BASES, number, 2 + (number - BASES) % (BASES - 2))
        base, magic = dr.gather(mi.UInt32, self.bases, row), dr.gather(mi.UInt32, self.magic, row)
        shift, start = dr.gather(mi.UInt32, self.shift, row), dr.gather(mi.UInt32, self.starts, row)
        left = dr.gather(mi.UInt32, self.counts, row)
        scale = dr.rcp(mi.Float(base))
        weight, value, node = mi.Float(1), mi.Float(0), mi.UInt32(key)
        while left > 0:
            left -= 1
            rest = dr.mul_hi(index, magic) >> shift
            digit = index - rest * base
            index = rest
            turned = dr.gather(mi.UInt32, self.permutations, start + digit) + below(node, base)
            turned = dr.select(turned >= base, turned - base, turned)
            weight *= scale
            value += mi.Float(turned) * weight
            node = stir(stir(node ^ (digit + 1) * GOLDEN))
        # Behind the last digit every sample of a pixel has a node of its own: the rest is a random number for each
        # index.
        value += unit(mix(node ^ index * GOLDEN)) * weight
        return mi.UInt32(dr.minimum(value, 1 - 2**-24) * 2.0**32)


@lru_cache(maxsize=8)
def digits(spp: int) -> Digits:
    """``Digits``, kept from one cell to the next."""
    return Digits(spp)


@cache
def tables() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The first primes, one random permutation of the digits of each, and where it begins; all uint32."""
    sieve = np.ones(3700, bool)
    sieve[:2] = False
    for number in range(2, 61):
        sieve[number * number :: number] &= not sieve[number]
    primes = np.flatnonzero(sieve)[:BASES].astype(np.uint32)
    random = np.random.default_rng(PERMUTATIONS_SEED)
    permutations = np.concatenate([random.permutation(int(prime)) for prime in primes]).astype(np.uint32)
    starts = np.concatenate([[0], np.cumsum(primes)[:-1]]).astype(np.uint32)
    return primes, permutations, starts


def digits_for(count: int, base: int) -> int:
    """How many digits tell 0 … count − 1 apart in a base."""
    digits, power = 1, base
    while power < count:
        digits, power = digits + 1, power * base
    return digits


def first_index(column: Any, row: Any) -> Any:
    """
    The first index of the sequence that falls into a pixel of the tile.

    It is the solution of index ≡ a (mod 2^7), index ≡ b (mod 3^5), where a and b are the reversed digits of column and
    row.
    """
    a = dr.brev(column) >> (32 - 7)
    b, rest = mi.UInt32(0), row * 1
    # Rows of a tile are 128 of 243 slots in base 3.
    for _ in range(5):
        third = dr.mul_hi(rest, mi.UInt32(0x55555556))
        b, rest = b * 3 + (rest - third * 3), third
    # 243 · inverse(243 mod 128) and 128 · inverse(128 mod 243), by Python's own modular inverse.
    left, right = ROWS * pow(ROWS, -1, COLUMNS), COLUMNS * pow(COLUMNS, -1, ROWS)
    return (a * left + b * right) % STRIDE
