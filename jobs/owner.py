"""
One process owns a data directory: it alone writes the database and the files.

Ownership is a lock on ``owner.lock`` that the system takes back when the process dies, however it dies. The
file says who it is, for people and for programs that want to talk to the owner. Its content is never trusted
as a lock: a file that a dead owner left behind is simply taken over.
"""

from __future__ import annotations

import contextlib
import errno
import fcntl
import json
import os
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from jobs.errors import DataDirectoryProblem
from jobs.store import now

FILE = "owner.lock"


@contextlib.contextmanager
def own(data: Path, url: str | None = None) -> Iterator[None]:
    """
    Own ``data``, which is created if need be, until the block ends.

    Raises ``DataDirectoryProblem`` if another process owns it or it cannot be written.
    """
    try:
        data.mkdir(parents=True, exist_ok=True)
        descriptor = os.open(data / FILE, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o644)
    except OSError as error:
        raise DataDirectoryProblem(
            f"cannot use {data} as a data directory: {error.strerror}; make it writable or choose another --data DIR"
        ) from error
    try:
        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError as error:
            raise _refused(data, error) from error
        try:
            os.ftruncate(descriptor, 0)
            os.pwrite(descriptor, json.dumps({"pid": os.getpid(), "url": url, "started": now()}).encode(), 0)
        except OSError as error:
            raise DataDirectoryProblem(
                f"cannot write to the data directory {data}: {error.strerror}; free some space or choose another "
                f"--data DIR"
            ) from error
        yield
        with contextlib.suppress(OSError):
            os.ftruncate(descriptor, 0)
    finally:
        os.close(descriptor)


def peek(data: Path) -> dict[str, Any] | None:
    """Who owns ``data`` now ({"pid", "url", "started"}; values may be missing for a moment), or None."""
    try:
        descriptor = os.open(data / FILE, os.O_RDONLY | os.O_CLOEXEC)
    except OSError:
        return None
    try:
        fcntl.flock(descriptor, fcntl.LOCK_SH | fcntl.LOCK_NB)
        return None
    except OSError:
        with contextlib.suppress(ValueError):
            told = json.loads(os.pread(descriptor, 4096, 0))
            return told if isinstance(told, dict) else {}
        return {}
    finally:
        os.close(descriptor)


def _refused(data: Path, error: OSError) -> DataDirectoryProblem:
    if error.errno not in (errno.EWOULDBLOCK, errno.EACCES):
        return DataDirectoryProblem(
            f"{data} is on a file system without locks ({error.strerror}); choose a --data DIR on a local disk"
        )
    owner = peek(data) or {}
    who = f"process {owner['pid']}" if owner.get("pid") else "another process"
    where = f" at {owner['url']}" if owner.get("url") else ""
    return DataDirectoryProblem(
        f"the data directory {data} is in use by {who}{where}; wait until it is done, stop it, or choose another "
        f"--data DIR"
    )
