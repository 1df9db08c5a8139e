"""
Laws of the client: every failure is one sentence with an exit code, streams survive their server, and a scene is sent
as exactly its files.

The server here is a real one on a socket that says what each test tells it to: half answers, wrong answers, none.
Against the real Dartboard server see tests/e2e/test_server_cli.py.
"""

from __future__ import annotations

import hashlib
import io
import itertools
import json
import socket
import zipfile
from collections.abc import Callable, Iterator
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from threading import Thread
from typing import Any
from urllib.parse import parse_qs, urlsplit

import pytest
from hypothesis import given
from hypothesis import strategies as st

from renderer.errors import DartboardError
from renderer.scenes import sources
from service import client as clients
from service.client import Away, Back, Client, Refused, ServerProblem, Unreachable, address
from service.eventstream import Event, events_in
from service.schemas import Progress, Update
from service.sending import archive

EXPERIMENT = {
    "id": 3, "name": "first", "state": "running", "created_at": "2026-01-01T00:00:00+00:00", "cells": {"queued": 2},
    "references": {}, "had": 1, "wanted": 4, "failed": 0, "seconds_left": None,
}  # fmt: skip
WORKER = {
    "state": "idle", "device": "llvm", "trouble": None, "experiment": None, "cell": None, "description": None,
    "queued": 0,
}  # fmt: skip
PROGRESS = {"cell": 7, "role": "cell", "replicate": 0, "done": 1, "passes": 2, "seconds": 0.1, "preview": 1}


class Handler(BaseHTTPRequestHandler):
    """Answers with what the test's function writes; every request is kept."""

    protocol_version = "HTTP/1.1"
    server: Scripted

    def answer(self) -> None:
        body = self.rfile.read(int(self.headers.get("Content-Length", 0)))
        self.server.seen.append((self.command, self.path, dict(self.headers), body))
        self.close_connection = True
        self.server.script(self, len(self.server.seen))

    do_GET = do_POST = answer

    def say(self, status: int, kind: str, body: Any) -> None:
        content = body if isinstance(body, bytes) else json.dumps(body).encode()
        self.send_response(status)
        self.send_header("Content-Type", kind)
        self.send_header("Content-Length", str(len(content)))
        self.end_headers()
        self.wfile.write(content)

    def stream(self, text: str) -> None:
        """These events, and the end of the connection."""
        self.send_response(200)
        self.send_header("Content-Type", "text/event-stream")
        self.end_headers()
        self.wfile.write(text.encode())

    def hang_up(self) -> None:
        self.connection.shutdown(socket.SHUT_RDWR)

    def log_message(self, *_: object) -> None:
        pass


Script = Callable[[Handler, int], None]


class Scripted(ThreadingHTTPServer):
    def __init__(self, script: Script):
        super().__init__(("127.0.0.1", 0), Handler)
        self.script, self.seen = script, list[tuple[str, str, dict[str, str], bytes]]()
        self.url = f"http://127.0.0.1:{self.server_port}"


@pytest.fixture
def serve(monkeypatch: pytest.MonkeyPatch) -> Iterator[Callable[[Script], Scripted]]:
    """Starts a server; the waits of the client are none."""
    monkeypatch.setattr(clients, "WAITS", (0.0,))
    started = []

    def start(script: Script) -> Scripted:
        server = Scripted(script)
        Thread(target=server.serve_forever, args=(0.01,), daemon=True).start()
        started.append(server)
        return server

    yield start
    for server in started:
        server.shutdown()
        server.server_close()


def problem(status: int, detail: str, *faults: str) -> Script:
    body = {
        "type": "urn:dartboard:x", "title": "x", "status": status, "detail": detail, "instance": "/",
        "problems": [{"detail": text, "field": None} for text in faults],
    }  # fmt: skip
    return lambda handler, _: handler.say(status, "application/problem+json", body)


