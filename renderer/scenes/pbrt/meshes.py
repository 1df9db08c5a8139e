"""
Triangle meshes: placed in the world with pbrt's orientation, and written as PLY.

Which side is outside: the normal of the object as the transform carries it, reversed by ``ReverseOrientation``. A mesh
in world coordinates therefore turns its triangles round where the transform mirrors XOR the orientation is reversed.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from renderer.errors import SceneError
from renderer.scenes.pbrt import transforms
from renderer.scenes.pbrt.lexer import Place
from renderer.scenes.pbrt.transforms import Matrix

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]

VERTICES_MAX = 2 * 10**7  # of all meshes of a scene
FACES_MAX = 4 * 10**7
GAP = 1e-3  # between the two sides of a lamp, of its size: seen by nobody, and safe from rounding
GAP_LEAST = 1e-5  # the same, of the largest coordinate, for small lamps far from the origin
CORNERS = np.array([[0, 0], [1, 0], [1, 1.0]])  # u and v of a triangle that has none, in pbrt


@dataclass(frozen=True, eq=False)
class Mesh:
    """
    vertices  (n, 3); faces (m, 3), indices of vertices, anticlockwise seen from outside
    normals   (n, 3) or None: flat faces
    uv        (n, 2) or None
    """

    vertices: Floats
    faces: Integers
    normals: Floats | None = None
    uv: Floats | None = None


class Budget:
    """How many vertices and faces a scene may still have."""

    def __init__(self) -> None:
        self.vertices, self.faces = VERTICES_MAX, FACES_MAX

    def take(self, vertices: int, faces: int, place: Place) -> None:
        """Raises ``SceneError`` over the limit. To be called before memory is used."""
        self.vertices -= vertices
        self.faces -= faces
        if self.vertices < 0 or self.faces < 0:
            raise SceneError(f"{place}: the scene has more than {VERTICES_MAX} vertices or {FACES_MAX} triangles")


def checked(mesh: Mesh, place: Place) -> Mesh:
    """The mesh, if its parts fit together. Raises ``SceneError``."""
    count = len(mesh.vertices)
    if len(mesh.faces) and not (mesh.faces.min() >= 0 and mesh.faces.max() < count):
        wrong = mesh.faces.max() if mesh.faces.max() >= count else mesh.faces.min()
        raise SceneError(f"{place}: a triangle refers to vertex {wrong}, and there are {count}, counted from 0")
    for name, part in (("normals", mesh.normals), ("uv", mesh.uv)):
        if part is not None and len(part) != count:
            raise SceneError(f"{place}: {len(part)} {name} for {count} vertices; give one each")
    if not (np.abs(mesh.vertices) < 1e30).all():
        raise SceneError(f"{place}: a vertex is further away than 1e30, or NaN")
    return mesh


def placed(mesh: Mesh, matrix: Matrix, reverse: bool, *, own_normals: bool) -> Mesh:
    """
    The mesh in world coordinates, turned to the right side.

    own_normals  True: the normals come from the file, which decide the side themselves, whatever ``reverse`` says;
                 False: they belong to the surface and are reversed with it
    """
    vertices = transforms.points(matrix, mesh.vertices)
    normals = None if mesh.normals is None else transforms.normals(matrix, mesh.normals)
    if normals is not None and own_normals:
        corners = vertices[mesh.faces]
        across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        turned = (across * normals[mesh.faces].sum(axis=1)).sum(axis=1) < 0
        faces = np.where(turned[:, None], mesh.faces[:, ::-1], mesh.faces)
        return Mesh(vertices, faces, normals, mesh.uv)
    if normals is not None and reverse:
        normals = -normals
    faces = mesh.faces[:, ::-1] if transforms.swaps(matrix) != reverse else mesh.faces
    return Mesh(vertices, faces, normals, mesh.uv)


def other_side(mesh: Mesh) -> Mesh:
    """The back of a mesh as a mesh that looks the other way, set back by a hair so that no ray confuses the two."""
    corners = mesh.vertices[mesh.faces]
    across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    ahead = np.zeros_like(mesh.vertices)
    np.add.at(ahead, mesh.faces.ravel(), np.repeat(across, 3, axis=0))
    length = np.linalg.norm(ahead, axis=1, keepdims=True)
    ahead = np.divide(ahead, length, out=np.zeros_like(ahead), where=length > 0)
    normals = None if mesh.normals is None else -mesh.normals
    gap = 0.0
    if len(mesh.vertices):
        size = float(np.linalg.norm(np.ptp(mesh.vertices, axis=0)))
        gap = max(GAP * size, GAP_LEAST * float(np.abs(mesh.vertices).max()))
    return Mesh(mesh.vertices - gap * ahead, mesh.faces[:, ::-1], normals, mesh.uv)


def with_uv(mesh: Mesh) -> Mesh:
    """pbrt's u and v for a mesh that has none, the same in every triangle: its vertices are no longer shared."""
    if mesh.uv is not None:
        return mesh
    flat = mesh.faces.ravel()
    normals = None if mesh.normals is None else mesh.normals[flat]
    uv = np.tile(CORNERS, (len(mesh.faces), 1))
    return replace(
        mesh, vertices=mesh.vertices[flat], faces=np.arange(len(flat)).reshape(-1, 3), normals=normals, uv=uv
    )


def surface(at: Callable[[Floats, Floats], tuple[Floats, Floats]], columns: int, rows: int) -> Mesh:
    """
    A mesh of a parametric surface: ``at(u, v)`` → points and normals, (…, 3), for u and v in [0, 1].

    Triangles that have shrunk to a line, at poles, are left out.
    """
    v, u = np.meshgrid(np.linspace(0, 1, rows + 1), np.linspace(0, 1, columns + 1), indexing="ij")
    points, normals = (part.reshape(-1, 3) for part in at(u, v))
    i, j = (part.ravel() for part in np.meshgrid(np.arange(columns), np.arange(rows)))
    a = j * (columns + 1) + i
    b, c, d = a + 1, a + columns + 2, a + columns + 1
    faces = np.concatenate([np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)])
    corners = points[faces]
    across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    outward = (across * normals[faces].sum(axis=1)).sum(axis=1)
    faces = np.where((outward < 0)[:, None], faces[:, ::-1], faces)
    kept = np.linalg.norm(across, axis=1) > 1e-12 * max(float(np.abs(points).max()) ** 2, 1e-300)
    return Mesh(points, faces[kept], normals, np.stack([u.ravel(), v.ravel()], axis=1))


def write(mesh: Mesh, path: Path) -> None:
    """A binary little-endian PLY file with float32 vertices."""
    names = ["x", "y", "z"]
    columns = [mesh.vertices]
    if mesh.normals is not None:
        names += ["nx", "ny", "nz"]
        columns.append(mesh.normals)
    if mesh.uv is not None:
        names += ["u", "v"]
        columns.append(mesh.uv)
    header = ["ply", "format binary_little_endian 1.0", f"element vertex {len(mesh.vertices)}"]
    header += [f"property float {name}" for name in names]
    header += [f"element face {len(mesh.faces)}", "property list uchar int vertex_indices", "end_header", ""]
    faces = np.empty(len(mesh.faces), [("count", "u1"), ("indices", "<i4", 3)])
    faces["count"], faces["indices"] = 3, mesh.faces
    with path.open("wb") as file:
        file.write("\n".join(header).encode("ascii"))
        np.concatenate(columns, axis=1).astype("<f4").tofile(file)
        faces.tofile(file)
