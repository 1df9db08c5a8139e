"""Point files in a grid: found beside it, part of what a cell is, and kept where cells draw them."""

from __future__ import annotations

import json
import re
from functools import partial

import numpy as np
import pytest

from jobs import experiments, grid, plan
from jobs.errors import GridError
from jobs.gridtoml import toml_of
from renderer import catalog
from renderer.errors import DartboardError
from renderer.samplers import pointfile
from renderer.scenes import sources
from tests.jobs.grids import complaints

RANDOM = np.random.default_rng(3)


@pytest.fixture
def beside(tmp_path):
    """A folder with my.npz (4 sets of 64 points), and others with files of the same name."""
    for place, seed in ((".", 1), ("a", 2), ("b", 3)):
        (tmp_path / place).mkdir(exist_ok=True)
        points = np.random.default_rng(seed).random((4, 64, 2))
        pointfile.write(tmp_path / place / "my.npz", points)
    (tmp_path / "copy").mkdir()
    (tmp_path / "copy" / "my.npz").write_bytes((tmp_path / "my.npz").read_bytes())
    return tmp_path


def parse(folder, samplers, spp=(4, 64), **keys):
    return grid.parse(
        {"scenes": ["cornell_box"], "samplers": samplers, "spp": list(spp), "reference": False, **keys},
        find=partial(sources.find, base=folder), points=partial(pointfile.find, base=folder), origin="grid.toml",
    )  # fmt: skip


def labels(found):
    return [catalog.label("sampler", sampler) for sampler in found.samplers]


def told(folder, samplers, **keys):
    with pytest.raises(GridError) as refused:
        parse(folder, samplers, **keys)
    return " ".join(refused.value.problems)


def test_a_sampler_knows_the_content_of_its_file_and_is_called_by_its_name(beside):
    found = parse(beside, ["pointset:file=a/../my.npz", "independent"])
    digest = pointfile.read(beside / "my.npz").digest
    assert labels(found) == ["pointset:file=my.npz", "independent"]
    assert dict(found.samplers[0].parameters) == {"file": "my.npz", "points": digest, "scramble": "shift"}
    assert [(source.digest, source.count) for source in found.points] == [(digest, 64)]
    assert digest in found.text


def test_a_file_that_changed_is_another_cell(beside):
    before = {cell.spec.digest for cell in plan.expand(parse(beside, ["pointset:file=my.npz"])).cells}
    pointfile.write(beside / "my.npz", pointfile.read(beside / "a" / "my.npz").points)
    after = {cell.spec.digest for cell in plan.expand(parse(beside, ["pointset:file=my.npz"])).cells}
    assert len(before) == len(after) == 2 and not before & after


def test_the_same_points_under_one_name_are_one_sampler(beside):
    found = parse(beside, ["pointset:file=my.npz", "pointset:file=copy/my.npz", "pointset:file=./my.npz"])
    assert labels(found) == ["pointset:file=my.npz"] and len(found.points) == 1


def test_different_files_of_one_name_keep_the_paths_that_are_written(beside):
    found = parse(beside, ["pointset:file=a/my.npz", "pointset:file=b/my.npz,scramble=owen"])
    assert labels(found) == ["pointset:file=a/my.npz", "pointset:file=b/my.npz,scramble=owen"]
    assert len(found.points) == 2
    cells = plan.expand(found).cells
    assert len({(cell.sampler, cell.spp_asked) for cell in cells}) == len(cells) == 4


def test_a_grid_reads_back_from_its_own_text_beside_the_same_file(beside):
    first = parse(beside, ["pointset:file=my.npz,scramble=none", "poissondisk:replay=zeros"])
    (beside / "again.toml").write_text(toml_of(json.loads(first.text)))
    assert grid.read(beside / "again.toml").digest == first.digest


