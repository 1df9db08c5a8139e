"""From a body to a plan: every way to write a grid is the same grid, and whatever else comes is refused in words."""

from __future__ import annotations

import json
import tomllib
from pathlib import Path

import pytest
from hypothesis import given, settings

from jobs import experiments, grid
from jobs.artifacts import Artifacts
from jobs.errors import GridError
from jobs.gridtoml import toml_of
from jobs.store import Store
from renderer.errors import DartboardError
from service import schemas, submission
from tests.jobs.conftest import work_off
from tests.jobs.grids import tables
from tests.service.conftest import GRID

TEXT = 'scenes = ["cornell_box"]\nsamplers = ["stratified"]\nspp = [3, 4]\nreplicates = 2\nreference = { spp = 64 }\n'


@pytest.fixture(scope="module")
def place(tmp_path_factory: pytest.TempPathFactory) -> tuple[Store, Artifacts]:
    data = tmp_path_factory.mktemp("data")
    return Store.open(data), Artifacts(data)


def planned(place: tuple[Store, Artifacts], **keys: object):
    return submission.planned(*place, schemas.Submission(**keys))


@pytest.mark.parametrize("kind", ["", "application/json", "application/json; charset=utf-8", "APPLICATION/JSON"])
def test_json_is_read_whatever_is_said_about_its_letters(kind: str) -> None:
    found = submission.read(json.dumps({"grid": GRID}).encode(), kind)
    assert (found.grid, found.toml) == (GRID, None)


@pytest.mark.parametrize("kind", ["application/toml", "application/toml; charset=utf-8", "Application/TOML"])
def test_a_grid_file_is_a_body_too(kind: str) -> None:
    """As an editor on Windows saves it, as well."""
    for mark in ("", "\ufeff"):
        assert submission.read((mark + TEXT).encode(), kind).toml == TEXT


@pytest.mark.parametrize("kind", ["text/plain", "application/x-www-form-urlencoded", "multipart/form-data", "x" * 999])
def test_another_type_is_refused_with_those_that_are_read(kind: str) -> None:
    with pytest.raises(DartboardError, match="send application/json .* or application/toml") as refused:
        submission.read(b"{}", kind)
    assert len(str(refused.value)) < 200


@pytest.mark.parametrize(
    ("body", "word"),
    [
        ({}, 'one of "grid"'),
        ({"grid": GRID, "toml": TEXT}, 'one of "grid"'),
        ({"grid": [GRID]}, "grid: input should be an object"),
        ({"toml": 3}, "toml: input should be a valid string"),
        ({"grid": GRID, "more": 1}, "more: extra inputs are not permitted"),
        ({"grid": GRID, "scenes": {"a": 1}}, "scenes.a: input should be a valid string"),
        ({"grid": GRID, "scenes": ["a"]}, "scenes: input should be an object"),
        ({"grid": GRID, "origin": "x" * 201}, "origin: string should have at most 200 characters"),
        ([], "input should be an object"),
        (None, "input should be an object"),
    ],
)
def test_a_body_of_another_shape_is_refused_by_its_place(body: object, word: str) -> None:
    with pytest.raises(DartboardError) as refused:
        submission.read(json.dumps(body).encode(), "application/json")
    assert word in str(refused.value)


@pytest.mark.parametrize(
    "body",
    [b"", b"{", b'{"grid": }', b"\xff", b'{"grid": {"a": "\xff"}}', b'{"grid": {"name": "\\ud800"}}', b"[" * 10**5,
     b'{"grid": ' * 10**4, b"\x00", "{\u2028}".encode()],
)  # fmt: skip
def test_what_is_no_json_is_refused(body: bytes) -> None:
    with pytest.raises(DartboardError, match="the body is no submission"):
        submission.read(body, "application/json")


def test_text_that_is_no_utf_8_is_refused() -> None:
    with pytest.raises(DartboardError, match="not UTF-8 text"):
        submission.read(b"\xff\xfe" + TEXT.encode("utf-16-le"), "application/toml")


