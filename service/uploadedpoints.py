"""Point files that come over the wire: checked like any other, and kept by the digest of their points."""

from __future__ import annotations

import re
import tempfile
from collections.abc import Mapping
from dataclasses import replace
from functools import lru_cache
from pathlib import Path
from typing import IO

from jobs import disk
from jobs.artifacts import Artifacts
from renderer.errors import BadParameter, shown
from renderer.samplers import pointfile
from renderer.samplers.pointfile import PointSource

MAX_NAME = 200  # characters
_DIGEST = re.compile(r"[0-9a-f]{64}")


def receive(artifacts: Artifacts, content: IO[bytes], name: str) -> PointSource:
    """
    Check a point file and keep a snapshot of it.

    name  what grids will call it. Raises ``BadParameter`` with the reason.
    """
    if not name.strip() or len(name) > MAX_NAME or not name.isprintable():
        raise BadParameter(f"the name {shown(name)} is not allowed; give 1 to {MAX_NAME} printable characters")
    with disk.explained(artifacts.data):
        folder = tempfile.TemporaryDirectory(prefix="upload-", dir=artifacts.work)
    with folder:
        path = Path(folder.name) / "points.npz"
        with disk.explained(artifacts.data), path.open("xb") as file:
            while block := content.read(2**20):
                file.write(block)
        source = replace(pointfile.source(name, path), name=name)
        kept = pointfile.snapshot(source, artifacts.points)
    return replace(source, path=kept)


def find(artifacts: Artifacts, uploaded: Mapping[str, str], name: str) -> PointSource:
    """The point file that a grid from outside names: never a path of this machine. Raises ``BadParameter``."""
    digest = uploaded.get(name)
    if digest is None:
        raise BadParameter(
            f"point file {shown(name)} is not known here; send it first, with the form or by POST /api/points, and "
            "name its digest in points"
        )
    path = artifacts.points / f"{digest}{pointfile.SUFFIX}"
    if not _DIGEST.fullmatch(digest) or not path.is_file():
        raise BadParameter(f"point file {shown(name)}: there is no uploaded one {shown(digest)}; send it again")
    return replace(_kept(path), name=name)


@lru_cache(maxsize=256)
def _kept(path: Path) -> PointSource:
    """A snapshot, read once: it is never changed."""
    return pointfile.source(path.name, path)
