"""
The queue: which cell runs next, and what may become of it.

A cell is queued as long as a live experiment wants more replicates of it than there are. ``claim`` takes the next one
and opens an attempt *before* it runs; a finished replicate is the unit of commit. A cell that ends its render process
MAX_ATTEMPTS times without a replicate in between is failed, and the rest goes on. Every change of state is a move of
MOVES and leaves an event. SQL lives in ``sql/queries.sql``; nothing here renders.

What comes back from an attempt that has ended (its cell was cancelled, or its owner lost it) changes no state, but a
finished picture is kept: it is the same picture whoever asked for it.
"""

from __future__ import annotations

import json
from dataclasses import dataclass

from jobs.store import Row, Store, now
from renderer.spec import CellSpec

MAX_ATTEMPTS = 3  # crashes that one cell may cause, with no replicate in between, before the grid goes on without it

MOVES = {
    ("queued", "claim"): "running",
    ("queued", "finish"): "done",  # its last replicate came late, from an attempt that had ended
    ("queued", "cancel"): "cancelled",
    ("running", "finish"): "done",
    ("running", "requeue"): "queued",  # it has what it was claimed for; more is wanted meanwhile
    ("running", "release"): "queued",  # given back unharmed
    ("running", "recover"): "queued",  # its owner died
    ("running", "crash"): "queued",
    ("running", "fail"): "failed",
    ("running", "cancel"): "cancelled",
    ("done", "want"): "queued",
    ("cancelled", "want"): "queued",
    ("cancelled", "retry"): "queued",
    ("failed", "retry"): "queued",
}

RETRIED = frozenset({"crash", "timeout", "out_of_memory", "lost"})  # may be the machine's fault
FATAL = frozenset({"scene_error", "bad_parameter", "nan_output"})  # the same input fails again


class MoveRefused(RuntimeError):
    """A change of state that MOVES does not know: a bug of ours, never a user's."""


@dataclass(frozen=True)
class Work:
    """
    A claimed cell.

    missing  (role, k) of the replicates to render now, those of role "cell" first
    """

    cell_id: int
    digest: str
    spec: CellSpec
    attempt_id: int
    machine: str
    device: str
    missing: tuple[tuple[str, int], ...]


def move(store: Store, cell: int, name: str) -> str:
    """Move one cell; its new state. Raises ``MoveRefused`` for a move that its state does not allow."""
    with store.transaction():
        found = store.one("cell_state", cell_id=cell)
        state = found["state"] if found else "absent"
        if (state, name) not in MOVES:
            raise MoveRefused(f"cell {cell} is {state}: no move {name!r} leads from there")
        target = MOVES[state, name]
        store.run("set_state", cell_id=cell, state=target, revision=_event(store, name, cell=cell))
        return target


def claim(store: Store, *, machine: str, device: str, experiment: int | None = None) -> Work | None:
    """
    The next cell, now running; None if nothing is left to do.

    In the order of priority, experiment, plan. With ``experiment`` only what that one wants. Cells of a version that
    renders other pictures under the same description fail here, with the way out.
    """
    with store.transaction():
        while row := _next(store, experiment):
            spec = CellSpec.parse(row["spec"])
            missing = _missing(store, row["id"], experiment)
            move(store, row["id"], "claim")
            attempt = store.insert("start_attempt", cell_id=row["id"], machine=machine, device=device, at=now())
            work = Work(row["id"], row["digest"], spec, attempt, machine, device, missing)
            if spec.digest == work.digest:
                return work
            fail(store, work, "bad_parameter", "it was asked of an older Dartboard; submit its grid again")
    return None


