"""``path_lights`` is Mitsuba's path tracer but for the lamps it picks, whatever picks them."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from renderer.errors import UnknownName
from renderer.lightsamplers import NAMES
from tests.renderer.lightsamplers.conftest import mixed_scene
from tests.renderer.scene_of import scene_of

Z = 3.3  # of two means, per channel (science.md E.4)


@pytest.fixture(autouse=True)
def registered(variant: str) -> None:
    """The plugin, also where the list of plugins lacks it."""
    import mitsuba as mi

    from renderer.integrators.path_lights import PathLights

    mi.register_integrator("path_lights", PathLights)


def integrator(light_sampler: str | None, **properties: Any) -> Any:
    """Mitsuba's ``path`` for None, else ``path_lights``."""
    import mitsuba as mi

    kind = {"type": "path"} if light_sampler is None else {"type": "path_lights", "light_sampler": light_sampler}
    return mi.load_dict({**kind, "max_depth": 6, **properties})


def pictures(scene: Any, tracer: Any, spp: int, count: int = 1) -> NDArray[np.float64]:
    """(count, H, W, 3) of different seeds."""
    import mitsuba as mi

    seeds = np.random.default_rng(count).integers(2**31, size=count)
    drawn = [np.array(mi.render(scene, integrator=tracer, spp=spp, seed=int(seed))) for seed in seeds]
    return np.array(drawn, np.float64)[..., :3]


def z(a: NDArray[np.float64], b: NDArray[np.float64]) -> NDArray[np.float64]:
    """z of the difference of two mean pictures, per channel."""
    a, b = a.mean((1, 2)), b.mean((1, 2))
    return (a.mean(0) - b.mean(0)) / np.sqrt(a.var(0, ddof=1) / len(a) + b.var(0, ddof=1) / len(b))


# -- the walk --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("hide_emitters", [False, True])
@pytest.mark.parametrize("depths", [(1, 5), (2, 5), (6, 1), (6, 3), (-1, 5)])
@pytest.mark.parametrize("environment", ["constant", "envmap"])
def test_uniform_is_the_path_of_mitsuba(environment: str, depths: tuple[int, int], hide_emitters: bool) -> None:
    """Sample by sample the same walk: pictures of one seed agree but for rounding, with every kind of lamp."""
    scene = scene_of(mixed_scene(environment))
    how = {"max_depth": depths[0], "rr_depth": depths[1], "hide_emitters": hide_emitters}
    ours, native = (pictures(scene, integrator(name, **how), 16)[0] for name in ("uniform", None))
    assert (native.max() > 0) == (not hide_emitters or depths[0] != 1)
    assert np.isclose(ours, native, rtol=1e-4, atol=1e-6).mean() > 0.995
    assert np.allclose(ours.mean((0, 1)), native.mean((0, 1)), rtol=1e-3)


@pytest.mark.parametrize("name", ["independent", "sobol", "halton", "poissondisk"])
def test_samplers_of_ours_draw_in_it(load_for: Callable[..., Any], name: str) -> None:
    """A loop carries what a Python sampler counts: the same random numbers reach the same places."""
    from renderer.frame import Frame
    from renderer.render import make_sampler
    from tests.renderer.conftest import make_cell

    spec = make_cell("many_lights", name, 16, size=(8, 8))
    loaded = load_for(spec, "many_lights")
    drawn = []
    for tracer in (integrator("uniform"), integrator(None)):
        frame, sampler = Frame(loaded, 8, 16), make_sampler(spec.sampler, 16)
        sampler.set_samples_per_wavefront(8)
        for first in (0, 8):
            if hasattr(sampler, "frame"):
                sampler.frame(8, 8, (0, 0, 8, 8), 8, first)
            sampler.seed(3, frame.lanes) if first == 0 else sampler.advance()
            rays, _, _ = frame.camera_rays(sampler)
            drawn.append(np.array(tracer.sample(loaded.scene, sampler, rays)[0]))
            sampler.schedule_state()
    for ours, native in zip(drawn[:2], drawn[2:], strict=True):
        assert np.isclose(ours, native, rtol=1e-4, atol=1e-6).mean() > 0.99
    assert not np.array_equal(drawn[0], drawn[1])


