"""
Who may talk to the server: browsers' requests from our own pages, and programs of this machine.

A page of another site can make a browser send requests to 127.0.0.1, or point a name of its own there (DNS rebinding).
So the Host must be localhost or a loopback address, and a request that changes something must come from our own
origin, or from no page at all (curl, the command line). Off loopback every request needs the token. Answers tell the
browser to load nothing from anywhere else.
"""

from __future__ import annotations

import hmac
import ipaddress
from http.cookies import CookieError, SimpleCookie
from urllib.parse import parse_qs, urlencode

from starlette.requests import Request
from starlette.responses import RedirectResponse, Response
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from renderer.errors import BadParameter
from service.problems import problem

SAFE = ("GET", "HEAD", "OPTIONS")
TOKEN_LENGTH = 16  # characters, at least
COOKIE = "dartboard_token"
OPEN_PATHS = ("/api/health",)  # a container's health check has no token
HEADERS = {
    b"content-security-policy": (
        b"default-src 'none'; script-src 'self'; style-src 'self' 'unsafe-inline'; img-src 'self' data: blob:; "
        b"connect-src 'self'; font-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
    ),
    b"x-content-type-options": b"nosniff",
    b"referrer-policy": b"no-referrer",
    b"cross-origin-opener-policy": b"same-origin",
    b"cross-origin-resource-policy": b"same-origin",
}


def is_loopback(host: str) -> bool:
    """Whether an address to listen on is reached from this machine only."""
    if host == "localhost":
        return True
    try:
        return ipaddress.ip_address(host.strip("[]")).is_loopback
    except ValueError:
        return False


def check_token(host: str, token: str | None) -> str | None:
    """The token to demand; None on loopback without one. Raises ``BadParameter`` where one is needed and missing."""
    if token is not None and len(token) < TOKEN_LENGTH:
        raise BadParameter(f"DARTBOARD_TOKEN has {len(token)} characters; give it at least {TOKEN_LENGTH}")
    if token is None and not is_loopback(host):
        raise BadParameter(
            f"--host {host} is reached from other machines, so it needs a token: set DARTBOARD_TOKEN to at least "
            f"{TOKEN_LENGTH} characters, or listen on 127.0.0.1"
        )
    return token


class Guard:
    """
    ASGI middleware: Host, Origin and token are checked before anything else sees a request.

    token  None: loopback, nobody asks for one. With a token the Host may be any: whoever has it may use any name
    """

    def __init__(self, app: ASGIApp, token: str | None = None):
        self.app, self.token = app, token

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] != "http":
            await self.app(scope, receive, send)
            return
        request = Request(scope)
        answer = self._refusal(request)
        if answer is not None:
            await answer(scope, receive, _with_headers(send))
            return
        await self.app(scope, receive, _with_headers(send))

    def _refusal(self, request: Request) -> Response | None:
        host = request.headers.get("host", "")
        if self.token is None and not is_loopback(_name(host)):
            detail = f"the Host {host[:80]!r} is not this machine; open http://127.0.0.1 with the server's port"
            return problem(request, "foreign-host", "not for this server", 421, detail)
        if request.method not in SAFE and _foreign(request, host):
            detail = "a page of another site may not change anything here; use the dashboard, the command line or curl"
            return problem(request, "foreign-origin", "not from our own pages", 403, detail)
        if self.token is not None and request.url.path not in OPEN_PATHS:
            return self._token_refusal(request)
        return None

    def _token_refusal(self, request: Request) -> Response | None:
        assert self.token is not None
        query = parse_qs(request.url.query)
        given = query.pop("token", [""])[0]
        if given and hmac.compare_digest(given.encode(), self.token.encode()):
            rest = urlencode(query, doseq=True)
            path = "/" + request.url.path.lstrip("/")  # two slashes would lead to another host
            answer = RedirectResponse(path + (f"?{rest}" if rest else ""), 303)
            answer.set_cookie(COOKIE, self.token, httponly=True, samesite="strict")
            return answer
        scheme, _, bearer = request.headers.get("authorization", "").partition(" ")
        for one in (bearer if scheme.lower() == "bearer" else "", _cookie(request)):
            if one and hmac.compare_digest(one.encode(), self.token.encode()):
                return None
        detail = (
            "this server wants its token: open it as /?token=… once, or send the header `Authorization: Bearer …` "
            "(the command line takes it from DARTBOARD_TOKEN)"
        )
        return problem(request, "token", "who are you?", 401, detail)


def _name(host: str) -> str:
    """A Host header without its port."""
    if host.startswith("["):
        return host.partition("]")[0] + "]"
    return host.partition(":")[0].lower()


def _foreign(request: Request, host: str) -> bool:
    """Whether a page of another origin sent this."""
    if request.headers.get("sec-fetch-site", "same-origin") not in ("same-origin", "none"):
        return True
    origin = request.headers.get("origin")
    return origin is not None and origin not in (f"http://{host}", f"https://{host}")


def _cookie(request: Request) -> str:
    try:
        found = SimpleCookie(request.headers.get("cookie", "")).get(COOKIE)
    except CookieError:
        return ""
    return found.value if found else ""


def _with_headers(send: Send) -> Send:
    async def add(message: Message) -> None:
        if message["type"] == "http.response.start":
            own = message.get("headers", [])
            brought = {name.lower() for name, _ in own}  # a report has a policy of its own
            message = {**message, "headers": [*own, *(item for item in HEADERS.items() if item[0] not in brought)]}
        await send(message)

    return add
