"""
A pbrt-v3 scene becomes a Mitsuba scene: ``scene.xml`` with its meshes and pictures beside it.

pbrt's file is a program for a state machine: transforms, material, area light and orientation are set, and shapes take
what is current. This module is that machine; the scene grows in ``assembly``.

The folder that is made holds nothing but what we wrote: plugins of the list, numbers, plain words, names of files made
here. It is vetted all the same, like any scene. No Mitsuba here, as the owner of a data directory converts.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np

from renderer.errors import SceneError, UnknownName, shown
from renderer.scenes.pbrt import camera, settings, transforms, xml
from renderer.scenes.pbrt.assembly import Assembly, State
from renderer.scenes.pbrt.lexer import Place
from renderer.scenes.pbrt.lights import LightReader
from renderer.scenes.pbrt.materials import Material
from renderer.scenes.pbrt.output import Output
from renderer.scenes.pbrt.parameters import Parameters
from renderer.scenes.pbrt.parser import NUMERIC, Directive, Folder, directives
from renderer.scenes.pbrt.report import Report
from renderer.scenes.pbrt.textures import Reader
from renderer.scenes.pbrt.transforms import IDENTITY, Matrix
from renderer.scenes.pbrt.xml import Xml

MAIN = "scene.xml"
NESTED_MAX = 10_000  # open blocks


def convert(source: Path, into: Path) -> list[str]:
    """
    Converts the scene file ``source`` into the folder ``into``, which exists and is empty: ``scene.xml`` and its files.

    Files that the scene refers to are read only from the folder of ``source``. Returns what was replaced or ignored,
    one sentence each, with file and line. Raises ``SceneError`` with file and line for what cannot be read or is
    missing.
    """
    folder = Folder(source.parent)
    machine = _Machine(folder, Output(into))
    for directive in directives(folder, source.name):
        machine.step(directive)
        if machine.done:
            break
    root = machine.finish(Place(source.name, 1))
    machine.report.check()
    (into / MAIN).write_bytes(xml.to_bytes(root))
    return machine.report.notes


class _Machine:
    """Takes directives in order; ``finish`` gives the scene."""

    def __init__(self, folder: Folder, output: Output):
        self.report = Report()
        self.folder = folder
        self.assembly = Assembly(folder, self.report, output)
        self.lights = LightReader(folder, self.report, output)
        nowhere = Parameters("the default material", Place("", 0))
        self.default = Material("matte", nowhere, {}, {}, name="default")
        self.state = State(IDENTITY, self.default)
        self.saved: list[tuple[str, State, Place]] = []
        self.systems: dict[str, Matrix] = {}
        self.options: dict[str, tuple[str, Parameters]] = {}
        self.view = IDENTITY  # world → camera
        self.active = True  # whether transforms apply to the start of the shutter, which is what is drawn
        self.in_world = self.done = False
        self.handlers: dict[str, Callable[[Directive], None]] = {
            name: getattr(self, method)
            for name, method in {
                "CoordinateSystem": "name_system", "CoordSysTransform": "take_system", "ActiveTransform": "activate",
                "ReverseOrientation": "reverse", "WorldBegin": "begin_world", "WorldEnd": "end_world",
                "AttributeBegin": "begin", "TransformBegin": "begin", "AttributeEnd": "end", "TransformEnd": "end",
                "ObjectBegin": "begin_object", "ObjectEnd": "end_object", "ObjectInstance": "instance",
                "Camera": "option", "Film": "option", "PixelFilter": "option", "Sampler": "option",
                "Integrator": "option", "Accelerator": "option", "Texture": "texture", "Material": "material",
                "MakeNamedMaterial": "make_material", "NamedMaterial": "take_material", "Shape": "shape",
                "AreaLightSource": "area_light", "LightSource": "light", "MakeNamedMedium": "medium",
                "MediumInterface": "medium",
            }.items()
        }  # fmt: skip

    def step(self, directive: Directive) -> None:
        name = directive.name
        if name == "TransformTimes":
            return
        if name in NUMERIC or name == "Identity":
            if self.active:
                matrix = transforms.of(name, directive.numbers, self.state.matrix, directive.place)
                if not (np.abs(matrix) < 1e30).all():
                    raise SceneError(f"{directive.place}: the transform has become larger than 1e30")
                self.state = replace(self.state, matrix=matrix)
        else:
            self.handlers[name](directive)

    def finish(self, start: Place) -> Xml:
        """The scene. Raises ``SceneError`` for blocks that are still open."""
        if self.saved:
            name, _, place = self.saved[-1]
            raise SceneError(f"{place}: {name} is never ended; add {name.replace('Begin', 'End')}")
        if not self.in_world:
            raise SceneError(f"{start.file}: there is no WorldBegin; a pbrt-v3 scene has its shapes after it")
        if not self.done:
            raise SceneError(f"{start.file}: there is no WorldEnd; the file may be truncated")
        root = xml.scene()
        film = self.options.get("Film")
        if film and film[0] != "image":
            self.report.note(film[1].place, f"the film {shown(film[0])} is unknown; it is taken as image")
        kind, given = self.options.get("Integrator", ("path", Parameters("the default integrator", start)))
        lamps = sum(1 for part in self.assembly.body for _ in part.iter("emitter"))
        root.append(settings.integrator(kind, given, self.report, lamps=lamps))
        kind, given = self.options.get("Sampler", ("halton", Parameters("the default sampler", start)))
        parts = [settings.sampler(kind, given, self.report),
                 settings.film(film[1] if film else None, self.options.get("PixelFilter"), self.report)]  # fmt: skip
        kind, given = self.options.get("Camera", ("perspective", Parameters("the default camera", start)))
        size = settings.film_size(film[1] if film else None)
        root.append(camera.sensor(kind, given, self.view, size, self.report, parts))
        for _, given in self.options.values():
            self.report.unknown(given)
        root.extend(self.assembly.head)
        root.extend(self.assembly.body)
        return root

    # Transforms and blocks.

    def name_system(self, directive: Directive) -> None:
        self.systems[directive.words[0]] = self.state.matrix

    def take_system(self, directive: Directive) -> None:
        name = directive.words[0]
        if name not in self.systems:
            raise SceneError(str(UnknownName("coordinate system", name, str(directive.place), self.systems)))
        self.state = replace(self.state, matrix=self.systems[name])

    def activate(self, directive: Directive) -> None:
        self.active = directive.words[0] in ("All", "StartTime")
        self.report.note(directive.place, "nothing moves here: the scene is drawn as it is when the shutter opens",
                         once="motion")  # fmt: skip

    def reverse(self, directive: Directive) -> None:
        self.state = replace(self.state, reverse=not self.state.reverse)

    def begin_world(self, directive: Directive) -> None:
        if self.in_world:
            raise SceneError(f"{directive.place}: a second WorldBegin; only one picture is read of a file")
        self.in_world, self.active = True, True
        self.state = replace(self.state, matrix=IDENTITY)
        self.systems["world"] = IDENTITY

    def end_world(self, directive: Directive) -> None:
        if self.saved:
            name, _, place = self.saved[-1]
            raise SceneError(f"{place}: {name} is not ended before WorldEnd; add {name.replace('Begin', 'End')}")
        self.need_world(directive)
        self.done = True

    def begin(self, directive: Directive) -> None:
        if len(self.saved) >= NESTED_MAX:
            raise SceneError(f"{directive.place}: more than {NESTED_MAX} blocks are open")
        self.saved.append((directive.name, self.state, directive.place))

    def end(self, directive: Directive) -> None:
        wanted = directive.name.replace("End", "Begin")
        if not self.saved or self.saved[-1][0] != wanted:
            rest = (
                f"the open block is {self.saved[-1][0]} of line {self.saved[-1][2].line}"
                if self.saved
                else "none is open"
            )
            raise SceneError(f"{directive.place}: {directive.name} without its {wanted}: {rest}")
        _, state, _ = self.saved.pop()
        self.state = replace(self.state, matrix=state.matrix) if wanted == "TransformBegin" else state

    # Objects.

    def begin_object(self, directive: Directive) -> None:
        self.need_world(directive)
        self.assembly.check_no_object(directive.place, "ObjectBegin inside of another object; end that one first")
        self.begin(directive)
        self.assembly.begin_object(directive.words[0])

    def end_object(self, directive: Directive) -> None:
        self.end(directive)
        self.assembly.end_object()

    def instance(self, directive: Directive) -> None:
        self.need_world(directive)
        self.assembly.instance(directive.words[0], self.state.matrix, directive.place)

    # What the scene is made of.

    def option(self, directive: Directive) -> None:
        if self.in_world:
            raise SceneError(f"{directive.place}: {directive.name} after WorldBegin; put it before")
        if directive.name == "Accelerator":
            return  # how rays are traced changes no picture
        self.options[directive.name] = directive.words[0], directive.parameters
        if directive.name == "Camera":
            self.view = self.state.matrix
            self.systems["camera"] = np.asarray(np.linalg.inv(self.view), np.float64)

    def texture(self, directive: Directive) -> None:
        name, kind, what = directive.words
        given = directive.parameters
        if kind not in ("float", "spectrum", "color"):
            raise SceneError(f"{directive.place}: the texture {shown(name)} is of type {shown(kind)}; there are "
                "float and spectrum")  # fmt: skip
        state = self.state
        reader = Reader(self.folder, self.report, state.floats, state.spectra)
        made = reader.define(what, given, 1 if kind == "float" else 3)
        if kind == "float":
            self.state = replace(state, floats={**state.floats, name: made})
        else:
            self.state = replace(state, spectra={**state.spectra, name: made})
        self.report.unknown(given)

    def material(self, directive: Directive) -> None:
        self.state = replace(self.state, material=self.defined(directive.words[0], directive.parameters))

    def make_material(self, directive: Directive) -> None:
        kind = directive.parameters.text("type")
        name = directive.words[0]
        if "type" not in directive.parameters:
            raise SceneError(f'{directive.place}: the material {shown(name)} has no "string type"')
        made = replace(self.defined(kind.strip(), directive.parameters), name=name)
        self.state = replace(self.state, materials={**self.state.materials, name: made})

    def take_material(self, directive: Directive) -> None:
        name = directive.words[0]
        if name not in self.state.materials:
            known = list(self.state.materials)[:20]
            raise SceneError(str(UnknownName("material", name, str(directive.place), known)))
        self.state = replace(self.state, material=self.state.materials[name])

    def defined(self, kind: str, given: Parameters) -> Material:
        return Material(kind, given, self.state.floats, self.state.spectra)

    def area_light(self, directive: Directive) -> None:
        self.need_world(directive)
        given = directive.parameters
        self.state = replace(self.state, lamp=self.lights.area(directive.words[0], given))
        self.report.unknown(given)

    def light(self, directive: Directive) -> None:
        self.need_world(directive)
        made = self.lights.source(directive.words[0], directive.parameters, self.state.matrix)
        if made is not None:
            self.assembly.body.append(made)
        self.report.unknown(directive.parameters)

    def medium(self, directive: Directive) -> None:
        self.report.note(directive.place, "media are not supported: light crosses them as a vacuum", once="media")

    def shape(self, directive: Directive) -> None:
        self.need_world(directive)
        self.assembly.shape(directive.words[0], directive.parameters, self.state)

    def need_world(self, directive: Directive) -> None:
        if not self.in_world:
            raise SceneError(f"{directive.place}: {directive.name} before WorldBegin; put it after")
