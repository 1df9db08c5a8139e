"""
pbrt's textures as small trees of values over (u, v), which can be evaluated.

What a texture is drawn with in Mitsuba is decided in texturexml.py. Three channels in "spectrum" textures, one in
"float" ones. Source: pbrt-v3, src/textures; pbrt's v points up in a picture.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from renderer.errors import SceneError, UnknownName, shown
from renderer.scenes.pbrt import imagefile, spectra
from renderer.scenes.pbrt.lexer import Place
from renderer.scenes.pbrt.noise import noise
from renderer.scenes.pbrt.parameters import SPECTRA, Parameters
from renderer.scenes.pbrt.parser import Folder
from renderer.scenes.pbrt.report import Report

Floats = NDArray[np.float64]

DOT_RADIUS = 0.35  # of a cell
LUMINANCE = np.array([0.212671, 0.715160, 0.072169])


@dataclass(frozen=True)
class Texture:
    """A value over (u, v). ``place``: where it is defined."""

    place: Place

    def at(self, u: Floats, v: Floats) -> Floats:
        """(…, C) values at coordinates of shape (…)."""
        raise NotImplementedError


@dataclass(frozen=True, eq=False)
class Constant(Texture):
    value: Floats  # (1,) or (3,)

    def at(self, u: Floats, v: Floats) -> Floats:
        return np.broadcast_to(self.value, (*u.shape, len(self.value)))


@dataclass(frozen=True)
class UVMapping:
    """(s, t) = (su·u + du, sv·v + dv)."""

    su: float
    sv: float
    du: float
    dv: float

    @property
    def matrix(self) -> Floats:
        return np.array([[self.su, 0, self.du], [0, self.sv, self.dv], [0, 0, 1.0]])

    def __call__(self, u: Floats, v: Floats) -> tuple[Floats, Floats]:
        return self.su * u + self.du, self.sv * v + self.dv


@dataclass(frozen=True, eq=False)
class Mapped(Texture):
    """A texture over (s, t), to which ``mapping`` leads."""

    mapping: UVMapping

    def at(self, u: Floats, v: Floats) -> Floats:
        return self.over(*self.mapping(u, v), u, v)

    def over(self, s: Floats, t: Floats, u: Floats, v: Floats) -> Floats:
        """``at``, of both coordinates: its parts are over (u, v)."""
        raise NotImplementedError


@dataclass(frozen=True, eq=False)
class Pattern(Mapped):
    """One of two textures, by the place."""

    first: Texture
    second: Texture

    def over(self, s: Floats, t: Floats, u: Floats, v: Floats) -> Floats:
        return np.where(self.takes_first(s, t)[..., None], self.first.at(u, v), self.second.at(u, v))

    def takes_first(self, s: Floats, t: Floats) -> NDArray[np.bool_]:
        raise NotImplementedError


class Checkerboard(Pattern):
    def takes_first(self, s: Floats, t: Floats) -> NDArray[np.bool_]:
        return (np.floor(s) + np.floor(t)) % 2 == 0


class Dots(Pattern):
    """``first`` inside of the dots."""

    def takes_first(self, s: Floats, t: Floats) -> NDArray[np.bool_]:
        column, row = np.floor(s + 0.5), np.floor(t + 0.5)
        room = 0.5 - DOT_RADIUS
        ds = s - (column + room * noise(column + 1.5, row + 2.8))
        dt = t - (row + room * noise(column + 4.5, row + 9.8))
        return (noise(column + 0.5, row + 0.5) > 0) & (ds**2 + dt**2 < DOT_RADIUS**2)


@dataclass(frozen=True, eq=False)
class Scaled(Texture):
    first: Texture
    second: Texture

    def at(self, u: Floats, v: Floats) -> Floats:
        return self.first.at(u, v) * self.second.at(u, v)


@dataclass(frozen=True, eq=False)
class Mixed(Texture):
    first: Texture
    second: Texture
    amount: Texture

    def at(self, u: Floats, v: Floats) -> Floats:
        share = self.amount.at(u, v)
        return (1 - share) * self.first.at(u, v) + share * self.second.at(u, v)


@dataclass(frozen=True, eq=False)
class Bilerp(Mapped):
    corners: tuple[Texture, Texture, Texture, Texture]  # at (0,0), (0,1), (1,0), (1,1)

    def over(self, s: Floats, t: Floats, u: Floats, v: Floats) -> Floats:
        s, t = s[..., None], t[..., None]
        v00, v01, v10, v11 = (corner.at(u, v) for corner in self.corners)
        return (1 - s) * ((1 - t) * v00 + t * v01) + s * ((1 - t) * v10 + t * v11)


class UVColour(Mapped):
    def over(self, s: Floats, t: Floats, u: Floats, v: Floats) -> Floats:
        return np.stack([s - np.floor(s), t - np.floor(t), np.zeros_like(s)], axis=-1)


@dataclass(frozen=True, eq=False)
class ImageMap(Mapped):
    path: Path
    wrap: str  # "repeat", "black" or "clamp"
    srgb: bool
    scale: float
    channels: int

    @cached_property
    def pixels(self) -> Floats:
        return imagefile.read(self.path, self.srgb, self.place) * self.scale

    def over(self, s: Floats, t: Floats, u: Floats, v: Floats) -> Floats:
        """Bilinear between pixel centres, as Mitsuba and pbrt do it."""
        height, width = self.pixels.shape[:2]
        x, y = s * width - 0.5, (1 - t) * height - 0.5
        i, j = np.floor(x).astype(int), np.floor(y).astype(int)
        fx, fy = (x - i)[..., None], (y - j)[..., None]
        looked = (1 - fy) * ((1 - fx) * self._pixel(i, j) + fx * self._pixel(i + 1, j))
        looked = looked + fy * ((1 - fx) * self._pixel(i, j + 1) + fx * self._pixel(i + 1, j + 1))
        return looked if self.channels == 3 else (looked @ LUMINANCE)[..., None]

    def _pixel(self, i: NDArray[np.int64], j: NDArray[np.int64]) -> Floats:
        height, width = self.pixels.shape[:2]
        if self.wrap == "repeat":
            return self.pixels[j % height, i % width]
        found = self.pixels[np.clip(j, 0, height - 1), np.clip(i, 0, width - 1)]
        outside = (i < 0) | (i >= width) | (j < 0) | (j >= height)
        return np.where(outside[..., None] & (self.wrap == "black"), 0.0, found)


@dataclass
class Reader:
    """Reads values that may be textures. ``floats`` and ``spectra`` are the textures defined so far, by name."""

    folder: Folder
    report: Report
    floats: Mapping[str, Texture]
    spectra: Mapping[str, Texture]

    def value(self, given: Parameters, name: str, default: float | Floats | None, channels: int) -> Texture | None:
        """
        The parameter ``name`` as a texture, whichever way it is written; the default where it is not there.

        Raises ``SceneError`` for a texture that is not defined.
        """
        found = given.get(name, "texture", "float", "integer", *SPECTRA)
        if found is None:
            if default is None:
                return None
            return Constant(given.place, np.broadcast_to(np.asarray(default, float), (channels,)))
        if found.kind == "texture":
            known = self.spectra if channels == 3 else self.floats
            wanted = found.strings[0].strip() if found.strings else ""
            if wanted not in known:
                other = self.floats if channels == 3 else self.spectra
                if wanted in other:
                    kinds = ("spectrum", "float") if channels == 3 else ("float", "spectrum")
                    raise SceneError(f"{found.place}: {name} of {given.owner} takes a {kinds[0]} texture, and "
                                     f"{shown(wanted)} is a {kinds[1]} texture")  # fmt: skip
                raise SceneError(str(UnknownName("texture", wanted, str(found.place), list(known)[:20])))
            return known[wanted]
        if found.kind in ("float", "integer"):
            return Constant(found.place, np.full(channels, found.numbers[0]))
        colour = spectra.colour(found, self.folder)
        return Constant(found.place, colour if channels == 3 else np.array([LUMINANCE @ colour]))

    def need(self, given: Parameters, name: str, default: float | Floats, channels: int) -> Texture:
        made = self.value(given, name, default, channels)
        assert made is not None
        return made

    def define(self, kind: str, given: Parameters, channels: int) -> Texture:
        """The texture of a ``Texture`` directive. A kind that we lack becomes a constant, and is reported."""
        place = given.place

        def part(name: str, default: float) -> Texture:
            return self.need(given, name, default, channels)

        match kind:
            case "constant":
                return part("value", 1.0)
            case "scale":
                return Scaled(place, part("tex1", 1.0), part("tex2", 1.0))
            case "mix":
                return Mixed(place, part("tex1", 0.0), part("tex2", 1.0), self.need(given, "amount", 0.5, 1))
            case "checkerboard":
                if given.integer("dimension", 2) != 2:
                    self.report.note(place, "a checkerboard of three dimensions is drawn in two, over u and v")
                given.ignore("aamode")
                return Checkerboard(place, self._mapping(given), part("tex1", 1.0), part("tex2", 0.0))
            case "dots":
                return Dots(place, self._mapping(given), part("inside", 1.0), part("outside", 0.0))
            case "bilerp":
                corners = part("v00", 0.0), part("v01", 1.0), part("v10", 0.0), part("v11", 1.0)
                return Bilerp(place, self._mapping(given), corners)
            case "uv":
                return UVColour(place, self._mapping(given))
            case "imagemap":
                return self._image(given, channels)
        self.report.note(place, f"the texture {shown(kind)} is not supported; a constant 0.5 is drawn")
        return Constant(place, np.full(channels, 0.5))

    def _mapping(self, given: Parameters) -> UVMapping:
        kind = given.text("mapping", "uv")
        if kind != "uv":
            self.report.note(given.place, f"the mapping {shown(kind)} of {given.owner} is not supported; u and v "
                             "of the shape are used")  # fmt: skip
            given.ignore("v1", "v2", "udelta", "vdelta")
            return UVMapping(1, 1, 0, 0)
        return UVMapping(given.number("uscale", 1), given.number("vscale", 1),
                         given.number("udelta", 0), given.number("vdelta", 0))  # fmt: skip

    def _image(self, given: Parameters, channels: int) -> ImageMap:
        name = given.text("filename")
        if not name:
            raise SceneError(f'{given.place}: {given.owner} names no file; add "string filename"')
        path = self.folder.locate(name, given.place, "the picture")
        given.ignore("trilinear", "maxanisotropy")
        wrap = given.text("wrap", "repeat")
        if wrap not in ("repeat", "black", "clamp"):
            self.report.note(given.place, f"the wrap mode {shown(wrap)} is unknown; repeat is used")
            wrap = "repeat"
        low = path.suffix.lower() in (".png", ".tga", ".jpg", ".jpeg", ".bmp")
        srgb = low and given.flag("gamma", True)
        given.ignore("gamma")
        return ImageMap(given.place, self._mapping(given), path, wrap, srgb, given.number("scale", 1), channels)
