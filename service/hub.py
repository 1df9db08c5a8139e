"""
The hub: news of the engine to every open page, worked out once.

A page follows one stream and remembers the revision it has seen. When the engine has changed, the hub waits a moment
for more, then every stream asks for what is new since its own revision. Pages that have seen the same get the same
bytes, so fifty pages cost fifty writes and one query. Slow pages simply see larger steps.
"""

from __future__ import annotations

import asyncio
import contextlib
import logging
import time
from collections.abc import AsyncIterator, Awaitable, Callable
from typing import Any, TypeVar

from renderer.errors import DartboardError
from service.engine import Engine, Moment

T = TypeVar("T")

STEP_SECONDS = 0.25  # between two messages on one stream: fast enough for an eye, slow enough for fifty pages
STEP_COSTS = 20.0  # a step lasts at least so many times what its messages took to make: 5 % of one core …
LONGEST_STEP_SECONDS = 2.0  # … but a page never waits longer
KEEP_ALIVE_SECONDS = 15.0
RETRY_MILLISECONDS = 1000  # before a browser connects again

log = logging.getLogger("dartboard")


class Hub:
    """Lives in the event loop; the engine's ``on_change`` is ``poke``."""

    def __init__(self) -> None:
        self.loop: asyncio.AbstractEventLoop | None = None
        self.poked = asyncio.Event()
        self.turned = asyncio.Event()  # replaced at every step
        self.closing = False
        self.cost = 0.0  # seconds that the messages of this step took
        self.shared: dict[tuple[Any, ...], asyncio.Task[Any]] = {}

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

    async def share(self, key: tuple[Any, ...], work: Callable[[], Awaitable[T]]) -> T:
        """The result of ``work`` for everybody who asks under this key soon, and before the next step."""
        task: asyncio.Task[T] | None = self.shared.get(key)
        if task is None:
            task = self.shared[key] = asyncio.ensure_future(self._timed(work))
            task.add_done_callback(lambda done: self._forget_later(key, done))
        return await asyncio.shield(task)

    async def _timed(self, work: Callable[[], Awaitable[T]]) -> T:
        start = time.perf_counter()
        try:
            return await work()
        finally:
            self.cost += time.perf_counter() - start

    def _forget_later(self, key: tuple[Any, ...], task: asyncio.Task[Any]) -> None:
        """Where nothing happens there is no next step: what streams of long ago were told is not kept for it."""

        def forget() -> None:
            if self.shared.get(key) is task:
                del self.shared[key]

        asyncio.get_running_loop().call_later(STEP_SECONDS, forget)

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
            except DartboardError as error:
                log.warning("a page has to wait for its news: %s", error)
                message = None
            if message is not None:
                yield message
        turned = await hub.step(seen)


def event(kind: str, data: str, revision: int | None = None) -> bytes:
    """One event in the format of EventSource; with a revision, a client that reconnects goes on from there."""
    identity = "" if revision is None else f"id: {revision}\n"
    return f"event: {kind}\n{identity}data: {data}\n\n".encode()
