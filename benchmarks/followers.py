"""
Fifty open pages without fifty browsers: what the dashboard's experiment page asks of a server while a grid renders.

    python -m benchmarks.followers URL EXPERIMENT COUNT

Each page has a stream and two connections that are kept, as browsers do. It reads the experiment, its cells and its
curves, then follows: the preview of every cell whose picture is new is fetched once, the curves again after changes
but not more often than every two seconds. Prints "open" when every page has its stream, and what they fetched, as
JSON, when the experiment has ended.
"""

from __future__ import annotations

import asyncio
import gzip
import json
import sys
import time
import urllib.parse
from collections import Counter
from collections.abc import AsyncIterator
from typing import Any

CURVES_SECONDS = 2.0  # EVERY_MS of web/views/experiment/curves.js
FIRST_PAGE, PAGE = 200, 2000  # cells, as in web/model.js
STAGGER_SECONDS = 0.02  # between two pages that open
STREAM_BYTES = 2**24  # of one line, at most


class Connection:
    """HTTP/1.1 with keep-alive, just enough of it."""

    def __init__(self, url: str):
        self.address = urllib.parse.urlsplit(url)
        self.streams: tuple[asyncio.StreamReader, asyncio.StreamWriter] | None = None

    async def ask(self, path: str) -> tuple[int, dict[str, str], asyncio.StreamReader]:
        """Status, headers, and where the body comes from. A connection that the server has closed is opened again."""
        try:
            return await self._ask(path)
        except (asyncio.IncompleteReadError, ConnectionError):
            self.streams = None
            return await self._ask(path)

    async def _ask(self, path: str) -> tuple[int, dict[str, str], asyncio.StreamReader]:
        if self.streams is None:
            self.streams = await asyncio.open_connection(self.address.hostname, self.address.port, limit=STREAM_BYTES)
        reader, writer = self.streams
        writer.write(f"GET {path} HTTP/1.1\r\nHost: {self.address.netloc}\r\nAccept-Encoding: gzip\r\n\r\n".encode())
        head, *lines = (await reader.readuntil(b"\r\n\r\n")).decode("latin-1").split("\r\n")
        pairs = (line.partition(": ") for line in lines if line)
        return int(head.split()[1]), {name.lower(): value for name, _, value in pairs}, reader

    async def fetch(self, path: str, tally: Counter[str]) -> bytes:
        """The body as it travels; the tally counts its bytes, and refusals."""
        status, headers, reader = await self.ask(path)
        if "content-length" in headers:
            body = await reader.readexactly(int(headers["content-length"]))
        else:
            body = b"".join([block async for block in chunks(reader)])
        tally["bytes"] += len(body)
        tally["refused"] += status >= 400
        return body

    async def json(self, path: str, tally: Counter[str]) -> Any:
        body = await self.fetch(path, tally)
        return json.loads(gzip.decompress(body) if body.startswith(b"\x1f\x8b") else body)


async def chunks(reader: asyncio.StreamReader) -> AsyncIterator[bytes]:
    """The blocks of a chunked body."""
    while length := int(await reader.readline(), 16):
        yield (await reader.readexactly(length + 2))[:-2]
    await reader.readline()


class Follower:
    """One page."""

    def __init__(self, url: str, experiment: int, tally: Counter[str]):
        self.path, self.tally = f"/api/experiments/{experiment}", tally
        self.stream, self.kept, self.second = Connection(url), Connection(url), Connection(url)
        self.open = asyncio.Event()
        self.changed = asyncio.Event()
        self.wanted: asyncio.Queue[tuple[str, float]] = asyncio.Queue()  # previews to fetch, one after the other
        self.known: set[str] = set()  # what the browser's cache holds

    async def run(self) -> None:
        """Open the page, and keep it open until the experiment has ended."""
        detail = await self.kept.json(self.path, self.tally)
        revision = await self._load()
        async with asyncio.TaskGroup() as tasks:
            pictures = tasks.create_task(self._pictures())
            curves = tasks.create_task(self._curves(detail["scenes"][0]["name"]))
            await self._follow(revision)
            pictures.cancel()
            curves.cancel()

    async def _load(self) -> int:
        """All cells; the revision of the first page."""
        page = await self.kept.json(f"{self.path}/cells?start=0&limit={FIRST_PAGE}", self.tally)
        revision = int(page["revision"])
        self._put(page["cells"])
        while (start := page["next"]) is not None:
            page = await self.kept.json(f"{self.path}/cells?start={start}&limit={PAGE}", self.tally)
            self._put(page["cells"])
        return revision

    async def _follow(self, revision: int) -> None:
        _, _, reader = await self.stream.ask(f"{self.path}/events?after={revision}")
        self.open.set()
        rest = b""
        async for block in chunks(reader):
            *events, rest = (rest + block).split(b"\n\n")
            for event in events:
                fields = dict(line.partition(b": ")[::2] for line in event.split(b"\n"))
                if fields.get(b"event") == b"update":
                    update = json.loads(fields[b"data"])
                    self.tally["updates"] += 1
                    self._put(update["cells"])
                    if update["reload"]:
                        await self._load()
                    if update["experiment"]["state"] not in ("queued", "running"):
                        return
                elif fields.get(b"event") == b"progress":
                    progress = json.loads(fields[b"data"])
                    if progress["preview"] and progress["replicate"] == 0:
                        self._want(progress["cell"], progress["role"], f"p{progress['preview']}")

    def _put(self, cells: list[dict[str, Any]]) -> None:
        for cell in cells:
            if cell["had"]:
                token = f"n{cell['had']}" if cell["role"] == "reference" else "done"
                self._want(cell["cell"], cell["role"], token)
        if cells:
            self.changed.set()

    def _want(self, cell: int, role: str, token: str) -> None:
        which = "&k=0" if role == "cell" else ""
        address = f"/api/cells/{cell}/preview.png?role={role}{which}&size=128&ev=0&tone=srgb&v={token}"
        if address not in self.known:
            self.known.add(address)
            self.wanted.put_nowait((address, time.monotonic()))

    async def _pictures(self) -> None:
        while True:
            address, since = await self.wanted.get()
            await self.kept.fetch(address, self.tally)
            self.tally["pictures"] += 1
            self.tally["longest wait ms"] = max(self.tally["longest wait ms"], round(1000 * (time.monotonic() - since)))

    async def _curves(self, scene: str) -> None:
        while True:
            await self.changed.wait()
            self.changed.clear()
            await self.second.fetch(f"{self.path}/convergence?metric=relmse&scene={scene}", self.tally)
            self.tally["curves"] += 1
            await asyncio.sleep(CURVES_SECONDS)


async def follow(url: str, experiment: int, count: int) -> Counter[str]:
    """Open the pages and keep them until the experiment has ended; what they fetched."""
    tally: Counter[str] = Counter()
    followers = [Follower(url, experiment, tally) for _ in range(count)]
    pages = []
    for follower in followers:
        pages.append(asyncio.create_task(follower.run()))
        await asyncio.sleep(STAGGER_SECONDS)
    for follower in followers:
        await follower.open.wait()
    print("open", flush=True)
    await asyncio.gather(*pages)
    return tally


if __name__ == "__main__":
    print(json.dumps(asyncio.run(follow(sys.argv[1], int(sys.argv[2]), int(sys.argv[3])))))