def finish_replicate(
    store: Store,
    work: Work,
    role: str,
    k: int,
    *,
    image: str,
    seed: int,
    render_seconds: float,
    compile_seconds: float,
    threads: int,
    neighbours: int,
) -> int:
    """
    Record a finished picture, whose file is in place; the id of its row.

    Its process has shown that it can render this cell, so earlier crashes are forgiven. A picture that is already
    recorded changes nothing.
    """
    with store.transaction():
        known = store.value("replicate_id", cell_id=work.cell_id, role=role, k=k)
        if known is not None:
            return int(known)
        replicate = store.insert(
            "add_replicate", cell_id=work.cell_id, role=role, k=k, seed=seed, image=image,
            render_seconds=render_seconds, compile_seconds=compile_seconds, machine=work.machine, device=work.device,
            threads=threads, neighbours=neighbours, attempt_id=work.attempt_id, at=now(),
        )  # fmt: skip
        store.run("touch", cell_id=work.cell_id, revision=_event(store, "replicate", cell=work.cell_id))
        state, crashes = _state(store, work.cell_id)
        if crashes:
            store.run("set_crashes", cell_id=work.cell_id, crashes=0)
        if state == "queued" and not _wanted(store, work.cell_id):
            move(store, work.cell_id, "finish")
    return replicate


def finish(store: Store, work: Work) -> str:
    """The attempt is over and its replicates are recorded: done, or queued again if more is wanted meanwhile."""
    with store.transaction():
        if not _end(store, work, "done"):
            return _state(store, work.cell_id)[0]
        return _leave(store, work.cell_id, "requeue")


def fail(store: Store, work: Work, error_class: str, message: str, log: str | None = None) -> str:
    """
    The attempt ended without all its replicates: queued again, or failed.

    ``log`` is the file with its process's last words, relative to the data directory. Raises ``ValueError`` for an
    unknown class.
    """
    if error_class not in RETRIED | FATAL:
        raise ValueError(f"unknown error class {error_class!r}; known: {', '.join(sorted(RETRIED | FATAL))}")
    with store.transaction():
        if not _end(store, work, error_class, message, log):
            return _state(store, work.cell_id)[0]
        if not _wanted(store, work.cell_id):
            return move(store, work.cell_id, "finish")  # it broke after its last picture
        crashes = _state(store, work.cell_id)[1] + 1
        store.run("set_crashes", cell_id=work.cell_id, crashes=crashes)
        if error_class in RETRIED and crashes < MAX_ATTEMPTS:
            return move(store, work.cell_id, "crash")
        store.run("set_error", cell_id=work.cell_id, error_class=error_class, error=message)
        store.run("close_cell", cell_id=work.cell_id)
        return move(store, work.cell_id, "fail")


def release(store: Store, work: Work) -> str:
    """Back to the queue without blame: the owner stops, or its process ended on account of another cell."""
    with store.transaction():
        if not _end(store, work, "released"):
            return _state(store, work.cell_id)[0]
        return _leave(store, work.cell_id, "release")


def recover(store: Store) -> int:
    """Queue again what a dead owner left running, without blame; how many cells. For a new owner, first of all."""
    with store.transaction():
        cells = [row["id"] for row in store.rows("running_cells")]
        store.run("end_attempts", cells=json.dumps(cells), at=now(), outcome="owner_lost")
        for cell in cells:
            _leave(store, cell, "recover")
    return len(cells)


def cancel(store: Store, experiment: int) -> list[int]:
    """
    Stop wanting what an experiment has not got; what other live experiments want goes on.

    The ids of the cells that were running for it alone: whoever renders them should kill that now. A pause ends with
    it: what is cancelled does not wait.
    """
    with store.transaction():
        stopped = _stop(store, experiment, "set_cancelled", "cancelled")
        store.run("set_paused", experiment_id=experiment, at=None)
    return stopped


def pause(store: Store, experiment: int) -> list[int]:
    """
    Like ``cancel``, for a while: ``resume`` goes on. A picture that is being drawn is begun again then.
    """
    if not store.value("is_live", experiment_id=experiment):
        return []
    return _stop(store, experiment, "set_paused", "released")


def resume(store: Store, experiment: int) -> int:
    """End a pause; in how many places of its plan the experiment wants something."""
    with store.transaction():
        if not store.run("set_paused", experiment_id=experiment, at=None):
            return 0
        return want(store, experiment) if store.value("is_live", experiment_id=experiment) else 0


def delete(store: Store, experiment: int) -> list[int]:
    """Put an experiment into the trash (jobs/trash.py), cancelling what it misses; the cells as for ``cancel``."""
    return _stop(store, experiment, "set_deleted", "cancelled")


