"""
What the database and the engine know, in the words of the wire. Routes, streams and reports read here, so that two of
them cannot tell different things.
"""

from __future__ import annotations

import json
from typing import Any

import pydantic_core

from jobs import cells, convergence, experiments
from jobs.experiments import Experiment
from jobs.gridtoml import toml_of
from jobs.store import Store
from renderer import catalog
from renderer.metrics import METRICS
from renderer.spec import Choice
from service import schemas
from service.engine import Engine, Moment, seconds_left

NO_NUMBERS = [before + value for before in ":,[" for value in ("NaN", "Infinity", "-Infinity")]
DEFAULT_METRICS = ("relmse", "mse_cross", "mse")  # the first that has values


def experiment(store: Store, found: Experiment, engine: Engine) -> dict[str, Any]:
    """``schemas.Experiment``: an experiment and how far it is."""
    standing = engine.standings.of(store, found.id)
    return {
        "id": found.id, "name": found.name, "state": standing.state, "created_at": found.created_at,
        "cells": standing.cells, "references": standing.references, "had": standing.had, "wanted": standing.wanted,
        "failed": standing.failed,
        "seconds_left": None if standing.finished else seconds_left(store, found.id, engine.moment.rate),
    }  # fmt: skip


def all_experiments(store: Store, engine: Engine) -> list[dict[str, Any]]:
    """Newest first."""
    return [experiment(store, found, engine) for found in reversed(experiments.everything(store))]


def detail(store: Store, found: Experiment, engine: Engine) -> schemas.ExperimentDetail:
    """An experiment with its axes."""
    revision = store.revision()
    grid = json.loads(found.grid)
    scenes = [
        schemas.SceneInfo(
            name=scene["name"], width=(scene["crop"] or [0, 0, scene["width"]])[2],
            height=(scene["crop"] or [0, 0, 0, scene["height"]])[3],
            reference=scene["reference"] and reference_line(scene["reference"]),
        )
        for scene in grid["scenes"]
    ]  # fmt: skip
    uploaded = {
        scene["name"]: scene["digest"]
        for scene in grid["scenes"]
        if not (store.one("scene_by_digest", digest=scene["digest"]) or {}).get("builtin")
    }
    return schemas.ExperimentDetail(
        **experiment(store, found, engine), revision=revision, scenes=scenes,
        integrators=[_label("integrator", item) for item in grid["integrators"]],
        samplers=[_label("sampler", item) for item in grid["samplers"]], spp=grid["spp"], sweeps=_sweeps(grid),
        replicates=grid["replicates"],
        points={item["file"]: item[catalog.POINTS] for item in grid["samplers"] if catalog.POINTS in item},
        replays=[text for item in grid["samplers"] if catalog.is_replay(text := _label("sampler", item))],
        metrics=[metric_info(name) for name in METRICS],
        default_metric=default_metric(store, found.id), toml=toml_of(grid), paths=uploaded,
    )  # fmt: skip


def default_metric(store: Store, experiment: int) -> str:
    """What an experiment is shown by, if nobody says otherwise."""
    there = {row["name"] for row in store.rows("measured_names", experiment_id=experiment)}
    return next((name for name in DEFAULT_METRICS if name in there), DEFAULT_METRICS[0])


def metric_info(name: str) -> schemas.MetricInfo:
    metric = METRICS[name]
    return schemas.MetricInfo(
        name=name, line=metric.line, formula=metric.formula, epsilon=metric.epsilon,
        lower_is_better=metric.lower_is_better,
    )  # fmt: skip


def curves(store: Store, experiment: int, metric: str, scene: str | None = None) -> dict[str, Any]:
    """``schemas.Convergence``, as plain values: validating 10 000 points would take longer than finding them."""
    revision = store.revision()
    found = convergence.curves(store, experiment, metric, scene)
    return {
        "metric": metric_info(metric).model_dump(),
        "revision": revision,
        "series": [{**vars(series), "slope": series.slope and vars(series.slope)} for series in found],
    }


def worker(engine: Engine, moment: Moment) -> dict[str, Any]:
    """``schemas.Worker``."""
    drawing = moment.drawing
    return {
        "state": moment.state, "device": engine.device.description, "trouble": moment.trouble,
        "experiment": drawing.experiments[0] if drawing and drawing.experiments else None,
        "cell": drawing.cell if drawing else None, "description": drawing.description if drawing else None,
        "queued": moment.queued,
    }  # fmt: skip


def update(store: Store, found: Experiment, after: int, engine: Engine, moment: Moment) -> dict[str, Any]:
    """``schemas.Update``: what is new of an experiment since a revision."""
    revision = store.revision()  # first: what is committed meanwhile comes again with the next update
    reload = cells.touched(store, found.id, after)
    page = None if reload else cells.page(store, found.id, after=after, limit=cells.PAGE)
    too_many = page is not None and page.next is not None
    return {
        "revision": revision, "experiment": experiment(store, found, engine),
        "worker": worker(engine, moment),
        "reload": reload or too_many, "cells": [] if page is None or too_many else page.cells,
    }  # fmt: skip


def to_json(value: Any) -> str:
    """Compact JSON of plain values, much faster than Python's own. Raises ``ValueError`` for NaN and infinities."""
    text = pydantic_core.to_json(value, inf_nan_mode="constants").decode()
    if any(token in text for token in NO_NUMBERS):  # or a name with these letters: Python's can tell
        return json.dumps(value, separators=(",", ":"), ensure_ascii=False, allow_nan=False)
    return text


def _sweeps(grid: dict[str, Any]) -> dict[str, list[Any]]:
    """Parameter → every value that it has in some scene, in the order of the grid."""
    found: dict[str, list[Any]] = {}
    for sweep in grid.get("sweeps", ()):
        values = found.setdefault(sweep["parameter"], [])
        values += [value for value in sweep["values"] if value not in values]
    return found


def reference_line(reference: dict[str, Any]) -> str:
    """How a reference is made, of its JSON in a grid."""
    sampler, integrator = _label("sampler", reference["sampler"]), _label("integrator", reference["integrator"])
    return f"{integrator}, {sampler}, {reference['replicates']} × {reference['spp']} spp"


def _label(axis: str, data: dict[str, Any]) -> str:
    return catalog.label(axis, Choice.of(data))
