"""
Bidirectional path tracing has the expected pictures of path tracing, strategy by strategy (science.md C.6).

Where a path tracer cannot go, to a Dirac lamp by way of a mirror, it is compared with a particle tracer.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from renderer.errors import SceneError
from tests.renderer.integrators.rooms import DIRAC_LAMPS, MIRRORS, draw, lamps, materials, rarer_lamps, room
from tests.renderer.means import check_means
from tests.renderer.scene_of import scene_of

pytestmark = pytest.mark.usefixtures("variant")

LAMPS = ["rectangle", "sphere", "mesh", "textured", "point", "spot", "directional", "constant", "envmap",
         "turned envmap", "several"]  # fmt: skip
MATERIALS = ["diffuse", "textured", "bumps", "gloss", "sharp gloss", "two sides", "rough metal", "rough glass",
             "plastic", "principled", "mask", "glass", "metal"]  # fmt: skip
WITH_DIRAC = (*DIRAC_LAMPS, "several")  # rooms in which a path tracer misses caustics
# What stands where. Together with a lamp they cover every pair of the two; masks have a wall behind them, because
# Mitsuba's path is black where it looks through one at nothing.
SETS = {
    "smooth": {"ball": "gloss", "block": "two sides", "back": "textured", "left": "diffuse", "floor": "principled"},
    "rough": {"ball": "rough glass", "block": "bumps", "back": "rough metal", "floor": "diffuse"},
    "mirrors": {"ball": "glass", "block": "mask", "back": "plastic", "left": "sharp gloss", "floor": "diffuse"},
    "metal": {"ball": "metal", "block": "sharp gloss", "back": "bumps", "floor": "textured"},
}
PLAIN = [name for name, made in SETS.items() if not set(made.values()) & set(MIRRORS)]
COVERED = [(lamp, name) for lamp, name in product(LAMPS, SETS) if name in PLAIN or lamp not in WITH_DIRAC]
PAIRS = [(lamp, one) for lamp, one in product(LAMPS, MATERIALS) if one not in MIRRORS or lamp not in WITH_DIRAC]
OTHERS = 35  # comparisons in this file besides these two lists
COMPARISONS = len(COVERED) + len(PAIRS) + OTHERS


def named(made_of: dict[str, str]) -> dict[str, Any]:
    known = materials()
    return {slot: known[name] for slot, name in made_of.items()}


@pytest.mark.parametrize(("lamp", "made_of"), COVERED)
def test_pictures_have_the_mean_of_path(lamp: str, made_of: str, tmp_path: Path) -> None:
    """Every kind of lamp with every kind of material, several in a room."""
    scene = room(lamps()[lamp], named(SETS[made_of]))
    ours, theirs = (draw(scene, how, 16, salt=lamp + made_of) for how in ("bdpt", "path"))
    check_means(ours, theirs, tmp_path, COMPARISONS)


@pytest.mark.slow
@pytest.mark.parametrize(("lamp", "material"), PAIRS)
def test_pictures_have_the_mean_of_path_pair_by_pair(lamp: str, material: str, tmp_path: Path) -> None:
    scene = room(lamps()[lamp], named({"ball": material, "block": material}))
    ours, theirs = (draw(scene, how, 32, 256, salt=lamp + material) for how in ("bdpt", "path"))
    check_means(ours, theirs, tmp_path, COMPARISONS)


@pytest.mark.slow
@pytest.mark.parametrize("lamp", ["disk", "cylinder", "textured sphere", "sky", "projector"])
def test_rarer_lamps(lamp: str, tmp_path: Path) -> None:
    scene = room(rarer_lamps()[lamp], named({"ball": "gloss", "block": "textured"}))
    ours, theirs = (draw(scene, how, 32, 256, salt=lamp) for how in ("bdpt", "path"))
    check_means(ours, theirs, tmp_path, COMPARISONS)


@pytest.mark.slow
def test_a_lamp_with_shading_normals(tmp_path: Path) -> None:
    """Light leaves a lamp by the normals of its corners: the cosine and the place are those of Mitsuba's mesh."""
    import mitsuba as mi

    scene = room(lamps()["mesh"], named({"ball": "gloss"}))
    parameters = mi.traverse(scene.scene)
    corners = np.array(parameters["lamp.vertex_positions"]).reshape(-1, 3)
    corners -= corners.mean(0)
    parameters["lamp.vertex_normals"] = (corners / np.linalg.norm(corners, axis=1)[:, None]).ravel()
    parameters.update()
    ours, theirs = (draw(scene, how, 32, 256) for how in ("bdpt", "path"))
    check_means(ours, theirs, tmp_path, COMPARISONS)


