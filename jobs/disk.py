"""
What a disk refuses, as one sentence that names the data directory and the way out.
"""

from __future__ import annotations

import contextlib
import errno
from collections.abc import Iterator
from pathlib import Path

from jobs.errors import DataDirectoryProblem

_FULL = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)
_CLOSED = (errno.EROFS, errno.EACCES, errno.EPERM)
_NO_FOLDER = (errno.EEXIST, errno.ENOTDIR)


@contextlib.contextmanager
def explained(data: Path) -> Iterator[None]:
    """The system's errors in this block as ``DataDirectoryProblem``."""
    try:
        yield
    except OSError as error:
        raise problem(error, data) from error


def problem(error: OSError, data: Path) -> DataDirectoryProblem:
    """The sentence for one error of the system."""
    if error.errno in _FULL:
        return full(data)
    if error.errno in _CLOSED:
        return DataDirectoryProblem(
            f"the data directory {data} cannot be written ({error.strerror}); make it writable or choose another "
            f"--data DIR"
        )
    if error.errno in _NO_FOLDER:
        return DataDirectoryProblem(f"{data} is a file, and a data directory is a folder; choose another --data DIR")
    return DataDirectoryProblem(f"the data directory {data} cannot be used: {error}; choose another --data DIR")


def full(data: Path) -> DataDirectoryProblem:
    """No space left, whoever noticed it."""
    return DataDirectoryProblem(
        f"the disk of the data directory {data} is full; free some space and run again: what was finished is there"
    )
