"""
A client of a Dartboard server: the REST API as the command line needs it, typed.

Whatever goes wrong becomes one sentence with an exit code: what the server refuses keeps the server's own words, a
server that is not there, or is no Dartboard, is named with the way out. A request may be sent again when its
connection breaks, because none of them does anything twice; ``follow`` outlives a server that is restarted.

This module loads ``httpx``; commands that talk to no server do not import it.
"""

from __future__ import annotations

import contextlib
import os
import re
import time
import uuid
from collections.abc import Callable, Generator, Iterator
from dataclasses import dataclass
from typing import IO, Any, TypeVar

import httpx
from pydantic import BaseModel, TypeAdapter, ValidationError

from renderer import __version__
from renderer.errors import DartboardError, EnvironmentProblem, shown
from service.control import Action
from service.eventstream import events_in
from service.schemas import (
    Cell,
    Cells,
    Experiment,
    ExperimentDetail,
    Health,
    PointFile,
    Problem,
    Progress,
    Scene,
    Update,
    Worker,
)

CONNECT_SECONDS = 5.0
ANSWER_SECONDS = 60.0  # without a byte; a report of a large experiment takes some seconds
SILENT_SECONDS = 45.0  # of a stream: a living server says something every 15 s
WAITS = (0.5, 1.0, 2.0, 4.0, 8.0)  # seconds between tries, the last one again and again
PATIENCE_SECONDS = 180.0  # without a server, before whoever follows gives up: a restart with a large database
PAGE = 2000  # cells
NOT_NOW = (401, 403, 408, 421, 429)  # not the fault of what was asked: exit code 3

Model = TypeVar("Model", bound=BaseModel)
Value = TypeVar("Value")


class Refused(DartboardError):
    """The server understood and said no, in its own words. ``status`` is HTTP's."""

    def __init__(self, status: int, text: str):
        self.status = status
        super().__init__(text)


class ServerProblem(EnvironmentProblem):
    """The server cannot, or is not what it should be."""


class Unreachable(ServerProblem):
    """Nobody answered, or the connection broke."""


@dataclass(frozen=True)
class Away:
    """``follow`` has lost the server and tries again."""


@dataclass(frozen=True)
class Back:
    """``follow`` has the server again."""