@pytest.mark.parametrize("lamp", DIRAC_LAMPS)
@pytest.mark.parametrize("mirror", ["glass", "metal"])
def test_caustics_of_dirac_lamps_are_those_of_a_particle_tracer(lamp: str, mirror: str, tmp_path: Path) -> None:
    """
    A camera that sees the floor beside a mirroring ball, and not the ball: there a particle tracer misses nothing.
    """
    import mitsuba as mi

    at = mi.ScalarTransform4f().look_at([-0.1, 0.4, 1.6], [-0.3, -1, 0.75], [0, 0, -1])
    scene = room(lamps()[lamp], named({"ball": mirror}), camera={"type": "perspective", "fov": 24, "to_world": at})
    ours, theirs = (draw(scene, how, 16, 256, salt=lamp + mirror) for how in ("bdpt", "ptracer"))
    check_means(ours, theirs, tmp_path, COMPARISONS)


def cameras() -> dict[str, dict[str, Any]]:
    import mitsuba as mi

    t = mi.ScalarTransform4f()
    at = t.look_at([0, 0.3, 4.2], [0, -0.35, 0], [0, 1, 0])
    lens = {"type": "thinlens", "aperture_radius": 0.15, "focus_distance": 4.0, "fov": 34, "to_world": at}
    return {
        "thin lens": {"camera": lens},
        "orthographic": {"camera": {"type": "orthographic", "to_world": at @ t.scale([1.1, 1.1, 1])}},
        "window": {"crop": (3, 4, 8, 8), "size": (20, 16)},
        "window of a lens": {"crop": (4, 4, 8, 8), "camera": lens},
        "gaussian": {"rfilter": "gaussian"},
        "mitchell": {"rfilter": "mitchell"},
        "shading normals": {"smooth_block": True},
    }


@pytest.mark.parametrize(
    "name", ["thin lens", "orthographic", "window", "window of a lens", "gaussian", "mitchell", "shading normals"]
)
def test_cameras_filters_and_shading_normals(name: str, tmp_path: Path) -> None:
    options = cameras()[name]
    rfilter = options.get("rfilter", "box")
    scene = room(lamps()["rectangle"], named({"ball": "gloss", "block": "diffuse"}), **options)
    ours, theirs = (draw(scene, how, 24, rfilter=rfilter, salt=name) for how in ("bdpt", "path"))
    check_means(ours, theirs, tmp_path, COMPARISONS)


@pytest.mark.parametrize("how", ["bdpt:heuristic=balance", "bdpt:light_sampler=power", "bdpt:light_sampler=spatial",
                                 "bdpt:rr_depth=2"])  # fmt: skip
def test_every_way_to_pick_and_weigh(how: str, tmp_path: Path) -> None:
    """Heuristics, light samplers and Russian roulette change the noise, not the mean."""
    scene = room(lamps()["several"], named(SETS["smooth"]))
    check_means(draw(scene, how, 16, salt="a"), draw(scene, "path", 16, salt="b"), tmp_path, COMPARISONS)


def test_what_light_paths_are_aimed_at_changes_no_mean(tmp_path: Path) -> None:
    scene = room(lamps()["rectangle"], named(SETS["mirrors"]))
    check_means(draw(scene, "bdpt", 16), draw(scene, "bdpt:aim=false", 16), tmp_path, COMPARISONS)


@pytest.mark.parametrize("sampler", ["stratified", "sobol", "halton", "zsobol", "pmj02bn", "poissondisk", "ldsampler"])
def test_every_sampler(sampler: str, tmp_path: Path) -> None:
    """Both subpaths draw from samplers of their own: nothing of one is found in the other."""
    scene = room(lamps()["rectangle"], named({"ball": "gloss"}))
    ours, theirs = draw(scene, "bdpt", 24, sampler=sampler), draw(scene, "path", 24)
    check_means(ours, theirs, tmp_path, COMPARISONS)


