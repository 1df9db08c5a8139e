"""Our progressive (0,2)-sequences: exactly stratified, exactly uniform, and farther apart than scrambled at random."""

from __future__ import annotations

import hashlib

import numpy as np
import pytest

from renderer.errors import BadParameter
from renderer.samplers import pmj
from renderer.samplers.pmj import MAX_POINTS, pmj02bn

MASKS = (0xAAAAAAAA, 0xCCCCCCCC, 0xF0F0F0F0, 0xFF00FF00, 0xFFFF0000)
PINNED = "4ea2204c4dc7e33b55c989054f431381bd64f08d119c9a40a3bb99bd4c938b1f"


@pytest.fixture(scope="module")
def sets():
    """16 sets of 1024 points."""
    return pmj02bn(1024, 16, seed=1)


def mirrored(v):
    """32-bit words with their bits in reverse order."""
    v = v.astype(np.uint64)
    out = np.zeros_like(v)
    for bit in range(32):
        out |= (v >> np.uint64(bit) & np.uint64(1)) << np.uint64(31 - bit)
    return out.astype(np.uint32)


def scrambled(v, seed):
    """Laine and Karras's hash as a random nested scrambling: each bit depends on those above it."""
    v = mirrored(v)
    with np.errstate(over="ignore"):
        v = v ^ v * np.uint32(0x3D20ADEA)
        v = (v + seed) * (seed >> np.uint32(16) | np.uint32(1))
        v = v ^ v * np.uint32(0x05526C56)
        v = v ^ v * np.uint32(0x53A22864)
    return mirrored(v)


def owen_sobol(n, sets, seed):
    """The Sobol' (0,2)-sequence under random Owen scramblings, as ``pmj02bn`` gives its points."""
    index = np.arange(n, dtype=np.uint32)
    pascal = index.copy()
    for k, mask in enumerate(MASKS):
        pascal ^= (pascal & np.uint32(mask)) >> np.uint32(2**k)
    seeds = np.random.default_rng(seed).integers(0, 2**32, (2, sets, 1), np.uint32)
    return np.stack([scrambled(mirrored(bits), seeds[axis]) for axis, bits in enumerate((index, pascal))], axis=-1)


def crowded(points):
    """How many elementary intervals of 1/N, of all shapes and in all sets (K, N, 2), hold no point of theirs."""
    count = points.shape[1]
    digits = count.bit_length() - 1
    wide = points.astype(np.uint64)
    missed = 0
    for across in range(digits + 1):
        column = wide[..., 0] >> np.uint64(32 - across)
        row = wide[..., 1] >> np.uint64(32 - digits + across)
        interval = np.sort(column << np.uint64(digits - across) | row, axis=1)
        missed += np.count_nonzero(interval != np.arange(count, dtype=np.uint64))
    return missed


def relative_distance(points):
    """Mean over sets of the smallest toroidal distance, relative to that of a hexagonal lattice of as many points."""
    count = points.shape[1]
    found = []
    for one in points / 2**32:
        apart = np.abs(one[:, None] - one)
        squared = (np.minimum(apart, 1 - apart) ** 2).sum(axis=2)
        np.fill_diagonal(squared, np.inf)
        found.append(np.sqrt(squared.min()))
    return np.mean(found) / np.sqrt(2 / (np.sqrt(3) * count))


@pytest.mark.parametrize("seed", [1, 2, 2**63])
def test_every_doubling_fills_all_elementary_intervals(seed):
    points = pmj02bn(1024, 4, seed)
    for m in range(11):
        assert crowded(points[:, : 2**m]) == 0


def test_so_does_every_aligned_block(sets):
    for m in range(10):
        for start in range(0, 1024, 2**m):
            assert crowded(sets[:2, start : start + 2**m]) == 0


def test_the_check_of_intervals_can_fail(sets):
    assert crowded(np.roll(sets, 1, axis=1)[:, :512]) > 0
    assert crowded(sets + np.uint32(2**29)) > 0, "toroidal shifts break nets"


@pytest.mark.slow
def test_doublings_are_nets_up_to_the_largest_number_of_points():
    points = pmj02bn(MAX_POINTS, 16, seed=3)
    for m in range(15):
        assert crowded(points[:, : 2**m]) == 0


def test_fewer_points_and_sets_are_a_prefix_of_more(sets):
    for n, count in ((1, 1), (200, 3), (256, 16)):
        np.testing.assert_array_equal(pmj02bn(n, count, seed=1), sets[:count, :n])
    np.testing.assert_array_equal(pmj02bn(16, 18, seed=1)[:16], sets[:, :16])  # more than are made together


def test_sets_and_seeds_differ(sets):
    other = pmj02bn(1024, 16, seed=2)
    everything = np.concatenate([sets, other])
    assert len(np.unique(everything.reshape(32, -1), axis=0)) == 32
    cells = (everything >> np.uint32(26)).reshape(32, -1)
    assert len(np.unique(cells, axis=0)) == 32, "they differ in more than the jitter"


def test_the_points_are_the_same_on_every_machine(sets):
    """If this changes, so do pictures: raise the version of the sampler."""
    assert sets.dtype == np.uint32 and sets.shape == (16, 1024, 2)
    assert hashlib.sha256(sets.astype("<u4").tobytes()).hexdigest() == PINNED


@pytest.mark.parametrize("sets", [16_000, pytest.param(96_000, marks=pytest.mark.slow)])
def test_every_point_is_uniform(sets):
    """
    Chi-square of the first 16 points in 16 × 16 cells, with only the four digits that decide about them.

    Uniform points have 255 ± 22.6 whatever the number of sets; a descent that sees which half is which has thousands.
    """
    columns, rows = [], []
    random = np.random.default_rng(5)
    for _ in range(sets // 1600):
        noise = random.integers(0, 2**32, (1600, 16, 2), np.uint32)
        for found, strips, sobol in zip((columns, rows), pmj.scrambling(noise, 4), pmj._sobol(), strict=True):
            found.append(strips[:, sobol[:16] >> (pmj.DIGITS - 4)])
    cells = np.concatenate(columns) * 16 + np.concatenate(rows)
    expected = len(cells) / 256
    for point in range(16):
        chi_square = ((np.bincount(cells[:, point], minlength=256) - expected) ** 2 / expected).sum()
        assert abs(chi_square - 255) < 4 * np.sqrt(2 * 255), f"point {point}"


@pytest.mark.parametrize("n, better", [(16, 1.2), (64, 1.4), (256, 1.7), (1024, 2.2)])
def test_points_are_farther_apart_than_randomly_scrambled_ones(sets, n, better):
    owen = owen_sobol(n, 64, seed=1)
    assert crowded(owen[:4]) == 0, "the baseline is one"
    assert relative_distance(sets[:, :n]) > better * relative_distance(owen[: max(16, 16384 // n)])


@pytest.mark.parametrize("n", [0, -1, MAX_POINTS + 1])
def test_too_few_and_too_many_points_are_refused(n):
    with pytest.raises(BadParameter, match=f"n = {n} of pmj02bn .* from 1 to 16384"):
        pmj02bn(n, 1, seed=0)


def test_sets_and_seed_are_checked():
    with pytest.raises(BadParameter, match="sets = 0"):
        pmj02bn(16, 0, seed=0)
    with pytest.raises(BadParameter, match="seed = -1"):
        pmj02bn(16, 1, seed=-1)
