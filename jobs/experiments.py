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
from jobs.errors import NotFound
from jobs.plan import Plan, Role
from jobs.store import Store, now
from renderer.scenes import sources

_ID = re.compile(r"[0-9]{1,18}")  # what SQLite can hold


@dataclass(frozen=True)
class Experiment:
    """A submitted grid. ``created_at`` is UTC, ISO 8601."""

    id: int
    name: str
    digest: str
    created_at: str
    cancelled: bool


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
        """Derived by counting: running, queued, failed, cancelled or done."""
        return next((state for state in _STATES if self.count(state)), "done")


_STATES = ("running", "queued", "failed", "cancelled", "done")


def submit(store: Store, plan: Plan, scenes: Path) -> tuple[Experiment, int]:
    """
    Record a plan → (its experiment, how many cells are new). Submitting it again changes nothing, but a
    cancelled experiment is wanted again.

    scenes  folder for the snapshots: a cell never renders a file that its author may still edit
    """
    for request in plan.grid.scenes:
        sources.snapshot(request.source, scenes)
    with store.transaction():
        known = store.value("experiment_by_digest", digest=plan.grid.digest)
        if known is not None:
            experiment = find(store, str(known))
            if experiment.cancelled:
                queue.want(store, experiment.id)
            return find(store, str(known)), 0
        before = store.value("count_cells")
        new = _insert(store, plan)
        queue.want(store, new)
        return find(store, str(new)), store.value("count_cells") - before


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
    """The experiment of that id, else the newest of that name. Raises ``NotFound`` with those that are there."""
    row = store.one("experiment_by_id", id=int(id_or_name)) if _ID.fullmatch(id_or_name) else None
    name = id_or_name.encode(errors="replace").decode()  # a command line may hold what is no text
    row = row or store.one("experiment_by_name", name=name)
    if row is None:
        there = [f"{item.id} ({item.name})" for item in everything(store)]
        listed = ", ".join(there[-10:]) or "none yet"
        raise NotFound(f"no experiment {id_or_name!r} in {store.path.parent}; there are: {listed}")
    return _experiment(row)


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


def _experiment(row: dict[str, Any]) -> Experiment:
    return Experiment(row["id"], row["name"], row["digest"], row["created_at"], row["cancelled_at"] is not None)


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
