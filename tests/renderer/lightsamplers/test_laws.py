"""Laws that every light sampler keeps, at random points of scenes with every kind of lamp."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy import stats

from renderer.errors import UnknownName
from renderer.lightsamplers import NAMES, make
from tests.renderer.lightsamplers.conftest import points_in
from tests.renderer.scene_of import scene_of

POINTS = 16  # at which a distribution is looked at in full
PICKS = 2**17
ERROR = 1e-3  # of a whole test, shared by its comparisons


def full_pmf(sampler: Any, p: Any, n: Any, points: int) -> np.ndarray:
    """The pmf at each of some points, shape (points, lamps)."""
    import drjit as dr
    import mitsuba as mi

    lane = dr.arange(mi.UInt32, points * sampler.count)
    at, index = lane // sampler.count, lane % sampler.count
    pmf = sampler.pmf(dr.gather(mi.Point3f, p, at), dr.gather(mi.Normal3f, n, at), index)
    return wide(pmf, points * sampler.count).reshape(points, sampler.count).astype(np.float64)


def wide(value: Any, count: int) -> np.ndarray:
    """One value a lane, also of what is the same for all."""
    import drjit as dr

    return (value + dr.zeros(type(value), count)).numpy()


@pytest.mark.parametrize("name", NAMES)
def test_pmf_sums_to_one_and_starves_no_lamp(name: str, mixed: Any) -> None:
    p, n = points_in(mixed, 512, seed=1)
    pmf = full_pmf(make(name, mixed), p, n, 512)
    assert np.allclose(pmf.sum(axis=1), 1, atol=1e-6) and (pmf >= 0).all()
    assert (pmf > 0).all()


@pytest.mark.parametrize("name", NAMES)
def test_lamps_are_picked_as_often_as_the_pmf_says(name: str, mixed: Any) -> None:
    """Pearson's χ² at each of some points; what ``pick`` reports is what ``pmf`` says; what is left of u is uniform."""
    import mitsuba as mi

    sampler = make(name, mixed)
    p, n = points_in(mixed, POINTS, seed=2)
    pmf = full_pmf(sampler, p, n, POINTS)
    u = mi.Float(np.random.default_rng(3).random(PICKS, dtype=np.float32))
    for k in range(POINTS):
        at = [type(x)(*(float(c[k]) for c in x)) for x in (p, n)]
        index, reported, rest = (wide(x, PICKS) for x in sampler.pick(*at, u))
        assert np.allclose(reported, pmf[k][index], rtol=1e-5)
        counts = np.bincount(index, minlength=sampler.count)
        possible = pmf[k] * PICKS > 5
        assert counts[pmf[k] == 0].sum() == 0
        expected = pmf[k][possible] * PICKS
        statistic = np.sum((counts[possible] - expected) ** 2 / expected)
        assert stats.chi2.sf(statistic, max(possible.sum() - 1, 1)) > ERROR / POINTS, (k, counts, expected)
        assert rest.min() >= 0 and rest.max() < 1
        assert stats.kstest(rest, "uniform").pvalue > ERROR / POINTS


@pytest.mark.parametrize("name", NAMES)
def test_light_paths_start_as_often_as_the_pmf_says(name: str, mixed: Any) -> None:
    import drjit as dr
    import mitsuba as mi

    sampler = make(name, mixed)
    u = mi.Float(np.random.default_rng(4).random(PICKS, dtype=np.float32))
    index, reported, rest = (wide(x, PICKS) for x in sampler.pick_emission(u))
    pmf = wide(sampler.pmf_emission(dr.arange(mi.UInt32, sampler.count)), sampler.count)
    assert np.isclose(pmf.sum(), 1) and (pmf > 0).all()
    assert np.array_equal(reported, pmf[index])
    assert stats.chisquare(np.bincount(index, minlength=sampler.count), pmf / pmf.sum() * PICKS).pvalue > ERROR
    assert rest.min() >= 0 and rest.max() < 1


@pytest.mark.parametrize("name", NAMES)
def test_directions_have_the_density_that_is_claimed(name: str, mixed: Any) -> None:
    """``pdf_direction`` of what was sampled is its density, but for delta lamps, where it is 0."""
    import drjit as dr
    import mitsuba as mi

    sampler = make(name, mixed)
    p, n = points_in(mixed, 4096, seed=5)
    it = dr.zeros(mi.Interaction3f, 4096)
    it.p, it.n = p, n
    u = np.random.default_rng(6).random((2, 4096), dtype=np.float32)
    ds, weight, index, pmf = sampler.sample_direction(it, mi.Point2f(u))
    assert np.array_equal(sampler.index(ds.emitter).numpy(), wide(index, 4096))
    claimed, found = ds.pdf.numpy(), sampler.pdf_direction(it, ds, True).numpy()
    delta, sent = ds.delta.numpy(), (np.array(weight) > 0).any(axis=0)
    assert delta.any() and (~delta).any() and np.isfinite(np.array(weight)).all()
    assert (found[delta] == 0).all()
    assert np.allclose(found[~delta & sent], claimed[~delta & sent], rtol=1e-3)
    assert np.allclose(claimed[delta & sent], wide(pmf, 4096)[delta & sent])


