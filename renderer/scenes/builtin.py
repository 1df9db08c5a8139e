"""
The scenes that come with Dartboard: one folder each, with ``scene.xml`` and ``about.toml``.

A new scene is a new folder; nothing else names it. ``about.toml`` is what the catalog tells people: what the scene is
good for, what makes it hard, what it cannot show, and how a reference of it is made. It is no part of the scene's
digest. No Mitsuba here.
"""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType
from typing import Any


@dataclass(frozen=True)
class BuiltinScene:
    """
    name           as typed in a grid, and the folder's name
    title          for headings
    summary        one line
    good_for       questions that it answers well
    hard_part      what makes it converge slowly
    bad_for        questions that it cannot answer
    lamp_in_frame  None, or what a lamp in the picture does to the metrics and what to use instead
    source         whose idea it is, with the publication
    reference      what it is measured against unless a grid says otherwise: keys and values of a grid's ``[reference]``
    folder         where its files are
    """

    name: str
    title: str
    summary: str
    good_for: str
    hard_part: str
    bad_for: str
    lamp_in_frame: str | None
    source: str
    reference: Mapping[str, Any]
    folder: Path


def _load(folder: Path) -> BuiltinScene:
    about = tomllib.loads((folder / "about.toml").read_text("utf-8"))
    return BuiltinScene(name=folder.name, folder=folder, lamp_in_frame=about.pop("lamp_in_frame", None), **about)


BUILTIN: Mapping[str, BuiltinScene] = MappingProxyType(
    {path.parent.name: _load(path.parent) for path in sorted(Path(__file__).parent.glob("*/about.toml"))}
)
