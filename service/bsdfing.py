"""
One value of a BSDF: ``dartboard bsdf``.

The plugin itself evaluates it, in a child process (``renderer.bsdfs.evaluate``) that ends when it has said so: what is
printed here is what a render uses.
"""

from __future__ import annotations

import json
import math
import os
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

from jobs.executors.local import explain_exit
from renderer import devices
from renderer.bsdfs import parameters
from renderer.errors import BadParameter, EnvironmentProblem, shown
from renderer.variant import name as variant_name
from service.settings import usable_kernel_caches

ROOT = Path(__file__).resolve().parent.parent
UNIT = 1e-5  # a length this close to 1 is a unit vector that was printed with a few digits

Direction = tuple[float, float, float]


def value_of(bsdf: str, wi: str, wo: str, *, device: str) -> tuple[dict[str, Any], list[str]]:
    """
    ``{"eval": f·cos θo, "pdf": …}`` of a BSDF for two directions, and notes for people.

    ``bsdf`` is NAME or NAME:key=value,…; ``wi`` and ``wo`` are ``x,y,z`` in the local frame (n = z, u = x), away from
    the surface. ``eval`` is one number where the three channels are equal, else red, green and blue. Raises
    ``DartboardError`` with one sentence for any bad value, before Mitsuba is started.
    """
    name, values = parameters.read(bsdf)
    directions, notes = [], []
    for option, text in (("--wi", wi), ("--wo", wo)):
        direction, length = _direction(text, option)
        directions.append(direction)
        if abs(length - 1) > UNIT:
            notes.append(f"{option} has a length of {length:.6g}; taken at unit length")
        if direction[2] <= 0:
            notes.append(f"{option} is not above the horizon (z = {direction[2]:.6g}): {name} reflects nothing there")
    reflectance = values.get("rd", 0.0)
    if isinstance(reflectance, float) and reflectance > 1:
        notes.append(f"rd = {reflectance:g} is above 1: the surface may reflect more energy than it gets")
    told = _evaluate({"type": name, **values}, directions, device)
    channels = told["eval"]
    return {"eval": channels[0] if len(set(channels)) == 1 else channels, "pdf": told["pdf"]}, notes


def _direction(text: str, option: str) -> tuple[Direction, float]:
    """The unit vector that ``x,y,z`` means, and the length it was written with."""
    try:
        x, y, z = (float(part) for part in text.split(","))
    except ValueError:
        raise BadParameter(f"{option} = {shown(text)} is no direction; write three numbers: 0,0.6,0.8") from None
    if not all(map(math.isfinite, (x, y, z))):
        raise BadParameter(f"{option} = {shown(text)} is no direction; its numbers must be finite")
    largest = max(abs(x), abs(y), abs(z))
    if largest == 0:
        raise BadParameter(f"{option} = {shown(text)} has no length, so no direction; write one such as 0,0.6,0.8")
    length = math.hypot(x / largest, y / largest, z / largest)  # of what cannot overflow
    return (x / largest / length, y / largest / length, z / largest / length), length * largest


def _evaluate(bsdf: dict[str, Any], directions: list[Direction], device: str) -> dict[str, Any]:
    """What the plugin says, in a process of its own."""
    wi, wo = directions
    with tempfile.TemporaryDirectory(prefix="dartboard-") as folder:
        drawing = devices.pick(device)
        kernels = usable_kernel_caches(Path(folder)) / "builtin"
        empty = Path(folder) / "empty"  # to work in: Mitsuba looks for plugins in the working directory
        for place in (kernels, empty):
            place.mkdir(parents=True, exist_ok=True)
        command = [
            sys.executable, "-m", "renderer.bsdfs.evaluate", "--variant", variant_name(drawing.name, "rgb"),
            "--bsdf", json.dumps(bsdf), "--wi", json.dumps(wi), "--wo", json.dumps(wo),
        ]  # fmt: skip
        environment = {
            **os.environ,
            **drawing.environment,
            "DRJIT_CACHE_DIR": str(kernels),
            "PYTHONPATH": os.pathsep.join(filter(None, [str(ROOT), os.environ.get("PYTHONPATH")])),
        }
        done = subprocess.run(command, cwd=empty, env=environment, capture_output=True, text=True, errors="replace")
    if done.returncode:
        said = done.stderr.strip().splitlines() or ["nothing"]
        raise EnvironmentProblem(
            f"the bsdf was not evaluated: {explain_exit(done.returncode, False)[1]}; its last words: {said[-1]}; "
            "`dartboard doctor` says what is missing here"
        )
    told: dict[str, Any] = json.loads(done.stdout.splitlines()[-1])
    return told
