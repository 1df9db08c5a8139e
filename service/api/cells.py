"""Cells: their pictures in every form, and their history."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any, Literal

from fastapi import APIRouter, Query, Request, Response
from fastapi.responses import FileResponse

from jobs.errors import NotFound
from service import schemas
from service.deps import CellId, EngineDep, StoreDep
from service.kept import ALWAYS
from service.pictures import Made, Pictures

router = APIRouter(prefix="/api/cells", tags=["cells"])

# A browser asks again each time, with the tag of what it has: the same address leads to another picture when another
# data directory is served.
ASK_AGAIN = "private, no-cache"
NOT_AT_ALL = "no-store"
Responses = dict[int | str, dict[str, Any]]
SAME: Responses = {304: {"description": "the client has it: its `If-None-Match` names it"}}
PNG: Responses = {200: {"content": {"image/png": {}}, "description": "the picture"}, **SAME}
ROWS: Responses = {200: {"content": {"application/octet-stream": {}}, "description": "float16 RGB rows"}, **SAME}
EXR: Responses = {200: {"content": {"image/x-exr": {}}, "description": "the picture"}}
RoleQuery = Annotated[schemas.Role, Query()]
Replicate = Annotated[str, Query(max_length=10, description="the number of a replicate, or `mean`")]
Token = Annotated[str, Query(max_length=100, description="ignored: it only makes an address another one")]
Maximum = Annotated[float, Query(alias="max", gt=0, allow_inf_nan=False, description="what the top of a scale means")]
Size = Annotated[Literal["64", "128", "256", "512"], Query(description="of the longer side, in pixels")]


@router.get("/{cell}/preview.png", response_class=Response, responses=PNG)
def preview(
    request: Request,
    store: StoreDep,
    cell: CellId,
    role: RoleQuery = "cell",
    k: Replicate = "",
    size: Size = "256",
    ev: Annotated[float, Query(ge=-20, le=20)] = 0.0,
    tone: str = "srgb",
    maximum: Maximum = 1.0,
    v: Token = "",
) -> Response:
    """
    A picture as people see it: exposure `ev` in stops, `tone` srgb, gamma22 or falsecolour (0 to `max`).

    While nothing is finished, what is drawn so far; 404 while there is nothing at all.
    """
    revision = store.revision()
    made = _pictures(request).preview(
        store, cell, role, _which(role, k), size=int(size), ev=ev, tone=tone, maximum=maximum
    )
    return _answer(request, made, revision, "image/png")


@router.get("/{cell}/error/{metric}.png", response_class=Response, responses=PNG)
def error_map(
    request: Request,
    store: StoreDep,
    cell: CellId,
    metric: str,
    reference: Annotated[int, Query(ge=1, le=2**62, description="the cell that it is compared with")],
    k: Replicate = "0",
    size: Size = "256",
    maximum: Maximum = 1.0,
    v: Token = "",
) -> Response:
    """Where the error is: the map whose mean is the metric, in inferno from 0 to `max`."""
    revision = store.revision()
    made = _pictures(request).error(store, cell, metric, reference, k, size=int(size), maximum=maximum)
    return _answer(request, made, revision, "image/png")


@router.get("/{cell}/pixels", response_class=Response, responses=ROWS)
def pixels(
    request: Request,
    store: StoreDep,
    cell: CellId,
    role: RoleQuery = "cell",
    k: Replicate = "",
    size: Annotated[int | None, Query(ge=16, le=16384)] = None,
    v: Token = "",
) -> Response:
    """
    Linear radiance as float16, little-endian RGB rows from the top; headers X-Width and X-Height.

    Without `k`: the first replicate of a cell, the mean of a reference. `size` makes the longer side at most so long.
    """
    revision = store.revision()
    width, height, made = _pictures(request).pixels(store, cell, role, _which(role, k), size)
    return _answer(
        request, made, revision, "application/octet-stream", {"x-width": str(width), "x-height": str(height)}
    )


@router.get("/{cell}/image.exr", response_class=FileResponse, responses=EXR)
def image(
    request: Request,
    engine: EngineDep,
    store: StoreDep,
    cell: CellId,
    role: RoleQuery = "cell",
    k: Annotated[int, Query(ge=0, le=10_000)] = 0,
) -> FileResponse:
    """A replicate as it was rendered: float32 OpenEXR, with all that is needed to make it again in its header."""
    path = engine.artifacts.path(_pictures(request).file(store, cell, role, k))
    if not path.is_file():
        raise NotFound(f"the picture {path.name} of cell {cell} is no longer in the data directory")
    return FileResponse(path, media_type="image/x-exr", filename=f"cell-{cell}-{role}-{k}.exr")


@router.get("/{cell}/attempts")
def attempts(engine: EngineDep, store: StoreDep, cell: CellId) -> schemas.Attempts:
    """Every try at a cell, oldest first, with the last words of render processes that ended badly."""
    if store.one("cell_by_id", id=cell) is None:
        raise NotFound(f"there is no cell {cell}")
    found = []
    for row in store.rows("attempts", cell_id=cell):
        log = None
        if row["log"]:
            path = engine.artifacts.path(row["log"])
            log = path.read_text(encoding="utf-8", errors="replace") if path.is_file() else "(the log is gone)"
        found.append(schemas.Attempt(**{**row, "log": log}))
    return schemas.Attempts(attempts=found)


def _answer(
    request: Request, made: Made, revision: int, media_type: str, more: Mapping[str, str] | None = None
) -> Response:
    """What was asked for, or the word that the client has it already. ``revision`` is of before it was looked for."""
    if made.tag is None:
        return Response(made.make(), media_type=media_type, headers={"cache-control": NOT_AT_ALL, **(more or {})})
    tag = f'"{made.tag}"'
    headers = {"cache-control": ASK_AGAIN, "etag": tag, **(more or {})}
    if tag in request.headers.get("if-none-match", ""):
        return Response(status_code=304, headers=headers)
    headers["x-revision"] = ALWAYS if made.fixed else str(revision)
    return Response(made.make(), media_type=media_type, headers=headers)


def _pictures(request: Request) -> Pictures:
    found: Pictures = request.app.state.pictures
    return found


def _which(role: str, k: str) -> str:
    return k or ("mean" if role == "reference" else "0")
