"""
``bvh``: a walk down a tree of lamps, at each node to the child that promises more light at the lit point.

What a node promises (Conty Estevez and Kulla 2018; pbrt-v4, LightBounds::Importance) is its power over the square of
the distance, times the best cosines that its cone of normals and the receiver's normal leave open. It never promises
nothing: 2 % do not depend on angles, so cones may be estimated from samples and no lamp is ever out of reach.

Finite lamps are in the tree. Infinite ones share the probability n / (n + 1) evenly, n being their number.
"""

from __future__ import annotations

from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from renderer.lightsamplers.base import ONE_BELOW, LightSampler, radical_inverses
from renderer.lightsamplers.power import CHUNK, power_pmf
from renderer.lightsamplers.rows import Rows, running_sums
from renderer.lightsamplers.tree import Lamps, Tree, build
from renderer.samplers.bits import floats_on_device, on_device

POINTS = 64  # of a lamp, for its cone of normals
FLOOR = 0.02  # of a node's importance does not depend on directions
NOWHERE = 2**32 - 1  # the leaf of a lamp that is not in the tree


class LightTree(LightSampler):
    """p = product of the nodes' shares of their parents' importance, on the way to the lamp."""

    __slots__ = ("_far", "_far_count", "_far_share", "_leaf", "_power", "_tree")

    def __init__(self, scene: Any):
        super().__init__(scene)
        power = power_pmf(scene)
        self._power = Rows(running_sums(power[None]))
        infinite = np.array([mi.has_flag(e.flags(), mi.EmitterFlags.Infinite) for e in scene.emitters()])
        near, far = np.flatnonzero(~infinite), np.flatnonzero(infinite)
        leaf = np.full(self.count, NOWHERE, np.uint32)
        self._tree: _Nodes | None = None
        if len(near):
            tree = build(lamps(scene, near, power[near]))
            self._tree = _Nodes(tree, near)
            leaf[near] = tree.leaf
        self._leaf = on_device(leaf)
        self._far_count = len(far)
        self._far_share = len(far) / (len(far) + bool(len(near)))
        self._far = on_device(far.astype(np.uint32)) if len(far) else None

    def pick(self, p: Any, n: Any, u: Any, active: Any = True) -> tuple[Any, Any, Any]:
        if self._tree is None:
            return self._pick_far(u, active)
        if not self._far_count:
            return self._tree.descend(p, n, u, active)
        is_far = u < self._far_share
        far, far_pmf, far_rest = self._pick_far(u / self._far_share, active & is_far)
        near, near_pmf, near_rest = self._tree.descend(
            p, n, dr.clip((u - self._far_share) / (1 - self._far_share), 0, ONE_BELOW), active & ~is_far
        )
        return (
            dr.select(is_far, far, near),
            dr.select(is_far, far_pmf * self._far_share, near_pmf * (1 - self._far_share)),
            dr.select(is_far, far_rest, near_rest),
        )

    def pmf(self, p: Any, n: Any, index: Any, active: Any = True) -> Any:
        if self._tree is None:
            return mi.Float(1 / self._far_count)
        leaf = dr.gather(mi.UInt32, self._leaf, index, active)
        is_far = leaf == NOWHERE
        near = self._tree.share(p, n, leaf, active & ~is_far) * (1 - self._far_share)
        return dr.select(is_far, self._far_share / max(self._far_count, 1), near)

    def pick_emission(self, u: Any, active: Any = True) -> tuple[Any, Any, Any]:
        return self._power.pick(mi.UInt32(0), u, active)

    def pmf_emission(self, index: Any, active: Any = True) -> Any:
        return self._power.pmf(mi.UInt32(0), index, active)

    def _pick_far(self, u: Any, active: Any) -> tuple[Any, Any, Any]:
        """One of the infinite lamps, all alike."""
        scaled = u * self._far_count
        number = dr.minimum(mi.UInt32(scaled), self._far_count - 1)
        rest = dr.clip(scaled - mi.Float(number), 0, ONE_BELOW)
        return dr.gather(mi.UInt32, self._far, number, active), mi.Float(1 / self._far_count), rest


