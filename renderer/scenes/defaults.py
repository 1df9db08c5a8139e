"""
What a scene file says about its own rendering: size, depth, integrator, sampler, samples per pixel.

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

WRAPPERS = frozenset({"aov", "moment", "stokes"})  # integrators that only add channels to the one inside


@dataclass(frozen=True)
class SceneDefaults:
    """
    width, height  of the film, in pixels
    max_depth      edges of the longest path (Mitsuba's count; -1: unlimited)
    integrator     plugin name, of the inner one where the outer only adds channels
    sampler        as people write it, NAME or NAME:key=value with the parameters that the catalog knows
    spp            samples per pixel, as asked (samplers may round)
    """

    width: int = 256
    height: int = 256
    max_depth: int = 6
    integrator: str = "path"
    sampler: str = "independent"
    spp: int = 16


def defaults_of(root: Element) -> SceneDefaults:
    """From the tree of a scene whose includes are in place and whose ``$`` names are replaced (``vet.examine``)."""
    ours = SceneDefaults()
    integrator = _first(root, "integrator")
    while integrator is not None and integrator.attributes.get("type") in WRAPPERS:
        integrator = _first(integrator, "integrator")
    sensor = _first(root, "sensor")
    film = _first(sensor, "film")
    sampler = _first(sensor, "sampler")
    return SceneDefaults(
        width=ours.width if film is None else _integer(film, "width", 768),
        height=ours.height if film is None else _integer(film, "height", 576),
        max_depth=ours.max_depth if integrator is None else _integer(integrator, "max_depth", -1),
        integrator=ours.integrator if integrator is None else integrator.attributes["type"],
        sampler=ours.sampler if sampler is None else _sampler(sampler),
        spp=ours.spp if sampler is None else _integer(sampler, "sample_count", 4),
    )


def _sampler(element: Element) -> str:
    """A sampler with its parameters; only its name where the catalog refuses them."""
    name = element.attributes["type"]
    try:
        known = {parameter.name for parameter in catalog.find("sampler", name).parameters}
        given = {
            child.attributes["name"]: child.attributes.get("value", "")
            for tag in ("boolean", "integer", "float")
            for child in _children(element, tag)
            if child.attributes.get("name") in known
        }
        return catalog.label("sampler", catalog.resolve("sampler", {"type": name, **given}))
    except DartboardError:
        return name


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
