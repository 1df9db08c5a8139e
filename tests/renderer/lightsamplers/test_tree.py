"""The tree of ``bvh``: that it holds all lamps, that nodes know what is below them, and that it picks well."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from renderer.lightsamplers import make
from tests.renderer.lightsamplers.conftest import points_in
from tests.renderer.lightsamplers.test_laws import full_pmf
from tests.renderer.scene_of import scene_of

LIGHT = {"type": "rgb", "value": [1, 1, 1]}


def random_lamps(count: int, seed: int, spots: bool = False) -> Any:
    """Lamps of any place, direction and power."""
    from renderer.lightsamplers.tree import Lamps

    rng = np.random.default_rng(seed)
    low, axis = rng.random((count, 3)) ** 3, rng.standard_normal((count, 3))
    axis /= np.linalg.norm(axis, axis=1, keepdims=True)
    spread = np.zeros(count) if spots else rng.uniform(0, np.pi, count)
    return Lamps(
        low, low + 0.1 * rng.random((count, 3)), axis, spread, np.full(count, 0.6), 10 ** rng.uniform(-3, 3, count)
    )


def depth(tree: Any) -> int:
    """Edges from the root to the deepest leaf."""

    def up(node: int) -> int:
        return 0 if node == 0 else 1 + up(int(tree.parent[node]))

    return max(up(int(leaf)) for leaf in tree.leaf)


@pytest.mark.parametrize("count", [1, 2, 3, 64, 500])
def test_every_lamp_is_one_leaf_below_nodes_that_bound_it(variant: str, count: int) -> None:
    from renderer.lightsamplers.tree import build

    lamps = random_lamps(count, seed=count)
    tree = build(lamps)
    assert np.array_equal(np.sort(tree.link[tree.is_leaf]), np.arange(count))
    assert np.array_equal(tree.link[tree.leaf], np.arange(count)) and tree.is_leaf[tree.leaf].all()
    for lamp in range(count):
        node = int(tree.leaf[lamp])
        while True:
            bounds = tree.bounds
            assert (bounds.low[node] <= lamps.low[lamp]).all() and (bounds.high[node] >= lamps.high[lamp]).all()
            angle = np.arccos(np.clip(bounds.axis[node] @ lamps.axis[lamp], -1, 1)) + lamps.spread[lamp]
            assert bounds.spread[node] >= min(angle, np.pi) - 1e-9 and bounds.falloff[node] >= lamps.falloff[lamp]
            if node == 0:
                break
            parent = int(tree.parent[node])
            assert tree.link[parent] in (node, node ^ 1)
            node = parent
    assert np.isclose(tree.bounds.power[0], lamps.power.sum())


def test_trees_stay_shallow(variant: str) -> None:
    """Lamps in one place are halved; lamps whose distances grow tenfold still end."""
    from renderer.lightsamplers.tree import Lamps, build

    same = Lamps(np.zeros((64, 3)), np.zeros((64, 3)), np.tile([0.0, 0, 1], (64, 1)), *np.ones((3, 64)))
    assert depth(build(same)) == 6
    assert depth(build(random_lamps(500, seed=1))) < 30
    far = np.outer(10.0 ** np.arange(-20, 20), [1, 0, 0])
    assert depth(build(Lamps(far, far, np.tile([0.0, 0, 1], (40, 1)), *np.ones((3, 40))))) < 40


def test_lamps_of_one_direction_are_kept_together(variant: str) -> None:
    """In two rows that shine apart the first split is by what they light, not by where they are."""
    from renderer.lightsamplers.tree import Lamps, build

    x, row = np.meshgrid(np.arange(8.0), [0.0, 1.0])
    low = np.stack([x.ravel() / 4, row.ravel(), np.zeros(16)], axis=1)
    axis = np.where(row.reshape(-1, 1) == 0, [0, 0, 1.0], [0, 0, -1.0])
    tree = build(Lamps(low, low + 0.01, axis, np.zeros(16), np.full(16, np.pi / 2), np.ones(16)))
    assert np.allclose(tree.bounds.spread[2:4], 0)


def test_pmf_is_that_of_picks_without_a_normal_too(mixed: Any) -> None:
    """A zero normal says that light may come from anywhere; the pmf still sums to 1."""
    import mitsuba as mi

    p, _ = points_in(mixed, 64, seed=9)
    pmf = full_pmf(make("bvh", mixed), p, mi.Normal3f(0 * p), 64)
    assert np.allclose(pmf.sum(1), 1, atol=1e-5) and (pmf > 0).all()


def test_near_lamps_and_those_that_face_the_point_are_picked(variant: str) -> None:
    """Of two lamps alike: by 1/d² when both face the point, hardly ever the one that faces away or is behind it."""
    import mitsuba as mi

    place = mi.ScalarTransform4f
    area = {"type": "area", "radiance": LIGHT}

    def share(a: Any, b: Any, p: Any, n: Any) -> float:
        lamp = {"type": "rectangle", "emitter": area}
        scene = scene_of({"a": {**lamp, "to_world": a}, "b": {**lamp, "to_world": b}})
        sampler = make("bvh", scene)
        first = next(k for k, e in enumerate(scene.emitters()) if "a" in e.get_shape().id())
        return float(sampler.pmf(mi.Point3f(p), mi.Normal3f(n), mi.UInt32(first))[0])

    near, far = place().translate([0, 0, -3]).scale(0.01), place().translate([0, 0, -6]).scale(0.01)
    assert np.isclose(share(near, far, [0, 0, 0], [0, 0, -1]), 0.8, atol=0.01)
    away = place().translate([0, 0, -3]).rotate([1, 0, 0], 180).scale(0.01)
    assert share(away, far, [0, 0, 0], [0, 0, -1]) < 0.1
    beside = place().translate([-3, 0, 0]).rotate([0, 1, 0], 90).scale(0.01)
    assert share(beside, near, [0, 0, 0], [0, 0, 1]) < 0.05


def test_infinite_lamps_share_what_pbrt_gives_them(variant: str) -> None:
    """n / (n + 1) of the probability, 1 where there is nothing else."""
    import mitsuba as mi

    sky = {"sky": {"type": "constant"}, "sun": {"type": "directional"}}
    lamps = {f"lamp_{k}": {"type": "point", "position": [k, 0, 0]} for k in range(3)}
    for others, share in (({}, 1), (lamps, 2 / 3)):
        scene = scene_of({"ball": {"type": "sphere"}, **sky, **others})
        far = [mi.has_flag(e.flags(), mi.EmitterFlags.Infinite) for e in scene.emitters()]
        pmf = full_pmf(make("bvh", scene), *points_in(scene, 4, seed=1), 4)
        assert np.allclose(pmf[:, far], share / 2) and np.allclose(pmf.sum(1), 1)


def test_lamps_are_where_they_are_and_shine_where_they_shine(mixed: Any) -> None:
    import mitsuba as mi

    from renderer.lightsamplers.bvh import lamps

    emitters = mixed.emitters()
    near = np.array([k for k, e in enumerate(emitters) if not mi.has_flag(e.flags(), mi.EmitterFlags.Infinite)])
    found = lamps(mixed, near, np.ones(len(near)))
    kinds = [emitters[k].get_shape().id() if emitters[k].get_shape() else emitters[k].id() for k in near]
    at = {kind: k for k, kind in enumerate(kinds)}
    assert np.allclose(found.axis[at["panel"]], [0, -1, 0], atol=1e-4) and found.spread[at["panel"]] < 0.01
    assert np.allclose(found.axis[at["disk"]], [-1, 0, 0], atol=1e-4)
    assert min(found.spread[at["ball"]], found.spread[at["cube"]]) > 2.5 and found.spread[at["point"]] == np.pi
    spot = at["spot"]
    down = np.array([0.5, -2.2, -1]) / np.linalg.norm([0.5, -2.2, -1])
    assert found.axis[spot] @ down > 0.999 and 0.9 * 35 < np.degrees(found.falloff[spot]) < 1.1 * 35
    assert np.allclose(found.low[spot], [-0.5, 1.2, 1], atol=1e-5) and np.allclose(found.high[spot], found.low[spot])
    ball = at["ball"]
    assert np.allclose(found.low[ball], [0.85, 0.65, -0.75], atol=1e-5)
    assert np.allclose(found.high[ball], [1.15, 0.95, -0.45], atol=1e-5)
