"""
Requests to an owner that has no server: small files in ``inbox/``, which the dispatcher
reads several times a second.

``dartboard cancel`` and ``retry`` use it beside a ``dartboard run``. A request is written aside and renamed, so
the owner never sees half of one.
"""

from __future__ import annotations

import contextlib
import json
import logging
import os
import uuid
from pathlib import Path
from typing import Any

from jobs.errors import DataDirectoryProblem

KINDS = ("cancel", "retry")

log = logging.getLogger("dartboard")


def post(data: Path, what: str, experiment: int) -> Path:
    """Ask the owner of ``data``; the file vanishes when the owner has seen it."""
    name = f"{uuid.uuid4().hex}.json"
    inbox = data / "inbox"
    try:
        inbox.mkdir(exist_ok=True)
        part = inbox / f"{name}.part"
        part.write_text(json.dumps({"do": what, "experiment": experiment}))
        os.replace(part, inbox / name)
    except OSError as error:
        raise DataDirectoryProblem(
            f"cannot leave a request for the owner of {data}: {error.strerror}; stop the owner with Ctrl-C instead"
        ) from error
    return inbox / name


def take(data: Path) -> list[dict[str, Any]]:
    """The requests that have come, oldest first; they are gone afterwards. What is no request is logged and dropped."""
    requests = []
    with contextlib.suppress(FileNotFoundError):
        for file in sorted((data / "inbox").glob("*.json"), key=lambda path: path.stat().st_mtime_ns):
            try:
                request = json.loads(file.read_text())
                if request["do"] not in KINDS or not isinstance(request["experiment"], int):
                    raise ValueError("it asks for nothing that is known")
                requests.append(request)
            except (OSError, ValueError, KeyError, TypeError) as error:
                log.warning("the request %s in the inbox is ignored: %s", file.name, error)
            file.unlink(missing_ok=True)
    return requests