@pytest.mark.parametrize("lamp", ["rectangle", "constant"])
def test_hidden_lamps(lamp: str, tmp_path: Path) -> None:
    """A lamp that is hidden lets the camera see through it, a ball too, and so it does for paths from the lamp."""
    lamp_parts = dict(lamps()[lamp])
    if lamp == "rectangle":
        import mitsuba as mi

        t = mi.ScalarTransform4f().translate([0.1, -0.3, 1.2]) @ mi.ScalarTransform4f().scale(0.25)
        lamp_parts["lamp"] = {**lamp_parts["lamp"], "to_world": t @ mi.ScalarTransform4f().rotate([0, 1, 0], 180)}
    scene = room(lamp_parts, named({"ball": "gloss"}))
    ours, theirs = (draw(scene, how, 24, hide_emitters=True) for how in ("bdpt", "path"))
    check_means(ours, theirs, tmp_path, COMPARISONS)


def strategies(edges: int) -> Iterator[str]:
    return (f"{s}-{edges + 1 - s}" for s in range(edges + 1))


@pytest.mark.parametrize("lamp", ["rectangle", "point", "envmap"])
@pytest.mark.parametrize("edges", [2, 3, 4])
def test_every_strategy_alone_has_the_light_of_its_paths(lamp: str, edges: int) -> None:
    """Of paths of one length, without weights: s = 0 cannot hit a Dirac lamp, all others have the same mean."""
    scene = room(lamps()[lamp], named({"ball": "gloss", "block": "diffuse"}))
    long, short = (draw(scene, "path", 16, 256, max_depth=depth).mean((1, 2)) for depth in (edges, edges - 1))
    exact = long.mean(0) - short.mean(0)
    error = np.sqrt((long.var(0, ddof=1) + short.var(0, ddof=1)) / 16)
    for pair in strategies(edges):
        how = f"bdpt:debug_weighted=false,debug_strategy={pair}"
        alone = draw(scene, how, 16, 256, max_depth=edges).mean((1, 2))
        if lamp == "point" and pair.startswith("0-"):
            assert not alone.any()
            continue
        z = (alone.mean(0) - exact) / np.sqrt(alone.var(0, ddof=1) / 16 + error**2)
        assert np.abs(z).max() < 4.5, f"strategy {pair}: z {z}, {alone.mean(0)} against {exact}"


def test_weighted_strategies_sum_to_the_picture() -> None:
    """With the same random numbers: nothing is counted twice, nothing is left out."""
    from renderer.integrators import adapter

    scene = room(lamps()["several"], named(SETS["smooth"]))
    parts = sum(
        draw_with_the_seeds_of(scene, adapter, "bdpt", strategy=(s, t))
        for s, t in product(range(5), range(1, 6)) if 2 <= s + t <= 5
    )  # fmt: skip
    whole = draw_with_the_seeds_of(scene, adapter, "bdpt", strategy=None)
    assert parts == pytest.approx(whole, rel=1e-3, abs=1e-5)


def draw_with_the_seeds_of(scene: Any, adapter: Any, how: str, **options: Any) -> Any:
    """One picture of ``how`` with other options for the estimator, its seeds unchanged."""
    with pytest.MonkeyPatch.context() as patch:
        made = adapter.Options
        patch.setattr(adapter, "Options", lambda **given: made(**{**given, **options}))
        return draw(scene, how, 1, 16, max_depth=4)[0]


@pytest.mark.parametrize("how", ["bdpt", "path"])
def test_furnace(how: str) -> None:
    """In a closed ball with Le = 1 and albedo ½ paths of up to k edges bring 2 − 2^(1−k)."""
    scene = furnace()
    for edges in (1, 2, 5, 10):
        picture = draw(scene, how, 4, 256, max_depth=edges)
        expected = 2 - 2.0 ** (1 - edges)
        mean, error = picture.mean((1, 2, 3)), picture.mean((1, 2, 3)).std(ddof=1) / 2
        assert abs(mean.mean() - expected) < 5 * error + 2e-3, (edges, mean.mean(), expected)


def furnace() -> Any:
    from renderer.scenes.load import LoadedScene

    scene: Any = scene_of({
        "box": {"type": "cube", "flip_normals": True,
                 "bsdf": {"type": "diffuse", "reflectance": {"type": "rgb", "value": 0.5}},
                 "emitter": {"type": "area", "radiance": {"type": "rgb", "value": 1.0}}},
        "sensor": {"type": "perspective", "fov": 60, "film": {"type": "hdrfilm", "width": 8, "height": 8,
                                                             "rfilter": {"type": "box"}}},
    })  # fmt: skip
    return LoadedScene(scene, scene.sensors()[0], 8, 8, (0, 0, 8, 8))


