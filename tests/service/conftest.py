"""
Servers for tests. A ``house`` needs no Mitsuba: its pictures are there at once (tests/jobs/painter.py) and a test says
how many. ``rendered`` is one real engine, with a render process, for all tests that look at real pictures.

Every answer that a test gets is checked for the headers that every answer must have.
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar

import httpx
import pytest
from fastapi import FastAPI
from fastapi.testclient import TestClient
from pydantic import BaseModel, TypeAdapter

from jobs.artifacts import Artifacts
from jobs.dispatcher import Dispatcher
from jobs.store import Store
from renderer import devices
from renderer.devices import Device
from service import engine as engines
from service import schemas
from service.app import create
from service.engine import Engine
from service.hub import Hub
from service.problems import MEDIA_TYPE
from service.security import HEADERS
from tests.jobs.painter import Painter

ADDRESS = "http://127.0.0.1:8765"
PATIENCE = 60  # seconds until a test that waits for something gives up: a failure, never a measurement
PAINT = Device("llvm", "paint", "for tests")
GRID: dict[str, Any] = {
    "name": "small", "scenes": ["cornell_box"], "samplers": ["independent", "stratified"], "spp": [4, 16],
    "replicates": 2, "resolution": [16, 12], "reference": {"spp": 32},
}  # fmt: skip
PICTURES = 2 * 2 * 2 + 2

M = TypeVar("M", bound=BaseModel)


class Watch:
    """Hears an engine, so that a test waits for a state of things and not for a time."""

    def __init__(self) -> None:
        self.changed = threading.Condition()

    def poke(self) -> None:
        with self.changed:
            self.changed.notify_all()

    def until(self, condition: Callable[[], Any]) -> None:
        with self.changed:
            assert self.changed.wait_for(condition, PATIENCE), "it did not come to that"


class Client(TestClient):
    """Checks what every answer must have."""

    def request(self, *args: Any, **keys: Any) -> httpx.Response:
        response = super().request(*args, **keys)
        assert_guarded(response)
        return response


@dataclass
class House:
    """An engine, what draws for it, who hears it, and a client."""

    engine: Engine
    painter: Painter
    watch: Watch
    hub: Hub
    app: FastAPI
    client: Client

    @property
    def artifacts(self) -> Artifacts:
        return self.engine.artifacts

    def submit(self, **keys: Any) -> schemas.Experiment:
        response = self.client.post("/api/experiments", json={"grid": {**GRID, **keys}})
        assert response.status_code in (200, 201), response.text
        return answer(response, schemas.Experiment)

    def experiment(self, number: int) -> schemas.Experiment:
        return answer(self.client.get(f"/api/experiments/{number}"), schemas.ExperimentDetail)

    def until_state(self, number: int, *states: str) -> schemas.Experiment:
        self.watch.until(lambda: self.experiment(number).state in states)
        return self.experiment(number)

    def finish(self, number: int) -> None:
        """Wait until everything is drawn and measured."""
        self.until_state(number, "done")
        self.do(lambda store, dispatcher: measure(dispatcher))

    def do(self, change: Callable[[Store, Dispatcher], Any]) -> Any:
        return self.engine.do(change)

    def count(self, table: str) -> int:
        with self.engine.readers.lend() as store:
            return int(store.connection.execute(f"select count(*) from {table}").fetchone()[0])


def measure(dispatcher: Dispatcher) -> None:
    while dispatcher.measurer.step(1.0):
        pass


def assert_guarded(response: httpx.Response) -> None:
    """No page may load anything from elsewhere, or be shown in one of somebody else's."""
    for name, value in HEADERS.items():
        found = response.headers.get_list(name.decode())
        if name == b"content-security-policy" and response.url.path.endswith("/report") and len(found) == 1:
            assert "default-src 'none'" in found[0], found  # it brings its own, which is as strict
        else:
            assert found == [value.decode()], (response.status_code, response.url)


def answer(response: httpx.Response, model: type[M]) -> M:
    """The body of a good answer, which fits its model and has nothing beside it."""
    assert response.status_code in (200, 201), response.text
    assert response.headers["content-type"].partition(";")[0] == "application/json"
    return model.model_validate_json(response.content)


def answers(response: httpx.Response, model: type[M]) -> list[M]:
    assert response.status_code == 200, response.text
    return TypeAdapter(list[model]).validate_json(response.content)  # type: ignore[valid-type]


def refusal(response: httpx.Response, status: int, kind: str | None = None) -> schemas.Problem:
    """The problem document of a refused request."""
    assert response.status_code == status, f"{response.status_code} {response.text}"
    assert response.headers["content-type"] == MEDIA_TYPE
    found = schemas.Problem.model_validate_json(response.content)
    assert found.status == status
    assert found.detail.strip() and found.title.strip()
    assert found.instance == response.request.url.path
    assert "Traceback" not in response.text
    assert kind is None or found.type == f"urn:dartboard:{kind}", found
    return found


def house_of(engine: Engine, painter: Painter, watch: Watch, hub: Hub, token: str | None = None) -> House:
    app = create(engine, hub, token)
    return House(engine, painter, watch, hub, app, Client(app, base_url=ADDRESS, follow_redirects=False))


@pytest.fixture
def painter(monkeypatch: pytest.MonkeyPatch) -> Painter:
    """Draws for every engine of the test."""
    painter = Painter()
    monkeypatch.setattr(engines, "LocalExecutor", lambda *_, **__: painter)
    return painter


@pytest.fixture
def house(tmp_path: Path, painter: Painter) -> Iterator[House]:
    hub, watch = Hub(), Watch()

    def hear() -> None:
        hub.poke()
        watch.poke()

    engine = Engine(tmp_path / "data", PAINT, on_change=hear)
    engine.start()
    house = house_of(engine, painter, watch, hub)
    with house.client:
        yield house
    engine.stop()


@pytest.fixture(scope="session")
def rendered(tmp_path_factory: pytest.TempPathFactory) -> Iterator[House]:
    """A server with a real render process that has rendered GRID as experiment 1. Tests may submit more."""
    hub, watch = Hub(), Watch()

    def hear() -> None:
        hub.poke()
        watch.poke()

    engine = Engine(tmp_path_factory.mktemp("rendered") / "data", devices.pick("llvm"), on_change=hear)
    engine.start()
    house = house_of(engine, Painter(), watch, hub)
    with house.client:
        found = house.submit()
        assert found.id == 1
        house.finish(1)
        yield house
    engine.stop()
