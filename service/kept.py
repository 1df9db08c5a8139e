"""
Answers that are given again without asking a route: pages that show the same experiment ask the same in one moment.

An answer is kept if it says how long it is true: with its header ``x-revision`` as long as the engine has not come
further than that revision, or ALWAYS. Who has it already, by its tag, is told just that. Of equal requests that arrive
together one is answered by its route, and the others with it. Bodies are kept as they travel, compressed or not.
Pictures of an experiment that was deleted may be given for a while; no other cell ever has their address.
"""

from __future__ import annotations

import asyncio
import math
from collections import OrderedDict
from collections.abc import Callable
from dataclasses import dataclass

from starlette.types import ASGIApp, Message, Receive, Scope, Send

PATHS = ("/api/cells/", "/api/experiments/")
ENDS = (".png", "/pixels", "/convergence")
LARGEST_BYTES = 2**22  # of one answer: the curves of 10 000 cells
KEPT_BYTES = 2**25
ALWAYS = "*"  # as x-revision: true whatever happens

Key = tuple[str, bytes, bool]


@dataclass(frozen=True)
class Answer:
    """Its first message, its body, and the last revision for which it is true."""

    start: Message
    body: bytes
    revision: float


class Kept:
    """
    ASGI middleware, within what decides who may ask and outside of what compresses.

    revision  what the engine has come to; a page never gets an answer that is older than that
    """

    def __init__(self, app: ASGIApp, revision: Callable[[], int]):
        self.app, self.revision = app, revision
        self.held: OrderedDict[Key, Answer] = OrderedDict()
        self.bytes = 0
        self.making: dict[Key, asyncio.Future[Answer | None]] = {}

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if not _may_be_kept(scope):
            await self.app(scope, receive, send)
            return
        key, revision = _key(scope), self.revision()
        answer = self._find(key, revision)
        if answer is None and key in self.making:
            answer = await asyncio.shield(self.making[key])
            if answer is not None and answer.revision < revision:
                answer = None
        if answer is not None:
            await _give(answer, scope, send)
        elif key in self.making:  # a second one at the same time: what it makes is its own
            await self.app(scope, receive, send)
        else:
            await self._make(key, scope, receive, send)

    def _find(self, key: Key, revision: int) -> Answer | None:
        answer = self.held.get(key)
        if answer is None:
            return None
        if answer.revision < revision:
            self._drop(key)
            return None
        self.held.move_to_end(key)
        return answer

    async def _make(self, key: Key, scope: Scope, receive: Receive, send: Send) -> None:
        """Have the route answer, listening."""
        start: Message | None = None
        parts: list[bytes] = []
        whole: Answer | None = None

        async def listen(message: Message) -> None:
            nonlocal start, whole
            if message["type"] == "http.response.start":
                start = message if _holds_until(message) is not None else None
            elif start is not None:
                parts.append(message.get("body", b""))
                if not message.get("more_body", False):
                    holds = _holds_until(start)
                    assert holds is not None
                    whole = Answer(start, b"".join(parts), holds)
            await send(message)

        made = self.making[key] = asyncio.get_running_loop().create_future()
        try:
            await self.app(scope, receive, listen)
        finally:
            del self.making[key]
            made.set_result(whole)
        if whole is not None and len(whole.body) <= LARGEST_BYTES:
            self._keep(key, whole)

    def _keep(self, key: Key, answer: Answer) -> None:
        self._drop(key)
        self.held[key] = answer
        self.bytes += len(answer.body)
        while self.bytes > KEPT_BYTES:
            self._drop(next(iter(self.held)))

    def _drop(self, key: Key) -> None:
        answer = self.held.pop(key, None)
        if answer is not None:
            self.bytes -= len(answer.body)


def _may_be_kept(scope: Scope) -> bool:
    if scope["type"] != "http" or scope["method"] != "GET":
        return False
    path: str = scope["path"]
    return path.startswith(PATHS) and path.endswith(ENDS)


def _key(scope: Scope) -> Key:
    compressed = any(name == b"accept-encoding" and b"gzip" in value for name, value in scope["headers"])
    return scope["path"], scope["query_string"], compressed


def _holds_until(start: Message) -> float | None:
    """The last revision for which an answer is true; None for one that may change at any time, or is an error."""
    if start["status"] != 200:
        return None
    headers = dict(start["headers"])
    revision = headers.get(b"x-revision")
    if revision is None:
        return None
    return math.inf if revision == ALWAYS.encode() else int(revision)


async def _give(answer: Answer, scope: Scope, send: Send) -> None:
    headers = answer.start["headers"]
    tag = dict(headers).get(b"etag")
    if tag is not None and any(name == b"if-none-match" and tag in value for name, value in scope["headers"]):
        rest = [(name, value) for name, value in headers if name not in (b"content-length", b"content-type")]
        await send({"type": "http.response.start", "status": 304, "headers": rest})
        await send({"type": "http.response.body", "body": b""})
    else:
        await send(answer.start)
        await send({"type": "http.response.body", "body": answer.body})
