"""
Random bits on the device: integer hashes and Owen scrambling for samplers that draw a whole wavefront at once.

Every function takes and returns Dr.Jit ``UInt32`` arrays (one value a lane) and is pure: the same lane, the same
number. A coordinate is a 0.32 fixed-point fraction until ``unit`` makes it a float: then a toroidal shift is an
addition that wraps round, a reflection is a complement, and nothing ever rounds up to 1.
"""

from __future__ import annotations

from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

GOLDEN = 0x9E3779B9  # 2^32 / golden ratio: its multiples are far apart, so consecutive numbers make distinct keys


def mix(value: Any) -> Any:
    """A bijection of 32 bits without visible structure: two rounds of xorshift and multiply (Wellons' lowbias32)."""
    value = value ^ (value >> 16)
    value = value * 0x7FEB352D
    value = value ^ (value >> 15)
    value = value * 0x846CA68B
    return value ^ (value >> 16)


def stir(value: Any) -> Any:
    """Half of ``mix``: the next of several numbers from one that is random already."""
    return (value ^ (value >> 15)) * 0x85EBCA6B


def scramble_reversed(value: Any, key: Any) -> Any:
    """
    Owen's nested uniform scrambling of a number whose bits are *reversed*: each bit is flipped, or not, by a hash of
    the key and of the bits below it (Laine and Karras 2011, constants of pbrt-v4's FastOwenScrambler).
    """
    value = value ^ (value * 0x3D20ADEA)
    value = value + key
    value = value * ((key >> 16) | 1)
    value = value ^ (value * 0x05526C56)
    return value ^ (value * 0x53A22864)


def scramble(value: Any, key: Any) -> Any:
    """Owen scrambling of a fraction: all elementary intervals stay as they are filled."""
    return dr.brev(scramble_reversed(dr.brev(value), key))


def second_sobol_reversed(index: Any) -> Any:
    """
    The second dimension of the Sobol' sequence at ``index``, bits reversed; the first is the radical inverse, which
    reversed is ``index`` itself. The generator matrix is Pascal's triangle mod 2: five steps (science.md A.7).
    """
    for shift, mask in ((1, 0xAAAAAAAA), (2, 0xCCCCCCCC), (4, 0xF0F0F0F0), (8, 0xFF00FF00), (16, 0xFFFF0000)):
        index = index ^ ((index & mask) >> shift)
    return index


def on_device(values: NDArray[np.uint32]) -> Any:
    """
    A table in memory of Dr.Jit's own. It would use that of numpy, whose alignment differs from one array to the next,
    and with it the kernel: pairs are loaded at once only where they are aligned.
    """
    table = mi.UInt32(values.ravel()) ^ dr.opaque(mi.UInt32, 0)
    dr.eval(table)
    return table


def floats_on_device(values: Any) -> Any:
    """The same for an array of numbers, as float32."""
    table = dr.reinterpret_array(mi.Float, on_device(np.ascontiguousarray(values, np.float32).view(np.uint32)))
    dr.eval(table)
    return table


def unit(fraction: Any) -> Any:
    """A 0.32 fixed-point fraction as a float in [0, 1): 24 bits are kept, so it is never rounded up to 1."""
    return mi.Float(fraction >> 8) * 2**-24


def below(bits: Any, limit: Any) -> Any:
    """Random bits as an integer in [0, limit), for a limit of at most 2^16: the high half of a product."""
    return ((bits >> 16) * limit) >> 16


class Divisor:
    """
    Division of lane numbers by one number that is not known to the kernel: ``quotient`` is exact for values below 2^31.

    A multiplication and two shifts (Granlund and Montgomery 1994) in place of a division, which LLVM does lane by lane.
    Not a Dr.Jit structure, so that loops leave it alone.
    """

    __slots__ = ("magic", "shift", "value")

    def __init__(self, value: int):
        bits = (value - 1).bit_length()
        self.value = dr.opaque(mi.UInt32, value)
        self.magic = dr.opaque(mi.UInt32, -(-(2 ** (31 + bits)) // value))
        self.shift = dr.opaque(mi.UInt32, bits)

    def quotient(self, number: Any) -> Any:
        return dr.mul_hi(number << 1, self.magic) >> self.shift

    def remainder(self, number: Any, quotient: Any) -> Any:
        return number - quotient * self.value
