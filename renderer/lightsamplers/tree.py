"""
A binary tree over lamps in space: each node knows where its lamps are, whereto they shine and how strong they are.

Built from the top by the surface area orientation heuristic (Conty Estevez and Kulla, "Importance Sampling of Many
Lights with Adaptive Tree Splitting", 2018, section 4.4): a split is as good as the power, the box and the solid angle
of its halves are small. No Mitsuba here.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
BUCKETS = 12  # along each axis; splits are tried between them
ENOUGH = 2048  # lamps to compare splits by: more would only cost memory


@dataclass(frozen=True)
class Lamps:
    """
    What the tree knows of n lamps.

    low, high  (n, 3)  bounding boxes
    axis       (n, 3)  unit vectors round which they shine
    spread     (n)     radians within which the normals are, of the axis; π for a ball
    falloff    (n)     radians from a normal to where light ends; π/2 of surfaces
    power      (n)     > 0
    """

    low: Floats
    high: Floats
    axis: Floats
    spread: Floats
    falloff: Floats
    power: Floats


@dataclass(frozen=True)
class Tree:
    """
    Nodes of a tree of n lamps: the root is node 0, and children lie side by side, so the sibling of k is k ^ 1 (node 1
    is nobody).

    bounds   Lamps of as many rows as there are nodes: what a node knows of all lamps below it
    link     (nodes) first child, or the lamp of a leaf
    is_leaf  (nodes)
    parent   (nodes)
    leaf     (n) the node of each lamp
    """

    bounds: Lamps
    link: NDArray[np.uint32]
    is_leaf: NDArray[np.bool_]
    parent: NDArray[np.uint32]
    leaf: NDArray[np.uint32]


def build(lamps: Lamps) -> Tree:
    """The tree of at least one lamp: one lamp a leaf. About 0.3 ms a lamp."""
    count = len(lamps.power)
    nodes = 2 * count if count > 1 else 1
    low, high, axis = (np.zeros((nodes, 3)) for _ in range(3))
    spread, falloff, power = (np.zeros(nodes) for _ in range(3))
    link, parent = np.zeros(nodes, np.uint32), np.zeros(nodes, np.uint32)
    is_leaf, leaf = np.zeros(nodes, np.bool_), np.zeros(count, np.uint32)
    free = 2
    waiting: list[tuple[int, NDArray[np.intp]]] = [(0, np.arange(count))]
    while waiting:
        node, members = waiting.pop()
        low[node], high[node] = lamps.low[members].min(0), lamps.high[members].max(0)
        power[node], falloff[node] = lamps.power[members].sum(), lamps.falloff[members].max()
        axis[node], spread[node] = (x[0] for x in cones(lamps, members, np.ones((1, len(members)), np.bool_)))
        if len(members) == 1:
            is_leaf[node], link[node], leaf[members[0]] = True, members[0], node
            continue
        left = split(lamps, members)
        link[node], parent[free : free + 2] = free, node
        waiting += [(free, members[left]), (free + 1, members[~left])]
        free += 2
    return Tree(Lamps(low, high, axis, spread, falloff, power), link, is_leaf, parent, leaf)


def split(lamps: Lamps, members: NDArray[np.intp]) -> NDArray[np.bool_]:
    """Which of at least two ``members`` go to the first child; neither child is empty."""
    if len(members) == 2:
        return np.array([True, False])
    middle = (lamps.low[members] + lamps.high[members]) / 2
    size = np.ptp(middle, axis=0)
    wide = size > 0
    if not wide.any():  # all in one place
        return np.arange(len(members)) < len(members) // 2
    bucket = np.minimum(BUCKETS * (middle - middle.min(0))[:, wide] / size[wide], BUCKETS - 1).astype(int)
    # One row a split: the members to its left. First and last bucket are never empty.
    left = (bucket.T[:, None] < np.arange(1, BUCKETS)[:, None]).reshape(-1, len(members))
    some = slice(None, None, -(-len(members) // ENOUGH))
    sets = np.concatenate([left[:, some], ~left[:, some]])
    costs = measure(lamps, members[some], sets).reshape(2, -1).sum(0)
    extent = lamps.high[members].max(0) - lamps.low[members].min(0)
    thin = extent.max() / np.maximum(extent, 1e-9 * extent.max())[wide]  # slices of these are bad clusters
    return left[(costs * np.repeat(thin, BUCKETS - 1)).argmin()]


def measure(lamps: Lamps, members: NDArray[np.intp], sets: NDArray[np.bool_]) -> Floats:
    """The cost of each set of members, rows of ``sets``: power × orientation × area of the box; inf if empty."""
    inside = sets[..., None]
    some: NDArray[np.bool_] = np.any(sets, axis=1)
    low = np.where(inside, lamps.low[members], np.inf).min(1)
    high = np.where(inside, lamps.high[members], -np.inf).max(1)
    x, y, z = np.where(some, (high - np.where(some[:, None], low, 0)).T, 0)
    # Of lamps in a line or a point the box has no area; that it is long counts all the same.
    area = 2 * (x * y + y * z + z * x) + 1e-3 * (x + y + z) ** 2
    power = np.where(sets, lamps.power[members], 0).sum(1)
    falloff = np.where(sets, lamps.falloff[members], 0).max(1)
    _, spread = cones(lamps, members, sets)
    reach = np.minimum(spread + falloff, np.pi)
    orientation = 2 * np.pi * (1 - np.cos(spread)) + np.pi / 2 * (
        2 * reach * np.sin(spread) - np.cos(spread - 2 * reach) - 2 * spread * np.sin(spread) + np.cos(spread)
    )
    return np.where(some, power * orientation * area, np.inf)


def cones(lamps: Lamps, members: NDArray[np.intp], sets: NDArray[np.bool_]) -> tuple[Floats, Floats]:
    """For each set of members, rows of ``sets``: an axis, and the angle round it that holds all of their normals."""
    own = lamps.axis[members]
    axis = sets.astype(float) @ own
    length = np.linalg.norm(axis, axis=1, keepdims=True)
    axis = np.divide(axis, length, out=np.tile([0.0, 0.0, 1.0], (len(sets), 1)), where=length > 1e-6)
    angle = np.arccos(np.clip(axis @ own.T, -1, 1)) + lamps.spread[members]
    return axis, np.minimum(np.where(sets, angle, 0).max(1), np.pi)
