"""An answer is given again exactly as long as it is true, and made once for everybody who asks in the same moment."""

from __future__ import annotations

import asyncio
from typing import Any

import pytest

from service import kept
from service.kept import ALWAYS, Kept

FOR_EVER = [(b"x-revision", ALWAYS.encode()), (b"etag", b'"tag"')]
PICTURE, CURVES = "/api/cells/7/preview.png", "/api/experiments/1/convergence"


class Route:
    """An application that counts what reaches it."""

    def __init__(self, headers: list[tuple[bytes, bytes]], status: int = 200, body: bytes = b"picture"):
        self.headers, self.status, self.body, self.asked = headers, status, body, 0

    async def __call__(self, scope: Any, receive: Any, send: Any) -> None:
        self.asked += 1
        answer = b"%s %d" % (self.body, self.asked)
        await asyncio.sleep(0)  # others may ask meanwhile
        await send({"type": "http.response.start", "status": self.status, "headers": self.headers})
        await send({"type": "http.response.body", "body": answer[:3], "more_body": True})
        await send({"type": "http.response.body", "body": answer[3:]})


async def ask(
    app: Kept, path: str = PICTURE, query: bytes = b"", method: str = "GET", gzip: bool = False, has: bytes = b""
) -> bytes:
    said: list[Any] = []

    async def send(message: Any) -> None:
        said.append(message)

    headers = [(b"accept-encoding", b"gzip, br")] if gzip else []
    if has:
        headers.append((b"if-none-match", has))
    scope = {"type": "http", "method": method, "path": path, "query_string": query, "headers": headers}
    await app(scope, None, send)  # type: ignore[arg-type]
    assert said[0]["type"] == "http.response.start"
    if said[0]["status"] == 304:
        assert b"content-length" not in dict(said[0]["headers"])
        return b"304" + b"".join(message["body"] for message in said[1:])
    return b"".join(message["body"] for message in said[1:])


def test_a_picture_that_never_changes_is_made_once() -> None:
    route = Route(FOR_EVER)
    app = Kept(route, lambda: 0)
    assert {asyncio.run(ask(app)) for _ in range(3)} == {b"picture 1"}
    assert asyncio.run(ask(app, query=b"ev=1")) == b"picture 2"
    assert asyncio.run(ask(app, gzip=True)) == b"picture 3"


def test_who_has_it_already_is_told_just_that() -> None:
    app = Kept(Route(FOR_EVER), lambda: 0)
    assert asyncio.run(ask(app)) == b"picture 1"
    assert asyncio.run(ask(app, has=b'"tag"')) == asyncio.run(ask(app, has=b'"other", W/"tag"')) == b"304"
    assert asyncio.run(ask(app, has=b'"other"')) == b"picture 1"


def test_fifty_who_ask_at_once_get_one_answer() -> None:
    route = Route(FOR_EVER)
    app = Kept(route, lambda: 0)

    async def all_at_once() -> list[bytes]:
        return await asyncio.gather(*(ask(app) for _ in range(50)))

    assert set(asyncio.run(all_at_once())) == {b"picture 1"}


@pytest.mark.parametrize(
    ("headers", "status"),
    [([(b"cache-control", b"no-store")], 200), ([], 200), (FOR_EVER, 404)],
    ids=["may change", "says nothing", "is an error"],
)
def test_what_may_change_is_asked_for_every_time(headers, status) -> None:
    app = Kept(Route(headers, status), lambda: 0)

    async def all_at_once() -> list[bytes]:
        return await asyncio.gather(*(ask(app) for _ in range(3)))

    assert set(asyncio.run(all_at_once())) == {b"picture 1", b"picture 2", b"picture 3"}
    assert asyncio.run(ask(app)) == b"picture 4"


def test_curves_hold_until_something_happens() -> None:
    reached = iter((5, 6, 7, 7))
    app = Kept(Route([(b"x-revision", b"6")], body=b"curves"), lambda: next(reached))
    for answer in (b"curves 1", b"curves 1", b"curves 2", b"curves 3"):  # the route goes on to say 6
        assert asyncio.run(ask(app, CURVES)) == answer


def test_who_knows_more_does_not_share_an_older_answer() -> None:
    now = 6

    async def one_after_something_happened() -> list[bytes]:
        nonlocal now
        first = asyncio.create_task(ask(app, CURVES))
        await asyncio.sleep(0)
        now = 7
        return [await ask(app, CURVES), await first]

    app = Kept(Route([(b"x-revision", b"6")], body=b"curves"), lambda: now)
    assert asyncio.run(one_after_something_happened()) == [b"curves 2", b"curves 1"]


def test_other_requests_pass() -> None:
    app = Kept(Route(FOR_EVER), lambda: 0)
    for _ in range(2):
        asyncio.run(ask(app, "/api/experiments/1/events"))
        asyncio.run(ask(app, method="HEAD"))
    assert not app.held
    assert app.app.asked == 4  # type: ignore[attr-defined]


def test_a_route_that_fails_leaves_nothing_behind() -> None:
    async def fail(scope: Any, receive: Any, send: Any) -> None:
        raise ValueError("no")

    app = Kept(fail, lambda: 0)
    for _ in range(2):
        with pytest.raises(ValueError, match="no"):
            asyncio.run(ask(app))
    assert not app.making
    assert not app.held


def test_it_keeps_no_more_than_its_limit(monkeypatch) -> None:
    monkeypatch.setattr(kept, "KEPT_BYTES", 30)
    app = Kept(Route(FOR_EVER), lambda: 0)
    for number in range(10):
        asyncio.run(ask(app, query=b"%d" % number))
    assert app.bytes == sum(len(answer.body) for answer in app.held.values()) <= 30
    assert asyncio.run(ask(app, query=b"9")) == b"picture 10"
