"""
What a scene file says about its own rendering: size, crop, filter, depth, integrator, sampler, samples per pixel.

Used where neither a grid nor the command line says anything. An element that is there but silent about a value means
Mitsuba's default for it; an element that is missing means ours.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass

from renderer import catalog
from renderer.errors import DartboardError
from renderer.scenes.xmlfile import Element

Crop = tuple[int, int, int, int]  # x, y, width, height in pixels, from the top left

WRAPPERS = frozenset({"aov", "moment", "stokes"})  # integrators that only add channels to the one inside


@dataclass(frozen=True)
class SceneDefaults:
    """
    width, height  of the film, in pixels
    max_depth      edges of the longest path (Mitsuba's count; -1: unlimited)
    integrator     as people write it, NAME or NAME:key=value with the parameters that the catalog knows but for
                   max_depth; the inner one where the outer only adds channels
    sampler        written like ``integrator``
    spp            samples per pixel, as asked (samplers may round)
    crop           x, y, width, height in pixels of the film; None: all of it
    rfilter        written like ``integrator``; box where the file names none, whatever Mitsuba's default is: pixels
                   share no samples then, as measuring errors wants it
    """

    width: int = 256
    height: int = 256
    max_depth: int = 6
    integrator: str = "path"
    sampler: str = "independent"
    spp: int = 16
    crop: Crop | None = None
    rfilter: str = "box"

    def crop_at(self, width: int, height: int) -> Crop | None:
        """The same part of the picture in a film of another size; None for all of it. At least one pixel."""
        if self.crop is None or (width, height) == (self.width, self.height) or min(self.width, self.height) < 1:
            return self.crop
        x, y, wide, high = self.crop
        left, right = _scaled(x, x + wide, self.width, width)
        top, bottom = _scaled(y, y + high, self.height, height)
        return left, top, right - left, bottom - top


def defaults_of(root: Element) -> SceneDefaults:
    """From the tree of a scene whose includes are in place and whose ``$`` names are replaced (``vet.examine``)."""
    ours = SceneDefaults()
    integrator = _first(root, "integrator")
    while integrator is not None and integrator.attributes.get("type") in WRAPPERS:
        integrator = _first(integrator, "integrator")
    sensor = _first(root, "sensor")
    film = _first(sensor, "film")
    sampler = _first(sensor, "sampler")
    rfilter = _first(film, "rfilter")
    width = ours.width if film is None else _integer(film, "width", 768)
    height = ours.height if film is None else _integer(film, "height", 576)
    return SceneDefaults(
        width=width,
        height=height,
        max_depth=ours.max_depth if integrator is None else _integer(integrator, "max_depth", -1),
        integrator=ours.integrator if integrator is None else _written("integrator", integrator),
        sampler=ours.sampler if sampler is None else _written("sampler", sampler),
        spp=ours.spp if sampler is None else _integer(sampler, "sample_count", 4),
        crop=None if film is None else _crop(film, width, height),
        rfilter=ours.rfilter if rfilter is None else _written("rfilter", rfilter),
    )


def _written(axis: str, element: Element) -> str:
    """A plugin with the parameters that the catalog knows; what the catalog refuses is told when it is asked for."""
    name = element.attributes["type"]
    try:
        known = {parameter.name for parameter in catalog.find(axis, name).parameters}
    except DartboardError:
        return name
    given = {
        child.attributes["name"]: child.attributes.get("value", "")
        for tag in ("boolean", "integer", "float", "string")
        for child in _children(element, tag)
        if child.attributes.get("name") in known - {"max_depth"}
    }
    try:
        return catalog.label(axis, catalog.resolve(axis, {"type": name, **given}))
    except DartboardError:
        return f"{name}:{','.join(f'{key}={value}' for key, value in given.items())}"


def _crop(film: Element, width: int, height: int) -> Crop | None:
    """The part of a film that its file wants drawn; what is left out means: as much as there is."""
    crop = (
        _integer(film, "crop_offset_x", 0), _integer(film, "crop_offset_y", 0),
        _integer(film, "crop_width", width), _integer(film, "crop_height", height),
    )  # fmt: skip
    return None if crop == (0, 0, width, height) else crop


def _scaled(start: int, end: int, old: int, new: int) -> tuple[int, int]:
    """A run of pixels in a row of another length: those whose edges lie at or after the old edges, as pbrt rounds."""
    first = min(-(-start * new // old), new - 1)
    return first, max(-(-end * new // old), first + 1)


def _first(parent: Element | None, tag: str) -> Element | None:
    """The first child of that kind; references (``<ref>``) are followed by nobody: such a scene gets our default."""
    return next(_children(parent, tag), None)


def _children(parent: Element | None, tag: str) -> Iterator[Element]:
    return (child for child in (parent.children if parent else ()) if child.tag == tag)


def _integer(element: Element, name: str, default: int) -> int:
    """The last ``<integer>`` of that name; scenes before version 2 write it in camelCase."""
    value = default
    for child in _children(element, "integer"):
        if re.sub("(?<=[a-z])[A-Z]", lambda m: "_" + m[0].lower(), child.attributes.get("name", "")) == name:
            with suppress(ValueError):  # Mitsuba refuses it with the better message, when the scene is loaded
                value = int(child.attributes.get("value", ""))
    return value
