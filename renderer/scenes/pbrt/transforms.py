"""
pbrt's transforms as 4×4 float64 matrices, column vectors: world = M · object.

pbrt's world is left-handed, Mitsuba's right-handed. The numbers of a scene are kept as they are and the *camera* is
mirrored instead (camera.py): the picture is the same, and no geometry has to be turned.
Source: pbrt-v3, src/core/transform.cpp (conventions only).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from renderer.errors import SceneError
from renderer.scenes.pbrt.lexer import Place

Matrix = NDArray[np.float64]
IDENTITY: Matrix = np.eye(4)


def of(name: str, numbers: Sequence[float], current: Matrix, place: Place) -> Matrix:
    """The current transform after one of the directives that change it. Raises ``SceneError`` for a singular one."""
    match name:
        case "Identity":
            return IDENTITY
        case "Transform":
            return _checked(_columns(numbers), name, place)
        case "ConcatTransform":
            return current @ _checked(_columns(numbers), name, place)
        case "Translate":
            return current @ translate(*numbers)
        case "Scale":
            return current @ _checked(np.diag([*numbers, 1.0]), name, place)
        case "Rotate":
            return current @ rotate(numbers[0], numbers[1:], place)
        case _:
            return current @ look_at(numbers, place)


def translate(x: float, y: float, z: float) -> Matrix:
    made = np.eye(4)
    made[:3, 3] = x, y, z
    return made


def rotate(degrees: float, axis: Sequence[float], place: Place) -> Matrix:
    """By Rodrigues' formula: R = cos·I + (1 − cos)·a aᵀ + sin·[a]×."""
    length = float(np.linalg.norm(axis))
    if length == 0:
        raise SceneError(f"{place}: Rotate about the axis 0 0 0; give an axis that is not zero")
    a = np.asarray(axis) / length
    c, s = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    cross = np.array([[0, -a[2], a[1]], [a[2], 0, -a[0]], [-a[1], a[0], 0]])
    made = np.eye(4)
    made[:3, :3] = c * np.eye(3) + (1 - c) * np.outer(a, a) + s * cross
    return made


def look_at(numbers: Sequence[float], place: Place) -> Matrix:
    """World → camera, whose x points right, y up and z ahead: left-handed."""
    eye, target, up = np.asarray(numbers, float).reshape(3, 3)
    ahead, length = target - eye, float(np.linalg.norm(target - eye))
    right = np.cross(up, ahead)
    if length == 0 or np.linalg.norm(right) <= 1e-9 * length * np.linalg.norm(up):
        raise SceneError(f"{place}: LookAt from a point to itself, or with an up vector along the view; change one")
    ahead, right = ahead / length, right / np.linalg.norm(right)
    to_world = np.eye(4)
    to_world[:3, 0], to_world[:3, 1], to_world[:3, 2], to_world[:3, 3] = right, np.cross(ahead, right), ahead, eye
    return np.asarray(np.linalg.inv(to_world), np.float64)


def swaps(matrix: Matrix) -> bool:
    """Whether it mirrors."""
    return bool(np.linalg.det(matrix[:3, :3]) < 0)


def points(matrix: Matrix, values: NDArray[np.float64]) -> NDArray[np.float64]:
    """(n, 3) points, transformed."""
    return values @ matrix[:3, :3].T + matrix[:3, 3]


def normals(matrix: Matrix, values: NDArray[np.float64]) -> NDArray[np.float64]:
    """(n, 3) normals, transformed by the inverse transpose and of length 1 (or 0 where they were)."""
    made = values @ np.linalg.inv(matrix[:3, :3])
    length = np.linalg.norm(made, axis=1, keepdims=True)
    return np.divide(made, length, out=np.zeros_like(made), where=length > 0)


def similarity(matrix: Matrix) -> float | None:
    """The scale of a transform that is only rotation, mirroring, shift and one scale; None for any other."""
    gram = matrix[:3, :3].T @ matrix[:3, :3]
    scale = float(np.sqrt(np.trace(gram) / 3))
    return scale if np.allclose(gram, scale**2 * np.eye(3), rtol=0, atol=1e-5 * scale**2) else None


def _columns(numbers: Sequence[float]) -> Matrix:
    return np.asarray(numbers, float).reshape(4, 4).T


def _checked(matrix: Matrix, name: str, place: Place) -> Matrix:
    """Invertible and affine. Mitsuba and pbrt would both go on with a scene that is not there."""
    singular = np.linalg.svd(matrix[:3, :3], compute_uv=False)
    if not singular[2] > 1e-12 * singular[0]:
        raise SceneError(f"{place}: {name} makes everything flat (a scale of 0); no scale may be zero")
    if not np.allclose(matrix[3], [0, 0, 0, 1], atol=1e-6):
        raise SceneError(f"{place}: {name} is projective; its last row (every fourth number) has to be 0 0 0 1")
    return matrix