@pytest.mark.parametrize("value", ["NaN", "Infinity", "-Infinity", "1e999", "9" * 5000, "-0.0", "1e-400"])
@pytest.mark.parametrize(
    "where",
    ['"spp": [%s]', '"replicates": %s', '"resolution": [%s, 8]', '"max_depth": %s', '"reference": {"spp": %s}',
     '"rfilter": {"type": "gaussian", "stddev": %s}', '"samplers": [{"type": "multijitter", "jitter": %s}]',
     '"integrators": [{"type": "path", "max_depth": %s}]', '"crop": [%s, 0, 1, 1]', '"name": %s', '"scenes": [%s]'],
)  # fmt: skip
def test_no_number_is_too_odd_to_be_refused(place: tuple[Store, Artifacts], where: str, value: str) -> None:
    """Numbers that Python reads and JSON does not know, or that no float holds: planned, or refused in words."""
    body = '{"grid": {"scenes": ["cornell_box"], "resolution": [8, 8], ' + where % value + "}}"
    try:
        plan = submission.planned(*place, submission.read(body.encode(), "application/json"))
    except DartboardError as refused:
        assert str(refused).strip() and len(str(refused)) < 1000
    else:
        assert plan.cells


@given(table=tables())
@settings(max_examples=60, deadline=None, derandomize=True)
def test_json_and_toml_of_a_grid_are_one_grid(place: tuple[Store, Artifacts], table: dict[str, object]) -> None:
    """The very digest: submitting the one after the other makes nothing new."""
    table = {"name": "a grid", **table}
    try:
        first = planned(place, grid=table)
    except GridError:
        return
    again = planned(place, toml=toml_of(json.loads(first.grid.text)))
    assert again.grid.digest == first.grid.digest
    assert [cell.spec.digest for cell in again.cells] == [cell.spec.digest for cell in first.cells]


def test_sentences_call_the_grid_what_its_client_calls_it(place: tuple[Store, Artifacts]) -> None:
    for keys in ({"grid": {"scenes": []}}, {"toml": "scenes = []"}):
        with pytest.raises(GridError, match="scenes of my grid.toml is empty"):
            planned(place, origin="my grid.toml", **keys)
    with pytest.raises(GridError, match="my grid.toml is not TOML at line 1, column 10"):
        planned(place, origin="my grid.toml", toml="scenes = nothing")
    assert planned(place, origin="my grid.toml", toml=TEXT).grid.name == "my grid"


@pytest.mark.parametrize("name", ["/etc/passwd", "../scene.xml", ".", "file:///etc/passwd", "room", "a\x00b"])
def test_a_scene_is_never_a_path_of_this_machine(
    place: tuple[Store, Artifacts], name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Not even one that exists where the server was started."""
    (tmp_path / "room").mkdir()
    (tmp_path / "room" / "scene.xml").write_text("<scene version='3.0.0'/>")
    monkeypatch.chdir(tmp_path)
    with pytest.raises(GridError, match="unknown scene .*; known: .*cornell_box"):
        planned(place, grid={"scenes": [name]})
    with pytest.raises(GridError, match="there is no uploaded scene"):
        planned(place, grid={"scenes": [name]}, scenes={name: "0" * 64})


def test_a_dry_run_tells_what_the_plan_holds_and_what_is_there(tmp_path: Path) -> None:
    store, artifacts = Store.open(tmp_path), Artifacts(tmp_path)
    plan = planned((store, artifacts), toml=TEXT)
    told = submission.dry_run(store, plan)
    assert told.axes == {"scenes": 1, "samplers": 1, "integrators": 1, "spp": 2, "replicates": 2}
    assert (told.cells, told.references, told.replicates, told.reused, told.experiment) == (2, 1, 4, 0, None)
    assert told.rounded == [schemas.Rounded(sampler="stratified", asked=3, rendered=4)]
    assert tomllib.loads(told.toml)["scenes"] == ["cornell_box"]
    assert grid.loads(told.toml, "x")["spp"] == [3, 4]
    found, _ = experiments.submit(store, plan, artifacts.scenes)
    work_off(store)
    told = submission.dry_run(store, plan)
    assert (told.reused, told.samples, told.experiment) == (4, 0, found.id)
    store.close()
