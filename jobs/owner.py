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
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from jobs import disk
from jobs.errors import DataDirectoryProblem
from jobs.store import now

FILE = "owner.lock"
TRIES = 5  # somebody who peeks holds the lock too, for some microseconds
TRY_SECONDS = 0.02
# Where locks or SQLite's shared memory do not hold between machines, or at all.
REMOTE = ("nfs", "nfs4", "cifs", "smb3", "smbfs", "afs", "fuse.sshfs", "fuse.s3fs", "fuse.rclone")


@contextlib.contextmanager
def own(data: Path, url: str | None = None) -> Iterator[None]:
    """
    Own ``data``, which is created if need be, until the block ends.

    Raises ``DataDirectoryProblem`` if another process owns it, it cannot be written, or it is not on a local disk.
    """
    with disk.explained(data):
        data.mkdir(parents=True, exist_ok=True)
        kind = file_system(data)
        if kind in REMOTE:
            raise DataDirectoryProblem(
                f"{data} is on a network file system ({kind}), where a database gets damaged; choose a --data DIR "
                f"on a local disk"
            )
        descriptor = os.open(data / FILE, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o644)
    try:
        _lock(descriptor, data)
        with disk.explained(data):
            os.ftruncate(descriptor, 0)
            os.pwrite(descriptor, json.dumps({"pid": os.getpid(), "url": url, "started": now()}).encode(), 0)
        yield
        with contextlib.suppress(OSError):
            os.ftruncate(descriptor, 0)
    finally:
        os.close(descriptor)


def refuse_owned(data: Path) -> None:
    """Raises ``DataDirectoryProblem`` if another process owns ``data`` now; says nothing about the next moment."""
    who = peek(data)
    if who is not None:
        raise _in_use(data, who)


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


def file_system(folder: Path) -> str:
    """The kind of file system that a folder is on (``ext4``), by Linux's list of mounts; "" where there is none."""
    best, kind = -1, ""
    with contextlib.suppress(OSError):
        place = folder.resolve()
        for line in Path("/proc/self/mounts").read_text(encoding="utf-8", errors="replace").splitlines():
            fields = line.split(" ")
            mounted = Path(fields[1].replace("\\040", " "))
            if len(mounted.parts) >= best and place.is_relative_to(mounted):  # a later mount hides an earlier one
                best, kind = len(mounted.parts), fields[2]
    return kind


def _lock(descriptor: int, data: Path) -> None:
    for attempt in range(TRIES):
        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
            return
        except OSError as error:
            if error.errno != errno.EWOULDBLOCK or attempt == TRIES - 1:
                raise _refused(data, error) from error
            time.sleep(TRY_SECONDS)


def _refused(data: Path, error: OSError) -> DataDirectoryProblem:
    if error.errno != errno.EWOULDBLOCK:
        return DataDirectoryProblem(
            f"{data} is on a file system without locks ({error.strerror}); choose a --data DIR on a local disk"
        )
    return _in_use(data, peek(data) or {})


def _in_use(data: Path, owner: dict[str, Any]) -> DataDirectoryProblem:
    who = f"process {owner['pid']}" if owner.get("pid") else "another process"
    where = f" at {owner['url']}" if owner.get("url") else ""
    return DataDirectoryProblem(
        f"the data directory {data} is in use by {who}{where}; wait until it is done, stop it, or choose another "
        f"--data DIR"
    )
