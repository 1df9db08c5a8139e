"""
Files of a data directory, by digest: written beside, brought to disk, then moved into place in one step.

A row is committed after its file and the file's name are on disk, so a row without its file cannot be, not
even after a power cut. A file without its row (a process died in between) is overwritten by the next attempt.
docs/storage.md says what that costs.
"""

from __future__ import annotations

import os
import shutil
from pathlib import Path

from jobs import disk


class Artifacts:
    """
    Where everything of a data directory lies. Names that go into the database are relative to ``data``.

    work  pictures on their way from a render process; emptied by every new owner
    """

    def __init__(self, data: Path):
        self.data = data.resolve()
        self.work = self.data / "work"
        self.logs = self.data / "logs"
        self.scenes = self.data / "scenes"
        self.points = self.data / "points"
        self.previews = self.data / "previews"
        self.empty = self.data / "work" / "empty"  # working directory of render processes

    def prepare(self) -> None:
        """What a new owner needs: the folders, and no leftovers of its predecessor."""
        with disk.explained(self.data):
            for leftover in (self.work, self.previews):
                shutil.rmtree(leftover, ignore_errors=True)
            for folder in (self.work, self.logs, self.scenes, self.previews, self.empty):
                folder.mkdir(parents=True, exist_ok=True)

    def picture(self, digest: str, role: str, k: int) -> str:
        """Name of a replicate's EXR: ``images/ab/<digest>/cell-000.exr``."""
        return f"images/{digest[:2]}/{digest}/{role}-{k:03}.exr"

    def preview(self, digest: str) -> Path:
        """Path of the small picture that refines while a cell renders."""
        return self.previews / f"{digest}.npy"

    def scene_folder(self, digest: str) -> Path:
        """Path of a scene's snapshot."""
        return self.scenes / digest

    def path(self, name: str) -> Path:
        """The path of a name that the database holds."""
        return self.data / name

    def adopt(self, temporary: Path, name: str) -> None:
        """
        Bring a finished file to disk and move it to ``name``, in one step for every reader.

        Raises ``DataDirectoryProblem`` for a disk that is full or cannot be written; the temporary file stays.
        """
        final = self.data / name
        with disk.explained(self.data):
            _sync(temporary)
            made = _make_folder(final.parent)
            temporary.replace(final)
            for folder in (final.parent, *(folder.parent for folder in made)):
                _sync(folder)  # else the name, or the folder's own, may be lost where the row is not

    def write_log(self, attempt: int, text: str) -> str | None:
        """Keep the log of an attempt that went wrong; its name, or None where there is nothing to keep."""
        if not text.strip():
            return None
        name = f"logs/attempt-{attempt}.log"
        with disk.explained(self.data):
            self.path(name).write_text(text, encoding="utf-8")
        return name


def _make_folder(folder: Path) -> list[Path]:
    """Make a folder and the missing ones above it; those that are new, innermost first."""
    made = []
    missing = folder
    while not missing.exists():
        made.append(missing)
        missing = missing.parent
    folder.mkdir(parents=True, exist_ok=True)
    return made


def _sync(path: Path) -> None:
    """Wait until a file's content, or a folder's names, are on disk."""
    descriptor = os.open(path, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)
