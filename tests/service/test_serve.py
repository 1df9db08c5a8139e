"""
The process behind ``dartboard serve``: it ends when it is told to, whatever is open; when it is killed nothing is lost;
and where it cannot start it says why. Real processes and real signals.
"""

from __future__ import annotations

import json
import signal
import socket
import threading
import urllib.request
from collections.abc import Iterator
from http.client import HTTPConnection
from pathlib import Path
from typing import Any

import pytest

from jobs import owner
from jobs.store import Store
from renderer.errors import BadParameter, EnvironmentProblem
from service import schemas, serve
from tests.e2e.test_run import images, render_processes, wait_gone
from tests.e2e.test_server_cli import Server, serving
from tests.jobs.conftest import assert_sound, select
from tests.service.conftest import GRID, PATIENCE, House
from tests.service.live import Stream

LONG = {**GRID, "name": "long", "spp": [4, 16, 900, 901, 902], "resolution": [64, 64], "replicates": 4}

MEDIUM = {**GRID, "name": "medium", "spp": [4, 16, 250, 251], "resolution": [32, 32]}


@pytest.fixture
def server(tmp_path: Path) -> Iterator[Server]:
    with serving(tmp_path / "data") as server:
        yield server


def ask(server: Server, path: str, body: Any = None) -> Any:
    data = None if body is None else json.dumps(body).encode()
    request = urllib.request.Request(server.url + path, data, {"Content-Type": "application/json"})
    with urllib.request.urlopen(request, timeout=PATIENCE) as response:
        return json.load(response)


def follow(server: Server, path: str, **headers: str) -> Stream:
    connection = HTTPConnection("127.0.0.1", server.port, timeout=PATIENCE)
    connection.request("GET", path, headers={name.replace("_", "-"): value for name, value in headers.items()})
    return Stream(connection, connection.getresponse())


def pictures(server: Server, experiment: int) -> int:
    return int(ask(server, f"/api/experiments/{experiment}")["had"])


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT])
def test_a_signal_ends_everything_within_five_seconds(server: Server, number: signal.Signals) -> None:
    """
    While it draws, with streams open, an idle connection, and a request of which only half has come: the streams end,
    no process is left, what was finished is kept, and nothing is called running.
    """
    found = ask(server, "/api/experiments", {"grid": LONG})
    streams = [follow(server, f"/api/experiments/{found['id']}/events?after=0") for _ in range(5)]
    streams += [follow(server, "/api/events") for _ in range(5)]
    streams[0].until(lambda update: update.experiment.had >= 5)
    idle, half = (socket.create_connection(("127.0.0.1", server.port)) for _ in range(2))
    idle.sendall(b"GET /api/health HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n")
    assert idle.recv(100).startswith(b"HTTP/1.1 200")
    half.sendall(b"POST /api/experiments HTTP/1.1\r\nHost: 127.0.0.1\r\nContent-Length: 100\r\n\r\n{")
    children = render_processes(server.process.pid)
    assert len(children) == 1
    server.process.send_signal(number)
    assert server.process.wait(timeout=5) == 0
    wait_gone(children)
    for stream in streams:
        stream.rest()
    assert half.recv(100).startswith(b"HTTP/1.1 503")
    idle.close()
    half.close()
    assert server.process.stderr is not None
    assert "Traceback" not in server.process.stderr.read()
    assert owner.peek(server.data) is None
    store = Store.read(server.data)
    assert select(store, "select count(*) from cell where state = 'running'") == [(0,)]
    assert select(store, "select count(*) from attempt where ended_at is null") == [(0,)]
    assert len(select(store, "select * from replicate")) == len(images(server.data)) >= 5
    assert_sound(store)