@pytest.mark.parametrize("name", NAMES)
def test_hidden_lamps_are_not_seen_but_light(name: str) -> None:
    """At one edge nothing is left to see, with more the lamps still light the rest."""
    scene = scene_of(mixed_scene())
    assert pictures(scene, integrator(name, max_depth=1, hide_emitters=True), 4).max() == 0
    hidden, shown = (pictures(scene, integrator(name, max_depth=2, hide_emitters=hide), 16) for hide in (True, False))
    assert 0 < hidden.mean() < shown.mean()


@pytest.mark.parametrize("name", NAMES)
def test_without_lamps_the_picture_is_black(name: str) -> None:
    scene = scene_of({"sensor": mixed_scene()["sensor"], "ball": {"type": "sphere"}})
    assert pictures(scene, integrator(name), 4).max() == 0
    assert pictures(scene, integrator(None), 4).max() == 0


def test_no_edges_no_light() -> None:
    assert pictures(scene_of(mixed_scene()), integrator("spatial", max_depth=0), 4).max() == 0


@pytest.mark.parametrize(
    "wrong, sentence",
    [({"max_depth": -2}, "max_depth = -2 is no number of edges"), ({"rr_depth": 0}, "rr_depth = 0 is no number")],
)
def test_wrong_depths_are_told(wrong: dict[str, int], sentence: str) -> None:
    with pytest.raises(Exception, match=sentence):
        integrator("uniform", **wrong)


def test_an_unknown_light_sampler_is_told() -> None:
    import mitsuba as mi

    scene = scene_of(mixed_scene())
    tracer = integrator("spacial")
    with pytest.raises(UnknownName, match="unknown light sampler 'spacial'; known: .*; did you mean 'spatial'"):
        tracer.sample(scene, mi.load_dict({"type": "independent"}), mi.RayDifferential3f([0, 0, 3], [0, 0, -1]))


# -- which plugin ----------------------------------------------------------------------------------------------


@pytest.mark.parametrize("lamps", [0, 1, 2])
@pytest.mark.parametrize("name", NAMES)
def test_mitsuba_walks_where_it_draws_the_same(name: str, lamps: int) -> None:
    from renderer.integrators.path_lights import plugin_for

    points = {f"lamp_{k}": {"type": "point", "position": [k, 0, 0]} for k in range(lamps)}
    scene = scene_of(points)
    assert plugin_for(name, scene) == ("path" if name == "uniform" or lamps < 2 else "path_lights")
    assert plugin_for(name, scene, hide_emitters=True) == "path_lights"


def test_we_walk_where_mitsuba_drops_light() -> None:
    """
    A half transparent screen before nothing: what it reflects is there, whatever the camera ray does then.

    Mitsuba's ``direct`` has it right, and ``path`` has not: this is told to be checked again with the next Mitsuba.
    """
    import mitsuba as mi

    from renderer.integrators.path_lights import plugin_for

    t = mi.ScalarTransform4f()
    screen = {"type": "mask", "opacity": 0.5, "bsdf": {"type": "twosided", "bsdf": {"type": "diffuse"}}}
    scene = scene_of({
        "screen": {"type": "rectangle", "to_world": t.scale(5), "bsdf": screen},
        "lamp": {"type": "point", "position": [0, 0, 3]},
        "sensor": {"type": "perspective", "to_world": t.look_at([0, 0, 5], [0, 0, 0], [0, 1, 0]),
                   "film": {"type": "hdrfilm", "width": 8, "height": 8, "rfilter": {"type": "box"}}},
    })  # fmt: skip
    assert plugin_for("uniform", scene) == "path_lights"
    ours, direct, path = (
        pictures(scene, how, 256).mean()
        for how in (integrator("uniform", max_depth=2), mi.load_dict({"type": "direct"}), integrator(None, max_depth=2))
    )
    assert ours == pytest.approx(direct, rel=0.01)
    assert path < 0.6 * direct


