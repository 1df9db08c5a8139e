"""
pbrt's textures as Mitsuba's: numbers, ``checkerboard`` and ``bitmap`` where they are the same, else a baked bitmap.

A baked texture is sampled at pixel centres for u and v from 0 to 1 and repeats beyond.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from renderer.scenes.pbrt import xml
from renderer.scenes.pbrt.output import Output
from renderer.scenes.pbrt.report import Report
from renderer.scenes.pbrt.textures import Checkerboard, Constant, ImageMap, Texture
from renderer.scenes.pbrt.xml import Xml

BAKED = 1024  # pixels along each side
UP = np.array([[1, 0, 0], [0, -1, 1], [0, 0, 1.0]])  # v ↔ 1 − v


class TextureWriter:
    """Makes XML of textures, and the files that it needs; a baked picture only once."""

    def __init__(self, output: Output, report: Report):
        self.output = output
        self.report = report
        self.baked: dict[Texture, str] = {}

    def write(
        self, texture: Texture, name: str, *, upside_down: bool = False, bounded: bool = True, smooth: bool = False
    ) -> Xml:
        """
        The texture as the parameter ``name``.

        upside_down  of shapes whose v runs against pbrt's: Mitsuba's spheres
        bounded      values are reflectances: Mitsuba refuses a number outside [0, 1], so they are clamped and reported
        smooth       it has to have a gradient, as a picture does and a checkerboard does not
        """
        if isinstance(texture, Constant):
            return self._constant(texture, name, bounded)
        flip = UP if upside_down else np.eye(3)
        if (
            not smooth
            and isinstance(texture, Checkerboard)
            and isinstance(texture.first, Constant)
            and isinstance(texture.second, Constant)
        ):
            half = np.diag([0.5, 0.5, 1])  # Mitsuba counts two squares as one
            parts = (self._constant(part, key, bounded) for part, key in
                     ((texture.first, "color0"), (texture.second, "color1")))  # fmt: skip
            return xml.plugin("texture", "checkerboard", *parts, self._to_uv(half @ texture.mapping.matrix @ flip),
                              name=name)  # fmt: skip
        if isinstance(texture, ImageMap) and texture.scale == 1 and texture.wrap != "black":
            file = self.output.picture(texture.path, texture.place)
            return self._bitmap(name, file, not texture.srgb, UP @ texture.mapping.matrix @ flip, texture.wrap)
        return self._bitmap(name, self._bake(texture, bounded), True, UP @ flip, "repeat")

    def _constant(self, texture: Constant, name: str, bounded: bool) -> Xml:
        value = texture.value
        if bounded and not ((value >= 0) & (value <= 1)).all():
            told = " ".join(xml.number(channel) for channel in value)
            self.report.note(texture.place, f"the reflectance {told} is clamped to 0 … 1: no surface gives more light "
                             "than it gets")  # fmt: skip
            value = np.clip(value, 0, 1)
        return xml.rgb(name, value) if len(value) == 3 else xml.value("float", name, float(value[0]))

    def _bake(self, texture: Texture, bounded: bool) -> str:
        if texture not in self.baked:
            side = BAKED
            centres = (np.arange(side) + 0.5) / side
            u, v = np.meshgrid(centres, 1 - centres)
            picture: NDArray[np.float64] = np.broadcast_to(texture.at(u, v), (side, side, 3))
            self.report.note(texture.place, f"this texture is baked into a picture of {side}×{side} pixels, for u and "
                             "v from 0 to 1")  # fmt: skip
            self.baked[texture] = self.output.baked(np.clip(picture, 0, 1) if bounded else picture, texture.place)
        return self.baked[texture]

    def _bitmap(self, name: str, file: str, raw: bool, to_uv: NDArray[np.float64], wrap: str) -> Xml:
        return xml.plugin(
            "texture", "bitmap", xml.value("string", "filename", file), xml.value("boolean", "raw", raw),
            xml.value("string", "wrap_mode", wrap), self._to_uv(to_uv), name=name,
        )  # fmt: skip

    def _to_uv(self, matrix: NDArray[np.float64]) -> Xml | None:
        return None if np.array_equal(matrix, np.eye(3)) else xml.transform("to_uv", matrix)
