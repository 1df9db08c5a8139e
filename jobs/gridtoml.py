"""
A grid as the text of a TOML file: what the form of the dashboard builds, and what an experiment was.

The inverse of ``grid.py``: reading the text gives the same grid. It is written from the canonical JSON of a
``GridSpec``, which the database keeps, so that it needs no scene. What equals the default is left out where the
default cannot depend on the scene.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from typing import Any

from renderer import catalog
from renderer.spec import Choice

Json = Mapping[str, Any]


def toml_of(grid: Json) -> str:
    """The TOML of ``json.loads(GridSpec.text)``."""
    scenes = grid["scenes"]
    common = _settings(scenes[0])
    lines = [
        f"name = {_text(grid['name'])}",
        f"scenes = {_list(scene['name'] for scene in scenes)}",
        f"samplers = {_list(_label('sampler', item) for item in grid['samplers'])}",
        f"integrators = {_list(_label('integrator', item) for item in grid['integrators'])}",
        f"spp = {json.dumps(grid['spp'])}",
        f"replicates = {grid['replicates']}",
    ]
    rfilter = _label("rfilter", grid["rfilter"])
    if said := rfilter != "box" or "rfilter" in scenes[0]:
        lines.append(f"rfilter = {_text(rfilter)}")
    if grid["colour"] != "rgb":
        lines.append(f"colour = {_text(grid['colour'])}")
    lines += [f"{key} = {value}" for key, value in common.items()]
    for scene in scenes[1:]:
        own = {key: value for key, value in _settings(scene).items() if value != common.get(key)}
        if "crop" in common and "crop" not in _settings(scene):
            own["crop"] = f"[0, 0, {scene['width']}, {scene['height']}]"  # the whole film
        if "rfilter" in scene and not (said and _label("rfilter", scene["rfilter"]) == rfilter):
            own["rfilter"] = _text(_label("rfilter", scene["rfilter"]))
        if own:
            lines += ["", f"[scene.{_text(scene['name'])}]", *(f"{key} = {value}" for key, value in own.items())]
    everywhere = [scene["name"] for scene in scenes]
    for sweep in grid.get("sweeps", ()):
        values = json.dumps(sweep["values"])
        lines += ["", "[[sweep]]", f"parameter = {_text(sweep['parameter'])}", f"values = {values}"]
        if sweep["scenes"] != everywhere:
            lines.append(f"scenes = {_list(iter(sweep['scenes']))}")
    return "\n".join(lines) + "\n"


def _settings(scene: Json) -> dict[str, str]:
    """What may differ from scene to scene, by its key in the file."""
    found = {"resolution": f"[{scene['width']}, {scene['height']}]"}
    if scene["crop"]:
        found["crop"] = json.dumps(scene["crop"])
    found["max_depth"] = str(scene["max_depth"])
    found["reference"] = _reference(scene["reference"])
    return found


def _reference(reference: Json | None) -> str:
    if reference is None:
        return "false"
    pairs = [
        f"integrator = {_text(_label('integrator', reference['integrator']))}",
        f"sampler = {_text(_label('sampler', reference['sampler']))}",
        f"spp = {reference['asked_total']}",
        f"replicates = {reference['replicates']}",
    ]
    return f"{{ {', '.join(pairs)} }}"


def _label(axis: str, choice: Json) -> str:
    return catalog.label(axis, Choice.of(choice))


def _list(texts: Iterator[str]) -> str:
    return f"[{', '.join(map(_text, texts))}]"


def _text(value: str) -> str:
    """A TOML string: JSON's spelling is one, but for the one character that TOML wants escaped and JSON does not."""
    return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")
