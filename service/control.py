"""
``dartboard cancel``, ``retry``, ``pause`` and ``resume`` on a data directory: over HTTP where a server owns it, through
the inbox where another process does, else as the owner.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path
from typing import Literal

from jobs import experiments, inbox, owner, queue
from jobs.errors import DataDirectoryProblem
from jobs.experiments import Experiment, Standing
from jobs.store import Store

ANSWER_SECONDS = 5.0  # an owner looks into its inbox several times a second
Action = Literal["cancel", "retry", "pause", "resume"]
DO: dict[Action, Callable[[Store, int], object]] = {
    "cancel": queue.cancel,
    "retry": queue.retry,
    "pause": queue.pause,
    "resume": queue.resume,
}


def change(what: Action, name: str, data: Path) -> str:
    """
    Do one of DO to an experiment; a sentence about what was done.

    Raises ``NotFound`` for an unknown experiment, ``DataDirectoryProblem`` if the owner does not answer.
    """
    store = Store.read(data)
    experiment = experiments.find(store, name)
    store.close()
    who = owner.peek(data)
    if who is not None and who.get("url"):
        from service.remote import change_there

        return change_there(what, str(experiment.id), who["url"])
    if who is not None:
        _ask_owner(what, experiment.id, data, who.get("pid"))
        return f"asked process {who.get('pid')}, which works on {data}, to {what} {experiment.name!r}"
    with owner.own(data):
        store = Store.open(data)
        queue.recover(store)
        done = DO[what](store, experiment.id)
        standing = experiments.standing(store, experiment.id)
        store.close()
    return _told(what, experiment, standing, bool(done))


def _told(what: Action, experiment: Experiment, standing: Standing, done: bool) -> str:
    kept = f"{standing.had} of {standing.wanted} pictures are kept"
    left = standing.wanted - standing.had
    if what == "cancel":
        return f"{experiment.name!r} is cancelled; {kept}"
    if what == "pause":
        if standing.state != "paused":
            return f"{experiment.name!r} is {standing.state}: there is nothing to pause"
        return f"{experiment.name!r} is paused; {kept}; `dartboard resume {experiment.id}` goes on"
    if what == "resume" and not done:
        return f"{experiment.name!r} is {standing.state}: there is nothing to resume"
    return f"{left} pictures of {experiment.name!r} are queued again; `dartboard run` its grid to render them"


def _ask_owner(what: Action, experiment: int, data: Path, pid: int | None) -> None:
    request = inbox.post(data, what, experiment)
    deadline = time.monotonic() + ANSWER_SECONDS
    while request.exists():
        if time.monotonic() > deadline:
            request.unlink(missing_ok=True)
            raise DataDirectoryProblem(
                f"process {pid}, which owns {data}, does not answer; stop it (kill {pid}) and try again"
            )
        time.sleep(0.05)
