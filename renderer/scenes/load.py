"""
A vetted scene folder becomes a Mitsuba scene, with the film that a cell asks for.

Mitsuba's parser gives the scene as nodes before anything is instantiated. There its own reading is checked once more
against the lists of ``allowed``; the file's film is replaced by one of the wanted size, window and filter, so that
field of view and aspect come out as if the file had said so itself; and its integrator and sampler are dropped: a cell
has its own. Equal nodes are not merged, or a sweep of one material would change its twin.

Used only in render processes, after ``mi.set_variant``.
"""

from __future__ import annotations

import re
import threading
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import mitsuba as mi

from renderer.errors import SceneError, shown
from renderer.lightsamplers.prepared import Prepared
from renderer.scenes.allowed import PLUGINS, PYTHON_PLUGINS, file_fault, string_fault, unknown_plugin
from renderer.sweep import Settings

MESSAGE_MAX = 400  # characters of Mitsuba's own text in an error

_loading = threading.Lock()  # parsing swaps Mitsuba's file resolver, of which a process has one


@dataclass
class LoadedScene:
    """
    A scene and the one sensor that sees it.

    width, height  of the whole film, in pixels
    crop           (x, y, width, height) of the window that is rendered; the whole film where none was asked
    """

    scene: mi.Scene
    sensor: mi.Sensor
    width: int
    height: int
    crop: tuple[int, int, int, int]

    @cached_property
    def settings(self) -> Settings:
        """What cells set in the scene."""
        return Settings(self.scene)

    @cached_property
    def lights(self) -> Prepared:
        """Its light samplers, made when a cell first asks for one."""
        return Prepared(self.scene)


def load(
    folder: Path,
    main: str,
    *,
    width: int,
    height: int,
    crop: tuple[int, int, int, int] | None = None,
    rfilter: str = "box",
    rfilter_parameters: Mapping[str, float] | None = None,
) -> LoadedScene:
    """
    Loads ``folder/main`` in the current variant. The first sensor of the file is used; other sensors are dropped.

    Raises ``SceneError`` for a scene without a sensor, or one that ``vet`` or Mitsuba refuses.
    """
    folder = folder.resolve()
    config = mi.parser.ParserConfig(str(mi.variant()))
    config.parallel = False  # a fixed order of plugins is a fixed kernel, found again in the cache
    with _loading:
        try:
            state = _parse(config, folder, main)
            if reasons := check_nodes(state, folder):
                raise SceneError(f"the scene {main} is refused: " + "; ".join(reasons))
            mi.parser.transform_upgrade(config, state)
            mi.parser.transform_resolve(config, state)
            _name_files(state, folder)
            _replace_film(state, main, _film(width, height, crop), _rfilter(rfilter, rfilter_parameters))
            scene: Any = mi.parser.instantiate(config, state)
        except (SceneError, MemoryError):
            raise
        except Exception as error:  # nanobind passes on whatever a plugin throws
            raise SceneError(f"the scene {main} cannot be loaded: {_sentence(str(error), folder)}") from None
    return LoadedScene(scene, scene.sensors()[0], width, height, crop or (0, 0, width, height))


def _parse(config: mi.parser.ParserConfig, folder: Path, main: str) -> mi.parser.ParserState:
    """
    Mitsuba's nodes of a scene file, with the scene's folder as the first place to look for spectra and includes.

    Only here: what is instantiated finds its files by absolute names, and code is never looked for in the folder.
    """
    core: Any = mi  # whose stubs lack the resolver
    outer = core.file_resolver()
    inner = core.FileResolver(outer)
    inner.prepend(str(folder))
    core.set_file_resolver(inner)
    try:
        return mi.parser.parse_file(config, str(folder / main))
    finally:
        core.set_file_resolver(outer)