@pytest.mark.parametrize(
    ("sampler", "words"),
    [
        ("pointset:file=none.npz", ["samplers of grid.toml", "there is no point file 'none.npz'"]),
        ("pointset:file=a", ["samplers of grid.toml", "is a folder"]),
        ("pointset", ["samplers[0] of grid.toml", "needs file"]),
        ({"type": "pointset", "file": 3}, ["samplers[0] of grid.toml", "file = 3", "a text"]),
        ("pointset:file=my.npz,points=0", ["points", "known: file, scramble"]),
    ],
)
def test_what_is_wrong_with_a_file_is_told_with_its_place(beside, sampler, words):
    text = told(beside, [sampler])
    assert all(word in text for word in words), text


def test_more_samples_than_points_are_refused_with_how_many_there_are(beside):
    assert parse(beside, ["pointset:file=my.npz"], spp=[1, 63, 64])
    text = told(beside, ["pointset:file=my.npz"], spp=[1, 65])
    assert "spp of grid.toml: 65 samples per pixel" in text and "has 64 points; ask for at most 64" in text


def test_everything_wrong_is_told_at_once(beside):
    text = told(beside, ["pointset:file=none.npz", "pointset:file=my.npz", "stratifed"], spp=[65])
    assert "none.npz" in text and "at most 64" in text and "did you mean 'stratified'" in text


def test_a_grid_that_lies_beside_nothing_names_no_files():
    [text] = complaints(samplers=["pointset:file=/etc/passwd"])
    assert "samplers of grid.toml: point file '/etc/passwd': this grid can name no files" in text


def test_a_submitted_plan_keeps_its_points(store, artifacts, beside):
    found = parse(beside, ["pointset:file=my.npz"])
    experiments.submit(store, plan.expand(found), artifacts.scenes, points=artifacts.points)
    [source] = found.points
    assert [path.name for path in artifacts.points.iterdir()] == [f"{source.digest}.npz"]
    pointfile.write(beside / "my.npz", RANDOM.random((1, 64, 2)))
    assert pointfile.read(artifacts.points / f"{source.digest}.npz").digest == source.digest


@pytest.mark.parametrize(
    "sampler", ["poissondisk:replay=zeros", "pointset:file=my.npz", "relaxedpoissondisk:replay=truncated"]
)
def test_what_errors_are_measured_against_is_a_correct_sampler(beside, sampler):
    text = told(beside, ["independent"], reference={"sampler": sampler})
    assert sampler in text and "a reference takes a correct sampler, such as independent" in text


def test_a_distance_without_room_at_any_spp_of_the_grid_is_refused():
    assert complaints(samplers=["poissondisk:min_dist=0.1"], spp=[4, 16]) == ()
    [text] = complaints(samplers=["poissondisk:min_dist=0.1"], spp=[4, 16, 256])
    assert "min_dist = 0.1 of poissondisk (spp of grid.toml)" in text
    largest = re.findall(r"(?:up to|at most) (0\.\d+)", text)[0]
    assert complaints(samplers=[f"poissondisk:min_dist={largest}"], spp=[4, 16, 256]) == (), "what is told is accepted"
    assert complaints(samplers=["relaxedpoissondisk:min_dist=0.1"], spp=[4, 16, 256]) == ()


def test_a_replay_that_ignores_spp_is_one_cell_at_every_spp_that_is_asked():
    found = plan.expand(
        grid.parse({"scenes": ["cornell_box"], "samplers": ["poissondisk:replay=ignore_spp"], "spp": [4, 16, 64]},
                   find=partial(sources.find, base=None), origin="grid.toml")
    )  # fmt: skip
    cells = [cell for cell in found.cells if cell.role == "cell"]
    assert [cell.spp_asked for cell in cells] == [4, 16, 64]
    assert {cell.spec.spp for cell in cells} == {16} and len({cell.spec.digest for cell in cells}) == 1


def test_a_name_of_a_file_is_never_more_than_a_name():
    """A label goes into pages and tables: what could break one is refused by the catalog."""
    with pytest.raises(DartboardError):
        catalog.resolve("sampler", {"type": "pointset", "file": "a\nb.npz"})