@pytest.mark.parametrize("name", NAMES)
def test_with_one_lamp_all_light_samplers_draw_one_picture(name: str, load_for: Callable[..., Any]) -> None:
    """To the last bit, even where our own walk is forced."""
    from tests.renderer.conftest import make_cell

    scene = load_for(make_cell("cornell_box", size=(24, 24)), "cornell_box").scene
    assert np.array_equal(pictures(scene, integrator(name), 16), pictures(scene, integrator("uniform"), 16))


def test_weights_of_a_file_do_not_make_uniform_uneven() -> None:
    """Mitsuba's own picking is uniform again: the random numbers of a file without weights pick the same lamps."""
    from renderer.integrators.path_lights import equal_weights

    plain = mixed_scene()
    uneven = mixed_scene()
    uneven["point"] = {**uneven["point"], "sampling_weight": 40.0}
    uneven["panel"] = {**uneven["panel"], "emitter": {**uneven["panel"]["emitter"], "sampling_weight": 0.0}}
    scene = scene_of(uneven)
    before = pictures(scene, integrator(None), 16)
    equal_weights(scene)
    after = pictures(scene, integrator(None), 16)
    assert all(emitter.sampling_weight() == 1 for emitter in scene.emitters())
    expected = pictures(scene_of(plain), integrator(None), 16)
    assert np.array_equal(after, expected)
    assert np.isclose(before, expected, rtol=1e-3, atol=1e-4).all(-1).mean() < 0.5


def test_light_samplers_of_a_scene_are_made_once_for_each_state_of_it() -> None:
    import mitsuba as mi

    from renderer.lightsamplers.prepared import Prepared

    scene = scene_of(mixed_scene())
    parameters = mi.traverse(scene)
    prepared = Prepared(scene)
    first = prepared.get("power", ())
    assert prepared.get("power", ()) is first and prepared.get("uniform", ()) is not first
    before = first.pmf(None, None, mi.UInt32(0))[0]
    parameters["point.intensity.value"] = mi.Color3f(1000)
    parameters.update()
    second = prepared.get("power", (("point.intensity", 1000.0),))
    assert second is not first
    assert second.pmf(None, None, mi.UInt32(0))[0] < before / 2


@pytest.mark.parametrize("name", [name for name in NAMES if name != "uniform"])
def test_a_sweep_leaks_into_no_other_cell(name: str, load_for: Callable[..., Any]) -> None:
    """A lamp made bright for one cell is picked more often in that cell alone."""
    from tests.renderer.conftest import make_cell

    loaded = load_for(make_cell("many_lights", size=(8, 8)), "many_lights")
    bright = (("lamp_00.emitter.radiance", 1e4),)

    def cell(sweep: tuple[tuple[str, float], ...]) -> NDArray[np.float64]:
        loaded.settings.apply(sweep)
        tracer = integrator(name)
        tracer.use(loaded.scene, loaded.lights.get(name, sweep))
        return pictures(loaded.scene, tracer, 16)

    before, swept, after = cell(()), cell(bright), cell(())
    assert np.array_equal(before, after) and swept.mean() > before.mean()
    loaded.settings.apply(bright)
    assert np.array_equal(swept, pictures(loaded.scene, integrator(name), 16))


# -- expectation and variance ----------------------------------------------------------------------------------


@pytest.mark.parametrize("environment", ["constant", "envmap"])
@pytest.mark.parametrize("name", [name for name in NAMES if name != "uniform"])
def test_means_are_equal(name: str, environment: str) -> None:
    """Light of every kind of lamp, by whatever it was picked, is that of Mitsuba's path."""
    scene = scene_of(mixed_scene(environment))
    ours, native = (pictures(scene, integrator(picks, rr_depth=3), 128, 16) for picks in (name, None))
    assert np.abs(z(ours, native)).max() < Z, z(ours, native)


