"""
The application: routes, streams and the pages in ``web/``, around one engine.

Importing this imports no Mitsuba, and neither does serving: only render processes do.
"""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import AsyncIterator
from pathlib import Path
from typing import Any

from fastapi import FastAPI, Request, Response
from fastapi.openapi.utils import get_openapi
from fastapi.responses import FileResponse
from starlette.exceptions import HTTPException
from starlette.middleware.gzip import DEFAULT_EXCLUDED_CONTENT_TYPES, GZipMiddleware
from starlette.staticfiles import StaticFiles

from renderer import __version__
from service import schemas
from service.api import cells, events, experiments, points, scenes, server
from service.engine import Engine
from service.hub import Hub
from service.kept import Kept
from service.pictures import Pictures
from service.problems import RESPONSES, install, of_http
from service.security import Guard

WEB = Path(__file__).resolve().parent.parent / "web"
PAGES = ("/", "/new", "/experiments/{experiment_id:int}")  # web/app.js shows the rest
NOT_COMPRESSED = (*DEFAULT_EXCLUDED_CONTENT_TYPES, "application/octet-stream", "image/x-exr")
# Models that no route's type names: streams, the body that two content types share, problems.
ALSO_TOLD = (schemas.Submission, schemas.Problem, schemas.Update, schemas.Overview, schemas.Progress)


class Assets(StaticFiles):
    """The files of the dashboard: asked for every time, sent only when they have changed."""

    def file_response(self, *args: Any, **keys: Any) -> Any:
        answer = super().file_response(*args, **keys)
        answer.headers["cache-control"] = "no-cache"
        return answer

    def lookup_path(self, path: str) -> Any:
        parts = Path(path).parts
        if "node_modules" in parts or any(part.startswith(".") for part in parts):
            return "", None  # a developer's tools
        return super().lookup_path(path)


def create(engine: Engine, hub: Hub, token: str | None = None) -> FastAPI:
    """The application around an engine that somebody starts and stops."""

    @contextlib.asynccontextmanager
    async def lifespan(app: FastAPI) -> AsyncIterator[None]:
        turning = asyncio.create_task(hub.run())
        yield
        turning.cancel()

    app = FastAPI(
        title="Dartboard", version=__version__, lifespan=lifespan, docs_url=None, redoc_url=None,
        description="Rendering experiments that people can believe. Errors are problem documents (RFC 9457).",
        responses=RESPONSES,
    )  # fmt: skip
    app.state.engine, app.state.hub = engine, hub
    app.state.pictures = Pictures(engine.artifacts)
    install(app)
    for module in (server, experiments, cells, scenes, points, events):
        app.include_router(module.router)
    app.mount("/static", Assets(directory=WEB), name="static")
    for path in PAGES:
        app.get(path, include_in_schema=False)(_page)
    app.exception_handler(404)(_unknown)
    app.add_middleware(GZipMiddleware, minimum_size=1024, compresslevel=2, exclude_content_types=NOT_COMPRESSED)
    app.add_middleware(Kept, revision=lambda: engine.moment.revision)
    app.add_middleware(Guard, token=token)
    app.openapi = lambda: _openapi(app)  # type: ignore[method-assign]
    return app


def _page() -> FileResponse:
    return FileResponse(WEB / "index.html", media_type="text/html", headers={"cache-control": "no-cache"})


async def _unknown(request: Request, error: HTTPException) -> Response:
    """A person who mistyped an address gets the dashboard's own words; a program gets a problem document."""
    person = request.method == "GET" and "text/html" in request.headers.get("accept", "")
    if not person or request.url.path.startswith(("/api/", "/static/")):
        return of_http(request, error)
    page = _page()
    page.status_code = 404
    return page


def _openapi(app: FastAPI) -> dict[str, Any]:
    """FastAPI's own, with the models of bodies and streams, and problems for what a request gets wrong."""
    if app.openapi_schema is None:
        told = get_openapi(title=app.title, version=app.version, description=app.description, routes=app.routes)
        known = told.setdefault("components", {}).setdefault("schemas", {})
        for model in ALSO_TOLD:
            schema = model.model_json_schema(ref_template="#/components/schemas/{model}")
            known.update(schema.pop("$defs", {}))
            known[model.__name__] = schema
        for unused in ("HTTPValidationError", "ValidationError"):
            known.pop(unused, None)
        app.openapi_schema = told
    return app.openapi_schema
