"""
Mitsuba's scene XML as it is written: elements with numbers, and files beside them.

Every text that comes from a pbrt file is made a plain word first (``word``), so nothing of it can mean anything.
"""

from __future__ import annotations

import re
from collections.abc import Iterable
from xml.etree.ElementTree import Element, indent, tostring

import numpy as np
from numpy.typing import NDArray

Xml = Element


def plugin(tag: str, kind: str, *children: Xml | None, name: str = "", identity: str = "") -> Xml:
    """<tag type="kind" name=… id=…>, with its children; those that are None are left out."""
    attributes = {"type": kind} | ({"name": name} if name else {}) | ({"id": identity} if identity else {})
    made = Element(tag, attributes)
    made.extend(child for child in children if child is not None)
    return made


def value(tag: str, name: str, content: object) -> Xml:
    """<float name=… value=…> and its like."""
    if isinstance(content, bool):
        content = "true" if content else "false"
    elif isinstance(content, float):
        content = number(content)
    return Element(tag, {"name": name, "value": str(content)})


def rgb(name: str, colour: Iterable[float]) -> Xml:
    return Element("rgb", {"name": name, "value": " ".join(number(channel) for channel in colour)})


def scene() -> Xml:
    """An empty <scene>."""
    return Element("scene", {"version": "3.0.0"})


def point(name: str, place: Iterable[float], tag: str = "point") -> Xml:
    """<point name=… x=… y=… z=…>, or a <vector>."""
    x, y, z = (number(axis) for axis in place)
    return Element(tag, {"name": name, "x": x, "y": y, "z": z})


def reference(identity: str, name: str = "") -> Xml:
    return Element("ref", {"id": identity} | ({"name": name} if name else {}))


def transform(name: str, matrix: NDArray[np.float64]) -> Xml:
    """<transform> of a 4×4 matrix, or of a 3×3 one for texture coordinates."""
    if matrix.shape == (3, 3):
        full = np.eye(4)
        full[:2, :2], full[:2, 3] = matrix[:2, :2], matrix[:2, 2]
        matrix = full
    made = Element("transform", {"name": name})
    made.append(Element("matrix", {"value": " ".join(number(entry) for entry in matrix.ravel())}))
    return made


def number(content: float) -> str:
    """Nine digits: what a float32 keeps. Never "-0", so that equal scenes are equal text."""
    return f"{float(content) + 0.0:.9g}"


def word(text: str) -> str:
    """A name as a word of ASCII letters, digits, - and _: ids become keys of parameters, where a dot separates."""
    return re.sub(r"[^A-Za-z0-9_-]+", "_", text).strip("_")[:60] or "unnamed"


def to_bytes(root: Xml) -> bytes:
    indent(root, "    ")
    return b'<?xml version="1.0" encoding="utf-8"?>\n' + tostring(root, encoding="utf-8") + b"\n"
