"""Point files over the wire: a good one is kept by its digest and named by grids; anything else is refused in words."""

from __future__ import annotations

import io
from pathlib import Path

import numpy as np
import pytest

from renderer.samplers import pointfile
from service import schemas, sending
from service.client import Refused
from tests.service.conftest import House, answer, refusal

POINTS = np.random.default_rng(5).random((2, 64, 2))
SUBMISSION = {"grid": {"scenes": ["cornell_box"], "samplers": ["pointset:file=my.npz"], "spp": [4, 16],
                       "replicates": 2, "resolution": [9, 9], "reference": {"spp": 8}}}  # fmt: skip


def packed(points: np.ndarray = POINTS) -> bytes:
    file = io.BytesIO()
    np.savez(file, points=points)
    return file.getvalue()


def upload(house: House, content: bytes, name: str = "my.npz"):
    return house.client.post(
        "/api/points", params={"name": name}, content=content, headers={"content-type": "application/octet-stream"}
    )


def test_a_point_file_is_kept_by_its_digest(house: House) -> None:
    sent = answer(upload(house, packed()), schemas.PointFile)
    assert sent.model_dump() == {
        "name": "my.npz", "digest": pointfile.digest_of(POINTS), "sets": 2, "count": 64,
    }  # fmt: skip
    assert [path.name for path in house.artifacts.points.iterdir()] == [f"{sent.digest}.npz"]
    assert answer(upload(house, packed(), "other name.npz"), schemas.PointFile).digest == sent.digest
    assert len(list(house.artifacts.points.iterdir())) == 1
    assert not list(house.artifacts.work.glob("upload-*"))


def test_a_grid_names_it_and_the_experiment_says_what_it_drew(house: House) -> None:
    digest = answer(upload(house, packed()), schemas.PointFile).digest
    submitted = house.client.post("/api/experiments", json={**SUBMISSION, "points": {"my.npz": digest}})
    found = answer(submitted, schemas.Experiment)
    house.finish(found.id)
    detail = answer(house.client.get(f"/api/experiments/{found.id}"), schemas.ExperimentDetail)
    assert (detail.samplers, detail.points, detail.replays) == (["pointset:file=my.npz"], {"my.npz": digest}, [])
    assert 'samplers = ["pointset:file=my.npz"]' in detail.toml
    again = {"toml": detail.toml, "scenes": detail.paths, "points": detail.points}
    assert answer(house.client.post("/api/experiments?dry_run=true", json=again), schemas.DryRun).experiment == found.id


def test_a_grid_names_only_what_was_sent(house: House, tmp_path: Path) -> None:
    pointfile.write(tmp_path / "my.npz", POINTS)
    digest = answer(upload(house, packed()), schemas.PointFile).digest
    there = str(tmp_path / "my.npz")
    for samplers, points, word in (
        (["pointset:file=my.npz"], {}, "send it first"),
        ([{"type": "pointset", "file": there}], {"my.npz": digest}, "send it first"),
        (["pointset:file=my.npz"], {"my.npz": "0" * 64}, "there is no uploaded one"),
        (["pointset:file=my.npz"], {"my.npz": "../" + digest}, "there is no uploaded one"),
        (["pointset:file=my.npz"], {"my.npz": ""}, "there is no uploaded one"),
    ):
        body = {"grid": {**SUBMISSION["grid"], "samplers": samplers}, "points": points}
        found = refusal(house.client.post("/api/experiments", json=body), 422, "bad-grid")
        assert word in found.detail and found.problems[0].field == "samplers"
    body = {"grid": {**SUBMISSION["grid"], "spp": [65]}, "points": {"my.npz": digest}}
    assert "at most 64" in refusal(house.client.post("/api/experiments", json=body), 422, "bad-grid").detail


@pytest.mark.parametrize(
    ("content", "word"),
    [
        (b"", "cannot be read"),
        (b"0.1 0.2", "cannot be read"),
        (packed(POINTS + 1), "outside [0, 1)"),
        (packed(POINTS[..., 0]), "have the shape (2, 64)"),
    ],
)
def test_what_is_no_point_file_is_refused_in_words_and_leaves_nothing(house: House, content: bytes, word: str) -> None:
    assert word in refusal(upload(house, content), 422, "bad-value").detail
    assert not list(house.artifacts.work.glob("upload-*")) and not house.artifacts.points.exists()


def test_a_name_that_no_grid_could_write_and_a_body_that_is_too_long_are_refused(house: House) -> None:
    refusal(upload(house, packed(), "a\nb.npz"), 422, "bad-value")
    length = {"content-type": "application/octet-stream", "content-length": str(2**26 + 1)}
    long = house.client.post("/api/points", params={"name": "my.npz"}, content=b"PK", headers=length)
    assert "more than 64 MiB" in refusal(long, 413, "too-large").detail


class Asked:
    """A client that hears what it is given, of a server that has no files yet."""

    def __init__(self) -> None:
        self.submitted: list[dict[str, dict[str, str]]] = []
        self.sent: list[tuple[str, int]] = []

    def submit(self, toml: str, origin: str, scenes: dict[str, str], points: dict[str, str]) -> tuple[str, bool]:
        self.submitted.append({"scenes": scenes, "points": points})
        if not self.sent:
            raise Refused(422, "point file 'my.npz': there is no uploaded one")
        return "the experiment", True

    def upload_points(self, name: str, file: io.BufferedReader) -> schemas.PointFile:
        self.sent.append((name, len(file.read())))
        return schemas.PointFile(name=name, digest="1" * 64, sets=2, count=64)


def test_the_command_line_sends_what_lies_beside_the_grid_and_only_when_it_is_missing(tmp_path: Path) -> None:
    pointfile.write(tmp_path / "my.npz", POINTS)
    (tmp_path / "grid.toml").write_text(
        'scenes = ["cornell_box"]\nsamplers = ["independent", {type = "pointset", file = "my.npz"}, "nobodys"]\n'
    )
    parcel = sending.pack(tmp_path / "grid.toml")
    assert {name: source.digest for name, source in parcel.points.items()} == {"my.npz": pointfile.digest_of(POINTS)}
    asked = Asked()
    assert sending.send(asked, parcel) == ("the experiment", True)  # type: ignore[arg-type]
    first, second = asked.submitted
    assert first["points"] == {"my.npz": pointfile.digest_of(POINTS)} and second["points"] == {"my.npz": "1" * 64}
    assert asked.sent == [("my.npz", (tmp_path / "my.npz").stat().st_size)]


def test_a_file_that_is_missing_is_said_before_anything_is_sent(tmp_path: Path) -> None:
    (tmp_path / "grid.toml").write_text('scenes = ["cornell_box"]\nsamplers = "pointset:file=my.npz"\n')
    with pytest.raises(Exception, match=r"samplers of grid\.toml: there is no point file 'my\.npz'"):
        sending.pack(tmp_path / "grid.toml")


def test_the_catalog_tells_what_a_form_needs(house: House) -> None:
    told = house.client.get("/api/catalog").json()
    [poisson] = [entry for entry in told["samplers"] if entry["name"] == "poissondisk"]
    [replay] = [item for item in poisson["parameters"] if item["name"] == "replay"]
    assert replay["options"][0] == "" and len(replay["options"]) == len(replay["meanings"]) == 6
    assert replay["replays"] == replay["options"][1:] and poisson["limit"] == 65536
    [points] = [entry for entry in told["samplers"] if entry["name"] == "pointset"]
    assert [item["name"] for item in points["parameters"] if item["required"]] == ["file"]
