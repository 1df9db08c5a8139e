"""
Requests to an owner that has no server: small files in ``inbox/``, which the dispatcher reads several times a second.

``dartboard cancel``, ``retry``, ``pause`` and ``resume`` use it beside a ``dartboard run``. A request is written aside
and renamed, so the owner never sees half of one, and it vanishes only after it was served: an owner that is killed in
between leaves it to the next. Serving one twice does no harm.
"""

from __future__ import annotations

import contextlib
import json
import logging
import time
import uuid
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from jobs.errors import DataDirectoryProblem

FOLDER = "inbox"
KINDS = ("cancel", "retry", "pause", "resume")
MAX_BYTES = 4096  # of a request: they have about 40

log = logging.getLogger("dartboard")


def post(data: Path, what: str, experiment: int) -> Path:
    """Ask the owner of ``data``; the file vanishes when the owner has done it."""
    assert what in KINDS, what
    inbox = data / FOLDER
    name = f"{time.time_ns():020}-{uuid.uuid4().hex}"  # sorts by age
    try:
        inbox.mkdir(exist_ok=True)
        part = inbox / f"{name}.part"
        part.write_text(json.dumps({"do": what, "experiment": experiment}), encoding="utf-8")
        return part.replace(inbox / f"{name}.json")
    except OSError as error:
        raise DataDirectoryProblem(
            f"cannot leave a request for the owner of {data}: {error.strerror}; stop the owner with Ctrl-C instead"
        ) from error


def take(data: Path) -> Iterator[dict[str, Any]]:
    """
    The requests that have come, oldest first: {"do": one of KINDS, "experiment": id}.

    Each is gone when the next is asked for. What is no request is logged and dropped.
    """
    try:
        files = sorted(path for path in (data / FOLDER).iterdir() if path.suffix == ".json" and path.is_file())
    except OSError:  # no inbox, no requests
        return
    for file in files:
        request = _read(file)
        try:
            if request:
                yield request
        finally:
            with contextlib.suppress(OSError):
                file.unlink(missing_ok=True)


def _read(file: Path) -> dict[str, Any] | None:
    try:
        with file.open("rb") as opened:
            request = json.loads(opened.read(MAX_BYTES))
        if request["do"] not in KINDS or not _is_id(request["experiment"]):
            raise ValueError("it asks for nothing that is known")
    except FileNotFoundError:  # withdrawn
        return None
    except (OSError, ValueError, KeyError, TypeError, RecursionError) as error:
        log.warning("the request %s in the inbox is ignored: %s", file.name, error)
        return None
    return {"do": request["do"], "experiment": request["experiment"]}


def _is_id(value: object) -> bool:
    """Whether SQLite could hold it as an id."""
    return type(value) is int and 0 < value < 2**63
