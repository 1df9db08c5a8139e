"""The laws that every sampler of ours keeps, as its plugin draws (science.md A.8, 1 to 6)."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from renderer import catalog
from renderer.samplers.draw import draw
from tests.renderer.samplers.conftest import CORRECT, COUNTS, NETS, POISSON

pytestmark = pytest.mark.usefixtures("variant")

PIXELS = 100_000  # of a uniformity test


def drawn(name: str, spp: int, sets: int, seed: int = 1, kinds: str = "2") -> list[NDArray[np.float64]]:
    return draw(catalog.resolve("sampler", name), spp, sets, seed, kinds=kinds)


def made(name: str, spp: int) -> Any:
    from renderer.render import make_sampler

    return make_sampler(catalog.resolve("sampler", name), spp)


def values(sampler: Any, kinds: str) -> list[NDArray[np.float32]]:
    return [np.array(sampler.next_2d() if kind == "2" else sampler.next_1d()) for kind in kinds]


def same(a: list[NDArray[np.float32]], b: list[NDArray[np.float32]]) -> bool:
    return all(np.array_equal(one, other) for one, other in zip(a, b, strict=True))


# -- 1 consistency ---------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", CORRECT)
def test_the_same_seed_draws_the_same_samples_and_another_seed_others(name: str) -> None:
    sampler, kinds = made(name, 16), "2121"
    sampler.frame(8, 4, (0, 0, 8, 4), 16, 0)
    sampler.seed(0, 8 * 4 * 16)
    first = values(sampler, kinds)
    sampler.seed(1, 8 * 4 * 16)
    other = values(sampler, kinds)
    sampler.seed(0, 8 * 4 * 16)
    assert same(first, values(sampler, kinds))
    assert all(np.mean(a == b) < 0.01 for a, b in zip(first, other, strict=True))


@pytest.mark.parametrize("name", CORRECT)
def test_a_clone_goes_on_where_its_original_stands(name: str) -> None:
    sampler = made(name, 16)
    sampler.frame(8, 4, (0, 0, 8, 4), 16, 0)
    sampler.seed(5, 8 * 4 * 16)
    values(sampler, "21")
    clone = sampler.clone()
    assert type(clone) is type(sampler)
    assert same(values(clone, "212"), values(sampler, "212"))


@pytest.mark.parametrize("spp", COUNTS)
@pytest.mark.parametrize("name", CORRECT)
def test_passes_of_any_size_draw_the_same_samples(name: str, spp: int) -> None:
    """The samples of a pixel are the same in one pass, in passes of 4 and one by one."""

    def cut(k: int) -> list[NDArray[np.float32]]:
        sampler, parts = made(name, spp), []
        for first in range(0, spp, k):
            sampler.frame(4, 3, (0, 0, 4, 3), k, first)
            sampler.seed(9, 12 * k) if first == 0 else sampler.advance()
            parts.append([array.reshape(*array.shape[:-1], 12, k) for array in values(sampler, "212")])
        return [np.concatenate(kind, axis=-1) for kind in zip(*parts, strict=True)]

    whole = cut(spp)
    assert same(whole, cut(4))
    assert spp > 64 or same(whole, cut(1))


@pytest.mark.parametrize("name", CORRECT)
def test_a_crop_has_the_samples_of_the_whole_film(name: str) -> None:
    def pixels(crop: tuple[int, int, int, int]) -> NDArray[np.float32]:
        sampler = made(name, 4)
        sampler.frame(9, 7, crop, 4, 0)
        sampler.seed(3, crop[2] * crop[3] * 4)
        return values(sampler, "22")[1].reshape(2, crop[3], crop[2], 4)

    assert np.array_equal(pixels((0, 0, 9, 7))[:, 2:5, 3:7], pixels((3, 2, 4, 3)))


@pytest.mark.parametrize("name", CORRECT)
def test_no_seed_spp_or_pass_makes_a_new_kernel(name: str) -> None:
    """What differs is in memory, not in the code: after the first kernel everything comes from the cache."""
    import drjit as dr

    def kernels(spp: int, seed: int, k: int) -> set[str]:
        found = set()
        sampler = made(name, spp)
        for first in range(0, spp, k):
            sampler.frame(4, 4, (0, 0, 4, 4), k, first)
            sampler.seed(seed, 16 * k) if first == 0 else sampler.advance()
            with dr.scoped_set_flag(dr.JitFlag.KernelHistory, True):
                dr.kernel_history_clear()
                dr.eval(sampler.next_2d(), sampler.next_1d(), sampler.next_2d())
                found |= {str(kernel["hash"]) for kernel in dr.kernel_history([dr.KernelType.JIT])}
        return found

    first = kernels(16, 1, 4)
    assert len(first) == 1
    assert kernels(16, 2, 4) == kernels(64, 3, 16) == first


def test_a_sampler_of_one_pass_says_so_and_one_that_needs_a_width_too() -> None:
    plain = made("sobol", 4)
    plain.seed(0, 16)
    with pytest.raises(RuntimeError, match="one pass unless it is told"):
        plain.advance()
    for name in ("halton", "zsobol"):
        with pytest.raises(RuntimeError, match="needs the width of the picture"):
            made(name, 4).seed(0, 16)


# -- 2 uniformity ----------------------------------------------------------------------------------------------


@pytest.mark.parametrize("spp", COUNTS)
@pytest.mark.parametrize("name", CORRECT)
def test_every_sample_of_a_pixel_is_uniform(name: str, spp: int) -> None:
    """
    Chi-square of single samples (dimension, index) over 10⁵ pixels: 16 × 16 cells of 2D, 256 cells of 1D samples.

    One-sided: sequences that span the picture may be more even than chance. Šidák over all tests of this function.
    """
    kinds, indices = "212212", (0, spp // 2 + 1, spp - 1)
    level = 1 - (1 - 0.01) ** (1 / (len(kinds) * len(indices) * len(CORRECT) * len(COUNTS)))
    width = math.isqrt(PIXELS) + 1
    sampler = made(name, spp)
    for index in indices:
        sampler.frame(width, width, (0, 0, width, width), 1, index)
        sampler.seed(11, width * width) if index == 0 else sampler.advance()
        for position, (kind, array) in enumerate(zip(kinds, values(sampler, kinds), strict=True)):
            assert array.min() >= 0 and array.max() < 1
            cells = (array * 16).astype(int) if kind == "2" else (array * 256).astype(int)
            counts = np.bincount(cells[0] * 16 + cells[1] if kind == "2" else cells, minlength=256)
            assert chi_square_tail(counts) > level, f"sample {index} of dimension {position} is not uniform"


def chi_square_tail(counts: NDArray[np.int64]) -> float:
    from scipy.stats import chi2

    expected = counts.sum() / len(counts)
    return float(chi2.sf(((counts - expected) ** 2 / expected).sum(), len(counts) - 1))


# -- 3 strata ----------------------------------------------------------------------------------------------------


def boxes_hold_one(points: NDArray[np.float64], columns: int, rows: int) -> bool:
    """Whether each of columns × rows = N boxes holds exactly one of the N points, in every set."""
    cells = np.floor(points * [columns, rows]).astype(int)
    numbers = np.sort(cells[..., 0] * rows + cells[..., 1], axis=1)
    return bool((numbers == np.arange(columns * rows)).all())


@pytest.mark.parametrize("bits", range(2, 11))
@pytest.mark.parametrize("name", NETS)
def test_nets_fill_every_elementary_interval(name: str, bits: int) -> None:
    for points in drawn(name, 2**bits, 9, kinds="212")[::2]:
        assert all(boxes_hold_one(points, 2**a, 2 ** (bits - a)) for a in range(bits + 1))


@pytest.mark.parametrize(("a", "b"), [(4, 0), (0, 3), (3, 2), (2, 3), (5, 2)])
def test_halton_fills_boxes_of_powers_of_two_and_three(a: int, b: int) -> None:
    assert boxes_hold_one(drawn("halton", 2**a * 3**b, 40)[0], 2**a, 3**b)


@pytest.mark.parametrize("spp", COUNTS)
@pytest.mark.parametrize("name", CORRECT)
def test_one_dimension_is_stratified(name: str, spp: int) -> None:
    """One sample in each of N strata, for nets if N is a power of two; halton keeps strata of powers of its base."""
    (samples,) = (one for one in drawn(name, spp, 25, kinds="21")[1:])
    if name == "halton":
        strata = 5 ** int(math.log(spp, 5))  # the 1D sample after the film is dimension 2: base 5
        counts = [np.bincount((row[:strata] * strata).astype(int), minlength=strata) for row in samples]
        assert (np.array(counts) == 1).all()
    elif name in POISSON or spp & (spp - 1) == 0:
        assert (np.sort((samples * spp).astype(int), axis=1) == np.arange(spp)).all()


@pytest.mark.parametrize(("name", "least"), [("poissondisk", 0.70), ("relaxedpoissondisk", 0.58), ("eliminated", 0.65)])
@pytest.mark.parametrize("spp", COUNTS)
def test_poisson_points_keep_their_distance_on_the_torus(name: str, least: float, spp: int) -> None:
    """Shift and symmetry change no distance: what the tables promise holds in every pixel and dimension."""
    bound = math.sqrt(2 / (math.sqrt(3) * spp))
    for points in drawn(name, spp, 20, kinds="22"):
        apart = np.abs(points[:, :, None] - points[:, None])
        squared = (np.minimum(apart, 1 - apart) ** 2).sum(-1) + 2 * np.eye(spp)
        assert math.sqrt(squared.min()) / bound > least


def test_zsobol_deals_out_aligned_blocks_and_every_index_once() -> None:
    import mitsuba as mi

    sampler = made("zsobol", 16)
    sampler.frame(32, 32, (0, 0, 32, 32), 16, 0)
    sampler.seed(2, 32 * 32 * 16)
    for dimension in (0, 1, 7):
        index = np.array(sampler._place(sampler.lanes, mi.UInt32(dimension))[0]).reshape(32, 32, 16)
        assert index.min() % index.size == 0
        assert np.array_equal(np.sort(index.ravel() - index.min()), np.arange(index.size))
        assert (index // 16 == index[:, :, :1] // 16).all()
        squares = index.reshape(16, 2, 16, 2, 16) // 64
        assert (squares == squares[:, :1, :, :1, :1]).all()


# -- 4 spectrum ----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("spp", COUNTS)
@pytest.mark.parametrize("name", CORRECT)
def test_low_frequencies_are_quiet(name: str, spp: int) -> None:
    """Power at |k| = 1, where random points have 1 and a front that stopped early has 29: below 0.2 for all of ours."""
    points = drawn(name, spp, 200)[0]
    power = [np.mean(np.abs(np.exp(2j * np.pi * points[..., axis]).sum(1)) ** 2) / spp for axis in (0, 1)]
    assert max(power) < 0.2


# -- 5 integration -------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("spp", COUNTS)
@pytest.mark.parametrize("name", CORRECT)
def test_means_are_unbiased(name: str, spp: int) -> None:
    """A Gaussian in the first and a later dimension: the mean over 2000 pixels is within 4 standard errors."""
    exact = (math.sqrt(math.pi / 8) * math.erf(math.sqrt(8) / 2)) ** 2
    for points in drawn(name, spp, 2000, kinds="2122")[::3]:
        estimates = np.exp(-8 * ((points - 0.5) ** 2).sum(-1)).mean(1)
        assert abs(estimates.mean() - exact) < 4 * estimates.std(ddof=1) / math.sqrt(len(estimates)) + 1e-7


# -- 6 pairing -----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("spp", COUNTS)
@pytest.mark.parametrize("name", CORRECT)
def test_dimensions_are_paired_at_random(name: str, spp: int) -> None:
    """
    A shadow edge that moves with the place in the pixel, a function of four dimensions: the error stays below
    0.75 of random at every N (index-locked jitter reaches 0.86 at 256).
    """
    pixel, light = drawn(name, spp, 3000, kinds="22")
    lit = (light[..., 0] + 0.5 * light[..., 1] < 0.25 + 0.5 * pixel[..., 0] + 0.25 * pixel[..., 1]).mean(1)
    random = np.random.default_rng(5)
    u, v = random.random((2, 2_000_000, 2))
    exact = np.mean(v[:, 0] + 0.5 * v[:, 1] < 0.25 + 0.5 * u[:, 0] + 0.25 * u[:, 1])
    assert np.mean((lit - exact) ** 2) / (exact * (1 - exact) / spp) < 0.75


@pytest.mark.parametrize("name", CORRECT)
def test_samples_of_two_dimensions_are_uncorrelated(name: str) -> None:
    """Correlation over pixels of the same sample in two dimensions: 0 within 4.5 standard errors, for all pairs."""
    drawn_kinds = drawn(name, 16, 4000, kinds="22122")
    columns = [array[..., axis] for array in drawn_kinds if array.ndim == 3 for axis in (0, 1)]
    columns += [array for array in drawn_kinds if array.ndim == 2]
    for index in (0, 7, 15):
        matrix = np.corrcoef(np.stack([column[:, index] for column in columns]))
        assert np.abs(matrix - np.eye(len(columns))).max() < 4.5 / math.sqrt(4000)


# -- in Mitsuba's own renderer ------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["poissondisk", "eliminated", "sobol", "pmj02bn"])
def test_plain_mitsuba_renders_the_same_picture_in_one_pass(name: str) -> None:
    """``mi.render`` tells a sampler only its seed and the number of lanes: enough for those that need no width."""
    import mitsuba as mi

    from renderer.render import render
    from renderer.scenes.load import LoadedScene
    from renderer.spec import CellSpec, Estimand

    scene: Any = mi.load_dict({
        "type": "scene",
        "integrator": {"type": "path", "max_depth": 3},
        "ball": {"type": "sphere"},
        "sky": {"type": "constant"},
        "sensor": {
            "type": "perspective",
            "to_world": mi.ScalarTransform4f().look_at([0, 0, 4], [0, 0, 0], [0, 1, 0]),
            "film": {"type": "hdrfilm", "width": 12, "height": 8, "rfilter": {"type": "box"}, "pixel_format": "rgb"},
            "sampler": {"type": name, "sample_count": 16},
        },
    })  # fmt: skip
    plain = np.array(mi.render(scene, seed=5, spp=16))
    estimand = Estimand("0" * 64, 12, 8, 3, catalog.resolve("rfilter", "box"))
    spec = CellSpec(estimand, catalog.resolve("integrator", "path"), catalog.resolve("sampler", name), 16)
    ours = next(render(spec, LoadedScene(scene, scene.sensors()[0], 12, 8, (0, 0, 12, 8)), [5])).picture
    assert np.allclose(plain, ours, rtol=1e-4, atol=1e-5)
