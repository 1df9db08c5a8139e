"""Bodies of requests, read up to a stated limit and never more."""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import IO

from fastapi import Request

from jobs import disk
from service.problems import TooLarge

GRID_BYTES = 2**24  # a grid file of 16 MiB is refused on the command line too
POINTS_BYTES = 2**26  # of a point file, and of what it unpacks to
SCENE_BYTES = 2**28  # of a scene as a zip: 256 MiB, half of what it may unpack to


async def read(request: Request, limit: int, what: str) -> bytes:
    """The body. Raises ``TooLarge`` as soon as it is."""
    with tempfile.SpooledTemporaryFile(limit + 1) as file:
        await _copy(request, file, limit, what)
        file.seek(0)
        return file.read()


async def save(request: Request, limit: int, what: str, data: Path) -> IO[bytes]:
    """
    The body in a temporary file in a data directory, at its start; the caller closes it.

    Raises ``TooLarge`` as soon as it is, and ``DataDirectoryProblem`` for a disk that is full.
    """
    with disk.explained(data):
        file = tempfile.TemporaryFile(dir=data)  # noqa: SIM115 - the caller's
        try:
            await _copy(request, file, limit, what)
            file.seek(0)
        except BaseException:
            file.close()
            raise
    return file


async def _copy(request: Request, file: IO[bytes], limit: int, what: str) -> None:
    told = request.headers.get("content-length", "")
    size = int(told) if told.isdecimal() else 0
    if size <= limit:
        size = 0
        async for chunk in request.stream():
            size += len(chunk)
            if size > limit:
                break
            file.write(chunk)
    if size > limit:
        raise TooLarge(f"{what} has more than {limit >> 20} MiB; send less")
