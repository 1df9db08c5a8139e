"""
A pbrt-v3 scene as a Mitsuba scene that can be edited: ``dartboard import``.

The folder appears whole or not at all, and what is in it has been vetted as every scene is.
"""

from __future__ import annotations

import os
import shutil
import tempfile
from pathlib import Path
from typing import Any

from renderer.errors import BadParameter, SceneError, shown
from renderer.scenes import sources
from renderer.scenes.pbrt.convert import MAIN, convert


def import_scene(scene: Path, output: Path) -> dict[str, Any]:
    """
    Convert the file ``scene`` into the folder ``output``, and say what was made and what is not as in the file.

    Raises ``BadParameter`` if the folder is there already and holds something, or cannot be; ``SceneError`` for what
    cannot be read, with file and line.
    """
    if not scene.is_file():
        raise SceneError(f"no scene at {shown(str(scene))}; name a pbrt-v3 file")
    if scene.suffix.lower() != sources.PBRT:
        raise SceneError(f"{shown(scene.name)} is not a .pbrt file; a Mitsuba scene needs no import")
    if output.exists() and not (output.is_dir() and not any(output.iterdir())):
        raise BadParameter(f"{output} is there already; name a new folder, or an empty one")
    parent = output.absolute().parent
    if not parent.is_dir():
        raise BadParameter(f"no folder {parent} to make {output.name} in; make it first")
    work = Path(tempfile.mkdtemp(prefix=".import-", dir=parent))
    try:
        notes = convert(scene, work)
        source = sources.find(MAIN, work)
        work.chmod(0o777 & ~_umask())
        if output.exists():
            output.rmdir()
        work.rename(output)
    finally:
        shutil.rmtree(work, ignore_errors=True)
    said = source.defaults
    return {
        "output": str(output), "scene": str(output / MAIN), "files": len(source.files), "width": said.width,
        "height": said.height, "integrator": said.integrator, "max_depth": said.max_depth, "sampler": said.sampler,
        "spp": said.spp, "notes": notes,
    }  # fmt: skip


def show(told: dict[str, Any]) -> None:
    """What ``import_scene`` says, for people: what was replaced, then what was made."""
    for note in told["notes"]:
        print(f"  {note}")
    print(
        f"{told['scene']}: {told['width']}×{told['height']}, {told['spp']} spp of {told['sampler']}, "
        f"{told['integrator']} with at most {told['max_depth']} edges; {told['files']} files"
    )


def _umask() -> int:
    """The process's own, which can only be read by setting it."""
    mask = os.umask(0)
    os.umask(mask)
    return mask
