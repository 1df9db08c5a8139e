"""
Samplers on the axes of a real grid: replays at the spp that was asked, points that somebody brings, over every way from
a grid file to a number. Real render processes and a real server.
"""

from __future__ import annotations

import csv
import io
import json
import re
import signal
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from renderer.images import read_header, read_picture
from renderer.samplers import pointfile
from tests.e2e.test_server_cli import dartboard, start, wait_for

GRID = """
name = "samplers"
scenes = ["cornell_box"]
samplers = ["independent", "poissondisk:replay=ignore_spp", "pointset:file=my.npz", "stratified"]
spp = [4, 15, 16]
replicates = 2
resolution = [12, 8]
reference = { spp = 32 }
"""
CELLS = 3 + 1 + 3 + 2  # ignore_spp renders one for all; stratified rounds 15 to 16
PICTURES = 2 * CELLS + 2


@pytest.fixture
def grid(tmp_path: Path) -> Path:
    pointfile.write(tmp_path / "my.npz", np.random.default_rng(1).random((4, 16, 2)))
    (tmp_path / "grid.toml").write_text(GRID)
    return tmp_path / "grid.toml"


@pytest.fixture
def server(tmp_path: Path) -> Iterator[str]:
    process = start("serve", "--data", tmp_path / "served", "--port", 0)
    yield re.findall(r"http://[\d.:]+", wait_for(process, "Ctrl-C ends it"))[0]
    process.send_signal(signal.SIGINT)
    process.communicate(timeout=60)


def results(*where: object) -> list[dict[str, str]]:
    return list(csv.DictReader(io.StringIO(dartboard("results", "samplers", "--format", "csv", *where).stdout)))


def assert_right(rows: list[dict[str, str]]) -> None:
    """Every wanted picture has its row; those of ignore_spp are the same ones at every spp."""
    assert len(rows) == 4 * 3 * 2 and {row["state"] for row in rows} == {"done"}
    flat = [row for row in rows if row["sampler"] == "poissondisk:replay=ignore_spp"]
    assert [(row["spp"], row["spp_actual"]) for row in flat] == [
        (asked, "16") for asked in ("4", "15", "16") for _ in range(2)
    ]
    assert len({row["relmse"] for row in flat}) == 2
    own = [row for row in rows if row["sampler"] == "pointset:file=my.npz"]
    assert [row["spp_actual"] for row in own] == [row["spp"] for row in own]
    assert all(float(row["relmse"]) > 0 for row in rows)


def test_a_grid_of_replays_and_points_runs_reports_and_has_nothing_left_to_do(grid: Path, tmp_path: Path) -> None:
    data, report = tmp_path / "data", tmp_path / "report.html"
    done = dartboard("run", grid, "--data", data, "--report", report, "--json")
    assert done.returncode == 0, done.stderr
    told = json.loads(done.stdout)
    assert told["pictures"] == told["wanted"] == PICTURES
    assert_right(results("--data", data))
    text = report.read_text()
    assert "poissondisk:replay=ignore_spp is a replay" in text and '"replay":true' in text
    assert "nothing to do" in dartboard("run", grid, "--data", data).stderr
    checked = json.loads(dartboard("check", grid, "--data", data, "--json").stdout)
    assert (checked["reused"], checked["samples"]) == (PICTURES, 0)


def test_a_changed_point_file_renders_its_own_cells_and_no_others(grid: Path, tmp_path: Path) -> None:
    data = tmp_path / "data"
    assert dartboard("run", grid, "--data", data).returncode == 0
    pointfile.write(tmp_path / "my.npz", np.random.default_rng(2).random((4, 16, 2)))
    checked = json.loads(dartboard("check", grid, "--data", data, "--json").stdout)
    assert checked["replicates"] - checked["reused"] == 3 * 2
    assert dartboard("run", grid, "--data", data).returncode == 0
    assert len(list((data / "points").iterdir())) == 2


def test_points_are_sent_with_their_grid(grid: Path, server: str, tmp_path: Path) -> None:
    done = dartboard("submit", grid, "--server", server, "--wait")
    assert done.returncode == 0, done.stderr
    assert "sending point file my.npz: 4 sets of 16 points" in done.stderr
    assert_right(results("--server", server))
    again = dartboard("submit", grid, "--server", server)
    assert "that grid was there already" in again.stdout and "sending" not in again.stderr
    beside = dartboard("run", grid, "--data", tmp_path / "served")
    assert beside.returncode == 0, beside.stderr
    (tmp_path / "my.npz").unlink()
    refused = dartboard("submit", grid, "--server", server)
    assert refused.returncode == 2 and "there is no point file 'my.npz'" in refused.stderr


def test_one_picture_of_own_points_is_the_picture_of_the_queue(grid: Path, tmp_path: Path) -> None:
    assert dartboard("run", grid, "--data", tmp_path / "data").returncode == 0
    words = ("render", "cornell_box", "--sampler", "pointset:file=my.npz", "--size", "12x8", "--seed", 1)
    done = dartboard(*words, "--spp", 16, "-o", "a.exr", "--json", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    told = json.loads(done.stdout)
    assert told["sampler"] == "pointset:file=my.npz"
    [queued] = (tmp_path / "data").glob(f"images/*/{told['digest']}/cell-001.exr")
    np.testing.assert_allclose(read_picture(tmp_path / "a.exr"), read_picture(queued), rtol=2e-5, atol=1e-6)
    assert read_header(tmp_path / "a.exr")["seed"] == read_header(queued)["seed"]
    for more, said in (
        (("--spp", 17), "ask for at most 16"),
        (("--spp", 4, "--sampler", "pointset:file=no.npz"), "no.npz"),
    ):
        refused = dartboard(*words, *more, "-o", "b.exr", cwd=tmp_path)
        assert refused.returncode == 2 and said in refused.stderr and "Traceback" not in refused.stderr