class Client:
    """
    A connection to the server at ``url`` (``http://`` may be left out). Use it in a ``with`` block.

    Off loopback a server asks for a token: the variable DARTBOARD_TOKEN.
    """

    def __init__(self, url: str, *, patience_seconds: float = PATIENCE_SECONDS):
        self.url = address(url)
        self.patience_seconds = patience_seconds
        loopback = httpx.URL(self.url).host in ("127.0.0.1", "localhost", "::1")
        headers = {"User-Agent": f"dartboard/{__version__}"}
        if token := os.environ.get("DARTBOARD_TOKEN"):
            headers["Authorization"] = f"Bearer {token}"
        self.http = httpx.Client(
            base_url=self.url,
            timeout=httpx.Timeout(ANSWER_SECONDS, connect=CONNECT_SECONDS),
            headers=headers,
            trust_env=not loopback,  # a proxy of the user's must not be asked for this machine
            verify=self.url.startswith("https:"),  # reading the certificates takes 30 ms
        )

    def __enter__(self) -> Client:
        return self

    def __exit__(self, *_: object) -> None:
        self.http.close()

    # -- reading --

    def health(self) -> Health:
        return self._get(Health, "/api/health")

    def worker(self) -> Worker:
        return self._get(Worker, "/api/worker")

    def experiments(self, name: str | None = None) -> list[Experiment]:
        """All of them, or those of a name; the newest first."""
        return self._list(Experiment, "/api/experiments", **({} if name is None else {"name": name}))

    def experiment(self, experiment: int) -> ExperimentDetail:
        return self._get(ExperimentDetail, f"/api/experiments/{experiment}")

    def find(self, id_or_name: str) -> Experiment:
        """The experiment of that id, else the newest of that name. Raises ``Refused`` with those that are there."""
        if re.fullmatch(r"[0-9]{1,18}", id_or_name):
            return self.experiment(int(id_or_name))
        name = id_or_name.encode(errors="replace").decode()  # a command line may hold what is no text
        if found := self.experiments(name):
            return found[0]
        there = [f"{item.id} ({item.name})" for item in reversed(self.experiments()[:10])]
        listed = ", ".join(there) or "none yet"
        raise Refused(404, f"no experiment {shown(name)} at {self.url}; there are: {listed}")

    def cells(self, experiment: int) -> Iterator[Cell]:
        """All cells, in the order of the plan."""
        start: int | None = 0
        while start is not None:
            page = self._get(Cells, f"/api/experiments/{experiment}/cells", start=start, limit=PAGE)
            yield from page.cells
            start = page.next

    def download(self, path: str, file: IO[bytes]) -> None:
        """The bytes of ``path`` into ``file``."""
        with self._told(), self.http.stream("GET", path) as answer:
            self._check(answer)
            for block in answer.iter_bytes():
                file.write(block)

    # -- changing --

    def act(self, experiment: int, action: Action) -> Experiment:
        return self._parse(Experiment, self._request("POST", f"/api/experiments/{experiment}/{action}").content)

    def upload(self, name: str, main: str, archive: IO[bytes], size: int) -> Scene:
        """Send a scene's folder as a zip of ``size`` bytes."""
        kind = {"Content-Type": "application/zip", "Content-Length": str(size)}
        return self._parse(Scene, self._send("/api/scenes", {"name": name, "main": main}, archive, kind).content)

    def upload_points(self, name: str, file: IO[bytes]) -> PointFile:
        """Send a point file, from where it stands open."""
        kind = {"Content-Type": "application/octet-stream", "Content-Length": str(file.seek(0, os.SEEK_END))}
        return self._parse(PointFile, self._send("/api/points", {"name": name}, file, kind).content)

    def submit(
        self, toml: str, origin: str, scenes: dict[str, str], points: dict[str, str] | None = None
    ) -> tuple[Experiment, bool]:
        """A grid → (its experiment, whether it is new)."""
        body = {"toml": toml, "origin": origin, "scenes": scenes} | ({"points": points} if points else {})
        headers = {"Idempotency-Key": uuid.uuid4().hex}
        answer = self._patiently(lambda: self._request("POST", "/api/experiments", json=body, headers=headers))
        return self._parse(Experiment, answer.content), answer.status_code == httpx.codes.CREATED

    # -- following --

    def follow(self, experiment: int, after: int) -> Generator[Update | Progress | Away | Back]:
        """
        What happens to an experiment after a revision, for ever: take what is needed and close the generator.

        Raises ``Refused`` when the experiment is deleted, ``ServerProblem`` when no server was there for
        ``patience_seconds``.
        """
        last: str | None = None
        away_since: float | None = None
        tries = 0
        while True:
            problem = ServerProblem(f"the server at {self.url} has closed the stream")
            try:
                for event, identity in self._stream(experiment, after, last):
                    last = identity or last
                    if away_since is not None:
                        away_since = None
                        yield Back()
                    if event is not None:
                        tries = 0
                        yield event
            except ServerProblem as error:
                problem = error
            if away_since is None:
                away_since = time.monotonic()
                yield Away()
            elif time.monotonic() - away_since > self.patience_seconds:
                raise problem
            time.sleep(WAITS[min(tries, len(WAITS) - 1)])
            tries += 1

    def _stream(
        self, experiment: int, after: int, last: str | None
    ) -> Iterator[tuple[Update | Progress | None, str | None]]:
        """One connection: each event with its id, and None first of all, when it is connected."""
        headers = {"Accept": "text/event-stream"} | ({"Last-Event-ID": last} if last else {})
        timeout = httpx.Timeout(SILENT_SECONDS, connect=CONNECT_SECONDS)
        path = f"/api/experiments/{experiment}/events"
        with (
            self._told(),
            self.http.stream("GET", path, params={"after": after}, headers=headers, timeout=timeout) as answer,
        ):
            self._check(answer)
            yield None, None
            for event in events_in(answer.iter_bytes()):
                if event.name == "update":
                    yield self._parse(Update, event.data), event.id
                elif event.name == "progress":
                    yield self._parse(Progress, event.data), event.id
                elif event.name == "gone":
                    raise Refused(404, f"experiment {experiment} was deleted from the server at {self.url}")

    # -- how --

    def _get(self, model: type[Model], path: str, **query: Any) -> Model:
        return self._parse(model, self._request("GET", path, params=query).content)

    def _list(self, model: type[Model], path: str, **query: Any) -> list[Model]:
        return self._parsed(TypeAdapter(list[model]), self._request("GET", path, params=query).content)  # type: ignore[valid-type]

    def _request(self, method: str, path: str, **options: Any) -> httpx.Response:
        with self._told():
            try:
                answer = self.http.request(method, path, **options)
            except httpx.RemoteProtocolError:
                if method != "GET":
                    raise
                # A connection that was kept, and that the server closed in the moment in which we used it again.
                answer = self.http.request(method, path, **options)
            self._check(answer)
            return answer

    def _send(self, path: str, query: dict[str, str], content: IO[bytes], headers: dict[str, str]) -> httpx.Response:
        """Post a file, from its beginning."""

        def send() -> httpx.Response:
            content.seek(0)
            return self._request("POST", path, params=query, content=content, headers=headers)

        return self._patiently(send)

    def _patiently(self, send: Callable[[], httpx.Response]) -> httpx.Response:
        """Send again when the connection breaks, a few times: for requests that take long."""
        for wait in WAITS:
            try:
                return send()
            except Unreachable:
                time.sleep(wait)
        return send()

    @contextlib.contextmanager
    def _told(self) -> Iterator[None]:
        """What the network does, in sentences."""
        try:
            yield
        except httpx.TimeoutException as error:
            raise Unreachable(
                f"the server at {self.url} does not answer in time; try again, or correct the URL"
            ) from error
        except httpx.TransportError as error:
            reason = re.sub(r"^\[Errno -?\d+\] ", "", str(error)) or type(error).__name__
            raise Unreachable(
                f"no server answers at {self.url} ({reason}); start one with `dartboard up`, or correct the URL"
            ) from error

    def _check(self, answer: httpx.Response) -> None:
        """Raises what an answer that is no success says."""
        if answer.is_success:
            return
        kind = answer.headers.get("content-type", "").partition(";")[0]
        if kind != "application/problem+json":
            raise ServerProblem(
                f"what answers at {self.url} is no Dartboard server (HTTP {answer.status_code}); correct the URL"
            )
        problem = self._parse(Problem, answer.read())
        text = "\n".join(fault.detail for fault in problem.problems) or problem.detail
        if answer.is_client_error and answer.status_code not in NOT_NOW:
            raise Refused(answer.status_code, text)
        raise ServerProblem(text)

    def _parse(self, model: type[Model], text: str | bytes) -> Model:
        return self._parsed(TypeAdapter(model), text)

    def _parsed(self, adapter: TypeAdapter[Value], text: str | bytes) -> Value:
        """A server that is newer may say more than is known here: that is ignored."""
        try:
            return adapter.validate_json(text, extra="ignore")
        except ValidationError as error:
            raise ServerProblem(
                f"the answer of {self.url} is not understood: it is no Dartboard server, or one of another version "
                f"than {__version__}; use the command line that came with it"
            ) from error


def address(url: str) -> str:
    """A server's address as it is used and shown: with its scheme, without a slash at the end."""
    full = url.strip()
    if "://" not in full:
        full = f"http://{full}"
    try:
        parsed = httpx.URL(full)
    except httpx.InvalidURL:
        parsed = httpx.URL("")
    whole = parsed.scheme in ("http", "https") and parsed.host and not parsed.query and not parsed.fragment
    if not whole or re.search(r"[\s%]", parsed.host):
        raise DartboardError(f"{shown(url)} is no address of a server; give one like http://127.0.0.1:8000")
    return full.rstrip("/")
