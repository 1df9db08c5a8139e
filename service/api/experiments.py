"""Experiments: submit, follow, stop, go on, delete, export."""

from __future__ import annotations

import io
from typing import Annotated, Any

from fastapi import APIRouter, Header, Query, Request, Response
from fastapi.concurrency import run_in_threadpool

from jobs import cells as cell_views
from jobs import experiments, queue, results, trash
from jobs.dispatcher import Dispatcher
from jobs.experiments import Experiment
from jobs.plan import Plan
from jobs.store import Store, now
from service import bodies, schemas, submission, views
from service.deps import EngineDep, ExperimentDep, ExperimentId, StoreDep
from service.engine import Engine

router = APIRouter(prefix="/api/experiments", tags=["experiments"])

BODY = {
    "requestBody": {
        "required": True,
        "content": {
            "application/json": {"schema": {"$ref": "#/components/schemas/Submission"}},
            "application/toml": {
                "schema": {"type": "string"},
                "example": 'scenes = ["cornell_box"]\nsamplers = ["independent", "stratified"]\nspp = [4, 16]\n',
            },
        },
    }
}

KNOWN: dict[int | str, dict[str, Any]] = {
    200: {"model": schemas.Experiment | schemas.DryRun, "description": "an experiment that was there, or a dry run"}
}


@router.get("", response_model=list[schemas.Experiment])
def list_experiments(
    engine: EngineDep,
    store: StoreDep,
    name: Annotated[str | None, Query(max_length=200, description="only those of this name")] = None,
) -> Response:
    """Every experiment with its state and progress, newest first."""
    found = views.all_experiments(store, engine)
    return _json([item for item in found if name is None or item["name"] == name])


@router.post("", openapi_extra=BODY, status_code=201, response_model=schemas.Experiment, responses=KNOWN)
async def submit(
    request: Request,
    engine: EngineDep,
    dry_run: bool = False,
    idempotency_key: Annotated[str | None, Header(min_length=1, max_length=200)] = None,
) -> Response:
    """
    Submit a grid: 201 for a new experiment, 200 for one that was there (a cancelled one is wanted again).

    The body is a `Submission` as JSON, or the text of a grid file with `Content-Type: application/toml`. With
    `dry_run` nothing is stored: the answer (200) says what the grid would render and cost. A client that is not sure
    whether its request arrived sends it again with the same `Idempotency-Key`.
    """
    asked = submission.read(
        await bodies.read(request, bodies.GRID_BYTES, "the grid"), request.headers.get("content-type", "")
    )
    return await run_in_threadpool(_dry_run if dry_run else _submit, engine, asked, idempotency_key)


@router.get("/{experiment_id}")
def show(engine: EngineDep, store: StoreDep, found: ExperimentDep) -> schemas.ExperimentDetail:
    """One experiment with its axes, metrics and grid."""
    return views.detail(store, found, engine)


@router.post("/{experiment_id}/pause")
def pause(engine: EngineDep, experiment_id: ExperimentId) -> schemas.Experiment:
    """Stop for a while, at once; the picture that is being drawn is begun again on resume."""
    return _change(engine, experiment_id, lambda store, dispatcher: dispatcher.pause(experiment_id))


@router.post("/{experiment_id}/resume")
def resume(engine: EngineDep, experiment_id: ExperimentId) -> schemas.Experiment:
    """Go on after a pause."""
    return _change(engine, experiment_id, lambda store, dispatcher: queue.resume(store, experiment_id))


@router.post("/{experiment_id}/cancel")
def cancel(engine: EngineDep, experiment_id: ExperimentId) -> schemas.Experiment:
    """Stop within seconds; what is finished is kept, and retry goes on."""
    return _change(engine, experiment_id, lambda store, dispatcher: dispatcher.cancel(experiment_id))


@router.post("/{experiment_id}/retry")
def retry(engine: EngineDep, experiment_id: ExperimentId) -> schemas.Experiment:
    """Queue failed and cancelled cells again."""
    return _change(engine, experiment_id, lambda store, dispatcher: queue.retry(store, experiment_id))


@router.delete("/{experiment_id}")
def delete(engine: EngineDep, store: StoreDep, found: ExperimentDep, dry_run: bool = False) -> schemas.Deleted:
    """
    Delete an experiment and the cells that no other one has; `dry_run` says what would go.

    It vanishes at once, and `restore` brings it back until `final_at`.
    """
    lost = trash.loss(store, engine.artifacts, found.id)
    if not dry_run:
        engine.do(lambda _, dispatcher: dispatcher.delete(found.id))
    return schemas.Deleted(
        id=found.id, name=found.name, cells=lost.cells, pictures=lost.pictures, disk_bytes=lost.disk_bytes,
        final_at=trash.final_at(now()),
    )  # fmt: skip


