"""
How long a zip says that its list of files is: what has to be known before anybody reads that list.

``zipfile`` makes an object of half a kilobyte of each entry before anybody can count them.
"""

from __future__ import annotations

import os
from typing import IO

MAX_DIRECTORY = 2**21  # bytes of an archive's list of files that may be read
END_BYTES = 22  # of the record at the end of an archive, without its comment


def directory_bytes(archive: IO[bytes]) -> int:
    """
    The length of an archive's list of files, in bytes; 0 where it says nothing, and more than MAX_DIRECTORY for zip64,
    which is for more files than we take. The archive is at its start afterwards.
    """
    size = archive.seek(0, os.SEEK_END)
    archive.seek(max(0, size - END_BYTES - 2**16))
    tail = archive.read()
    archive.seek(0)
    end = tail.rfind(b"PK\5\6")
    if end < 0 or len(tail) < end + END_BYTES:
        return 0
    if tail[max(0, end - 20) :].startswith(b"PK\6\7"):
        return MAX_DIRECTORY + 1
    return int.from_bytes(tail[end + 12 : end + 16], "little")