def test_a_killed_server_loses_nothing_and_a_stream_goes_on(server: Server) -> None:
    """
    kill -9, twice, in the middle of the work: the render process dies with it, the next server completes the grid, no
    finished picture is drawn again, and a page that comes back with its last event is told what it has missed.
    """
    found = ask(server, "/api/experiments", {"grid": MEDIUM})
    address = f"/api/experiments/{found['id']}"
    stream = follow(server, f"{address}/events?after=0")
    kept: dict[str, int] = {}
    rows: dict[int, schemas.Cell] = {}

    def apply(updates: list[schemas.Update]) -> schemas.Update:
        for update in updates:
            told = schemas.Cells(**ask(server, f"{address}/cells")).cells if update.reload else update.cells
            rows.update({cell.position: cell for cell in told})
        return updates[-1]

    for count in (3, 8):
        last = apply(stream.until(lambda update, count=count: update.experiment.had >= count))
        children = render_processes(server.process.pid)
        server.process.send_signal(signal.SIGKILL)
        server.process.wait()
        wait_gone(children)
        with_rows = {image for (image,) in select(Store.read(server.data), "select image from replicate")}
        kept |= {name: inode for name, inode in images(server.data).items() if name in with_rows}
        server.start()
        stream = follow(server, f"{address}/events", Last_Event_ID=str(last.revision))
        update = apply([stream.update()])
        assert update.revision >= last.revision
        assert update.experiment.had >= last.experiment.had
    apply(stream.until(lambda update: update.experiment.state == "done" and update.worker.state == "idle"))
    while rows != {cell["position"]: schemas.Cell(**cell) for cell in ask(server, f"{address}/cells")["cells"]}:
        apply([stream.update()])
    after = images(server.data)
    assert {name: after[name] for name in kept} == kept
    assert len(after) == found["wanted"] == pictures(server, found["id"])
    server.stop()
    store = Store.read(server.data)
    assert select(store, "select count(*), count(distinct cell_id || role || k) from replicate") == [
        (found["wanted"], found["wanted"])
    ]
    outcomes = dict(select(store, "select outcome, count(*) from attempt group by 1"))
    assert set(outcomes) == {"done", "owner_lost"}, "a killed owner blames nobody"
    assert_sound(store)


def test_a_change_that_was_answered_survives_a_kill(server: Server) -> None:
    """Submitted, paused, deleted: what a client was told is there afterwards, to the last word."""
    one = ask(server, "/api/experiments", {"grid": {**LONG, "name": "one"}})
    two = ask(server, "/api/experiments", {"grid": {**LONG, "name": "two", "spp": [9]}})
    ask(server, f"/api/experiments/{one['id']}/pause", {})
    request = urllib.request.Request(f"{server.url}/api/experiments/{two['id']}", method="DELETE")
    urllib.request.urlopen(request, timeout=PATIENCE).close()
    server.process.send_signal(signal.SIGKILL)
    server.process.wait()
    server.start()
    assert [(found["id"], found["state"]) for found in ask(server, "/api/experiments")] == [(one["id"], "paused")]
    assert ask(server, f"/api/experiments/{two['id']}/restore", {})["state"] in ("queued", "running", "done")


def test_a_second_server_on_one_data_directory_is_refused(server: Server, tmp_path: Path) -> None:
    """In a sentence with the pid and the address of the first, which is not disturbed."""
    with pytest.raises(EnvironmentProblem) as refused:
        serve.serve(server.data, host="127.0.0.1", port=0, device="llvm", demo=True)
    assert str(server.process.pid) in str(refused.value) and server.url in str(refused.value)
    assert refused.value.exit_code == 3
    assert ask(server, "/api/experiments") == []


def test_a_port_in_use_is_refused_before_anything_is_made(tmp_path: Path) -> None:
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
        with pytest.raises(EnvironmentProblem, match=rf"port {port} of 127.0.0.1 cannot be used .*--port 0") as refused:
            serve.serve(tmp_path / "data", host="127.0.0.1", port=port, device="llvm", demo=False)
    assert refused.value.exit_code == 3
    assert not (tmp_path / "data").exists()


@pytest.mark.parametrize("host", ["no.such.host.invalid", "256.256.256.256", "192.0.2.1"])
def test_an_address_that_is_not_ours_is_refused(tmp_path: Path, host: str) -> None:
    with pytest.raises(EnvironmentProblem, match="--host|cannot be used"):
        serve.serve(tmp_path / "data", host=host, port=0, device="llvm", demo=False, token="x" * 16)