@router.post("/{experiment_id}/restore")
def restore(engine: EngineDep, experiment_id: ExperimentId) -> schemas.Experiment:
    """Take back a deletion; nothing happens to an experiment that is there."""
    return _change(engine, experiment_id, lambda store, _: queue.restore(store, experiment_id), deleted=True)


@router.get("/{experiment_id}/cells", response_model=schemas.Cells)
def list_cells(
    store: StoreDep,
    found: ExperimentDep,
    after: Annotated[int, Query(ge=0, le=2**62)] = 0,
    start: Annotated[int, Query(ge=0, le=2**31)] = 0,
    limit: Annotated[int, Query(ge=1, le=2000)] = cell_views.PAGE,
) -> Response:
    """
    Cells in the order of the plan, page by page; with `after`, those that changed since that revision.

    A dashboard reads all pages once, keeps the revision of the first, and follows `events` from there.
    """
    revision = store.revision()
    page = cell_views.page(store, found.id, after=after, start=start, limit=limit)
    return _json({"revision": revision, "next": page.next, "cells": page.cells})


@router.get("/{experiment_id}/convergence", response_model=schemas.Convergence)
def show_convergence(
    store: StoreDep,
    found: ExperimentDep,
    metric: str = "relmse",
    scene: Annotated[str | None, Query(max_length=1000)] = None,
) -> Response:
    """The curves of a metric: error against spp and seconds, with 95 % intervals and slopes."""
    revision = store.revision()
    answer = _json(views.curves(store, found.id, metric, scene))
    answer.headers["x-revision"] = str(revision)  # so long it is true: see service/kept.py
    return answer


@router.get("/{experiment_id}/results.csv", response_class=Response, responses={200: {"content": {"text/csv": {}}}})
def results_csv(store: StoreDep, found: ExperimentDep) -> Response:
    """One row per replicate with every metric, as `dartboard results --format csv`."""
    return _export(store, found, "csv", "text/csv; charset=utf-8")


@router.get("/{experiment_id}/results.json", response_class=Response,
            responses={200: {"content": {"application/json": {}}}})  # fmt: skip
def results_json(store: StoreDep, found: ExperimentDep) -> Response:
    """The same as JSON."""
    return _export(store, found, "json", "application/json")


@router.get("/{experiment_id}/report", response_class=Response, responses={200: {"content": {"text/html": {}}}})
def report(engine: EngineDep, store: StoreDep, found: ExperimentDep, download: bool = False) -> Response:
    """The experiment as one HTML file that needs nothing else; `download` gives it a file name."""
    from service.report import SERVED_POLICY, render_report

    text = render_report(store, engine.artifacts, found.id)
    headers = {"content-security-policy": SERVED_POLICY}
    if download:
        headers["content-disposition"] = f'attachment; filename="dartboard-{found.id}.html"'
    return Response(text, media_type="text/html; charset=utf-8", headers=headers)


def _change(engine: Engine, experiment: int, change: Any, deleted: bool = False) -> schemas.Experiment:
    """Have the engine change an experiment; what it is then. Raises ``NotFound``."""

    def checked(store: Any, dispatcher: Any) -> Experiment:
        if not deleted:
            experiments.get(store, experiment)
        change(store, dispatcher)
        return experiments.get(store, experiment)

    found = engine.do(checked)
    with engine.readers.lend() as store:
        return schemas.Experiment(**views.experiment(store, found, engine))


def _dry_run(engine: Engine, asked: schemas.Submission, key: str | None) -> Response:
    with engine.readers.lend() as store:
        wanted = submission.planned(store, engine.artifacts, asked, engine.lister)
        return _json(submission.dry_run(store, wanted).model_dump())


def _submit(engine: Engine, asked: schemas.Submission, key: str | None) -> Response:
    with engine.readers.lend() as store:
        wanted: Plan = submission.planned(store, engine.artifacts, asked, engine.lister)

    def change(store: Store, dispatcher: Dispatcher) -> tuple[Experiment, bool]:
        there = store.one("experiment_by_digest", digest=wanted.grid.digest) is not None
        return dispatcher.submit(wanted, key)[0], there

    found, there = engine.do(change)
    with engine.readers.lend() as store:
        answer = _json(views.experiment(store, found, engine), 200 if there else 201)
    answer.headers["location"] = f"/api/experiments/{found.id}"
    return answer


def _export(store: Store, found: Experiment, form: str, media_type: str) -> Response:
    file = io.StringIO(newline="")
    write = results.write_csv if form == "csv" else results.write_json
    with store.moment():
        write(results.rows(store, found.id), file)
    name = f'attachment; filename="dartboard-{found.id}.{form}"'
    return Response(file.getvalue(), media_type=media_type, headers={"content-disposition": name})


def _json(value: Any, status: int = 200) -> Response:
    return Response(views.to_json(value), status, media_type="application/json")