def test_roulette_changes_no_mean() -> None:
    scene = scene_of(mixed_scene())
    early, late = (pictures(scene, integrator("spatial", rr_depth=depth), 64, 16) for depth in (1, 50))
    assert np.abs(z(early, late)).max() < Z, z(early, late)


@pytest.fixture(scope="module")
def corridor(variant: str) -> Any:
    """``many_lights``, 32 × 32, and its pictures by Mitsuba's path."""
    from renderer.scenes.load import load
    from renderer.scenes.sources import find

    source = find("many_lights", Path())
    scene = load(source.folder, source.main, width=32, height=32).scene
    return scene, pictures(scene, integrator(None), 32, 16)


@pytest.mark.parametrize("name", [name for name in NAMES if name != "uniform"])
def test_means_are_equal_in_the_corridor(name: str, corridor: Any) -> None:
    scene, native = corridor
    ours = pictures(scene, integrator(name), 32, 16)
    assert np.abs(z(ours, native)).max() < Z, z(ours, native)
    if name in ("spatial", "bvh"):
        ratio = native.var(0, ddof=1).mean() / ours.var(0, ddof=1).mean()
        assert ratio > 5, ratio


@pytest.mark.slow
@pytest.mark.parametrize("spp, count", [(16, 32), (64, 16)])
def test_spatial_has_a_fifteenth_of_the_variance(spp: int, count: int, variant: str) -> None:
    """Of uniform's, in the corridor, by the mean over its pixels."""
    from renderer.scenes.load import load
    from renderer.scenes.sources import find

    source = find("many_lights", Path())
    scene = load(source.folder, source.main, width=128, height=128).scene
    uniform, spatial, tree = (
        pictures(scene, integrator(name), spp, count).var(0, ddof=1).mean() for name in ("uniform", "spatial", "bvh")
    )
    assert uniform > 15 * spatial and uniform > 15 * tree, (uniform / spatial, uniform / tree)


SPECTRAL = """
import sys
from renderer.variant import use
use("llvm_ad_spectral")
from tests.renderer.integrators import test_path_lights as t
import mitsuba as mi, numpy as np
from renderer.integrators.path_lights import PathLights
from renderer.lightsamplers import NAMES
mi.register_integrator("path_lights", PathLights)
scene = t.scene_of(t.mixed_scene("envmap"))
native = t.pictures(scene, t.integrator(None), 128, 12)
ours = t.pictures(scene, t.integrator("uniform"), 128, 12)
print(np.isclose(ours, native, rtol=1e-3, atol=1e-5).mean() > 0.99)
for name in NAMES[1:]:
    print(np.abs(t.z(t.pictures(scene, t.integrator(name), 128, 12), native)).max() < t.Z)
"""


def test_the_same_in_spectral_colours() -> None:
    """In a process of its own: a variant cannot be taken back."""
    done = subprocess.run([sys.executable, "-c", SPECTRAL], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert done.stdout.split() == ["True"] * len(NAMES), done.stdout


# -- kernels ---------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", NAMES)
def test_no_colour_of_a_lamp_makes_a_new_kernel(name: str) -> None:
    """Tables and colours are memory, not code: also the making of the light sampler."""
    import drjit as dr
    import mitsuba as mi

    scene = scene_of(mixed_scene())
    parameters = mi.traverse(scene)

    def kernels(power: float) -> set[str]:
        parameters["point.intensity.value"] = mi.Color3f(dr.opaque(mi.Float, power), 1, dr.opaque(mi.Float, power / 2))
        parameters.update()
        with dr.scoped_set_flag(dr.JitFlag.KernelHistory, True):
            dr.kernel_history_clear()
            pictures(scene, integrator(name), 4)
            history = dr.kernel_history([dr.KernelType.JIT])
        # Small ones copy tables from numpy: one kernel where these lie aligned, another elsewhere.
        return {str(kernel["hash"]) for kernel in history if kernel["operation_count"] > 100}

    first = kernels(1)
    assert first and kernels(50) == first
