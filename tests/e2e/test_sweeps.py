"""
A sweep from a grid file to numbers, with real render processes: every picture is the one of a scene file with the
values written in by hand, and what a scene does not have is refused before anything is rendered.
"""

from __future__ import annotations

import csv
import io
import itertools
import json
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from renderer.images import read_header, read_picture
from tests.e2e.test_run import ROOT, command, dartboard

ALPHAS, COLOURS = (0.05, 0.4), ([0.1, 0.9, 0.2], 0.5)
GRID = """
name = "sweeps"
scenes = ["cornell_box", "room"]
samplers = ["independent", "stratified"]
spp = [4, 16]
replicates = 2
resolution = [24, 16]
reference = { spp = 32 }

[[sweep]]
parameter = "white_sphere.bsdf.alpha"
values = [0.05, 0.4]
scenes = ["room"]

[[sweep]]
parameter = "near_sphere.reflectance"
values = [[0.1, 0.9, 0.2], 0.5]
scenes = ["room"]
"""
SCENE = ROOT / "tests" / "renderer" / "swept"
SWEPT = ["near_sphere.reflectance", "white_sphere.bsdf.alpha"]

# Draws the plain scene in a folder with the seed of a picture: a render process without anything swept.
DRAW = """
import sys
from dataclasses import replace
from pathlib import Path
import numpy as np
from renderer.variant import use
use("llvm_ad_rgb")
from renderer.render import render
from renderer.scenes.load import load
from renderer.spec import CellSpec
folder, seed, spec, out = sys.argv[1:]
cell = CellSpec.parse(spec)
cell = replace(cell, estimand=replace(cell.estimand, sweep=()))
loaded = load(Path(folder), "scene.xml", width=cell.estimand.width, height=cell.estimand.height)
np.save(out, next(render(cell, loaded, [int(seed)])).picture)
"""


def write_grid(folder: Path, text: str = GRID) -> Path:
    """A grid file beside its scene."""
    shutil.copytree(SCENE, folder / "room")
    (folder / "grid.toml").write_text(text)
    return folder / "grid.toml"


@pytest.fixture(scope="module")
def data(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A data directory in which GRID was run."""
    folder = tmp_path_factory.mktemp("sweeps")
    done = dartboard("run", write_grid(folder), "--data", folder / "data", "--report", folder / "report.html")
    assert done.returncode == 0, done.stderr
    return folder / "data"


def test_check_counts_what_is_swept(tmp_path: Path) -> None:
    write_grid(tmp_path)
    told = json.loads(dartboard("check", tmp_path / "grid.toml", "--data", tmp_path / "data", "--json").stdout)
    assert (told["cells"], told["references"]) == ((1 + 4) * 2 * 2, 1 + 4)
    assert [told["axes"][name] for name in SWEPT] == [2, 2]
    shown = dartboard("check", tmp_path / "grid.toml", "--data", tmp_path / "data").stdout
    assert "white_sphere.bsdf.alpha: 2 values in room" in shown


def test_results_have_a_column_for_each_sweep(data: Path) -> None:
    rows = list(csv.DictReader(io.StringIO(dartboard("results", "sweeps", "--data", data, "--format", "csv").stdout)))
    assert len(rows) == 5 * 2 * 2 * 2
    assert {row["state"] for row in rows} == {"done"} and all(float(row["relmse"]) > 0 for row in rows)
    points = {tuple(row[name] for name in SWEPT) for row in rows if row["scene"] == "room"}
    assert points == {(str(colour), str(alpha)) for alpha, colour in itertools.product(ALPHAS, COLOURS)}
    assert {tuple(row[name] for name in SWEPT) for row in rows if row["scene"] == "cornell_box"} == {("", "")}
    table = dartboard("results", "sweeps", "--data", data, "--format", "table").stdout
    assert all(f"= {value}" in " ".join(table.split()) for value in (*ALPHAS, *COLOURS))


def test_a_report_names_the_sweeps(data: Path) -> None:
    text = (data.parent / "report.html").read_text()
    assert "Sweeps: what is set in a scene" in text
    assert "white_sphere.bsdf.alpha = 0.05" in text and "near_sphere.reflectance = [0.1, 0.9, 0.2]" in text


def test_one_process_and_few_compilations_serve_the_sweep(data: Path) -> None:
    """Of a scene with two samplers: the kernels of the first cell of each, not of every value."""
    rows = json.loads(dartboard("results", "sweeps", "--data", data, "--format", "json").stdout)
    first: dict[str, None] = {}
    for row in rows:
        if row["scene"] == "room" and row["compile_seconds"] > 0.1:
            first[f"{row['sampler']} {row[SWEPT[0]]} {row[SWEPT[1]]}"] = None
    assert len(first) <= 2, first


def test_every_picture_is_that_of_a_file_edited_by_hand(data: Path, tmp_path: Path) -> None:
    pictures: list[np.ndarray] = []
    for file in sorted((data / "images").rglob("cell-000.exr")):
        header = read_header(file)
        spec = json.loads(header["spec"])
        sweep = spec["estimand"]["sweep"]
        if not sweep or spec["spp"] != 16 or spec["sampler"]["type"] != "stratified":
            continue
        folder = tmp_path / str(len(pictures))
        folder.mkdir()
        colour = sweep["near_sphere.reflectance"]
        text = (SCENE / "scene.xml").read_text("utf-8")
        text = text.replace('"alpha" value="0.25"', f'"alpha" value="{sweep["white_sphere.bsdf.alpha"]}"')
        words = " ".join(map(str, colour if isinstance(colour, list) else [colour] * 3))
        text = text.replace('value="0.85 0.36 0.08"', f'value="{words}"')
        (folder / "scene.xml").write_text(text, "utf-8")
        out = folder / "drawn.npy"
        words_of = [sys.executable, "-c", DRAW, str(folder), header["seed"], header["spec"], str(out)]
        subprocess.run(words_of, cwd=ROOT, check=True)
        swept = read_picture(file)
        assert np.abs(swept - np.load(out)).max() <= 1e-6
        pictures.append(swept)
    assert len(pictures) == 4
    for one, other in itertools.combinations(pictures, 2):
        assert np.abs(one - other).max() > 0.01


@pytest.mark.parametrize("words", [["check"], ["run"]])
def test_what_a_scene_does_not_have_is_refused_before_anything_is_rendered(words: list[str], tmp_path: Path) -> None:
    write_grid(tmp_path, GRID.replace("sphere.bsdf.alpha", "sphere.bsdf.alhpa"))
    done = subprocess.run(
        command(*words, tmp_path / "grid.toml", "--data", tmp_path / "data"), cwd=ROOT, capture_output=True, text=True
    )
    told = " ".join(done.stderr.split())
    assert done.returncode == 2 and "Traceback" not in told
    assert "did you mean 'white_sphere.bsdf.alpha'" in told and "in scene 'room'" in told
    assert not (tmp_path / "data" / "images").exists()
