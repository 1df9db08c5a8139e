"""The server itself: whether it works, what it draws with, what grids may name."""

from __future__ import annotations

import os
from typing import Any

from fastapi import APIRouter

from renderer import __version__, catalog
from service import schemas, views
from service.deps import EngineDep

router = APIRouter(prefix="/api", tags=["server"])


@router.get("/health")
def health(engine: EngineDep) -> schemas.Health:
    """Whether the server works: `stalled` says that nothing is rendered until the trouble is over."""
    moment = engine.moment
    return schemas.Health(
        status="stalled" if moment.state == "stalled" else "ok", version=__version__, data=engine.artifacts.data.name,
        machine=engine.machine, pid=os.getpid(), started_at=engine.started_at, revision=moment.revision,
        worker=schemas.Worker(**views.worker(engine, moment)),
    )  # fmt: skip


@router.get("/worker")
def worker(engine: EngineDep) -> schemas.Worker:
    """What renders, and what it does now."""
    return schemas.Worker(**views.worker(engine, engine.moment))


@router.get("/catalog")
def show_catalog() -> dict[str, list[dict[str, Any]]]:
    """Every sampler, integrator, scene, filter and metric with its parameters, defaults and units."""
    return catalog.as_json()
