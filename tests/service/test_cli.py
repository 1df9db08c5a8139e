"""
The command line as people type it: real processes. Bad input is one sentence on stderr that names the value, the
exit code says whose fault it was, and there is never a traceback.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from renderer.images import read_header, read_picture, write_picture

ROOT = Path(__file__).resolve().parent.parent.parent
TINY = 'scenes = ["cornell_box"]\nspp = [4]\nresolution = [16, 16]\nreplicates = 1\nreference = false\n'


def dartboard(*words: object, cwd: Path = ROOT, **environment: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-m", "service.cli", *map(str, words)], cwd=cwd, capture_output=True, text=True, timeout=120,
        env={**os.environ, "PYTHONPATH": str(ROOT), "COLUMNS": "120", **environment},
    )  # fmt: skip


def refused(done: subprocess.CompletedProcess[str], code: int, *words: str) -> None:
    """The exit code, and one clear sentence with these words; nothing on stdout, no traceback."""
    assert done.returncode == code, done.stderr
    assert "Traceback" not in done.stderr
    assert done.stdout == ""
    for word in words:
        assert word in done.stderr, (word, done.stderr)


@pytest.mark.parametrize("words", [("--help",), ("check", "GRID"), ("results", "1"), ("status",), ("catalog",)])
def test_reading_commands_never_load_mitsuba(tmp_path: Path, words: tuple[str, ...]) -> None:
    (tmp_path / "grid.toml").write_text(TINY)
    words = tuple(str(tmp_path / "grid.toml") if word == "GRID" else word for word in words)
    code = (
        f"import sys; sys.argv[1:] = {list(words)!r}\nfrom service import cli\n"
        "try:\n    cli.main()\nexcept SystemExit:\n    pass\n"
        "assert not {'mitsuba', 'drjit'} & set(sys.modules)"
    )
    done = subprocess.run(
        [sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True,
        env={**os.environ, "DARTBOARD_DATA": str(tmp_path / "data")},
    )  # fmt: skip
    assert done.returncode == 0, done.stderr


@pytest.mark.parametrize(
    ("content", "words"),
    [
        ('scenes = ["cornel_box"]', ("'cornel_box'", "scenes[0]", "did you mean 'cornell_box'")),
        ('scenes = ["cornell_box"]\nsamplers = ["poisondisk"]', ("'poisondisk'", "samplers[0]", "multijitter")),
        ('scenes = ["cornell_box"]\nsamplers = ["stratified:x=1"]', ("'x'", "known: jitter")),
        ('scenes = ["cornell_box"]\nspp = [0, -1, 1000000000]', ("spp[0]", "spp[1]", "spp[2]", "1 to 10000000")),
        ('scenes = ["cornell_box"', ("not TOML",)),
        ('scenes = ["none.xml"]', ("none.xml",)),
        ('scenes = ["text.xml"]', ("text.xml", "XML")),
        ('scenes = ["plugin.xml"]', ("'no_such_plugin'", "line 1")),
    ],
)
@pytest.mark.parametrize("command", ["check", "run"])
def test_bad_grids_are_refused(tmp_path: Path, command: str, content: str, words: tuple[str, ...]) -> None:
    (tmp_path / "grid.toml").write_text(content)
    (tmp_path / "text.xml").write_text("hello")
    (tmp_path / "plugin.xml").write_text('<scene version="3.0.0"><bsdf type="no_such_plugin"/></scene>')
    refused(dartboard(command, tmp_path / "grid.toml", "--data", tmp_path / "data"), 2, *words)
    assert not (tmp_path / "data").exists()  # nothing is half-made for a grid that cannot run


def test_a_million_cells_are_refused_before_they_are_made(tmp_path: Path) -> None:
    spp, depths = list(range(1, 1001)), [f"path:rr_depth={depth}" for depth in range(1, 1001)]
    (tmp_path / "grid.toml").write_text(f'scenes = ["cornell_box"]\nspp = {spp}\nintegrators = {depths}\n')
    refused(dartboard("check", tmp_path / "grid.toml"), 2, "1000000 cells", "100000")


@pytest.mark.parametrize(
    ("words", "code", "said"),
    [
        (("nosuch",), 2, "'nosuch'"),
        (("cornell_box", "--spp", "0"), 2, "--spp"),
        (("cornell_box", "--size", "10"), 2, "WIDTHxHEIGHT"),
        (("cornell_box", "--max-depth", "0"), 2, "max_depth = 0"),
        (("cornell_box", "--crop", "1,2,3"), 2, "X,Y,WIDTH,HEIGHT"),
        (("cornell_box", "--crop", "250,0,7,8"), 2, "256×256"),
        (("cornell_box", "--rfilter", "blur"), 2, "'blur'"),
        (("cornell_box", "--sampler", "random:jitter=1"), 2, "'jitter'"),
        (("cornell_box", "--device", "tpu"), 2, "'tpu'"),
    ],
)
def test_bad_render_options_are_refused(tmp_path: Path, words: tuple[str, ...], code: int, said: str) -> None:
    refused(dartboard("render", *words, "-o", tmp_path / "a.exr"), code, said)
    assert list(tmp_path.iterdir()) == []


def test_render_is_the_picture_of_the_queue(tmp_path: Path) -> None:
    """``render --seed k`` is replicate k of the same cell in a grid, and says the spp that was really rendered."""
    words = ("render", "cornell_box", "--sampler", "stratified", "--spp", 5, "--size", "16x12", "--max-depth", 4)
    told = json.loads(dartboard(*words, "--seed", 1, "-o", tmp_path / "a.exr", "--json").stdout)
    assert (told["spp_actual"], told["width"], told["height"], told["max_depth"]) == (9, 16, 12, 4)
    grid = 'scenes = ["cornell_box"]\nsamplers = ["stratified"]\nspp = 5\nresolution = [16, 12]\nmax_depth = 4\n'
    (tmp_path / "grid.toml").write_text(grid + "replicates = 2\nreference = false\n")
    assert dartboard("run", tmp_path / "grid.toml", "--data", tmp_path / "data").returncode == 0
    (queued,) = (tmp_path / "data").glob(f"images/*/{told['digest']}/cell-001.exr")
    np.testing.assert_allclose(read_picture(tmp_path / "a.exr"), read_picture(queued), rtol=2e-5, atol=1e-6)
    assert read_header(tmp_path / "a.exr")["seed"] == read_header(queued)["seed"]


def test_measure_prints_every_metric(tmp_path: Path) -> None:
    """Constant pictures: every metric in closed form."""
    for name, value in (("a", 1.5), ("b", 1.0)):
        write_picture(tmp_path / f"{name}.exr", np.full((4, 6, 3), value), {})
    told = json.loads(dartboard("measure", tmp_path / "a.exr", tmp_path / "b.exr", "--json").stdout)
    values = {name: metric["value"] for name, metric in told["metrics"].items()}
    assert values == pytest.approx({"mse": 0.25, "relmse": 0.25 / 1.01, "mean_ratio": 1.5})
    assert "relmse" in dartboard("measure", tmp_path / "a.exr", tmp_path / "b.exr").stdout


def test_measure_refuses_sizes_that_differ(tmp_path: Path) -> None:
    write_picture(tmp_path / "a.exr", np.ones((4, 6, 3)), {})
    write_picture(tmp_path / "b.exr", np.ones((5, 6, 3)), {})
    refused(dartboard("measure", tmp_path / "a.exr", tmp_path / "b.exr"), 2, "6×4", "6×5")
    refused(dartboard("measure", tmp_path / "a.exr", tmp_path / "none.exr"), 2, "none.exr")


def test_data_directories_that_cannot_be_used_are_named(tmp_path: Path) -> None:
    (tmp_path / "grid.toml").write_text(TINY)
    (tmp_path / "file").write_text("")
    refused(dartboard("run", tmp_path / "grid.toml", "--data", tmp_path / "file"), 3, "file", "--data")
    refused(dartboard("results", "1", "--data", tmp_path / "none"), 3, "none", "dartboard run")
    (tmp_path / "garbage").mkdir()
    (tmp_path / "garbage" / "dartboard.sqlite").write_bytes(b"no database at all" * 100)
    for words in (("run", tmp_path / "grid.toml"), ("status",), ("results", "1"), ("check", tmp_path / "grid.toml")):
        refused(dartboard(*words, "--data", tmp_path / "garbage"), 3, "dartboard.sqlite")


def test_the_catalog_is_json_for_programs() -> None:
    told = json.loads(dartboard("catalog", "--json").stdout)
    assert {"samplers", "integrators", "rfilters", "scenes", "metrics"} <= set(told)
    names = [entry["name"] for entry in told["samplers"]]
    assert names[:5] == ["independent", "stratified", "multijitter", "orthogonal", "ldsampler"]  # Mitsuba's come first
    assert {"sobol", "halton", "poissondisk", "pointset"} <= set(names[5:])


def test_check_says_what_it_would_render(tmp_path: Path) -> None:
    (tmp_path / "grid.toml").write_text('scenes = ["defocus"]\nsamplers = ["ldsampler"]\nspp = [5]\nreplicates = 3\n')
    told = json.loads(dartboard("check", tmp_path / "grid.toml", "--data", tmp_path / "none", "--json").stdout)
    assert (told["cells"], told["references"], told["replicates"], told["reused"]) == (1, 1, 5, 0)
    assert {"sampler": "ldsampler", "asked": 5, "rendered": 16} in told["rounded"]
    assert not (tmp_path / "none").exists()


def test_a_home_that_cannot_be_written_costs_only_the_shared_cache(tmp_path: Path) -> None:
    """The kernels then lie in the data directory, and the run is none the worse."""
    (tmp_path / "grid.toml").write_text(TINY)
    (tmp_path / "no-folder").write_text("")
    environment = {"XDG_CACHE_HOME": str(tmp_path / "no-folder" / "cache")}
    done = dartboard("run", tmp_path / "grid.toml", "--data", tmp_path / "data", **environment)
    assert done.returncode == 0, done.stderr
    assert list((tmp_path / "data" / "kernels" / "builtin").glob("*.bin"))