def check_nodes(state: mi.parser.ParserState, folder: Path) -> list[str]:
    """Reasons to refuse a scene as Mitsuba itself has read it; ``folder`` is resolved. Instantiates nothing."""
    reasons = []
    for file in state.files:
        if not Path(str(file)).resolve().is_relative_to(folder):
            reasons.append("an included file lies outside the scene's folder")
    # Looked at in a copy: reading a property marks it as used, and Mitsuba then misses what no plugin reads.
    for index, node in enumerate(mi.parser.ParserState(state).nodes):
        plugin = node.props.plugin_name()
        if plugin not in PLUGINS | PYTHON_PLUGINS and not (plugin == "scene" and index == 0):
            reasons.append(unknown_plugin(plugin))
        if (index == 0) != (node.type == mi.ObjectType.Scene):
            reasons.append("it is not one <scene>")
        for key, value in node.props.items():
            if not isinstance(value, str):
                continue
            fault = file_fault(value) if key == "filename" else string_fault(value)
            if not fault and key == "filename" and not (folder / value).resolve().is_relative_to(folder):
                fault = "leads out of the scene's folder"
            if fault:
                reasons.append(f"the value {shown(value)} of {key!r} {fault}")
    return reasons


def _name_files(state: mi.parser.ParserState, folder: Path) -> None:
    """Makes file names absolute, so that Mitsuba finds them whatever its resolver holds."""
    for node in state.nodes:
        if "filename" in node.props:
            node.props["filename"] = str(folder / node.props["filename"])


def _film(width: int, height: int, crop: tuple[int, int, int, int] | None) -> mi.Properties:
    film = mi.Properties("hdrfilm")
    film["width"], film["height"] = width, height
    if crop is not None:
        film["crop_offset_x"], film["crop_offset_y"], film["crop_width"], film["crop_height"] = crop
    film["pixel_format"], film["component_format"] = "rgb", "float32"
    return film


def _rfilter(name: str, parameters: Mapping[str, float] | None) -> mi.Properties:
    rfilter = mi.Properties(name)
    for key, value in (parameters or {}).items():
        rfilter[key] = value
    return rfilter


def _replace_film(state: mi.parser.ParserState, main: str, film: mi.Properties, rfilter: mi.Properties) -> None:
    """Gives the first sensor this film, and drops the other sensors, every integrator and the file's sampler."""
    film["rfilter"] = _append(state, mi.ObjectType.ReconstructionFilter, rfilter)
    film_reference = _append(state, mi.ObjectType.Film, film)  # before any node is held: appending moves them all
    sensor = None
    for key, index in _children(state, 0):
        kind = state.nodes[index].type
        if kind == mi.ObjectType.Sensor and sensor is None:
            sensor = index
        elif kind in (mi.ObjectType.Sensor, mi.ObjectType.Integrator):
            del state.nodes[0].props[key]
    if sensor is None:
        raise SceneError(f"the scene {main} has no camera; add a <sensor>, such as <sensor type='perspective'>")
    for key, index in _children(state, sensor):
        if state.nodes[index].type in (mi.ObjectType.Film, mi.ObjectType.Sampler):
            del state.nodes[sensor].props[key]
    state.nodes[sensor].props["film"] = film_reference


def _append(state: mi.parser.ParserState, kind: mi.ObjectType, props: mi.Properties) -> Any:
    node = mi.parser.SceneNode()
    node.type = kind
    node.props = props
    state.nodes.append(node)
    return mi.Properties.ResolvedReference(len(state.nodes) - 1)


def _children(state: mi.parser.ParserState, parent: int) -> list[tuple[str, int]]:
    """The (property, node index) pairs below a node, in the order of the file."""
    props = state.nodes[parent].props
    keys = [key for key in props if props.type(key) == mi.Properties.Type.ResolvedReference]
    return [(key, props[key].index()) for key in keys]


def _sentence(text: str, folder: Path) -> str:
    """Mitsuba's error as one line: no positions in sources, no traceback, no path of ours, no content of a file."""
    text = text.replace(str(folder) + "/", "")
    text = re.sub(r"\[\w+(\.cpp|\.h)?(:\d+)?\] ", "", text)
    text = re.sub(r'(spectrum file "[^"]*"): ".*', r"\1", text, flags=re.DOTALL)
    text = re.sub(r"Traceback \(most recent call last\):.*?\n\w+(Error|Exception): ", "", text, flags=re.DOTALL)
    text = re.sub(r"\s+", " ", text).strip()
    return text if len(text) <= MESSAGE_MAX else text[: MESSAGE_MAX - 3] + "..."