def test_one_edge_is_the_lamp_as_it_is_seen() -> None:
    """At max_depth 1 both draw what the same camera rays hit: the same picture, to the last bit."""
    lamp = dict(lamps()["sphere"])
    lamp["lamp"] = {**lamp["lamp"], "center": [0.2, 0.2, 0.6]}
    scene = room(lamp, named({"ball": "gloss"}))
    ours, theirs = (draw_with_seed(scene, how, 5) for how in ("bdpt", "path"))
    assert ours.max() > 0
    assert np.array_equal(ours, theirs)


def draw_with_seed(scene: Any, how: str, number: int) -> Any:
    from renderer import catalog
    from renderer.render import render
    from renderer.spec import CellSpec, Choice, Estimand

    choice = catalog.resolve("integrator", how)
    kept = tuple(pair for pair in choice.parameters if pair[0] not in ("max_depth", "hide_emitters"))
    estimand = Estimand("0" * 64, scene.width, scene.height, 1, catalog.resolve("rfilter", "box"))
    spec = CellSpec(estimand, Choice(choice.name, choice.version, kept), catalog.resolve("sampler", "independent"), 16)
    return next(render(spec, scene, [number])).picture


def test_a_wrong_weight_is_found(tmp_path: Path) -> None:
    """Pictures without weights, summed: the comparison has to see that, or it could not fail."""
    from renderer.integrators import adapter

    scene = room(lamps()["rectangle"], named({"ball": "gloss"}))
    made = adapter.Options
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(adapter, "Options", lambda **given: made(**{**given, "weighted": False}))
        wrong = draw(scene, "bdpt", 16)
    with pytest.raises(pytest.fail.Exception, match="means differ"):
        check_means(wrong, draw(scene, "path", 16), tmp_path, COMPARISONS)


def test_where_there_is_no_lamp_it_is_dark() -> None:
    assert not draw(room({}, {}), "bdpt", 1).any()


def test_a_camera_inside_glass(tmp_path: Path) -> None:
    """The camera's own surroundings are what it sees them through."""
    import mitsuba as mi

    at = mi.ScalarTransform4f().look_at([0, 0.3, 4.2], [0, -0.35, 0], [0, 1, 0])
    shell = {"shell": {"type": "sphere", "center": [0, 0.3, 4.2], "radius": 0.3, "bsdf": {"type": "dielectric"}}}
    scene = room({**lamps()["rectangle"], **shell}, {}, camera={"type": "perspective", "fov": 34, "to_world": at})
    ours, theirs = (draw(scene, how, 16, max_depth=6) for how in ("bdpt", "path"))
    check_means(ours, theirs, tmp_path, COMPARISONS)


def test_smoke_is_refused_in_a_sentence() -> None:
    smoke = {"fog": {"type": "sphere", "center": [0, 0, 1], "radius": 0.2, "bsdf": {"type": "null"},
                     "interior": {"type": "homogeneous", "albedo": 0.5}}}  # fmt: skip
    scene = room({**lamps()["rectangle"], **smoke}, {})
    with pytest.raises(SceneError, match="take volpath"):
        draw(scene, "bdpt", 1)


def test_a_particle_tracer_of_parallel_rays_is_refused_in_a_sentence() -> None:
    scene = room(lamps()["rectangle"], {}, **cameras()["orthographic"])
    with pytest.raises(SceneError, match="orthographic sensor; bdpt can"):
        draw(scene, "ptracer", 1)


def test_kernels_do_not_grow_with_the_depth() -> None:
    """Depths that need as much room for vertices share one kernel, and more room makes it no longer."""
    scene = room(lamps()["rectangle"], {})
    seen = {depth: kernel_of(scene, depth) for depth in (3, 9, 34, 50)}
    assert seen[3]["hash"] == seen[9]["hash"] == seen[34]["hash"]
    assert seen[50]["operation_count"] == seen[3]["operation_count"]


def kernel_of(scene: Any, depth: int) -> Any:
    """The kernel that draws a pass: the longest one."""
    import drjit as dr

    from renderer import render as loop

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(loop, "_compile_seconds", lambda: 0.0)  # reading the history forgets it
        draw(scene, "bdpt", 1, 1, max_depth=depth)
    return max(dr.kernel_history([dr.KernelType.JIT]), key=lambda kernel: kernel["operation_count"])


def test_more_room_is_another_kernel() -> None:
    """Dr.Jit 1.5 takes kernels for one that differ in the size of a local array alone: then this would crash."""
    scene = room(lamps()["rectangle"], {})
    shallow, deep = (kernel_of(scene, depth)["hash"] for depth in (20, 50))
    assert shallow != deep
