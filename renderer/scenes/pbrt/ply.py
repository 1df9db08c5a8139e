"""
PLY files as pbrt-v3's ``plymesh`` takes them: ASCII or binary, triangles and quads (polygons become fans).

The header is believed only as far as the limits of a scene go, and every length is checked, so a truncated file is one
sentence. Source: Turk, "The PLY Polygon File Format" (1994).
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import BinaryIO

import numpy as np
from numpy.typing import NDArray

from renderer.errors import SceneError, shown
from renderer.scenes.pbrt.lexer import Place
from renderer.scenes.pbrt.meshes import VERTICES_MAX, Budget, Integers, Mesh, checked

HEADER_LINES = 1000
LINE_MAX = 2**20  # bytes of a line of an ASCII file
BLOCK = 2**16  # lines of an ASCII file that are read at once
TYPES = {
    "char": "i1", "int8": "i1", "uchar": "u1", "uint8": "u1", "short": "i2", "int16": "i2", "ushort": "u2",
    "uint16": "u2", "int": "i4", "int32": "i4", "uint": "u4", "uint32": "u4", "float": "f4", "float32": "f4",
    "double": "f8", "float64": "f8",
}  # fmt: skip
UV = (("u", "v"), ("s", "t"), ("texture_u", "texture_v"), ("texture_s", "texture_t"))
POLYGON_MAX = 1000


@dataclass
class _Element:
    """``properties``: (name, numpy type, type of the count for a list or "")."""

    name: str
    count: int
    properties: list[tuple[str, str, str]] = field(default_factory=list)


class _Broken(Exception):
    """Why a file is no mesh: the end of a sentence."""


def read(path: Path, written: str, place: Place, budget: Budget) -> Mesh:
    """
    The mesh in a PLY file. Raises ``SceneError`` that names the file, and where the scene refers to it.

    budget  what the file's header says is taken from it before anything else is read
    """
    try:
        with path.open("rb") as file:
            form, elements = _header(file)
            counts = {element.name: element.count for element in elements}
            budget.take(counts.get("vertex", 0), counts.get("face", 0), place)
            return checked(_body(file, form, elements), place)
    except _Broken as error:
        raise SceneError(f"{place}: the mesh {shown(written)} {error}") from None


def _header(file: BinaryIO) -> tuple[str, list[_Element]]:
    if file.readline(LINE_MAX).strip() != b"ply":
        raise _Broken("is no PLY file: it does not start with 'ply'")
    form, elements = "", list[_Element]()
    for _ in range(HEADER_LINES):
        line = file.readline(LINE_MAX)
        match line.decode("ascii", "replace").split():
            case ["end_header"]:
                if form not in ("ascii", "binary_little_endian", "binary_big_endian"):
                    raise _Broken("has no format that is known: ascii, binary_little_endian or binary_big_endian")
                return form, elements
            case ["format", kind, *_]:
                form = kind
            case ["element", name, count] if count.isdigit() and len(count) < 12:
                elements.append(_Element(name, int(count)))
            case ["property", "list", count, kind, name] if elements and {count, kind} <= TYPES.keys():
                elements[-1].properties.append((name, TYPES[kind], TYPES[count]))
            case ["property", kind, name] if elements and kind in TYPES:
                elements[-1].properties.append((name, TYPES[kind], ""))
            case ["comment" | "obj_info", *_] | [] if line:
                continue
            case _ if not line:
                break
            case _:
                raise _Broken(f"has the line {shown(line.strip().decode('ascii', 'replace'))} in its header")
    raise _Broken("is truncated: its header does not end")


def _body(file: BinaryIO, form: str, elements: list[_Element]) -> Mesh:
    vertices = faces = None
    columns: dict[str, NDArray[np.float64]] = {}
    for element in elements:
        lists = [item for item in element.properties if item[2]]
        if element.name == "face":
            faces = _faces(file, form, element)
        elif not lists and element.count <= VERTICES_MAX:
            columns = _scalars(file, form, element)
            if element.name == "vertex":
                vertices = columns
        elif vertices is None or faces is None:
            raise _Broken(f"has an element {shown(element.name)} that is not read here, before its mesh")
        else:
            break
    if vertices is None or faces is None:
        raise _Broken("has no vertices or no faces")
    if not {"x", "y", "z"} <= vertices.keys():
        raise _Broken("has vertices without x, y and z")
    normals = _stack(vertices, ("nx", "ny", "nz"))
    uv = next((found for names in UV if (found := _stack(vertices, names)) is not None), None)
    points = _stack(vertices, ("x", "y", "z"))
    assert points is not None
    for part in (points, normals, uv):
        if part is not None and not np.isfinite(part).all():
            raise _Broken("holds an infinite number or NaN")
    return Mesh(points, faces, normals, uv)


def _stack(columns: dict[str, NDArray[np.float64]], names: tuple[str, ...]) -> NDArray[np.float64] | None:
    return np.stack([columns[name] for name in names], axis=1) if set(names) <= columns.keys() else None


def _scalars(file: BinaryIO, form: str, element: _Element) -> dict[str, NDArray[np.float64]]:
    names = [name for name, _, _ in element.properties]
    if len(set(names)) < len(names) or (element.count and not names):
        raise _Broken(f"names a property of {shown(element.name)} twice, or none")
    if form == "ascii":
        rows = _rows(file, element.count, len(names), element.name)
        return {name: rows[:, i] for i, name in enumerate(names)}
    record = np.dtype([(name, _order(form) + kind) for name, kind, _ in element.properties])
    data = _records(file, record, element.count)
    return {name: data[name].astype(np.float64) for name in names}


def _rows(file: BinaryIO, count: int, width: int, what: str) -> NDArray[np.float64]:
    """``count`` lines of ``width`` numbers."""
    parts = [np.empty((0, width))]
    for lines in _blocks(file, count):
        numbers = _numbers(b" ".join(lines))
        if len(numbers) != len(lines) * width:
            raise _Broken(f"is truncated, or has a line of {shown(what)} without its {width} numbers")
        parts.append(numbers.reshape(-1, width))
    return np.concatenate(parts)


def _faces(file: BinaryIO, form: str, element: _Element) -> Integers:
    kinds = element.properties
    at = next((i for i, item in enumerate(kinds) if item[0] in ("vertex_indices", "vertex_index") and item[2]), None)
    if at is None:
        raise _Broken("has faces without a list vertex_indices")
    if form == "ascii":
        return _ascii_faces(file, element, at)
    order = _order(form)
    if len(kinds) == 1 and element.count:
        start = file.tell()
        first = np.frombuffer(_exactly(file, np.dtype(kinds[0][2]).itemsize), order + kinds[0][2])[0]
        file.seek(start)
        if first in (3, 4):  # all of the same size is what nearly every file has
            record = np.dtype([("count", order + kinds[0][2]), ("indices", order + kinds[0][1], int(first))])
            size = record.itemsize * element.count
            if os.fstat(file.fileno()).st_size - start >= size:
                data = _exactly(file, size)
                read = np.frombuffer(data, record)
                if (read["count"] == first).all():
                    return _triangles(read["indices"].astype(np.int64))
            file.seek(start)
    return _slow_faces(file, element, at, order)


def _slow_faces(file: BinaryIO, element: _Element, at: int, order: str) -> Integers:
    """Faces of different sizes, or with other properties beside the indices."""
    types = [
        (np.dtype(order + kind), np.dtype(order + count) if count else None) for _, kind, count in element.properties
    ]
    found: list[list[int]] = []
    for _ in range(element.count):
        for i, (kind, count) in enumerate(types):
            size = 1 if count is None else int(np.frombuffer(_exactly(file, count.itemsize), count)[0])
            if not 0 <= size <= POLYGON_MAX:
                raise _Broken(f"has a face with a list of {size} numbers")
            data = _exactly(file, kind.itemsize * size)
            if i == at:
                found += _fan(np.frombuffer(data, kind).tolist())
    return _integers(found)


def _ascii_faces(file: BinaryIO, element: _Element, at: int) -> Integers:
    parts: list[Integers] = [np.empty((0, 3), np.int64)]
    for lines in _blocks(file, element.count):
        numbers = _numbers(b" ".join(lines))
        if len(element.properties) == 1:
            for size in (3, 4):
                if len(numbers) == len(lines) * (size + 1) and (numbers[:: size + 1] == size).all():
                    parts.append(_triangles(numbers.reshape(-1, size + 1)[:, 1:].astype(np.int64)))
                    break
            else:
                parts.append(_walk(numbers, len(lines), element, at))
        else:
            parts.append(_walk(numbers, len(lines), element, at))
    return np.concatenate(parts)


def _walk(numbers: NDArray[np.float64], count: int, element: _Element, at: int) -> Integers:
    values, position = numbers.tolist(), 0
    found: list[list[int]] = []
    for _ in range(count):
        for i, (_, _, listed) in enumerate(element.properties):
            if position >= len(values):
                raise _Broken("is truncated: a face lacks numbers")
            size = int(values[position]) if listed else 1
            position += bool(listed)
            if not 0 <= size <= POLYGON_MAX or position + size > len(values):
                raise _Broken("is truncated: a face lacks numbers")
            if i == at:
                found += _fan([int(value) for value in values[position : position + size]])
            position += size
    return _integers(found)


def _fan(corners: list[int]) -> list[list[int]]:
    return [[corners[0], corners[i], corners[i + 1]] for i in range(1, len(corners) - 1)]


def _triangles(corners: Integers) -> Integers:
    if corners.shape[1] == 3:
        return corners
    return np.concatenate([corners[:, [0, 1, 2]], corners[:, [0, 2, 3]]], axis=1).reshape(-1, 3)


def _integers(faces: list[list[int]]) -> Integers:
    return np.array(faces, np.int64).reshape(-1, 3)


def _blocks(file: BinaryIO, count: int) -> Iterator[list[bytes]]:
    """``count`` lines of an ASCII file, some at a time, empty ones left out."""
    while count:
        lines: list[bytes] = []
        while len(lines) < min(count, BLOCK):
            line = file.readline(LINE_MAX)
            if not line:
                raise _Broken(f"is truncated: {count - len(lines)} lines are missing")
            if line.strip():
                lines.append(line)
        count -= len(lines)
        yield lines


def _numbers(text: bytes) -> NDArray[np.float64]:
    if not text.strip():
        return np.empty(0)
    try:
        return np.fromstring(text, sep=" ")
    except (ValueError, DeprecationWarning):
        raise _Broken("has something that is no number") from None


def _order(form: str) -> str:
    return ">" if form == "binary_big_endian" else "<"


def _records(file: BinaryIO, record: np.dtype[np.void], count: int) -> NDArray[np.void]:
    return np.frombuffer(_exactly(file, record.itemsize * count), record)


def _exactly(file: BinaryIO, size: int) -> bytes:
    there = os.fstat(file.fileno()).st_size - file.tell() if size > 2**16 else size
    data = file.read(min(size, there))  # a header may claim more than memory holds
    if len(data) < size:
        raise _Broken(f"is truncated: {size - len(data)} bytes are missing")
    return data