def restore(store: Store, experiment: int) -> None:
    """Take an experiment out of the trash: as live as it was before."""
    with store.transaction():
        if store.run("set_deleted", experiment_id=experiment, at=None):
            if store.value("is_live", experiment_id=experiment):
                want(store, experiment)
            else:
                _event(store, "restore", experiment=experiment)


def retry(store: Store, experiment: int) -> int:
    """
    Want again what failed or was cancelled in an experiment; in how many places of its plan.

    A cell that comes back from failed is open again for every live experiment that misses some of it.
    """
    with store.transaction():
        failed = json.dumps([row["id"] for row in store.rows("failed_cells", experiment_id=experiment)])
        store.run("forgive", cells=failed)
        store.run("set_cancelled", experiment_id=experiment, at=None)
        store.run("set_paused", experiment_id=experiment, at=None)
        _move_many(store, "retry", "move_missing", experiment)
        opened = want(store, experiment)
        store.run("open_everywhere", cells=failed)
    return opened


def want(store: Store, experiment: int) -> int:
    """Make an experiment live and open what it misses, except what has failed; in how many places of its plan."""
    with store.transaction():
        for mark in ("set_cancelled", "set_paused", "set_deleted"):
            store.run(mark, experiment_id=experiment, at=None)
        _move_many(store, "want", "move_missing", experiment)
        return store.run("open_experiment", experiment_id=experiment)


def note(store: Store, what: str) -> None:
    """An event that concerns no single cell or experiment: whoever follows should look again."""
    _event(store, what)


def _event(store: Store, what: str, *, cell: int | None = None, experiment: int | None = None) -> int:
    return store.insert("add_event", at=now(), what=what, cell_id=cell, experiment_id=experiment)


def _state(store: Store, cell: int) -> tuple[str, int]:
    row = store.one("cell_state", cell_id=cell)
    assert row, f"no cell {cell}"
    return row["state"], row["crashes"]


def _wanted(store: Store, cell: int) -> bool:
    return bool(store.value("is_wanted", cell_id=cell))


def _next(store: Store, experiment: int | None) -> Row | None:
    if experiment is None:
        return store.one("next_cell")
    return store.one("next_cell_of_experiment", experiment_id=experiment)


def _missing(store: Store, cell: int, experiment: int | None) -> tuple[tuple[str, int], ...]:
    had = {(row["role"], row["k"]) for row in store.rows("had_replicates", cell_id=cell)}
    wanted = store.rows("wanted_replicates", cell_id=cell, experiment_id=experiment)
    all_of_them = [(row["role"], k) for row in wanted for k in range(row["replicates"])]
    return tuple(pair for pair in all_of_them if pair not in had)


def _end(store: Store, work: Work, outcome: str, error: str | None = None, log: str | None = None) -> bool:
    """Close the attempt; False if it had ended already."""
    return store.run("end_attempt", attempt_id=work.attempt_id, at=now(), outcome=outcome, error=error, log=log) == 1


def _stop(store: Store, experiment: int, mark: str, outcome: str) -> list[int]:
    """Close an experiment under a mark; the cells that were running for it alone."""
    with store.transaction():
        if not store.run(mark, experiment_id=experiment, at=now()):
            return []
        store.run("close_experiment", experiment_id=experiment)
        running = [row["id"] for row in store.rows("unwanted_running", experiment_id=experiment)]
        store.run("end_attempts", cells=json.dumps(running), at=now(), outcome=outcome)
        _move_many(store, "cancel", "move_unwanted", experiment)
    return running


def _leave(store: Store, cell: int, name: str) -> str:
    """Out of running by ``name`` if more of it is wanted, else by finishing."""
    return move(store, cell, name if _wanted(store, cell) else "finish")


def _move_many(store: Store, name: str, query: str, experiment: int) -> None:
    """Move all cells that ``query`` selects of an experiment, from every state that the move leads away from."""
    revision = _event(store, name, experiment=experiment)
    for (source, other), target in MOVES.items():
        if other == name:
            store.run(query, experiment_id=experiment, source=source, target=target, revision=revision)
