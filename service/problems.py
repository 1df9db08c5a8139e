"""
Problem documents: every error of the service in one shape (RFC 9457), with the sentence that the command line prints.

A ``DartboardError`` is a sentence already; its class decides the status. Anything else is a bug of ours: logged with
its traceback, told without.
"""

from __future__ import annotations

import asyncio
import logging
import re
from collections.abc import Sequence
from http import HTTPStatus
from typing import Any

from fastapi import FastAPI, Request
from fastapi.exceptions import RequestValidationError
from fastapi.responses import JSONResponse, Response
from pydantic import ValidationError
from starlette.datastructures import Headers
from starlette.exceptions import HTTPException
from starlette.requests import ClientDisconnect
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from jobs.errors import Conflict, DataDirectoryProblem, GridError, NotFound, WasDeleted
from renderer.errors import BadParameter, DartboardError, EnvironmentProblem, SceneError, UnknownName
from service.schemas import Fault, Problem

PLURALS = {"sampler": "samplers", "integrator": "integrators", "scene": "scenes"}  # an axis → its key in a grid
MEDIA_TYPE = "application/problem+json"
# The first class that fits counts.
KINDS: Sequence[tuple[type[DartboardError], str, str, int]] = (
    (WasDeleted, "experiment-deleted", "the experiment was deleted", 404),
    (NotFound, "not-found", "there is no such thing", 404),
    (Conflict, "conflict", "that does not fit the state of things", 409),
    (GridError, "bad-grid", "the grid cannot be run", 422),
    (SceneError, "bad-scene", "the scene cannot be used", 422),
    (UnknownName, "unknown-name", "the catalog knows no such name", 422),
    (BadParameter, "bad-value", "a value is not allowed", 422),
    (DataDirectoryProblem, "data-directory", "the data directory cannot be used", 507),
    (EnvironmentProblem, "environment", "the machine lacks something", 503),
    (DartboardError, "bad-request", "the request cannot be used", 422),
)
RESPONSES: dict[int | str, dict[str, Any]] = {
    status: {"description": text, "content": {MEDIA_TYPE: {"schema": {"$ref": "#/components/schemas/Problem"}}}}
    for status, text in (
        (401, "the token is missing"),
        (403, "a page of another site"),
        (404, "unknown"),
        (409, "it does not fit the state of things"),
        (413, "too large"),
        (421, "another host"),
        (422, "bad value"),
        (503, "the machine lacks something"),
        (507, "the data directory cannot be used"),
    )
}

log = logging.getLogger("dartboard")


class TooLarge(DartboardError):
    """A body over a stated limit."""


def problem(
    request: Request, name: str, title: str, status: int, detail: str, faults: Sequence[Fault] = ()
) -> JSONResponse:
    """One problem document."""
    body = Problem(
        type=f"urn:dartboard:{name}", title=title, status=status, detail=detail, instance=request.url.path,
        problems=list(faults),
    )  # fmt: skip
    return JSONResponse(body.model_dump(), status, media_type=MEDIA_TYPE)


def of_error(request: Request, error: DartboardError) -> JSONResponse:
    """The document of one of our own errors."""
    if isinstance(error, TooLarge):
        return problem(request, "too-large", "the request is too large", 413, str(error))
    name, title, status = next((name, title, status) for kind, name, title, status in KINDS if isinstance(error, kind))
    faults = [Fault(detail=text, field=field_of(text)) for text in getattr(error, "problems", ())]
    return problem(request, name, title, status, str(error), faults)


def of_http(request: Request, error: HTTPException) -> JSONResponse:
    """The document of what the framework refuses: an unknown path, a method that a route does not have."""
    title = HTTPStatus(error.status_code).phrase.lower()
    name = title.replace(" ", "-")
    answer = problem(request, name, title, error.status_code, f"{request.method} {request.url.path}: {title}")
    answer.headers.update(error.headers or {})
    return answer


def field_of(sentence: str) -> str | None:
    """The key of a grid that a sentence of ``jobs/grid.py`` is about, from the place that it names."""
    named = re.search(r"\[(scene|reference|sweep)\b", sentence)
    keyed = re.search(
        r"\b(name|scenes|samplers|integrators|spp|replicates|resolution|crop|max_depth|rfilter|colour|reference"
        r"|sweep)(\[\d+\])?( of |: | is | asks )",
        sentence,
    )
    found = named or keyed or re.search(r"in (samplers|integrators|rfilter)\b", sentence)
    if found:
        return found[1]
    unknown = re.match(r"unknown (sampler|integrator|scene|colour|rfilter)\b", sentence)
    return PLURALS.get(unknown[1], unknown[1]) if unknown else None


def install(app: FastAPI) -> None:
    """Have every error of an application come out as a problem document."""

    @app.exception_handler(DartboardError)
    async def ours(request: Request, error: DartboardError) -> JSONResponse:
        return of_error(request, error)

    @app.exception_handler(RequestValidationError)
    async def invalid(request: Request, error: RequestValidationError) -> JSONResponse:
        return problem(request, "bad-request", "the request cannot be used", 422, sentences(error.errors()))

    @app.exception_handler(HTTPException)
    async def http(request: Request, error: HTTPException) -> JSONResponse:
        return of_http(request, error)

    @app.exception_handler(ClientDisconnect)
    async def gone(request: Request, error: ClientDisconnect) -> Response:
        return Response(status_code=400)  # nobody hears it

    app.add_middleware(Net)


class Net:
    """
    ASGI middleware: what no handler has seen becomes a problem document as well. That is a bug of ours, what the
    framework refuses in plain text (a range outside of a file), and a request that the end of the server cuts off.
    """

    def __init__(self, app: ASGIApp):
        self.app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] != "http":
            await self.app(scope, receive, send)
            return
        request, status, replaced = Request(scope), 0, False

        async def watch(message: Message) -> None:
            nonlocal status, replaced
            if message["type"] == "http.response.start":
                status = message["status"]
                headers = Headers(raw=message["headers"])
                replaced = status >= 400 and headers.get("content-type", "").startswith("text/plain")
                if replaced:
                    told = {name: value for name, value in headers.items() if name == "content-range"}
                    await of_http(request, HTTPException(status, headers=told))(scope, receive, send)
            if not replaced:
                await send(message)

        try:
            await self.app(scope, receive, watch)
        except asyncio.CancelledError:  # the server is ending and has waited long enough
            if not status:
                await problem(request, "ending", "the server is ending", 503, "ask again when it is back")(
                    scope, receive, send
                )
        except Exception as error:
            if status:
                raise  # half of an answer is out: to hang up is all that is left to say
            log.error("%s %s failed", request.method, request.url.path, exc_info=error)
            detail = f"Dartboard has a bug: {type(error).__name__} (the server's log has more); nothing was lost"
            await problem(request, "bug", "internal error", 500, detail)(scope, receive, send)


def sentences(errors: Sequence[Any]) -> str:
    """What pydantic found, in words."""
    found = []
    for error in errors:
        place = ".".join(str(part) for part in error["loc"] if part not in ("body", "query", "path"))
        message = error["msg"][:1].lower() + error["msg"][1:]
        found.append(f"{place}: {message}" if place else message)
    return "; ".join(found)


def of_model(error: ValidationError) -> DartboardError:
    """A body that does not fit its model."""
    return DartboardError(f"the body is no submission: {sentences(error.errors(include_url=False))}")
