"""Scenes that tests describe, loaded alike every time."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any


def scene_of(parts: Mapping[str, Any]) -> Any:
    """
    A scene of Mitsuba's in the order of ``parts``, as our own loader makes it.

    Merging equal parts and loading in threads, ``load_dict``'s defaults, order lamps and shapes otherwise in each run:
    a seed would then not give one picture.
    """
    import mitsuba as mi

    return mi.load_dict({"type": "scene", **parts}, parallel=False, optimize=False)
