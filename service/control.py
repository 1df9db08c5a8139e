"""``dartboard cancel`` and ``retry``: through the owner's inbox where there is an owner, else as the owner."""

from __future__ import annotations

import time
from pathlib import Path

from jobs import experiments, inbox, owner, queue
from jobs.errors import DataDirectoryProblem
from jobs.store import Store

ANSWER_SECONDS = 5.0  # an owner looks into its inbox several times a second


def change(what: str, name: str, data: Path) -> str:
    """
    Cancel or retry an experiment; a sentence about what was done.

    Raises ``NotFound`` for an unknown experiment, ``DataDirectoryProblem`` if the owner does not answer.
    """
    store = Store.read(data)
    experiment = experiments.find(store, name)
    store.close()
    who = owner.peek(data)
    if who is not None:
        _ask_owner(what, experiment.id, data, who.get("pid"))
        return f"asked process {who.get('pid')}, which works on {data}, to {what} {experiment.name!r}"
    with owner.own(data):
        store = Store.open(data)
        queue.recover(store)
        if what == "cancel":
            queue.cancel(store, experiment.id)
        else:
            queue.retry(store, experiment.id)
        standing = experiments.standing(store, experiment.id)
        store.close()
    if what == "cancel":
        return f"{experiment.name!r} is cancelled; {standing.had} of {standing.wanted} pictures are kept"
    left = standing.wanted - standing.had
    return f"{left} pictures of {experiment.name!r} are queued again; `dartboard run` its grid to render them"


def _ask_owner(what: str, experiment: int, data: Path, pid: int | None) -> None:
    request = inbox.post(data, what, experiment)
    deadline = time.monotonic() + ANSWER_SECONDS
    while request.exists():
        if time.monotonic() > deadline:
            request.unlink(missing_ok=True)
            raise DataDirectoryProblem(
                f"process {pid}, which owns {data}, does not answer; stop it (kill {pid}) and try again"
            )
        time.sleep(0.05)