class _Nodes:
    """
    A tree in memory. Not a Dr.Jit structure, so that loops leave it alone.

    words   12 floats a node: centre and squared radius of its ball; axis of its cone and power; cosine and sine of the
            cone's angle, cosine of the falloff, nothing
    link    twice the first child; twice the lamp of a leaf, plus 1
    parent  of each node
    """

    __slots__ = ("link", "parent", "words")

    def __init__(self, tree: Tree, numbers: NDArray[np.intp]):
        """``numbers``: of the tree's lamps in the scene."""
        bounds = tree.bounds
        half = (bounds.high - bounds.low) / 2
        radius2 = 1.0001 * np.sum(half**2, axis=1) + 1e-12  # of float32
        columns = (
            (bounds.low + bounds.high) / 2, radius2, bounds.axis, bounds.power,
            np.cos(bounds.spread), np.sin(bounds.spread), np.cos(bounds.falloff), np.zeros(len(radius2)),
        )  # fmt: skip
        self.words = floats_on_device(np.column_stack(columns).ravel())
        link = 2 * tree.link
        link[tree.is_leaf] = 2 * numbers[tree.link[tree.is_leaf]] + 1
        self.link, self.parent = on_device(link), on_device(tree.parent)

    def importance(self, node: Any, p: Any, n: Any, active: Any) -> Any:
        """What a node promises at ``p`` with normal ``n`` (zero: any): > 0, per lane."""
        ball, cone, angles = (dr.gather(mi.Vector4f, self.words, node * 3 + k, active) for k in range(3))
        to_p = p - mi.Point3f(ball.x, ball.y, ball.z)
        distance2 = dr.maximum(dr.squared_norm(to_p), 1e-20)
        to_p *= dr.rsqrt(distance2)
        # The ball is seen within the angle b of its centre; from inside it may be in any direction.
        sin2_b = dr.minimum(ball.w / distance2, 1)
        sin_b, cos_b = dr.sqrt(sin2_b), dr.select(sin2_b < 1, dr.safe_sqrt(1 - sin2_b), -1)
        sin_b = dr.select(sin2_b < 1, sin_b, 0)
        cos_w = dr.dot(mi.Vector3f(cone.x, cone.y, cone.z), to_p)
        cos_x, sin_x = _less(cos_w, dr.safe_sqrt(1 - cos_w * cos_w), angles.x, angles.y)
        cos_lamp, _ = _less(cos_x, sin_x, cos_b, sin_b)
        cos_lamp = dr.select(cos_lamp > angles.z, dr.maximum(cos_lamp, 0), 0)
        cos_i = dr.abs(dr.dot(n, to_p))  # light from behind counts too: the surface may be glass
        cos_p, _ = _less(cos_i, dr.safe_sqrt(1 - cos_i * cos_i), cos_b, sin_b)
        cos_p = dr.select(dr.squared_norm(n) > 0, cos_p, 1)
        return cone.w / dr.maximum(distance2, ball.w) * dr.fma(1 - FLOOR, cos_lamp * dr.maximum(cos_p, 0), FLOOR)

    @dr.syntax  # type: ignore[untyped-decorator]
    def descend(self, p: Any, n: Any, u: Any, active: Any) -> tuple[Any, Any, Any]:
        """A walk from the root to a leaf, by ``u`` → (lamp, its probability, what is left of u)."""
        pmf, u = mi.Float(1), mi.Float(u)
        link = dr.gather(mi.UInt32, self.link, mi.UInt32(0), active)
        walking = mi.Bool(active) & (link & 1 == 0)
        while walking:
            child = link >> 1
            first, second = self.importance(child, p, n, walking), self.importance(child + 1, p, n, walking)
            share = first / (first + second)
            to_first = u < share
            pmf *= dr.select(to_first, first, second) / (first + second)
            u = dr.clip(dr.select(to_first, u / share, (u - share) / (1 - share)), 0, ONE_BELOW)
            link = dr.gather(mi.UInt32, self.link, dr.select(to_first, child, child + 1), walking)
            walking &= link & 1 == 0
        return link >> 1, pmf, u

    @dr.syntax  # type: ignore[untyped-decorator]
    def share(self, p: Any, n: Any, node: Any, active: Any) -> Any:
        """The probability that ``descend`` ends at the leaf ``node``, by the walk back from it to the root."""
        pmf, node = mi.Float(1), mi.UInt32(node)
        walking = mi.Bool(active) & (node != 0)
        while walking:
            own, other = self.importance(node, p, n, walking), self.importance(node ^ 1, p, n, walking)
            pmf *= own / (own + other)
            node = dr.gather(mi.UInt32, self.parent, node, walking)
            walking &= node != 0
        return pmf


