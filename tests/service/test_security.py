"""Who may talk to the server: hosts, origins and tokens, on every route and before anything else."""

from __future__ import annotations

import pytest

from renderer.errors import BadParameter
from service.security import check_token, is_loopback
from tests.service.conftest import House, house_of, refusal

TOKEN = "a token of more than sixteen characters"
OURS = ["127.0.0.1", "127.0.0.1:8765", "127.0.0.2:1", "localhost", "LOCALHOST:1", "[::1]", "[::1]:8000"]
FOREIGN = [
    "evil.example",
    "evil.example:8765",
    "127.0.0.1.evil.example",
    "localhost.evil.example",
    "192.168.1.5",
    "[::2]",
    "",
    "127.0.0.1@evil.example",
    "2130706433",
    "0.0.0.0:8765",
]


@pytest.mark.parametrize("host", OURS)
def test_loopback_names_are_served(house: House, host: str) -> None:
    assert house.client.get("/api/health", headers={"host": host}).status_code == 200


@pytest.mark.parametrize(
    "path", ["/", "/api/health", "/api/experiments", "/static/app.js", "/openapi.json", "/nowhere"]
)
@pytest.mark.parametrize("host", FOREIGN)
def test_a_name_that_points_here_from_elsewhere_is_not_served(house: House, host: str, path: str) -> None:
    """DNS rebinding: a page of evil.example whose name resolves to 127.0.0.1 reads nothing."""
    refusal(house.client.get(path, headers={"host": host}), 421, "foreign-host")


@pytest.mark.parametrize(
    "headers",
    [
        {"origin": "http://evil.example"},
        {"origin": "null"},
        {"origin": "http://127.0.0.1:9999"},  # another server of this machine
        {"origin": "https://127.0.0.1"},
        {"sec-fetch-site": "cross-site"},
        {"sec-fetch-site": "same-site"},
    ],
)
def test_a_page_of_another_origin_changes_nothing(house: House, headers: dict[str, str]) -> None:
    found = house.submit()
    house.finish(found.id)
    before = house.count("event")
    for method, path in (("POST", f"/api/experiments/{found.id}/cancel"), ("DELETE", f"/api/experiments/{found.id}"),
                         ("POST", "/api/experiments"), ("POST", "/api/scenes?name=x")):  # fmt: skip
        refusal(house.client.request(method, path, headers=headers), 403, "foreign-origin")
    assert house.count("event") == before


@pytest.mark.parametrize(
    "headers",
    [
        {},  # curl
        {"origin": "http://127.0.0.1:8765"},
        {"origin": "http://127.0.0.1:8765", "sec-fetch-site": "same-origin"},
        {"sec-fetch-site": "none"},
    ],
)
def test_our_pages_and_programs_may(house: House, headers: dict[str, str]) -> None:
    found = house.submit()
    assert house.client.post(f"/api/experiments/{found.id}/cancel", headers=headers).status_code == 200


def test_with_a_token_everything_but_health_asks_for_it(house: House) -> None:
    guarded = house_of(house.engine, house.painter, house.watch, house.hub, token=TOKEN)
    client = guarded.client
    assert client.get("/api/health", headers={"host": "dartboard.example"}).status_code == 200
    for path in ("/", "/api/experiments", "/static/app.js", "/openapi.json", "/api/worker", "/nowhere"):
        refusal(client.get(path), 401, "token")
        refusal(client.get(path, headers={"authorization": "Bearer wrong"}), 401, "token")
        refusal(client.get(path, headers={"authorization": f"Basic {TOKEN}"}), 401, "token")
        refusal(client.get(path, headers={"cookie": "dartboard_token=wrong"}), 401, "token")
        refusal(client.get(path, params={"token": "wrong"}), 401, "token")
    assert client.get("/api/experiments", headers={"authorization": f"Bearer {TOKEN}"}).status_code == 200


def test_the_token_in_an_address_becomes_a_cookie_and_leaves_the_address(house: House) -> None:
    """Else it would lie in the history, in bookmarks, and in what people copy."""
    client = house_of(house.engine, house.painter, house.watch, house.hub, token=TOKEN).client
    answer = client.get("/experiments/3", params={"token": TOKEN, "rows": "sampler"})
    assert (answer.status_code, answer.headers["location"]) == (303, "/experiments/3?rows=sampler")
    cookie = answer.headers["set-cookie"]
    assert "HttpOnly" in cookie and "samesite=strict" in cookie.lower()
    assert client.get("/api/experiments").status_code == 200  # the client keeps cookies as a browser does


def test_a_page_of_another_origin_has_no_use_of_the_cookie(house: House) -> None:
    client = house_of(house.engine, house.painter, house.watch, house.hub, token=TOKEN).client
    client.get("/", params={"token": TOKEN})
    refusal(client.post("/api/experiments/1/cancel", headers={"origin": "http://evil.example"}), 403, "foreign-origin")


@pytest.mark.parametrize("host", ["127.0.0.1", "127.1.2.3", "localhost", "::1", "[::1]"])
def test_loopback_needs_no_token(host: str) -> None:
    assert is_loopback(host)
    assert check_token(host, None) is None


@pytest.mark.parametrize("host", ["0.0.0.0", "::", "192.168.1.5", "dartboard.example", ""])
def test_other_addresses_need_a_long_one(host: str) -> None:
    with pytest.raises(BadParameter, match="DARTBOARD_TOKEN"):
        check_token(host, None)
    with pytest.raises(BadParameter, match="at least 16"):
        check_token(host, "short")
    assert check_token(host, TOKEN) == TOKEN


@pytest.mark.parametrize(
    "path",
    [
        "/static/../service/app.py",
        "/static/%2e%2e/service/app.py",
        "/static/..%2fservice%2fapp.py",
        "/static/%2e%2e%2f%2e%2e%2fetc%2fpasswd",
        "/static//etc/passwd",
        "/static/node_modules/typescript/package.json",
        "/static/.npmrc",
        "/static/vendor/../../pyproject.toml",
        "/static/",
        "/static/views",
    ],
)
def test_only_files_of_the_dashboard_are_sent(house: House, path: str) -> None:
    response = house.client.get(path)
    assert response.status_code == 404, response.text[:200]
