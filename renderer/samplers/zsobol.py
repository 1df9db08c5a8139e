"""The Z-Sobol' sampler: one Sobol' sequence over the whole picture, dealt out along a shuffled Morton curve."""

from __future__ import annotations

from typing import Any

import drjit as dr
import mitsuba as mi

from renderer.samplers.base import Lanes, PixelSampler
from renderer.samplers.bits import GOLDEN, mix, stir
from renderer.samplers.sobol import scrambled_sobol

# Every order of four quadrants is linear in the two bits of the quadrant, then a flip of both, either or none: 6
# invertible matrices times 4. A matrix is a byte here, two bits for each quadrant's image; two of the 6 stand twice
# among the 8.
MATRICES = (0xE4, 0xD8, 0xB4, 0x9C, 0x78, 0x6C, 0xE4, 0xD8)
LOWER, UPPER = (sum(byte << 8 * k for k, byte in enumerate(MATRICES[part : part + 4])) for part in (0, 4))


class ZSobol(PixelSampler):
    """
    Owen-scrambled Sobol' points handed out so that neighbouring pixels share a net: the error looks like blue noise.

    What it does: pixels follow a Morton curve; a pixel's samples are an aligned block of one Sobol' sequence, and so
    are those of every aligned square of 2^k × 2^k pixels. For each dimension the curve is shuffled anew: the four
    quadrants of each square, down to the samples of a pixel, are visited in one of 24 orders that a hash of the
    quadrants above it decides. Errors of neighbouring pixels are then of opposite sign more often than not.

    When it wins: at a few samples a pixel, seen by eye or measured after a blur; and a little in MSE against padded
    Sobol', as a block is a net of its own.

    When it loses: spp that are no power of two take part of a block, and lose what makes it a net. MSE does not see the
    blue noise: measure a blurred picture. It needs to know the width of the picture, so it works in Dartboard's pass
    loop only.

    Source: Ahmed and Wonka 2020, "Screen-Space Blue-Noise Diffusion of Monte Carlo Sampling Error via Hierarchical
    Ordering of Pixels"; in the form of pbrt-v4's ZSobolSampler, with the samples of a pixel rounded up, not down, to a
    power of two.
    """

    def __init__(self, props: mi.Properties):
        super().__init__(props)
        self.curve: Any = None  # a Curve, once it is prepared

    def prepare(self) -> None:
        picture = self.picture
        if picture is None:
            raise RuntimeError(
                "zsobol needs the width of the picture, which mi.render does not tell a sampler: call "
                "sampler.frame(width, height, crop, spp_per_pass, first_sample) before seed(), or render with Dartboard"
            )
        size = (max(picture.width, picture.height), self.sample_count())
        if self.curve is None or self.curve.size != size:
            self.curve = Curve(*size)

    def adopt(self, other: Any) -> None:
        self.curve = other.curve

    def fraction_1d(self, lanes: Lanes, dimension: Any) -> Any:
        index, key = self._place(lanes, dimension * 2 + 1)
        return scrambled_sobol(index, stir(key), key)[0]

    def fraction_2d(self, lanes: Lanes, dimension: Any) -> tuple[Any, Any]:
        index, key = self._place(lanes, dimension * 2)
        return scrambled_sobol(index, stir(key), mix(key ^ 0x5BD1E995))

    def _place(self, lanes: Lanes, dimension: Any) -> tuple[Any, Any]:
        """The index of each lane in the sequence of this dimension, and the key of that sequence."""
        curve = self.curve
        side = curve.side_bits
        tile = mix((lanes.x >> side) * GOLDEN ^ mix((lanes.y >> side) ^ self.base_seed))
        key = mix(tile + dimension * GOLDEN)
        inside = (dr.opaque(mi.UInt32, 1) << side) - 1
        code = morton(lanes.x & inside, lanes.y & inside) << curve.sample_bits | lanes.index
        return curve.shuffled(code, key), key


class Curve:
    """
    How the picture is cut: squares of 2^side_bits pixels a side, 2^sample_bits samples a pixel, 32 bits together.

    A picture that needs more bits is several squares, each with a sequence of its own.
    """

    __slots__ = ("odd", "pairs", "sample_bits", "side_bits", "size")

    def __init__(self, side: int, spp: int):
        samples = (spp - 1).bit_length()
        bits = min((side - 1).bit_length(), (32 - samples) // 2)
        self.size = (side, spp)
        self.side_bits, self.sample_bits = dr.opaque(mi.UInt32, bits), dr.opaque(mi.UInt32, samples)
        self.odd = dr.opaque(mi.UInt32, samples & 1)
        self.pairs = dr.opaque(mi.UInt32, (bits + samples // 2 + 1) // 2)

    @dr.syntax  # type: ignore[untyped-decorator]
    def shuffled(self, code: Any, key: Any) -> Any:
        """
        ``code`` with its digits of base 4 permuted from the top down, and a last one of base 2 if the bits are odd.

        Two digits take one hash of those above them: 5 bits for the first, and 5 of their own for each second one.
        """
        left = self.pairs + mi.UInt32(0)
        out = mi.UInt32(0)
        while left > 0:
            left -= 1
            digits = code >> (left * 4 + self.odd)
            bits = (digits >> 4) ^ key
            bits = stir(bits * 0x7FEB352D)
            bits = bits ^ (bits >> 15)
            first = (digits >> 2) & 3
            out = out << 4 | permuted(first, bits >> 27) << 2 | permuted(digits & 3, bits >> (first * 5))
        last = (code ^ (mix((code >> 1) ^ key) >> 31)) & 1
        return dr.select(self.odd != 0, out << 1 | last, out)


def permuted(digit: Any, bits: Any) -> Any:
    """One of the 24 orders of four digits: 3 bits choose the matrix, 2 the flips."""
    matrices = dr.select((bits & 4) != 0, mi.UInt32(UPPER), mi.UInt32(LOWER))
    return ((matrices >> (((bits & 3) << 3) + (digit << 1))) ^ (bits >> 3)) & 3


def morton(x: Any, y: Any) -> Any:
    """The bits of x and y, at most 16 each, interleaved."""
    return spread(x) | spread(y) << 1


def spread(value: Any) -> Any:
    """A zero between any two of the lower 16 bits."""
    value = (value ^ (value << 8)) & 0x00FF00FF
    value = (value ^ (value << 4)) & 0x0F0F0F0F
    value = (value ^ (value << 2)) & 0x33333333
    return (value ^ (value << 1)) & 0x55555555