def test_lamps_have_the_numbers_of_the_scene(mixed: Any) -> None:
    """Whatever order Dr.Jit numbers them in; a null pointer, which no lamp has, is 0."""
    import drjit as dr
    import mitsuba as mi

    sampler = make("uniform", mixed)
    assert sampler.count == len(mixed.emitters()) == 9
    for number, emitter in enumerate(mixed.emitters()):
        assert sampler.index(mi.EmitterPtr(emitter))[0] == number
    backwards = 8 - dr.arange(mi.UInt32, 9)
    assert np.array_equal(sampler.index(dr.gather(mi.EmitterPtr, mixed.emitters_dr(), backwards)), backwards.numpy())
    assert sampler.index(dr.zeros(mi.EmitterPtr, 1))[0] == 0


def test_power_is_that_of_textbooks(variant: str) -> None:
    """πAL of area lamps, 4πI of a point, 2πI(1 − (cos a + cos b)/2) of a spot nearly, πR²E from far away."""
    from renderer.lightsamplers.power import powers

    light = {"type": "rgb", "value": [2, 1, 0.5]}
    y = 0.212671 * 2 + 0.71516 * 1 + 0.072169 * 0.5
    area = {"type": "area", "radiance": light}
    lamps: dict[str, tuple[dict[str, Any], float]] = {
        "a": ({"type": "rectangle", "emitter": area}, np.pi * 4),
        "b": ({"type": "sphere", "radius": 0.5, "emitter": area}, np.pi * np.pi),
        "c": ({"type": "disk", "emitter": area}, np.pi * np.pi),
        "d": ({"type": "cube", "emitter": area}, np.pi * 24),
        "e": ({"type": "point", "intensity": light}, 4 * np.pi),
        "f": ({"type": "directional", "irradiance": light}, np.pi * 3),
        "g": ({"type": "constant", "radiance": light}, np.pi * 3 * 4 * np.pi),
        "h": ({"type": "spot", "intensity": light, "cutoff_angle": 30, "beam_width": 29.9}, 2 * np.pi * 0.1335),
    }  # fmt: skip
    scene = scene_of({name: lamp for name, (lamp, _) in lamps.items()})
    assert len(scene.emitters()) == len(lamps)
    assert np.allclose(sorted(powers(scene)), sorted(y * power for _, power in lamps.values()), rtol=0.02)


def test_power_of_a_picture_is_that_of_its_mean(variant: str) -> None:
    """Textured lamps have no closed form; fixed points integrate them, each time to the same number."""
    import mitsuba as mi

    from renderer.lightsamplers.power import powers

    pixels = np.random.default_rng(7).random((16, 16, 3)).astype(np.float32) ** 8
    lamp = {"type": "area", "radiance": {"type": "bitmap", "bitmap": mi.Bitmap(pixels), "raw": True}}
    scene = scene_of({"lamp": {"type": "rectangle", "emitter": lamp}})
    first = powers(scene)
    assert np.isclose(first[0], 4 * np.pi * (pixels @ [0.212671, 0.71516, 0.072169]).mean(), rtol=0.05)
    assert np.array_equal(first, powers(scene))


@pytest.mark.parametrize("name", NAMES)
def test_a_lamp_without_light_is_not_lost(name: str, variant: str) -> None:
    """Nothing is certain about a lamp: all black, or one of them, it still has a probability."""
    black = {"type": "point", "intensity": {"type": "rgb", "value": 0}}
    shape = {"type": "sphere", "radius": 2}
    for others in (
        {},
        {"bright": {"type": "point", "position": [1, 0, 0], "intensity": {"type": "rgb", "value": 1e6}}},
    ):
        scene = scene_of({"shape": shape, "a": black, "b": dict(black), **others})
        p, n = points_in(scene, 8, seed=8)
        pmf = full_pmf(make(name, scene), p, n, 8)
        assert (pmf > 1e-7).all() and np.allclose(pmf.sum(axis=1), 1), pmf


@pytest.mark.parametrize("name", NAMES)
def test_without_lamps_all_is_dark(name: str, variant: str) -> None:
    import drjit as dr
    import mitsuba as mi

    scene = scene_of({"shape": {"type": "sphere"}})
    sampler = make(name, scene)
    it = dr.zeros(mi.Interaction3f, 4)
    ds, weight, index, pmf = sampler.sample_direction(it, mi.Point2f(0.5), True)
    assert sampler.count == 0 and (pmf[0], ds.pdf[0], weight[0][0], index[0]) == (0, 0, 0, 0)
    assert sampler.pdf_direction(it, ds, True)[0] == 0 and sampler.pick_emission(mi.Float(0.5))[1][0] == 0


def test_a_wrong_name_is_told_the_right_ones(variant: str) -> None:
    scene = scene_of({})
    with pytest.raises(UnknownName, match="unknown light sampler 'spatail'; known: .*power.*uniform"):
        make("spatail", scene)
