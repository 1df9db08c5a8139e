"""
The wire against its own description: whatever fits OpenAPI gets an answer that OpenAPI describes, and never a 5xx.
"""

from __future__ import annotations

import json
import os
import shutil
import subprocess
from pathlib import Path
from typing import Any

import pytest
import schemathesis
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from schemathesis.checks import not_a_server_error
from schemathesis.specs.openapi.checks import (
    content_type_conformance,
    response_schema_conformance,
    status_code_conformance,
)

from tests.service.conftest import GRID, House, refusal

ROOT = Path(__file__).resolve().parents[3]
CHECKS = (not_a_server_error, status_code_conformance, content_type_conformance, response_schema_conformance)
STREAMS = ("/api/events", "/api/experiments/{experiment_id}/events")  # these never end


@schemathesis.serializer("application/zip", "application/toml")
def as_it_is(context: schemathesis.SerializationContext, value: Any) -> Any:
    """What schemathesis makes up for these is text or bytes already; the service finds out what it is worth."""
    return value if isinstance(value, bytes) else str(value).encode()


def conforms(house: House, examples: int) -> None:
    """Every route with ``examples`` requests that its description allows, on a house with one finished experiment."""
    found = house.submit()
    house.finish(found.id)
    schema = schemathesis.openapi.from_dict(house.app.openapi())
    for result in schema.get_all_operations():
        operation = result.ok()
        if operation.path in STREAMS:
            continue

        @settings(
            max_examples=examples, deadline=None, derandomize=True, database=None,
            suppress_health_check=list(HealthCheck),
        )  # fmt: skip
        @given(case=operation.as_strategy())
        def holds(case: schemathesis.Case) -> None:
            arguments = case.as_transport_kwargs(base_url=str(house.client.base_url))
            arguments.pop("cookies", None)
            if "data" in arguments:
                arguments["content"] = arguments.pop("data")
            response = house.client.request(**arguments)
            case.validate_response(
                schemathesis.Response.from_any(response), checks=CHECKS, headers=dict(response.headers)
            )

        holds()


def test_every_route_answers_as_it_is_described(house: House) -> None:
    conforms(house, 12)


@pytest.mark.slow
def test_every_route_answers_as_it_is_described_many_times(house: House) -> None:
    conforms(house, 300)


json_values = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats(allow_nan=False) | st.text(max_size=30),
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text(max_size=12), inner, max_size=4),
    max_leaves=12,
)
KEYS = [*GRID, "integrators", "max_depth", "crop", "rfilter", "colour", "sweep", "scene", "nonsense"]


@settings(max_examples=150, deadline=None, derandomize=True, suppress_health_check=list(HealthCheck))
@given(
    changes=st.dictionaries(st.sampled_from(KEYS), json_values, max_size=4), whole=json_values, take_whole=st.booleans()
)
def test_no_json_at_all_makes_the_service_stumble(
    house: House, changes: dict[str, Any], whole: Any, take_whole: bool
) -> None:
    """A grid is planned, or refused with at least one sentence; nothing else."""
    body = {"grid": whole if take_whole else {**GRID, **changes}}
    response = house.client.post("/api/experiments?dry_run=true", content=json.dumps(body))
    if response.status_code != 200:
        found = refusal(response, 422)
        assert all(fault.detail.strip() for fault in found.problems)


@pytest.mark.parametrize(
    "body", [b"", b"{", b"[1, 2", b"\xff\xfe", b"null", b'"grid"', b"[]", b"{}", b'{"grid": {}, "toml": ""}', b"{}}"]
)
def test_a_body_that_is_no_submission_is_refused_in_words(house: House, body: bytes) -> None:
    refusal(house.client.post("/api/experiments", content=body), 422)
    refusal(house.client.post("/api/experiments", content=body, headers={"content-type": "application/toml"}), 422)


def test_the_dashboards_types_are_those_of_the_service(house: House, tmp_path: Path) -> None:
    """``web/openapi.d.ts`` is generated; whoever changes the wire generates it again (CONTRIBUTING.md)."""
    tool = ROOT / "web" / "node_modules" / ".bin" / "openapi-typescript"
    if not tool.exists() or shutil.which("node") is None:
        if os.environ.get("CI"):
            pytest.fail("CI has no openapi-typescript: npm ci in web/ failed")
        pytest.skip("no openapi-typescript: run npm ci in web/")
    description = tmp_path / "openapi.json"
    description.write_text(json.dumps(house.app.openapi()))
    made = tmp_path / "openapi.d.ts"
    subprocess.run([tool, description, "--output", made], cwd=ROOT / "web", check=True, capture_output=True)
    assert made.read_text() == (ROOT / "web" / "openapi.d.ts").read_text()
