"""
pbrt's shapes as Mitsuba's.

Whole spheres, cylinders and disks under a transform that keeps their form stay what they are; parts of them, stretched
ones, cones and paraboloids become fine meshes, and the report says so. Meshes are written in world coordinates.
Source: pbrt-v3, src/shapes (parametrisations).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from renderer.errors import SceneError, shown
from renderer.scenes.pbrt import meshes, ply, transforms, xml
from renderer.scenes.pbrt.lexer import Place
from renderer.scenes.pbrt.meshes import Floats, Mesh
from renderer.scenes.pbrt.output import Output
from renderer.scenes.pbrt.parameters import Parameters
from renderer.scenes.pbrt.parser import Folder
from renderer.scenes.pbrt.report import Report
from renderer.scenes.pbrt.transforms import Matrix
from renderer.scenes.pbrt.xml import Xml

COLUMNS, ROWS = 128, 64  # of a surface that becomes a mesh
UNSUPPORTED = frozenset({"curve", "hyperboloid", "loopsubdiv", "nurbs"})
QUADRICS = frozenset({"sphere", "cylinder", "disk", "cone", "paraboloid"})


@dataclass(frozen=True)
class Shape:
    """
    shape        the element, to which its BSDF and its emitter are added
    upside_down  whether its v runs against pbrt's
    """

    shape: Xml
    upside_down: bool = False


class ShapeMaker:
    """Makes shapes, and writes their meshes."""

    def __init__(self, folder: Folder, report: Report, output: Output):
        self.folder, self.report, self.output = folder, report, output
        self.budget = meshes.Budget()

    def make(
        self,
        kind: str,
        given: Parameters,
        matrix: Matrix,
        *,
        reverse: bool,
        uses_uv: bool,
        lamp: bool,
        group: bool,
        back: bool = False,
    ) -> Shape | None:
        """
        A shape. None, and an error in the report, for a kind that we lack.

        uses_uv  u, v and the tangent matter; lamp  it emits; group  it is part of an object that is instanced
        back     the other side of it, set back by a hair: Mitsuba's lamps shine to one side
        """
        if kind in QUADRICS:
            if lamp and transforms.swaps(matrix):
                self.report.note(
                    given.place, f"a {kind} that emits under a mirroring transform shines to the side to which its "
                    "normal is mirrored; pbrt-v3 disagrees with itself there"
                )  # fmt: skip
            return self._quadric(kind, given, matrix, reverse, uses_uv, group, back)
        if kind in ("trianglemesh", "plymesh", "heightfield"):
            mesh, own_normals = self._mesh(kind, given)
            mesh = meshes.with_uv(mesh) if uses_uv and kind != "heightfield" else mesh
            return self._written(meshes.placed(mesh, matrix, reverse, own_normals=own_normals), given.place, back)
        told = "is not supported" if kind in UNSUPPORTED else "is unknown"
        self.report.lacks(given.place, f"the shape {shown(kind)} {told}; make it a trianglemesh or plymesh")
        given.ignore(*given.items)
        return None

    def _written(self, mesh: Mesh, place: Place, back: bool) -> Shape:
        mesh = meshes.other_side(mesh) if back else mesh
        path, name = self.output.new("meshes", ".ply", place)
        meshes.write(mesh, path)
        return Shape(
            xml.plugin(
                "shape",
                "ply",
                xml.value("string", "filename", name),
                xml.value("boolean", "face_normals", True) if mesh.normals is None else None,
            )
        )

    def _mesh(self, kind: str, given: Parameters) -> tuple[Mesh, bool]:
        """A mesh in its own coordinates, and whether it brings normals along."""
        if kind == "plymesh":
            name = given.text("filename")
            if not name:
                raise SceneError(f'{given.place}: {given.owner} names no file; add "string filename"')
            mesh = ply.read(self.folder.locate(name, given.place, "the mesh"), name, given.place, self.budget)
            return mesh, mesh.normals is not None
        if kind == "heightfield":
            return self._heightfield(given), False
        points, indices = given.array("P", 3, "point3"), given.array("indices", 3, "integer")
        if points is None or indices is None:
            raise SceneError(f"{given.place}: {given.owner} has no {'P' if points is None else 'indices'}")
        self.budget.take(len(points), len(indices), given.place)
        uv = given.array("uv", 2, "float", "point2")
        uv = given.array("st", 2, "float", "point2") if uv is None else uv
        normals = given.array("N", 3, "normal", "vector3", "point3")
        if given.get("S") is not None:
            self.report.note(given.place, "the tangents S of a trianglemesh are left out; they follow from u and v")
        given.ignore("faceIndices")
        if (indices != np.floor(indices)).any():
            raise SceneError(f"{given.place}: the indices of {given.owner} are integers")
        return meshes.checked(Mesh(points, indices.astype(np.int64), normals, uv), given.place), normals is not None

    def _heightfield(self, given: Parameters) -> Mesh:
        columns, rows = given.integer("nu", -1), given.integer("nv", -1)
        heights = given.array("Pz", 1, "float")
        if columns < 2 or rows < 2 or heights is None or len(heights) != columns * rows:
            raise SceneError(f"{given.place}: a heightfield takes nu and nv of at least 2, and nu·nv numbers Pz")
        self.budget.take(len(heights), 2 * len(heights), given.place)
        y, x = np.meshgrid(np.linspace(0, 1, rows), np.linspace(0, 1, columns), indexing="ij")
        i, j = (part.ravel() for part in np.meshgrid(np.arange(columns - 1), np.arange(rows - 1)))
        a = j * columns + i
        faces = np.stack([a, a + 1, a + columns + 1, a, a + columns + 1, a + columns], axis=1).reshape(-1, 3)
        uv = np.stack([x.ravel(), y.ravel()], axis=1)
        return Mesh(np.concatenate([uv, heights], axis=1), faces, None, uv)

    def _quadric(
        self, kind: str, given: Parameters, matrix: Matrix, reverse: bool, uses_uv: bool, group: bool, back: bool
    ) -> Shape:
        radius = given.number("radius", 1, positive=True)
        sweep = min(max(given.number("phimax", 360), 0), 360)
        ends = {"sphere": (-radius, radius), "cylinder": (-1.0, 1.0), "paraboloid": (0.0, 1.0)}.get(kind)
        low, high = sorted((given.number("zmin", ends[0]), given.number("zmax", ends[1]))) if ends else (0.0, 0.0)
        height = given.number("height", 1.0 if kind == "cone" else 0.0) if kind in ("cone", "disk") else 0.0
        inner = given.number("innerradius", 0) if kind == "disk" else 0.0
        scale = transforms.similarity(matrix)
        if sweep == 360 and scale is not None:
            flip = xml.value("boolean", "flip_normals", True) if reverse != back else None
            gap = (
                max(meshes.GAP * radius, meshes.GAP_LEAST * float(np.abs(matrix[:3, 3]).max()) / scale) if back else 0.0
            )
            lifted = gap if flip is None else -gap  # along the normal
            if kind == "sphere" and low <= -radius and high >= radius:
                return self._sphere(matrix, radius + lifted, scale, flip)
            if kind == "cylinder" and not group:  # Mitsuba sees no cylinders inside instances
                line = [xml.point("p0", (0, 0, low)), xml.point("p1", (0, 0, high))]
                size = xml.value("float", "radius", radius + lifted)
                return Shape(xml.plugin("shape", "cylinder", *line, size, xml.transform("to_world", matrix), flip))
            if kind == "disk" and inner == 0 and not uses_uv:
                local = matrix @ transforms.translate(0, 0, height + lifted) @ np.diag([radius, radius, 1, 1])
                return Shape(xml.plugin("shape", "disk", xml.transform("to_world", local), flip))
        if kind != "disk":
            why = "part of it, or stretched" if kind in ("sphere", "cylinder") else "which Mitsuba lacks"
            self.report.note(given.place, f"a {kind}, {why}, is drawn as a mesh of {COLUMNS}×{ROWS} squares")
        self.budget.take((COLUMNS + 1) * (ROWS + 1), 2 * COLUMNS * ROWS, given.place)
        mesh = _tessellated(kind, radius, (low, high), height, inner, math.radians(sweep), given.place)
        return self._written(meshes.placed(mesh, matrix, reverse, own_normals=False), given.place, back)

    def _sphere(self, matrix: Matrix, radius: float, scale: float, flip: Xml | None) -> Shape:
        """Mitsuba's sphere cannot be mirrored, and its v runs down: so a mirrored one has pbrt's v, and others not."""
        rotation = matrix.copy()
        rotation[:3, :3] /= scale
        mirrored = transforms.swaps(matrix)
        if mirrored:
            rotation[:3, 2] *= -1
        return Shape(
            xml.plugin(
                "shape", "sphere", xml.value("float", "radius", radius * scale),
                xml.transform("to_world", rotation), flip,
            ),
            upside_down=not mirrored,
        )  # fmt: skip


def _tessellated(kind: str, radius: float, z: tuple[float, float], height: float, inner: float, sweep: float,
                 place: Place) -> Mesh:  # fmt: skip
    """A quadric as a mesh, u along its angle and v along its profile, as in pbrt."""
    low, high = z
    if kind == "paraboloid" and (high <= 0 or low < 0):
        raise SceneError(f"{place}: a paraboloid from z = {low:g} to {high:g}; give 0 ≤ zmin < zmax")

    def at(u: Floats, v: Floats) -> tuple[Floats, Floats]:
        cos, sin, zero = np.cos(sweep * u), np.sin(sweep * u), np.zeros_like(u)
        if kind == "sphere":
            start, end = (math.acos(min(max(end / radius, -1), 1)) for end in (low, high))
            theta = start + v * (end - start)
            normal = np.stack([np.sin(theta) * cos, np.sin(theta) * sin, np.cos(theta)], axis=-1)
            return radius * normal, normal
        if kind == "cylinder":
            r, along, slope, rise = radius + zero, low + v * (high - low), 1 + zero, zero
        elif kind == "cone":
            r, along, slope, rise = radius * (1 - v), v * height, height + zero, radius + zero
        elif kind == "paraboloid":
            along = low + v * (high - low)
            r = radius * np.sqrt(along / high)
            slope, rise = 2 * r, -(radius**2) / high + zero
        else:
            r, along, slope, rise = inner + (1 - v) * (radius - inner), height + zero, zero, 1 + zero
        normal = np.stack([slope * cos, slope * sin, rise], axis=-1)
        return np.stack([r * cos, r * sin, along], axis=-1), normal / np.linalg.norm(normal, axis=-1, keepdims=True)

    return meshes.surface(at, COLUMNS, 1 if kind in ("disk", "cylinder") else ROWS)
