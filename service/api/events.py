"""Streams of events (SSE): what a page follows to stay true."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Any

from fastapi import APIRouter, Header, Query, Response
from fastapi.concurrency import run_in_threadpool
from fastapi.responses import StreamingResponse

from jobs import experiments
from jobs.errors import NotFound
from service import schemas, views
from service.deps import EngineDep, ExperimentDep, HubDep
from service.engine import Drawing, Engine, Moment
from service.hub import EndOfStream, Hub, event, stream

router = APIRouter(prefix="/api", tags=["events"])

SSE: dict[int | str, dict[str, Any]] = {200: {"content": {"text/event-stream": {}}, "description": "events"}}
LastEventId = Annotated[int | None, Header(ge=0, le=2**62)]


@router.get("/events", response_class=Response, responses=SSE)
async def follow_all(engine: EngineDep, hub: HubDep) -> StreamingResponse:
    """Events `update`, data `Overview`: every experiment and the worker, whenever something has changed."""
    last: bytes | None = None

    async def news(moment: Moment) -> bytes | None:
        nonlocal last
        message = await hub.share(("all",), lambda: run_in_threadpool(_overview, engine, moment))
        if message == last:
            return None
        last = message
        return message

    return _sse(hub, engine, news)


@router.get("/experiments/{experiment_id}/events", response_class=Response, responses=SSE)
async def follow_one(
    engine: EngineDep,
    hub: HubDep,
    found: ExperimentDep,
    after: Annotated[int | None, Query(ge=0, le=2**62, description="the revision that the client has seen")] = None,
    last_event_id: LastEventId = None,
) -> StreamingResponse:
    """
    Events of one experiment: `update` (data `Update`), `progress` (data `Progress`), `gone` when it was deleted.

    It begins after the revision in the header `Last-Event-ID`, else in `after`, else now.
    """
    seen = last_event_id if last_event_id is not None else after
    if seen is None:
        seen = engine.moment.revision
    follower = Follower(engine, hub, found.id, seen)
    return _sse(hub, engine, follower.news)


class Follower:
    """One stream of an experiment: what it has told so far."""

    def __init__(self, engine: Engine, hub: Hub, experiment: int, seen: int):
        self.engine, self.hub, self.experiment, self.seen = engine, hub, experiment, seen
        self.told: tuple[Any, ...] | None = None
        self.drawing: Drawing | None = None

    async def news(self, moment: Moment) -> bytes | None:
        """The update, if there is anything new, and the progress of what is drawn for this experiment."""
        parts = []
        if _key(moment) != self.told:
            seen = self.seen
            update = await self.hub.share(
                (self.experiment, seen), lambda: run_in_threadpool(_update, self.engine, self.experiment, seen, moment)
            )
            if update is None:
                raise EndOfStream(event("gone", "{}"))
            # What another stream had made may be of an earlier moment than this: then the next step tells the rest.
            self.told, self.seen = update.told, update.revision
            parts.append(update.message)
        drawing = moment.drawing
        if drawing and drawing.passes and drawing != self.drawing and self.experiment in drawing.experiments:
            parts.append(event("progress", _progress(drawing)))
        self.drawing = drawing
        return b"".join(parts) or None


def _overview(engine: Engine, moment: Moment) -> bytes:
    with engine.readers.lend() as store:
        data = {
            "revision": moment.revision,
            "experiments": views.all_experiments(store, engine),
            "worker": views.worker(engine, moment),
        }
    return event("update", views.to_json(data), moment.revision)


def _key(moment: Moment) -> tuple[Any, ...]:
    """What of a moment an update tells: when it differs, there is news."""
    return moment.revision, moment.state, moment.trouble, moment.drawing and moment.drawing.cell


@dataclass(frozen=True)
class Told:
    """An update as it is sent: the moment that it tells of, and the revision from which the next one goes on."""

    message: bytes
    told: tuple[Any, ...]
    revision: int


def _update(engine: Engine, experiment: int, after: int, moment: Moment) -> Told | None:
    """The update since a revision; None if the experiment is gone."""
    with engine.readers.lend() as store:
        try:
            found = experiments.get(store, experiment)
        except NotFound:
            return None
        data = views.update(store, found, after, engine, moment)
    return Told(event("update", views.to_json(data), data["revision"]), _key(moment), data["revision"])


def _progress(drawing: Drawing) -> str:
    return schemas.Progress(
        cell=drawing.cell, role="reference" if drawing.role == "reference" else "cell", replicate=drawing.replicate,
        done=drawing.done, passes=drawing.passes, seconds=round(drawing.seconds, 3), preview=drawing.preview,
    ).model_dump_json()  # fmt: skip


def _sse(hub: Hub, engine: Engine, news: Any) -> StreamingResponse:
    headers = {"cache-control": "no-cache", "x-accel-buffering": "no"}
    return StreamingResponse(stream(hub, engine, news), media_type="text/event-stream", headers=headers)