def test_other_machines_need_a_token(tmp_path: Path) -> None:
    with pytest.raises(BadParameter, match="DARTBOARD_TOKEN"):
        serve.serve(tmp_path / "data", host="0.0.0.0", port=0, device="llvm", demo=False)
    assert not (tmp_path / "data").exists()


@pytest.mark.parametrize(
    ("host", "url"),
    [("127.0.0.1", "http://127.0.0.1:80"), ("0.0.0.0", "http://127.0.0.1:80"), ("::1", "http://[::1]:80"),
     ("::", "http://[::1]:80"), ("dartboard.example", "http://dartboard.example:80")],
)  # fmt: skip
def test_the_address_that_is_told_can_be_opened(host: str, url: str) -> None:
    assert serve._url(host, 80) == url


def test_the_demo_grid_comes_to_an_empty_data_directory_only(house: House) -> None:
    house.painter.allowed = 0
    serve.submit_demo(house.engine)
    (demo,) = house.client.get("/api/experiments").json()
    serve.submit_demo(house.engine)
    assert house.client.get("/api/experiments").json()[0]["id"] == demo["id"]
    house.client.delete(f"/api/experiments/{demo['id']}")
    serve.submit_demo(house.engine)
    assert house.client.get("/api/experiments").json() == [], "who deletes it does not want it back"
    mine = house.submit()
    serve.submit_demo(house.engine)
    assert [found["id"] for found in house.client.get("/api/experiments").json()] == [mine.id]


def test_many_clients_of_all_kinds_at_once(server: Server) -> None:
    """Pages, pollers, submitters and those that hang up: every answer is whole, and the server ends as it should."""
    failures: list[BaseException] = []

    def client(index: int) -> None:
        try:
            grid = {**GRID, "name": f"grid {index % 4}", "spp": [1 + index % 4], "replicates": 1, "reference": False}
            found = ask(server, "/api/experiments", {"grid": grid})
            stream = follow(server, f"/api/experiments/{found['id']}/events?after=0")
            stream.until(lambda update: update.experiment.state == "done")
            cells = ask(server, f"/api/experiments/{found['id']}/cells")["cells"]
            assert {cell["state"] for cell in cells} == {"done"}
            stream.tear() if index % 2 else stream.close()
        except BaseException as error:
            failures.append(error)

    threads = [threading.Thread(target=client, args=(index,)) for index in range(16)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert not failures
    assert len(ask(server, "/api/experiments")) == 4
    assert len(images(server.data)) == 6, "stratified makes 4 spp of 2 and of 3"
    server.process.terminate()
    assert server.process.wait(timeout=5) == 0


def test_an_idle_server_lets_its_render_process_go(house: House) -> None:
    """What holds 200 MB ends when nothing was asked for a while; the next grid starts it again."""
    rested = threading.Event()
    house.painter.rest = rested.set  # type: ignore[method-assign]
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("jobs.dispatcher.REST_SECONDS", 0.0)
        patch.setattr("jobs.dispatcher.IDLE_WAIT_SECONDS", 0.01)
        found = house.submit()
        house.finish(found.id)
        assert rested.wait(PATIENCE)


def test_the_process_that_serves_never_loads_mitsuba(server: Server) -> None:
    """Also when it has drawn, measured, shown and reported."""
    found = ask(server, "/api/experiments", {"grid": GRID})
    stream = follow(server, f"/api/experiments/{found['id']}/events?after=0")
    stream.until(lambda update: update.experiment.state == "done")
    for path in ("/api/catalog", "/api/scenes", f"/api/experiments/{found['id']}/convergence"):
        ask(server, path)
    for path in ("/api/cells/1/preview.png", "/api/cells/1/pixels", f"/api/experiments/{found['id']}/report"):
        urllib.request.urlopen(server.url + path, timeout=PATIENCE).close()
    mapped = Path(f"/proc/{server.process.pid}/maps").read_text()
    assert "mitsuba" not in mapped and "drjit" not in mapped