def _less(cos_a: Any, sin_a: Any, cos_b: Any, sin_b: Any) -> tuple[Any, Any]:
    """Cosine and sine of max(0, a − b)."""
    beyond = cos_a > cos_b  # a < b
    cosine = dr.select(beyond, 1, dr.fma(cos_a, cos_b, sin_a * sin_b))
    return cosine, dr.select(beyond, 0, dr.fma(sin_a, cos_b, -cos_a * sin_b))


def lamps(scene: Any, near: NDArray[np.intp], power: NDArray[np.float64]) -> Lamps:
    """
    Where the lamps with the numbers ``near`` are and whereto they shine.

    Normals of surfaces are those of points that are sampled from the eight corners about the lamp, directions of point
    and spot lamps those of rays that these send.
    """
    count, emitters = len(near), scene.emitters()
    low, high = np.zeros((count, 3)), np.zeros((count, 3))
    surface = np.zeros(count, np.bool_)
    for row, number in enumerate(near):
        shape = emitters[number].get_shape()
        surface[row] = shape is not None
        if surface[row]:
            box = shape.bbox()
            low[row], high[row] = ([corner.x, corner.y, corner.z] for corner in (box.min, box.max))
    points = [floats_on_device(column) for column in radical_inverses(POINTS, 4).T]
    size = float(np.max(high - low, initial=1e-3))
    directions, places = np.empty((count, POINTS, 3)), np.empty((count, POINTS, 3))
    at_once = CHUNK // POINTS
    for first in range(0, count, at_once):
        some = slice(first, min(first + at_once, count))
        lane = dr.arange(mi.UInt32, (some.stop - first) * POINTS)
        row = lane // POINTS
        number = dr.gather(mi.UInt32, on_device(near[some].astype(np.uint32)), row)
        emitter = dr.gather(mi.EmitterPtr, scene.emitters_dr(), number)
        a, b, c, d = (dr.gather(mi.Float, column, lane % POINTS) for column in points)
        middle = [floats_on_device(x) for x in ((low + high)[some] / 2).T]
        corner = [dr.select((lane >> k) & 1 == 1, mi.Float(size), -size) for k in range(3)]
        it = dr.zeros(mi.Interaction3f, dr.width(lane))
        it.p = mi.Point3f([dr.gather(mi.Float, x, row) + 2 * y for x, y in zip(middle, corner, strict=True)])
        if mi.is_spectral:
            it.wavelengths, _ = mi.sample_rgb_spectrum(mi.sample_shifted(a))
        ds, _ = emitter.sample_direction(it, mi.Point2f(a, b))
        ray, _ = emitter.sample_ray(0, c, mi.Point2f(a, b), mi.Point2f(c, d))
        on_surface = mi.has_flag(emitter.flags(), mi.EmitterFlags.Surface)
        shines = dr.select(on_surface, mi.Vector3f(ds.n), ray.d)
        directions[some] = shines.numpy().T.reshape(-1, POINTS, 3)
        places[some] = ds.p.numpy().T.reshape(-1, POINTS, 3)
    low[~surface], high[~surface] = places[~surface].min(1), places[~surface].max(1)
    axis = directions.mean(1)
    length = np.linalg.norm(axis, axis=1, keepdims=True)
    axis = np.divide(axis, length, out=np.tile([0.0, 0.0, 1.0], (count, 1)), where=length > 0.1)
    angle = np.arccos(np.clip(np.einsum("lpk,lk->lp", directions, axis), -1, 1)).max(1)
    angle = np.where(length[:, 0] > 0.1, 1.05 * angle, np.pi)
    return Lamps(
        low, high, axis, np.where(surface | (angle > np.pi / 2), np.minimum(angle, np.pi), 0),
        np.where(surface, np.pi / 2, np.minimum(angle, np.pi / 2)), power,
    )  # fmt: skip
