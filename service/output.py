"""Files that commands write: whole or not at all, and refused before the work begins where they cannot be written."""

from __future__ import annotations

import contextlib
import os
from collections.abc import Iterator
from pathlib import Path
from typing import BinaryIO

from renderer.errors import EnvironmentProblem


def refuse_unwritable(file: Path) -> None:
    """Raises ``EnvironmentProblem`` for a file that could not be written in the end: before hours of rendering."""
    if file.is_dir():
        raise EnvironmentProblem(f"{file} is a folder; name a file in it, such as {file / 'report.html'}")
    folder = file.absolute().parent
    if not folder.is_dir():
        raise EnvironmentProblem(f"{file} cannot be written: there is no folder {folder}; make it, or name another")
    if not os.access(folder, os.W_OK | os.X_OK):
        raise EnvironmentProblem(f"{file} cannot be written: {folder} is not yours to write in; name another folder")


@contextlib.contextmanager
def whole(file: Path) -> Iterator[BinaryIO]:
    """A file to write ``file``'s content to. It takes its place at the end; after an error all is as it was."""
    refuse_unwritable(file)
    part = file.with_name(f".{file.name[:200]}.part-{os.getpid()}")  # beside it: a rename does not leave a disk
    try:
        with part.open("wb") as opened:
            yield opened
        part.replace(file)
    except OSError as error:
        raise EnvironmentProblem(f"{file} cannot be written: {error.strerror}; make room, or name another") from error
    finally:
        part.unlink(missing_ok=True)
