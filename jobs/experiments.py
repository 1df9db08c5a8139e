"""
Experiments: a plan goes in once, by digest, and is found again by id or name.

The same cell in two experiments is one row and is rendered once; submitting the same grid again creates
nothing; adding one spp creates only that. What becomes of the cells is the business of ``queue.py``.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from jobs import queue
from jobs.errors import KeyReused, NotFound, WasDeleted
from jobs.plan import Plan, Role
from jobs.points import refresh_experiment
from jobs.store import Store, now
from renderer.samplers import pointfile
from renderer.scenes import sources

_ID = re.compile(r"[0-9]{1,18}")  # what SQLite can hold


@dataclass(frozen=True)
class Experiment:
    """
    A submitted grid. Times are UTC, ISO 8601.

    grid        canonical JSON (jobs/gridspec.py)
    deleted_at  None, or when it was put into the trash
    """

    id: int
    name: str
    digest: str
    created_at: str
    cancelled: bool
    paused: bool
    grid: str
    deleted_at: str | None = None


@dataclass(frozen=True)
class Standing:
    """How far an experiment is: cells by role and state, and pictures had of those wanted."""

    cells: dict[str, int]
    references: dict[str, int]
    had: int
    wanted: int

    def count(self, state: str) -> int:
        return self.cells.get(state, 0) + self.references.get(state, 0)

    @property
    def failed(self) -> int:
        return self.count("failed")

    @property
    def finished(self) -> bool:
        """True if nothing is queued or running."""
        return not (self.count("queued") or self.count("running"))

    @property
    def state(self) -> str:
        """Derived by counting: running, queued, paused, failed, cancelled or done."""
        return next((state for state in _STATES if self.count(state)), "done")


_STATES = ("running", "queued", "paused", "failed", "cancelled", "done")


def submit(
    store: Store, plan: Plan, scenes: Path, key: str | None = None, *, points: Path | None = None
) -> tuple[Experiment, int]:
    """
    Record a plan → (its experiment, how many cells are new). Submitting it again changes nothing, but an
    experiment that was cancelled, paused or deleted is wanted again.

    scenes  folder for the snapshots: a cell never renders a file that its author may still edit
    points  folder for the snapshots of point files, for the same reason; a plan without any needs none
    key     of a client that may send the same request twice: the second changes nothing at all. Raises
            ``KeyReused`` if the key came with another grid
    """
    for request in plan.grid.scenes:
        sources.snapshot(request.source, scenes)
    for source in plan.grid.points:
        assert points, "a plan with point files needs a folder for them"
        pointfile.snapshot(source, points)
    with store.transaction():
        if key is not None and (sent := store.one("submission", key=key)):
            if sent["digest"] != plan.grid.digest:
                raise KeyReused(key)
            return get(store, sent["experiment_id"]), 0
        known = store.value("experiment_by_digest", digest=plan.grid.digest)
        if known is not None:
            experiment, cells = _experiment_of(store, known), 0
            if experiment.cancelled or experiment.paused or experiment.deleted_at:
                queue.want(store, experiment.id)
        else:
            before = store.value("count_cells")
            known = _insert(store, plan)
            queue.want(store, known)
            refresh_experiment(store, known)
            cells = store.value("count_cells") - before
        if key is not None:
            store.run("add_submission", key=key, digest=plan.grid.digest, experiment_id=known, at=now())
        return get(store, known), cells


def _insert(store: Store, plan: Plan) -> int:
    """Rows for a plan; the id of its experiment, which wants nothing yet."""
    for request in plan.grid.scenes:
        source = request.source
        store.run("add_scene", digest=source.digest, name=source.name, main=source.main, builtin=source.builtin)
    experiment = store.insert(
        "add_experiment", digest=plan.grid.digest, name=plan.grid.name, created_at=now(), grid=plan.grid.text
    )
    revision = store.insert("add_event", at=now(), what="submit", cell_id=None, experiment_id=experiment)
    scenes = {row["digest"]: row["id"] for row in store.rows("scenes")}
    store.run_many("add_cell", _cell_rows(plan, revision, scenes))
    digests = {cell.reference for cell in plan.cells} - {None}
    references = {digest: store.value("cell_id", digest=digest) for digest in digests}
    store.run_many("add_experiment_cell", _wanted_rows(plan, experiment, references))
    return experiment


def find(store: Store, id_or_name: str) -> Experiment:
    """
    The experiment of that id, else the newest of that name. Raises ``NotFound`` with those that are there,
    ``WasDeleted`` for one in the trash.
    """
    if _ID.fullmatch(id_or_name) and store.one("experiment_by_id", id=int(id_or_name)):
        return get(store, int(id_or_name))
    name = id_or_name.encode(errors="replace").decode()  # a command line may hold what is no text
    row = store.one("experiment_by_name", name=name)
    if row is None:
        raise _unknown(store, id_or_name)
    return _experiment(row)


def get(store: Store, experiment: int) -> Experiment:
    """The experiment of that id. Raises ``NotFound``, or ``WasDeleted`` for one in the trash."""
    found = _experiment_of(store, experiment)
    if found.deleted_at is not None:
        raise WasDeleted(found.id, found.name)
    return found


def everything(store: Store) -> list[Experiment]:
    """All experiments, oldest first."""
    return [_experiment(row) for row in store.rows("experiments")]


def standing(store: Store, experiment: int) -> Standing:
    """Counts of an experiment. Two requests that were rounded to one cell count once."""
    counts: dict[str, dict[str, int]] = {"cell": {}, "reference": {}}
    had = wanted = 0
    for row in store.rows("progress", experiment_id=experiment):
        counts[row["role"]][row["state"]] = row["cells"]
        had, wanted = had + row["had"], wanted + row["wanted"]
    return Standing(counts["cell"], counts["reference"], had, wanted)


def replicates_had(store: Store) -> dict[tuple[str, Role], int]:
    """(digest, role) → how many pictures are there, for ``estimate``."""
    return {(row["digest"], row["role"]): row["had"] for row in store.rows("replicates_had")}


def rates(store: Store, machine: str) -> dict[tuple[str, str], float]:
    """(scene, integrator) → samples per second that this machine has reached, for ``estimate``."""
    return {(row["scene"], row["integrator"]): row["rate"] for row in store.rows("rates", machine=machine)}


def _experiment_of(store: Store, experiment: int) -> Experiment:
    """Of that id, in the trash or not."""
    row = store.one("experiment_by_id", id=experiment)
    if row is None:
        raise _unknown(store, str(experiment))
    return _experiment(row)


def _unknown(store: Store, id_or_name: str) -> NotFound:
    there = [f"{item.id} ({shown_name(item.name)})" for item in everything(store)]
    listed = ", ".join(there[-10:]) or "none yet"
    return NotFound(f"no experiment {id_or_name[:80]!r} in {store.path.parent}; there are: {listed}")


def shown_name(name: str) -> str:
    """A name as a sentence repeats it."""
    return name if len(name) <= 60 else name[:57] + "…"


def _experiment(row: dict[str, Any]) -> Experiment:
    return Experiment(
        row["id"], row["name"], row["digest"], row["created_at"], cancelled=row["cancelled_at"] is not None,
        paused=row["paused_at"] is not None, grid=row["grid"], deleted_at=row["deleted_at"],
    )  # fmt: skip


def _cell_rows(plan: Plan, revision: int, scenes: Mapping[str, int]) -> Iterator[dict[str, Any]]:
    for planned in plan.cells:
        spec = planned.spec
        yield {
            "digest": spec.digest, "spec": spec.text, "estimand": spec.estimand.digest, "spp": spec.spp,
            "pixels": math.prod(spec.estimand.size), "scene_id": scenes[spec.estimand.scene], "revision": revision,
        }  # fmt: skip


def _wanted_rows(plan: Plan, experiment: int, references: Mapping[str | None, int]) -> Iterator[dict[str, Any]]:
    for position, planned in enumerate(plan.cells):
        yield {
            "experiment_id": experiment, "position": position, "digest": planned.spec.digest, "role": planned.role,
            "replicates": planned.replicates, "reference_id": references.get(planned.reference),
            "spp_asked": planned.spp_asked, "scene": planned.scene, "integrator": planned.integrator,
            "sampler": planned.sampler,
        }  # fmt: skip
