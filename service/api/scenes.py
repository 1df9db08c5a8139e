"""Scenes: those that are built in, and those that clients bring."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

from fastapi import APIRouter, Query, Request
from fastapi import Path as PathParameter
from fastapi.concurrency import run_in_threadpool

from jobs.gridscenes import own_reference
from renderer.errors import shown
from renderer.scenes import sources
from renderer.scenes.builtin import BUILTIN
from renderer.scenes.sources import SceneSource
from service import bodies, schemas, uploads, views
from service.deps import EngineDep, StoreDep

router = APIRouter(prefix="/api/scenes", tags=["scenes"])

ZIP = {
    "requestBody": {
        "required": True,
        "content": {"application/zip": {"schema": {"type": "string", "format": "binary"}}},
    }
}


@router.get("")
def list_scenes(engine: EngineDep, store: StoreDep) -> list[schemas.Scene]:
    """
    The built-in scenes, then those that clients have brought, newest first, with what their files say about size,
    integrator and sampler.
    """
    built_in = [sources.find(name, Path()) for name in BUILTIN]
    return [_scene(source) for source in [*built_in, *uploads.everything(store, engine.artifacts)]]


@router.post("", openapi_extra=ZIP, status_code=201)
async def upload(
    request: Request,
    engine: EngineDep,
    name: Annotated[str, Query(min_length=1, max_length=200, description="what grids will call it")],
    main: Annotated[
        str | None, Query(max_length=200, description="its scene file, where the folder has several")
    ] = None,
) -> schemas.Scene:
    """
    Upload a scene: a zip of its folder, at most 256 MiB; a pbrt-v3 one is converted, and the answer's `notes` say what
    is not as in its file. It is vetted (only plugins that ship with Mitsuba, only files of its own folder) and kept
    by its digest; a submission then says `"scenes": {NAME: digest}`.
    """
    what = f"the archive of {shown(name)}"
    with await bodies.save(request, bodies.SCENE_BYTES, what, engine.artifacts.data) as archive:
        return _scene(await run_in_threadpool(uploads.receive, engine, archive, name, main))


@router.get("/{digest}/parameters")
def list_parameters(
    engine: EngineDep,
    store: StoreDep,
    digest: Annotated[str, PathParameter(pattern="^[0-9a-f]{64}$", description="of a scene in the list of scenes")],
    colour: Literal["rgb", "spectral"] = "rgb",
) -> list[schemas.SceneParameter]:
    """What can be swept in a scene; empty where this machine cannot load one."""
    built_in = (sources.find(name, Path()) for name in BUILTIN)
    source = next((one for one in built_in if one.digest == digest), None)
    if source is None:
        source = uploads.find(store, engine.artifacts, {digest: digest}, digest)
    known = engine.lister(source, colour) or {}
    return [
        schemas.SceneParameter(name=parameter.short, kind=parameter.kind, now=parameter.now)
        for parameter in known.values()
        if parameter.kind != "other"
    ]


def _scene(source: SceneSource) -> schemas.Scene:
    said = source.defaults
    return schemas.Scene(
        name=source.name, digest=source.digest, builtin=source.builtin, main=source.main, width=said.width,
        height=said.height, max_depth=said.max_depth, integrator=said.integrator, sampler=said.sampler, spp=said.spp,
        reference=views.reference_line(own_reference(source).as_json()), files=[file.path for file in source.files],
        notes=list(source.notes),
    )  # fmt: skip