def update(revision: int, state: str = "running") -> str:
    data = {
        "revision": revision, "experiment": EXPERIMENT | {"state": state}, "worker": WORKER, "reload": False,
        "cells": [],
    }  # fmt: skip
    return f"event: update\nid: {revision}\ndata: {json.dumps(data)}\n\n"


# -- sentences and exit codes --


@pytest.mark.parametrize(
    ("status", "code"),
    [(400, 2), (404, 2), (409, 2), (413, 2), (422, 2), (401, 3), (403, 3), (421, 3), (500, 3), (503, 3), (507, 3)],
)
def test_a_problem_document_is_its_sentence(serve, status: int, code: int) -> None:
    server = serve(problem(status, "the disk is full; make room"))
    with Client(server.url) as client, pytest.raises(DartboardError, match="^the disk is full; make room$") as caught:
        client.health()
    assert caught.value.exit_code == code


def test_every_fault_of_a_grid_is_a_line(serve) -> None:
    server = serve(problem(422, "two\nlines", "first fault", "second fault"))
    with Client(server.url) as client, pytest.raises(Refused, match="^first fault\nsecond fault$"):
        client.submit("", "grid.toml", {})


@pytest.mark.parametrize(
    ("status", "kind", "body", "word"),
    [
        (404, "text/html", b"<h1>not here</h1>", "no Dartboard server"),
        (200, "text/html", b"<h1>hello</h1>", "not understood"),
        (200, "application/json", b'{"status": "ok"}', "version"),
        (500, "application/json", b"{}", "no Dartboard server"),
        (404, "application/problem+json", b"{", "not understood"),
        (302, "text/plain", b"", "no Dartboard server"),
    ],
)
def test_what_is_no_dartboard_is_named(serve, status: int, kind: str, body: bytes, word: str) -> None:
    server = serve(lambda handler, _: handler.say(status, kind, body))
    with Client(server.url) as client, pytest.raises(ServerProblem, match=word) as caught:
        client.health()
    assert server.url in str(caught.value)
    assert caught.value.exit_code == 3


def test_nobody_there_is_one_sentence() -> None:
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
    with Client(f"127.0.0.1:{port}") as client, pytest.raises(Unreachable) as caught:
        client.health()
    told = f"no server answers at http://127.0.0.1:{port} (Connection refused); start one with `dartboard up`, or "
    assert str(caught.value) == told + "correct the URL"


