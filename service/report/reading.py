"""
Reading: all that a report says about an experiment, read in one moment.

Numbers come from the functions that the dashboard and the CSV read, so none of the three can disagree with another.
What is read here is plain values; nothing is chosen, compared or worded yet, and no picture is opened but for its
header.
"""

from __future__ import annotations

import json
from dataclasses import dataclass
from typing import Any

from jobs import cells, experiments, results
from jobs.artifacts import Artifacts
from jobs.experiments import Experiment, Standing
from jobs.gridtoml import toml_of
from jobs.store import Row, Store, now
from renderer.errors import DartboardError
from renderer.images import read_header
from renderer.metrics import METRICS
from service import views

MOST_REPLICATES = 20_000  # rows: about 2 MB; beyond, the report says which command writes them


@dataclass(frozen=True)
class Reading:
    """
    An experiment at a revision of its store.

    at           when it was read: UTC, ISO 8601
    grid         canonical JSON of what was asked (jobs/gridspec.py)
    metric       the name of the metric that it is shown by
    cells        in the order of the plan, references too: ``schemas.Cell`` with ``digest``, and ``images``, the files
                 of its pictures relative to the data directory: the first one, or all that make up a reference
    curves       ``schemas.Convergence`` of every metric
    replicates   what ``dartboard results`` writes, one row per wanted picture; None if they are too many
    made_on      conditions (machine, device, threads, neighbours) with how many pictures were made under them, and when
    versions     of Mitsuba and Dr.Jit with the variant, as the pictures themselves say
    uploaded     scenes that are not built in: name → digest of the snapshot
    """

    experiment: Experiment
    standing: Standing
    revision: int
    at: str
    grid: dict[str, Any]
    toml: str
    metric: str
    cells: list[Row]
    curves: dict[str, dict[str, Any]]
    replicates: list[Row] | None
    made_on: list[Row]
    versions: list[dict[str, str]]
    uploaded: dict[str, str]


def read(store: Store, artifacts: Artifacts, experiment_id: int) -> Reading:
    """Raises ``NotFound`` for an experiment that is not there, ``WasDeleted`` for one in the trash."""
    with store.moment():
        experiment = experiments.get(store, experiment_id)
        grid = json.loads(experiment.grid)
        made_on = store.rows("made_on", experiment_id=experiment_id)
        return Reading(
            experiment, experiments.standing(store, experiment_id), store.revision(), now(), grid, toml_of(grid),
            views.default_metric(store, experiment_id), _cells(store, experiment_id),
            {metric: views.curves(store, experiment_id, metric) for metric in METRICS},
            _replicates(store, experiment_id), made_on, _versions(artifacts, made_on), _uploaded(store, grid),
        )  # fmt: skip


def _cells(store: Store, experiment: int) -> list[Row]:
    found: dict[int, Row] = {}
    start: int | None = 0
    while start is not None:
        page = cells.page(store, experiment, start=start)
        found |= {cell["position"]: cell | {"images": []} for cell in page.cells}
        start = page.next
    for row in store.stream("files_of_experiment", experiment_id=experiment):
        cell = found[row["position"]]
        cell["digest"] = row["digest"]
        if row["image"]:
            cell["images"].append(row["image"])
    return list(found.values())


def _replicates(store: Store, experiment: int) -> list[Row] | None:
    found: list[Row] = []
    for row in results.rows(store, experiment):
        if len(found) == MOST_REPLICATES:
            return None
        found.append(row)
    return found


def _versions(artifacts: Artifacts, made_on: list[Row]) -> list[dict[str, str]]:
    """Of the first and the last picture under each condition: opening every file would take minutes."""
    found: list[dict[str, str]] = []
    for name in dict.fromkeys(row[key] for row in made_on for key in ("first_image", "last_image")):
        try:
            header = read_header(artifacts.path(name))
            told = json.loads(header["versions"])
        except (DartboardError, KeyError, ValueError):
            continue  # a lost or foreign file says nothing; its numbers are in the database all the same
        versions = {part: str(told.get(part, "unknown")) for part in ("mitsuba", "drjit")}
        versions["variant"] = header.get("variant", "unknown")
        if versions not in found:
            found.append(versions)
    return found


def _uploaded(store: Store, grid: dict[str, Any]) -> dict[str, str]:
    return {
        scene["name"]: scene["digest"]
        for scene in grid["scenes"]
        if not (store.one("scene_by_digest", digest=scene["digest"]) or {}).get("builtin")
    }
