"""The Sobol' sampler: padded, Owen-scrambled (0,2)-nets."""

from __future__ import annotations

from typing import Any

import drjit as dr

from renderer.samplers.base import Lanes, PixelSampler
from renderer.samplers.bits import mix, scramble_reversed, second_sobol_reversed, stir


class Sobol(PixelSampler):
    """
    The first two dimensions of the Sobol' sequence, scrambled and shuffled anew for every pixel and dimension.

    What it does: each pair of dimensions of a pixel gets its own (0,2)-sequence: the first two Sobol' dimensions under
    an independent Owen scrambling, taken in an order that is an independent nested shuffle. Of N = 2^m samples exactly
    one lies in every elementary interval 2^-a × 2^-(m-a). Higher dimensions are padded: pairs are stratified in
    themselves, and paired at random with each other. No table: 60 integer operations a sample.

    When it wins: nearly always, if spp is a power of two. For smooth integrands of two dimensions its squared error
    falls as N^-3, with edges as N^-1.5. It is the default to beat.

    When it loses: at other spp. The Gaussian of the tables below has 20 times the error at 200 samples that it has at
    256. Structure of more than two dimensions is left to chance, as with every padded sampler: N^-1 in the end.

    Source: Sobol' 1967; Owen 1995; shuffle and hashed scrambling by Burley 2020, "Practical Hash-based Owen Scrambling"
    (JCGT 9:4), with the hash of Laine and Karras 2011.
    """

    def fraction_1d(self, lanes: Lanes, dimension: Any) -> Any:
        return van_der_corput(lanes.index, self.key(dimension, 1))

    def fraction_2d(self, lanes: Lanes, dimension: Any) -> tuple[Any, Any]:
        return sobol_2d(lanes.index, self.key(dimension, 0))


def van_der_corput(index: Any, key: Any) -> Any:
    """A shuffled, Owen-scrambled radical inverse in base 2: one of N = 2^m samples in each interval of 1/N."""
    shuffled = dr.brev(scramble_reversed(dr.brev(index), key))
    return dr.brev(scramble_reversed(shuffled, stir(key)))


def sobol_2d(index: Any, key: Any) -> tuple[Any, Any]:
    """A shuffled, Owen-scrambled (0,2)-sequence at ``index``; ``key`` decides all three permutations."""
    shuffled = dr.brev(scramble_reversed(dr.brev(index), key))
    return scrambled_sobol(shuffled, stir(key), mix(key ^ 0x5BD1E995))


def scrambled_sobol(index: Any, key_x: Any, key_y: Any) -> tuple[Any, Any]:
    """The first two dimensions of the Sobol' sequence at ``index`` under two Owen scramblings, as fractions."""
    x = dr.brev(scramble_reversed(index, key_x))
    y = dr.brev(scramble_reversed(second_sobol_reversed(index), key_y))
    return x, y
