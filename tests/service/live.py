"""A house behind a real socket, and a browser's view of its streams."""

from __future__ import annotations

import asyncio
import contextlib
import json
import socket
import threading
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from http.client import HTTPConnection, HTTPResponse
from typing import Any

import uvicorn

from service import schemas
from service.eventstream import Event, events_in
from service.serve import Server
from tests.service.conftest import PATIENCE, House

MODELS = {"update": schemas.Update, "progress": schemas.Progress}


class InThread(Server):
    """A thread hears no signals."""

    @contextlib.contextmanager
    def capture_signals(self) -> Iterator[None]:
        yield


class Live:
    """uvicorn as ``dartboard serve`` runs it, in a thread."""

    def __init__(self, house: House):
        self.house = house
        self.socket = socket.create_server(("127.0.0.1", 0))
        self.port = self.socket.getsockname()[1]
        config = uvicorn.Config(
            house.app, log_level="warning", access_log=False, server_header=False, timeout_graceful_shutdown=2,
            loop="uvloop", http="httptools",
        )  # fmt: skip
        self.server = InThread(house.hub, config)
        self.thread = threading.Thread(target=self.server.run, kwargs={"sockets": [self.socket]})

    def start(self) -> None:
        self.thread.start()
        eventually(lambda: self.server.started)

    def stop(self) -> None:
        self.server.should_exit = True
        self.thread.join()

    def follow(self, path: str, **headers: str) -> Stream:
        connection = HTTPConnection("127.0.0.1", self.port, timeout=PATIENCE)
        connection.request("GET", path, headers={name.replace("_", "-"): value for name, value in headers.items()})
        return Stream(connection, connection.getresponse())

    def tasks(self) -> int:
        """How many tasks the server's event loop has."""
        loop = self.house.hub.loop
        assert loop is not None

        async def count() -> int:
            return len(asyncio.all_tasks())

        return asyncio.run_coroutine_threadsafe(count(), loop).result(PATIENCE) - 1


@dataclass
class Stream:
    """What an EventSource shows of a stream; everything that comes fits its model."""

    connection: HTTPConnection
    response: HTTPResponse
    events: Iterator[Event] = field(init=False)
    seen: list[Event] = field(default_factory=list)

    def __post_init__(self) -> None:
        assert self.response.status == 200, self.response.read()
        assert self.response.getheader("content-type") == "text/event-stream; charset=utf-8"
        self.events = events_in(iter(self._block, b""))

    def _block(self) -> bytes:
        return self.response.read1(65536)

    def next(self, *names: str) -> Event:
        """The next event, of one of these names."""
        for event in self.events:
            self.seen.append(event)
            if event.name in MODELS and "experiments" not in json.loads(event.data):
                MODELS[event.name].model_validate_json(event.data)
            if not names or event.name in names:
                return event
        raise AssertionError(f"the stream ended after {[event.name for event in self.seen]}")

    def update(self) -> schemas.Update:
        event = self.next("update")
        found = schemas.Update.model_validate_json(event.data)
        assert event.id == str(found.revision)
        return found

    def until(self, condition: Callable[[schemas.Update], Any]) -> list[schemas.Update]:
        """All updates up to the first that fits."""
        found = [self.update()]
        while not condition(found[-1]):
            found.append(self.update())
        return found

    def rest(self) -> list[Event]:
        """Everything up to the end that the server makes."""
        self.seen += self.events
        return self.seen

    def close(self) -> None:
        """As a browser does when its tab is closed."""
        self.response.close()
        self.connection.close()

    def tear(self) -> None:
        """As a machine does that is switched off and on again: the connection is reset."""
        self.connection.sock.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, b"\1\0\0\0\0\0\0\0")
        self.close()


@dataclass
class Page:
    """An experiment as a page has it: all cells, then whatever the stream says."""

    house: House
    number: int
    rows: dict[int, schemas.Cell] = field(default_factory=dict)
    revision: int = 0

    def load(self) -> Page:
        start: int | None = 0
        first = None
        while start is not None:
            response = self.house.client.get(
                f"/api/experiments/{self.number}/cells", params={"start": start, "limit": 3}
            )
            page = schemas.Cells.model_validate_json(response.content)
            first = page.revision if first is None else first
            self.rows |= {cell.position: cell for cell in page.cells}
            start = page.next
        assert first is not None
        self.revision = first
        return self

    def apply(self, update: schemas.Update) -> None:
        self.rows |= {cell.position: cell for cell in update.cells}
        self.revision = update.revision
        if update.reload:
            self.load()

    def is_true(self) -> bool:
        """Whether it shows what a page shows that is opened now."""
        return self.rows == Page(self.house, self.number).load().rows


def eventually(condition: Callable[[], Any]) -> None:
    """For what nobody tells: asked again and again until it is so."""
    for _ in range(100 * PATIENCE):
        if condition():
            return
        threading.Event().wait(0.01)
    raise AssertionError("it did not come to that")
