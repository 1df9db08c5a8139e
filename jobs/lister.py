"""
What can be swept in a scene, asked of a child process that loads it.

The owner of a data directory never loads a scene. A child does (``renderer.sweep``), in an empty folder and with a
kernel cache of its own, and prints the names; they are remembered by the scene's digest, so that a form that asks after
every key stroke starts one child a scene. Where no child can be had the answer is None: the render process tells later.
"""

from __future__ import annotations

import json
import logging
import os
import subprocess
import sys
import tempfile
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from renderer.devices import Device
from renderer.errors import EnvironmentProblem, SceneError
from renderer.parameters import Parameter
from renderer.scenes.sources import SceneSource
from renderer.variant import name as variant_name

LIST_SECONDS = 60  # a large scene loads in a few; a child that hangs is killed
REMEMBERED = 256  # scenes

ROOT = Path(__file__).resolve().parent.parent

log = logging.getLogger("dartboard")


class SceneLister:
    """
    Called with a scene and a colour mode: its parameters by key, or None where that cannot be found out here.

    device  gives the device whose variant will render; asked when the first scene is
    Raises ``SceneError`` for a scene that does not load. Safe to call from several threads.
    """

    def __init__(self, device: Callable[[], Device]):
        self.device = device
        self.known: dict[tuple[str, str], Mapping[str, Parameter]] = {}

    def __call__(self, scene: SceneSource, colour: str) -> Mapping[str, Parameter] | None:
        key = (scene.digest, colour)
        found = self.known.get(key)
        if found is None:
            try:
                told = _ask(self.device(), scene, colour)
            except (OSError, ValueError, EnvironmentProblem, subprocess.SubprocessError) as error:
                log.warning("the parameters of scene %s are unknown until it is rendered: %s", scene.name, error)
                return None
            if "error" in told:
                raise SceneError(f"scene {scene.name!r}: {told['error']}")
            found = {key: Parameter(key, kind, _value(now)) for key, kind, now in told["parameters"]}
            if len(self.known) >= REMEMBERED:
                self.known.clear()
            self.known[key] = found
        return found


def _ask(device: Device, scene: SceneSource, colour: str) -> dict[str, Any]:
    """What the child prints. Raises ``SubprocessError`` for one that crashes or hangs, ``ValueError`` for nonsense."""
    with tempfile.TemporaryDirectory(prefix="dartboard-list-") as empty:
        environment = {
            **os.environ,
            **device.environment,
            "DRJIT_CACHE_DIR": empty,
            "PYTHONPATH": os.pathsep.join(filter(None, [str(ROOT), os.environ.get("PYTHONPATH")])),
        }
        done = subprocess.run(
            [
                sys.executable, "-m", "renderer.sweep", variant_name(device.name, colour), scene.folder.absolute(),
                scene.main,
            ],
            cwd=empty, env=environment, stdin=subprocess.DEVNULL, capture_output=True, timeout=LIST_SECONDS, check=True,
            start_new_session=True,
        )  # fmt: skip
    told = json.loads(done.stdout.splitlines()[-1] if done.stdout else "")
    if not isinstance(told, dict):
        raise ValueError("the child printed no table")
    return told


def _value(now: object) -> float | tuple[float, float, float] | None:
    if isinstance(now, list):
        red, green, blue = now
        return (red, green, blue)
    return now if isinstance(now, (int, float)) else None
