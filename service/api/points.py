"""Point files: the points of ``pointset`` samplers, brought by clients."""

from __future__ import annotations

from typing import Annotated

from fastapi import APIRouter, Query, Request
from fastapi.concurrency import run_in_threadpool

from renderer.errors import shown
from service import bodies, schemas, uploadedpoints
from service.deps import EngineDep

router = APIRouter(prefix="/api/points", tags=["points"])

NPZ = {
    "requestBody": {
        "required": True,
        "content": {"application/octet-stream": {"schema": {"type": "string", "format": "binary"}}},
    }
}


@router.post("", openapi_extra=NPZ, status_code=201)
async def upload(
    request: Request,
    engine: EngineDep,
    name: Annotated[str, Query(min_length=1, max_length=200, description="what grids will call it")],
) -> schemas.PointFile:
    """
    Upload a point file: a numpy archive (.npz) with `points`, float (K, N, 2) or (N, 2) in [0, 1), at most 64 MiB. It
    is kept by its digest; a submission with `pointset:file=NAME` then says `"points": {NAME: digest}`.
    """
    what = f"the point file {shown(name)}"
    with await bodies.save(request, bodies.POINTS_BYTES, what, engine.artifacts.data) as content:
        source = await run_in_threadpool(uploadedpoints.receive, engine.artifacts, content, name)
    return schemas.PointFile(name=source.name, digest=source.digest, sets=source.sets, count=source.count)
