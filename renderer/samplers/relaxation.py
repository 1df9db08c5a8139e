"""
Lloyd relaxation on the torus: every point moves to the centroid of its Voronoi cell.

A step makes a set more even; after many it turns into patches of a hexagonal lattice, which alias. Source: Lloyd 1982,
"Least Squares Quantization in PCM"; for point sets in rendering, McCool and Fiume 1992.
"""

from __future__ import annotations

import math

import numpy as np

from renderer.samplers.torus import Floats

BATCH = 2**15  # points, of several sets, that are triangulated together


def lloyd(points: Floats, iterations: int) -> Floats:
    """(K, N, 2) points in [0, 1) after so many steps of Lloyd relaxation."""
    sets, n, _ = points.shape
    together = max(1, BATCH // n)
    for _ in range(iterations if n > 1 else 0):  # the cell of a single point is centred on it
        points = np.concatenate([_step(points[k : k + together]) for k in range(0, sets, together)])
    return points


def _step(points: Floats) -> Floats:
    """One step. How far the periodic copies have to reach is known only afterwards: as far as the empty circles do."""
    seam = 2 / math.sqrt(points.shape[1])
    while (centroids := _centroids(points, seam)) is None:
        seam *= 1.5
    centroids -= np.floor(centroids)
    return np.where(centroids < 1, centroids, 0.0)  # −1e-17 − ⌊−1e-17⌋ is 1


def _centroids(points: Floats, seam: float) -> Floats | None:
    """
    The exact centroids of the Voronoi cells, (K, N, 2); None where an empty circle reaches beyond the copies in
    ``seam``.

    The cells are the dual of one Delaunay triangulation of all sets. A cell is cut into triangles from its point p to
    the edges a → b between circumcentres: each has the area (a − p) × (b − p) / 2 and the centroid (p + a + b) / 3.
    """
    from scipy.spatial import Delaunay  # takes half a second to import

    sets, n, _ = points.shape
    spots, column = _laid_out(points, seam)
    mesh = Delaunay(spots)
    a, b, c = (spots[mesh.simplices[:, k]] for k in range(3))
    centre = a + _circumcentre(b - a, c - a)
    radius = np.hypot(*(centre - a).T)

    # Triangles turn left, so the one across the edge v₁ → v₂ comes before this one on the way round v₁.
    origin, across = np.roll(mesh.simplices, -1, axis=1).ravel(), mesh.neighbors.ravel()
    here = np.repeat(np.arange(len(centre)), 3)
    own = np.flatnonzero(origin < sets * n)
    origin, across, here = origin[own], across[own], here[own]
    middle = centre[here] - column[origin]
    if (across < 0).any() or (np.abs(middle - 0.5) + radius[here, None] > 0.5 + seam).any():
        return None

    p = spots[origin]
    before, after = centre[across] - p, centre[here] - p
    area = (before[:, 0] * after[:, 1] - before[:, 1] * after[:, 0]) / 2
    moment = area[:, None] * (before + after) / 3
    total = np.bincount(origin, area, sets * n)
    shift = np.stack([np.bincount(origin, moment[:, axis], sets * n) / total for axis in range(2)], axis=1)
    return points + shift.reshape(points.shape)


def _laid_out(points: Floats, seam: float) -> tuple[Floats, Floats]:
    """
    The points of all sets, set after set, then their periodic copies within ``seam`` of the unit square: (M, 2). The
    sets lie in a row, too far apart to meet in an empty circle. And what was added to each spot for that, (M, 2).
    """
    sets, n, _ = points.shape
    flat = points.reshape(-1, 2)
    place = np.zeros_like(flat)
    place[:, 0] = np.repeat(np.arange(sets), n) * (3 + 6 * seam)
    rounds = range(-math.ceil(seam), math.ceil(seam) + 1)
    spots, places = [flat], [place]
    for shift in [(x, y) for x in rounds for y in rounds if (x, y) != (0, 0)]:
        copy = flat + np.array(shift)
        near = (np.abs(copy - 0.5) <= 0.5 + seam).all(axis=1)
        spots.append(copy[near])
        places.append(place[near])
    column = np.concatenate(places)
    return np.concatenate(spots) + column, column


def _circumcentre(b: Floats, c: Floats) -> Floats:
    """Of the triangles (0, b, c)."""
    double = 2 * (b[:, 0] * c[:, 1] - b[:, 1] * c[:, 0])[:, None]
    bb, cc = (b**2).sum(axis=1), (c**2).sum(axis=1)
    with np.errstate(divide="ignore", invalid="ignore"):  # flat triangles, on the rim
        return np.stack([c[:, 1] * bb - b[:, 1] * cc, b[:, 0] * cc - c[:, 0] * bb], axis=1) / double