def test_silence_has_an_end(serve, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(clients, "ANSWER_SECONDS", 0.05)
    with (
        socket.create_server(("127.0.0.1", 0)) as mute,
        Client(f"127.0.0.1:{mute.getsockname()[1]}") as client,
        pytest.raises(Unreachable, match="does not answer in time"),
    ):
        client.health()


@pytest.mark.parametrize(
    ("given", "used"),
    [
        ("localhost:8000", "http://localhost:8000"),
        (" http://127.0.0.1:8000/ ", "http://127.0.0.1:8000"),
        ("https://host.example/dartboard/", "https://host.example/dartboard"),
    ],
)
def test_addresses(given: str, used: str) -> None:
    assert address(given) == used


@pytest.mark.parametrize(
    "text", ["", "ftp://host", "http://", "http://host:port", "http://h/?a=1", "two words", "http://[::1"]
)
def test_what_is_no_address_is_named(text: str) -> None:
    with pytest.raises(DartboardError, match="is no address of a server") as caught:
        address(text)
    assert caught.value.exit_code == 2


def test_a_newer_server_may_say_more(serve) -> None:
    """Fields that this version does not know are ignored."""
    more = WORKER | {"mood": "fine"}
    with Client(serve(lambda handler, _: handler.say(200, "application/json", more)).url) as client:
        assert client.worker().state == "idle"


def test_a_proxy_is_not_asked_for_this_machine(serve, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("HTTP_PROXY", "http://127.0.0.1:9")
    monkeypatch.setenv("NO_PROXY", "")
    with Client(serve(lambda handler, _: handler.say(200, "application/json", WORKER)).url) as client:
        client.worker()


def test_the_token_comes_from_the_environment(serve, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("DARTBOARD_TOKEN", "0123456789abcdef")
    server = serve(lambda handler, _: handler.say(200, "application/json", WORKER))
    with Client(server.url) as client:
        client.worker()
    assert server.seen[0][2]["Authorization"] == "Bearer 0123456789abcdef"


def test_a_question_on_a_kept_connection_that_breaks_is_asked_again(serve) -> None:
    server = serve(lambda handler, n: handler.hang_up() if n == 1 else handler.say(200, "application/json", WORKER))
    with Client(server.url) as client:
        assert client.worker().state == "idle"
    assert len(server.seen) == 2


# -- experiments --


def test_an_experiment_is_found_by_the_newest_of_its_name(serve) -> None:
    server = serve(lambda handler, _: handler.say(200, "application/json", [EXPERIMENT | {"id": 9}, EXPERIMENT]))
    with Client(server.url) as client:
        assert client.find("a & b/ü").id == 9
    assert parse_qs(urlsplit(server.seen[0][1]).query) == {"name": ["a & b/ü"]}


def test_an_unknown_name_is_told_with_those_that_are_there(serve) -> None:
    server = serve(lambda handler, n: handler.say(200, "application/json", [] if n == 1 else [EXPERIMENT]))
    with Client(server.url) as client, pytest.raises(Refused, match=r"no experiment 'second' at .*: 3 \(first\)"):
        client.find("second")


def test_a_grid_is_sent_again_under_the_same_key(serve) -> None:
    """A connection that breaks before the answer: nobody knows whether the grid arrived."""

    def script(handler: Handler, n: int) -> None:
        handler.hang_up() if n == 1 else handler.say(201, "application/json", EXPERIMENT)

    server = serve(script)
    with Client(server.url) as client:
        experiment, new = client.submit("spp = 4", "grid.toml", {"room": "0" * 64})
    assert (experiment.id, new) == (3, True)
    first, second = server.seen
    assert first[2]["Idempotency-Key"] == second[2]["Idempotency-Key"]
    assert json.loads(second[3]) == {"toml": "spp = 4", "origin": "grid.toml", "scenes": {"room": "0" * 64}}


# -- streams --


def test_following_goes_on_where_it_was(serve) -> None:
    """The server goes away after an event: the next connection names that event, as a browser's would."""

    def script(handler: Handler, n: int) -> None:
        if n == 1:
            handler.stream(f": hello\n\n{update(11)}event: progress\ndata: {json.dumps(PROGRESS)}\n\nevent: upd")
        elif n == 2:
            handler.hang_up()
        else:
            handler.stream(update(12, "done"))

    server = serve(script)
    with Client(server.url) as client:
        events = client.follow(3, after=10)
        found = [next(events) for _ in range(5)]
        events.close()
    assert [type(event) for event in found] == [Update, Progress, Away, Back, Update]
    assert found[-1].experiment.state == "done"
    assert [path for _, path, _, _ in server.seen] == ["/api/experiments/3/events?after=10"] * 3
    assert [headers.get("Last-Event-ID") for _, _, headers, _ in server.seen] == [None, "11", "11"]


def test_following_ends_when_the_experiment_is_deleted(serve) -> None:
    server = serve(lambda handler, _: handler.stream("event: gone\ndata: {}\n\n"))
    with Client(server.url) as client, pytest.raises(Refused, match="experiment 3 was deleted"):
        next(client.follow(3, after=0))


def test_following_ends_when_the_server_no_longer_knows_it(serve) -> None:
    def script(handler: Handler, n: int) -> None:
        handler.stream("") if n == 1 else problem(404, "no experiment 3 in data")(handler, n)

    with Client(serve(script).url) as client, pytest.raises(Refused, match="no experiment 3 in data"):
        list(client.follow(3, after=0))


def test_patience_has_an_end(serve) -> None:
    """A server that stays away: one notice, then the reason."""
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
    with Client(f"127.0.0.1:{port}", patience_seconds=0.0) as client:
        events = client.follow(3, after=0)
        assert isinstance(next(events), Away)
        with pytest.raises(Unreachable, match="no server answers"):
            next(events)


@given(
    st.lists(
        st.tuples(
            st.sampled_from(["update", "progress"]), st.text(st.characters(codec="utf-8", exclude_characters="\r\n"))
        )
    ),
    st.sampled_from(["\n", "\r\n"]),
    st.lists(st.integers(0, 500)),
)
def test_events_arrive_whole_however_they_are_cut(sent, end: str, cuts: list[int]) -> None:
    r"""Blocks end anywhere, within a character too; what Python takes for a line's end (U+2028, \x0b) is none."""
    events = [Event(name, data, str(n)) for n, (name, data) in enumerate(sent)]
    text = "".join(f"event: {one.name}{end}: ping{end}data: {one.data}{end}id: {one.id}{end}{end}" for one in events)
    content = (text + "data: cut off").encode()
    edges = [0, *sorted(min(cut, len(content)) for cut in cuts), len(content)]
    blocks = [content[a:b] for a, b in itertools.pairwise(edges)]
    assert list(events_in(blocks)) == events


# -- scenes --

SCENE = """<scene version="3.0.0">
  <include filename="lights.xml"/>
  <shape type="obj"><string name="filename" value="meshes/ball.obj"/></shape>
</scene>"""


@pytest.fixture
def room(tmp_path: Path) -> Path:
    """A scene of three files in a folder that holds more."""
    folder = tmp_path / "room"
    (folder / "meshes").mkdir(parents=True)
    (folder / "scene.xml").write_text(SCENE)
    (folder / "lights.xml").write_text('<scene version="3.0.0"><emitter type="constant"/></scene>')
    (folder / "meshes/ball.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    (folder / "secret.txt").write_text("not part of it")
    return tmp_path


def zipped(room: Path) -> bytes:
    file = io.BytesIO()
    archive(sources.find("room", room), file)
    return file.getvalue()


def test_a_scene_is_sent_as_exactly_its_files(room: Path) -> None:
    with zipfile.ZipFile(io.BytesIO(zipped(room))) as made:
        assert sorted(made.namelist()) == ["lights.xml", "meshes/ball.obj", "scene.xml"]
        assert made.read("scene.xml").decode() == SCENE
        assert made.testzip() is None


def test_the_same_scene_is_the_same_bytes(room: Path) -> None:
    """Whenever it is sent, whatever the time and rights of its files."""
    first = zipped(room)
    for path in (room / "room").rglob("*"):
        if path.is_file():
            path.chmod(0o600)
            path.write_bytes(path.read_bytes())
    assert hashlib.sha256(zipped(room)).digest() == hashlib.sha256(first).digest()


def test_an_upload_is_the_zip_with_its_name_and_main_file(serve, room: Path) -> None:
    """Sent again whole when the connection breaks."""
    scene = {
        "name": "room", "digest": "0" * 64, "builtin": False, "main": "scene.xml", "width": 1, "height": 1,
        "max_depth": 6, "integrator": "path", "sampler": "independent", "spp": 4, "files": [],
    }  # fmt: skip

    def script(handler: Handler, n: int) -> None:
        handler.hang_up() if n == 1 else handler.say(201, "application/json", scene)

    server = serve(script)
    content = zipped(room)
    with Client(server.url) as client:
        assert client.upload("a room", "scene.xml", io.BytesIO(content), len(content)).digest == "0" * 64
    assert [body for _, _, _, body in server.seen] == [content, content]
    _, path, headers, _ = server.seen[1]
    assert parse_qs(urlsplit(path).query) == {"name": ["a room"], "main": ["scene.xml"]}
    assert headers["Content-Type"] == "application/zip"
