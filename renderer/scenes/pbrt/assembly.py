"""
The Mitsuba scene as it grows: shapes with their materials and lamps, objects and their instances, emitters.

A material becomes a BSDF at the head of the scene once, and shapes refer to it; a shape that overrides parameters of
its material has one of its own. What is current when a shape is met is its ``State``; how it came to be so is the
business of ``convert``.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from renderer.errors import SceneError, UnknownName
from renderer.scenes.pbrt import xml
from renderer.scenes.pbrt.lexer import Place
from renderer.scenes.pbrt.lights import Lamp
from renderer.scenes.pbrt.materials import OVERRIDES, Material, MaterialWriter, Surface
from renderer.scenes.pbrt.output import Output
from renderer.scenes.pbrt.parameters import Parameters
from renderer.scenes.pbrt.parser import Folder
from renderer.scenes.pbrt.report import Report
from renderer.scenes.pbrt.shapes import ShapeMaker
from renderer.scenes.pbrt.textures import Reader, Texture
from renderer.scenes.pbrt.texturexml import TextureWriter
from renderer.scenes.pbrt.transforms import Matrix
from renderer.scenes.pbrt.xml import Xml


@dataclass(frozen=True)
class State:
    """What is current, and what AttributeBegin saves."""

    matrix: Matrix
    material: Material
    reverse: bool = False
    lamp: Lamp | None = None
    floats: Mapping[str, Texture] = field(default_factory=dict)
    spectra: Mapping[str, Texture] = field(default_factory=dict)
    materials: Mapping[str, Material] = field(default_factory=dict)


class Assembly:
    """
    head  BSDFs and shape groups, which others refer to
    body  shapes, instances and emitters
    """

    def __init__(self, folder: Folder, report: Report, output: Output):
        self.folder, self.report = folder, report
        self.textures = TextureWriter(output, report)
        self.materials = MaterialWriter(folder, report, self.textures)
        self.shapes = ShapeMaker(folder, report, output)
        self.head: list[Xml] = []
        self.body: list[Xml] = []
        self._bsdfs: dict[tuple[int, bool], tuple[str, Material]] = {}
        self._surfaces: dict[int, tuple[Surface, Material]] = {}
        self._identities: set[str] = set()
        self._objects: dict[str, tuple[Xml, int]] = {}
        self._group: Xml | None = None
        self._group_name = ""

    def check_no_object(self, place: Place, told: str) -> None:
        """Raises ``SceneError`` inside of an object, for what cannot be there."""
        if self._group is not None:
            raise SceneError(f"{place}: {told}")

    def begin_object(self, name: str) -> None:
        self._group = xml.plugin("shape", "shapegroup", identity=self._identity(xml.word(name)))
        self._group_name = name

    def end_object(self) -> None:
        assert self._group is not None
        group, self._group = self._group, None
        self._objects[self._group_name] = group, len(group)
        if len(group):
            self.head.append(group)

    def instance(self, name: str, matrix: Matrix, place: Place) -> None:
        """An object once more. Raises ``SceneError`` for one that is not defined, and inside of another."""
        if name not in self._objects:
            raise SceneError(str(UnknownName("object", name, str(place), list(self._objects)[:20])))
        self.check_no_object(place, "ObjectInstance inside of an object is not supported; draw its shapes")
        group, count = self._objects[name]
        if count:
            made = xml.plugin("shape", "instance", xml.reference(group.get("id", "")))
            made.append(xml.transform("to_world", matrix))
            self.body.append(made)

    def shape(self, kind: str, given: Parameters, state: State) -> None:
        """A shape under what is current. One of a kind that we lack is an error in the report."""
        material = state.material
        own = bool(OVERRIDES & given.items.keys())
        if own:
            given.fallback = material.parameters
        bsdf = given if own else material.parameters
        surface = self._surface(material, bsdf, state, own)
        lamp = state.lamp
        if lamp is not None and self._group is not None:
            self.report.note(given.place, "a lamp inside an object does not shine, as in pbrt-v3")
            lamp = None
        alpha = Reader(self.folder, self.report, state.floats, state.spectra).value(given, "alpha", None, 1)
        if "shadowalpha" in given:
            self.report.note(given.place, "shadowalpha is left out: what is transparent casts no shadow")
            given.ignore("shadowalpha")
        shines = lamp is not None and bool(lamp.radiance.any())
        for back in (False, True) if lamp and shines and lamp.twosided else (False,):
            made = self.shapes.make(
                kind, given, state.matrix, reverse=state.reverse, uses_uv=surface.uses_uv or "alpha" in given,
                lamp=lamp is not None, group=self._group is not None, back=back,
            )  # fmt: skip
            if made is None:
                return
            upside_down = made.upside_down and surface.textured
            if own:
                part = self.materials.write(material, bsdf, state.materials, upside_down=upside_down).bsdf
            else:
                part = xml.reference(self._shared(material, surface, state, upside_down))
            if alpha is not None:
                cut = self.textures.write(alpha, "opacity", upside_down=made.upside_down)
                part = xml.plugin("bsdf", "mask", cut, part)
            made.shape.set("id", self._identity(f"{xml.word(kind)}_{given.place.line}"))
            made.shape.append(part)
            if lamp and shines:
                made.shape.append(xml.plugin("emitter", "area", xml.rgb("radiance", lamp.radiance)))
            (self.body if self._group is None else self._group).append(made.shape)
        if own:
            given.ignore(*OVERRIDES)
        self.report.unknown(given)

    def _surface(self, material: Material, given: Parameters, state: State, own: bool) -> Surface:
        """The BSDF of a material as it is; made once unless the shape has a say."""
        if not own and id(material) in self._surfaces:
            return self._surfaces[id(material)][0]
        made = self.materials.write(material, given, state.materials, upside_down=False)
        if not own:
            self._surfaces[id(material)] = made, material  # kept alive, or another would have its id
        self.report.unknown(material.parameters)
        return made

    def _shared(self, material: Material, surface: Surface, state: State, upside_down: bool) -> str:
        """The name of a material's BSDF, written at the head of the scene the first time."""
        key = id(material), upside_down
        if key not in self._bsdfs:
            made = surface.bsdf
            if upside_down:
                made = self.materials.write(material, material.parameters, state.materials, upside_down=True).bsdf
            made.set("id", self._identity(material.identity + "_sphere" * upside_down))
            self.head.append(made)
            self._bsdfs[key] = made.get("id", ""), material
        return self._bsdfs[key][0]

    def _identity(self, wanted: str) -> str:
        """A name that no other thing has."""
        found, number = wanted, 2
        while found in self._identities:
            found, number = f"{wanted}_{number}", number + 1
        self._identities.add(found)
        return found
