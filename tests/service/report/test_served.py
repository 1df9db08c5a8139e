"""A report that a server sends keeps its own policy, and cannot speak for its reader."""

from __future__ import annotations

import asyncio

from starlette.responses import PlainTextResponse

from service.report import POLICY, SERVED_POLICY
from service.security import HEADERS, Guard


def sent(headers: dict[str, str]) -> dict[str, list[str]]:
    """The headers of an answer that passes the guard."""
    found: dict[str, list[str]] = {}

    async def app(scope, receive, send):
        await PlainTextResponse("x", headers=headers)(scope, receive, send)

    async def receive():
        return {"type": "http.request"}

    async def send(message):
        for name, value in message.get("headers", []):
            found.setdefault(name.decode(), []).append(value.decode())

    scope = {"type": "http", "method": "GET", "path": "/", "query_string": b"", "headers": [(b"host", b"localhost")]}
    asyncio.run(Guard(app)(scope, receive, send))
    return found


def test_an_answer_with_a_policy_of_its_own_keeps_it_alone():
    found = sent({"Content-Security-Policy": SERVED_POLICY})
    assert found["content-security-policy"] == [SERVED_POLICY]
    assert found["x-content-type-options"] == ["nosniff"]
    assert sent({})["content-security-policy"] == [HEADERS[b"content-security-policy"].decode()]


def test_a_served_report_is_in_an_origin_of_its_own():
    """Its inline scripts run; sandboxed without ``allow-same-origin`` they have neither cookies nor our routes."""
    assert SERVED_POLICY.startswith("sandbox ") and "allow-same-origin" not in SERVED_POLICY
    assert POLICY in SERVED_POLICY
