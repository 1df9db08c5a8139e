"""Errors: each is a problem document with the status that fits, also a bug of ours; and nobody gets a traceback."""

from __future__ import annotations

import logging
import socket

import pytest

from jobs.errors import Conflict, DataDirectoryProblem, GridError, KeyReused, NotFound, WasDeleted
from renderer.errors import BadParameter, DartboardError, EnvironmentProblem, SceneError, UnknownName
from service import problems, views
from service.problems import TooLarge
from tests.service.api.test_events import live  # noqa: F401 - a fixture
from tests.service.conftest import House, house_of, refusal
from tests.service.live import Live, eventually

ERRORS: list[tuple[DartboardError, int, str]] = [
    (WasDeleted(3, "first"), 404, "experiment-deleted"),
    (NotFound("no cell 7"), 404, "not-found"),
    (Conflict("not now"), 409, "conflict"),
    (KeyReused("k"), 409, "conflict"),
    (GridError(["one", "two"]), 422, "bad-grid"),
    (SceneError("no such file"), 422, "bad-scene"),
    (UnknownName("metric", "x", "", ["mse"]), 422, "unknown-name"),
    (BadParameter("no"), 422, "bad-value"),
    (TooLarge("too much"), 413, "too-large"),
    (DataDirectoryProblem("full"), 507, "data-directory"),
    (EnvironmentProblem("no LLVM"), 503, "environment"),
    (DartboardError("something else"), 422, "bad-request"),
]


@pytest.mark.parametrize(("error", "status", "kind"), ERRORS, ids=[type(error).__name__ for error, _, _ in ERRORS])
def test_every_error_of_ours_has_its_status_and_its_own_sentence(
    house: House, monkeypatch: pytest.MonkeyPatch, error: DartboardError, status: int, kind: str
) -> None:
    def fail(*_: object) -> None:
        raise error

    monkeypatch.setattr(views, "all_experiments", fail)
    found = refusal(house.client.get("/api/experiments"), status, kind)
    assert found.detail == str(error)
    assert [fault.detail for fault in found.problems] == list(getattr(error, "problems", ()))


