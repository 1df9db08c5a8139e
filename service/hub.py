"""
The hub: news of the engine to every open page, worked out once.

A page follows one stream and remembers the revision it has seen. When the engine has changed, the hub waits a moment
for more, then every stream asks for what is new since its own revision. Pages that have seen the same get the same
bytes, so fifty pages cost fifty writes and one query. Slow pages simply see larger steps.
"""

from __future__ import annotations

import asyncio
import contextlib
import time
from collections.abc import AsyncIterator, Awaitable, Callable
from typing import Any

from service.engine import Engine, Moment

STEP_SECONDS = 0.25  # between two messages on one stream: fast enough for an eye, slow enough for fifty pages
STEP_COSTS = 20.0  # a step lasts at least so many times what its messages took to make: 5 % of one core …
LONGEST_STEP_SECONDS = 2.0  # … but a page never waits longer
KEEP_ALIVE_SECONDS = 15.0
RETRY_MILLISECONDS = 1000  # before a browser connects again


class Hub:
    """Lives in the event loop; the engine's ``on_change`` is ``poke``."""

    def __init__(self) -> None:
        self.loop: asyncio.AbstractEventLoop | None = None
        self.poked = asyncio.Event()
        self.turned = asyncio.Event()  # replaced at every step
        self.closing = False
        self.cost = 0.0  # seconds that the messages of this step took
        self.shared: dict[tuple[Any, ...], asyncio.Task[bytes | None]] = {}

    def poke(self) -> None:
        """Something changed. From any thread."""
        loop = self.loop
        if loop is not None:
            with contextlib.suppress(RuntimeError):  # the loop has just closed
                loop.call_soon_threadsafe(self.poked.set)

    async def run(self) -> None:
        """Turn steps until cancelled."""
        self.loop = asyncio.get_running_loop()
        while True:
            await self.poked.wait()
            self.poked.clear()
            self.shared.clear()
            self.cost = 0.0
            self._turn()
            await asyncio.sleep(STEP_SECONDS)
            await asyncio.sleep(min(STEP_COSTS * self.cost, LONGEST_STEP_SECONDS) - STEP_SECONDS)

    def close(self) -> None:
        """End every stream now, so that the server can end. From the event loop."""
        self.closing = True
        self._turn()

    async def step(self, seen: asyncio.Event) -> bool:
        """Wait for the step after the one that had ``seen``; False after KEEP_ALIVE_SECONDS without one."""
        try:
            await asyncio.wait_for(seen.wait(), KEEP_ALIVE_SECONDS)
        except TimeoutError:
            return False
        return True

    async def share(self, key: tuple[Any, ...], work: Callable[[], Awaitable[bytes | None]]) -> bytes | None:
        """The result of ``work`` for everybody who asks under this key before the next step."""
        if key not in self.shared:
            self.shared[key] = asyncio.ensure_future(self._timed(work))
        return await asyncio.shield(self.shared[key])

    async def _timed(self, work: Callable[[], Awaitable[bytes | None]]) -> bytes | None:
        start = time.perf_counter()
        try:
            return await work()
        finally:
            self.cost += time.perf_counter() - start

    def _turn(self) -> None:
        self.turned.set()
        self.turned = asyncio.Event()


class EndOfStream(Exception):
    """There will be no more news: a last message, and the end."""

    def __init__(self, message: bytes):
        self.message = message


async def stream(hub: Hub, engine: Engine, news: Callable[[Moment], Awaitable[bytes | None]]) -> AsyncIterator[bytes]:
    """
    An SSE stream: what ``news`` gives for every moment of the engine, and a comment now and then to keep it alive.

    ``news`` returns None when there is nothing to tell, and raises ``EndOfStream`` when there never will be.
    """
    yield b"retry: %d\n\n" % RETRY_MILLISECONDS
    turned = True
    while not hub.closing:
        seen = hub.turned
        if not turned:
            yield b": still here\n\n"
        else:
            try:
                message = await news(engine.moment)
            except EndOfStream as end:
                yield end.message
                return
            if message is not None:
                yield message
        turned = await hub.step(seen)


def event(kind: str, data: str, revision: int | None = None) -> bytes:
    """One event in the format of EventSource; with a revision, a client that reconnects goes on from there."""
    identity = "" if revision is None else f"id: {revision}\n"
    return f"event: {kind}\n{identity}data: {data}\n\n".encode()