def test_a_bug_of_ours_is_told_without_its_traceback_and_logged_with_it(
    house: House, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    """With every header that other answers have; the server goes on."""

    def fail(*_: object) -> None:
        raise ZeroDivisionError("a secret place")

    with monkeypatch.context() as patch, caplog.at_level(logging.ERROR):
        patch.setattr(views, "all_experiments", fail)
        found = refusal(house.client.get("/api/experiments"), 500, "bug")
    assert "ZeroDivisionError" in found.detail and "nothing was lost" in found.detail
    assert "secret" not in found.detail
    (record,) = caplog.records
    assert record.getMessage() == "GET /api/experiments failed" and record.exc_info is not None
    assert house.client.get("/api/experiments").status_code == 200


def test_a_bug_in_the_middle_of_an_answer_ends_it(house: House, monkeypatch: pytest.MonkeyPatch) -> None:
    """What was sent cannot be taken back: the connection breaks, and no second answer follows the first."""
    from fastapi.responses import StreamingResponse

    def answer() -> StreamingResponse:
        def half():
            yield b"half of "
            raise ZeroDivisionError

        return StreamingResponse(half())

    house.app.get("/half")(answer)
    with pytest.raises(ZeroDivisionError):
        house.client.get("/half")


@pytest.mark.parametrize("path", ["/nowhere", "/api/nowhere", "/api/experiments/1/nowhere", "/static/nowhere.js"])
def test_an_unknown_path_is_404(house: House, path: str) -> None:
    assert path in refusal(house.client.get(path), 404, "not-found").detail


def test_a_person_who_mistyped_gets_a_page(house: House) -> None:
    page = house.client.get("/nowhere", headers={"accept": "text/html,*/*;q=0.8"})
    assert (page.status_code, page.headers["content-type"]) == (404, "text/html; charset=utf-8")
    refusal(house.client.get("/api/nowhere", headers={"accept": "text/html"}), 404)


@pytest.mark.parametrize(
    ("method", "path", "allowed"),
    [
        ("PUT", "/api/experiments", {"GET", "POST"}), ("PATCH", "/api/experiments/1", {"GET", "DELETE"}),
        ("GET", "/api/experiments/1/cancel", {"POST"}), ("POST", "/api/health", {"GET"}),
        ("DELETE", "/static/app.js", {"GET", "HEAD"}), ("OPTIONS", "/api/catalog", {"GET"}),
    ],
)  # fmt: skip
def test_a_method_that_a_route_has_not_is_405(house: House, method: str, path: str, allowed: set[str]) -> None:
    response = house.client.request(method, path)
    refusal(response, 405, "method-not-allowed")
    assert set(response.headers["allow"].split(", ")) <= allowed


@pytest.mark.parametrize(("asked", "status"), [("bytes=9999999-", 416), ("bytes=5-2", 400), ("lines=1-2", 400)])
def test_a_range_that_a_file_has_not_is_a_problem_too(house: House, asked: str, status: int) -> None:
    response = house.client.get("/static/app.js", headers={"range": asked})
    refusal(response, status)
    assert ("content-range" in response.headers) is (status == 416)
    assert house.client.get("/static/app.js", headers={"range": "bytes=0-9"}).status_code == 206


@pytest.mark.parametrize("token", [None, "0123456789abcdef"])
def test_every_refusal_of_the_guard_is_a_problem_too(house: House, token: str | None) -> None:
    guarded = house_of(house.engine, house.painter, house.watch, house.hub, token)
    host = {} if token else {"host": "evil.example"}
    for method, path in (("GET", "/"), ("GET", "/api/experiments"), ("HEAD", "/static/app.js"), ("POST", "/nowhere")):
        response = guarded.client.request(method, path, headers=host)
        assert response.status_code == (401 if token else 421)
        assert response.headers["content-type"] == problems.MEDIA_TYPE


@pytest.mark.parametrize(
    ("path", "words"),
    [
        ("/api/experiments/x", ["experiment_id: input should be a valid integer"]),
        ("/api/experiments/0", ["experiment_id: input should be greater than or equal to 1"]),
        ("/api/experiments/1/cells?after=-1&limit=0", ["after: input should be", "; limit: input should be"]),
    ],
)
def test_what_a_query_gets_wrong_is_said_in_words(house: House, path: str, words: list[str]) -> None:
    house.submit()
    found = refusal(house.client.get(path), 422, "bad-request")
    for word in words:
        assert word in found.detail


def test_a_client_that_hangs_up_is_no_news(house: House, live: Live, caplog: pytest.LogCaptureFixture) -> None:  # noqa: F811
    """In the middle of a body or of an answer: nothing is logged, nothing is left, the next one is served."""
    with caplog.at_level(logging.WARNING):
        for path in ("/api/experiments", "/api/scenes?name=x"):
            for sent in (b"", b'{"grid": {'):
                with socket.create_connection(("127.0.0.1", live.port)) as connection:
                    head = f"POST {path} HTTP/1.1\r\nHost: 127.0.0.1\r\nContent-Length: 1000000\r\n\r\n"
                    connection.sendall(head.encode() + sent)
        for path in ("/static/vendor/plotly-basic.min.js", "/api/experiments"):
            with socket.create_connection(("127.0.0.1", live.port)) as connection:
                connection.sendall(f"GET {path} HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n".encode())
        eventually(lambda: live.tasks() == 3)
    assert [record.getMessage() for record in caplog.records] == []
    assert house.client.get("/api/experiments").json() == []
    assert not list(house.artifacts.work.glob("upload-*"))


def test_a_large_body_is_refused_before_it_is_sent(house: House, live: Live) -> None:  # noqa: F811
    """A gigabyte that is announced is answered at once."""
    announced = b"POST /api/scenes?name=x HTTP/1.1\r\nHost: 127.0.0.1\r\nContent-Length: 1073741824\r\n\r\n"
    with socket.create_connection(("127.0.0.1", live.port), timeout=30) as connection:
        connection.sendall(announced)
        assert connection.recv(4096).startswith(b"HTTP/1.1 413 ")


@pytest.mark.parametrize("text", ["x" * 50_000, "%80", "%00", "../../etc/passwd", "<script>alert(1)</script>", "%25"])
def test_no_path_is_too_odd_to_be_answered(house: House, text: str) -> None:
    for path in (f"/{text}", f"/static/{text}", f"/api/experiments/{text}", f"/api/cells/{text}/preview.png"):
        assert house.client.get(path).status_code in (404, 422)


@pytest.mark.parametrize(
    ("sentence", "field"),
    [
        ("unknown sampler 'poisondisk' in samplers[1] of grid; known: independent", "samplers"),
        ("spp[2] of the grid is 0; give an integer from 1 to 10000000", "spp"),
        ("scenes is missing in the grid; name at least one", "scenes"),
        ("crop of [scene.x] of the grid is [1, 2], outside the film", "scene"),
        ("spp of [reference] of the grid is 0; give an integer", "reference"),
        ("sweep of the grid: in scene 'x' there is no parameter 'ball.mu'; its object has ball.nu", "sweep"),
        ("values[0] of [[sweep]] 1 of the grid is 'x'; give a finite number", "sweep"),
        ("unknown scene 'y' in scenes[0] of [[sweep]] 0 of the grid; known: x", "sweep"),
        ("the grid asks for 200000 cells", None),
    ],
)
def test_a_fault_names_the_field_that_it_concerns(sentence: str, field: str | None) -> None:
    assert problems.field_of(sentence) == field
