"""
A grid from the command line to its results, with the accidents that happen to real runs: real processes, real
signals, a real database. Whatever dies, the next run completes the grid and no finished picture is drawn twice.
"""

from __future__ import annotations

import csv
import io
import json
import os
import signal
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from renderer.images import read_header, read_picture

ROOT = Path(__file__).resolve().parent.parent.parent
PICTURES = 2 * 2 * 3 * 2 + 2 * 2  # scenes × samplers × spp × replicates, and two halves of two references
GRID = """
name = "small"
scenes = ["cornell_box", "defocus"]
samplers = ["independent", "stratified"]
spp = [4, 16, 256]
replicates = 2
resolution = [24, 16]
reference = { spp = 2048 }
"""


@pytest.fixture
def grid(tmp_path: Path) -> Path:
    file = tmp_path / "grid.toml"
    file.write_text(GRID)
    return file


@pytest.fixture
def data(tmp_path: Path) -> Path:
    return tmp_path / "data"


def command(*words: object) -> list[str]:
    return [sys.executable, "-m", "service.cli", *map(str, words)]


def dartboard(*words: object) -> subprocess.CompletedProcess[str]:
    return subprocess.run(command(*words), cwd=ROOT, capture_output=True, text=True, timeout=300)


def start(grid: Path, data: Path) -> subprocess.Popen[str]:
    """``dartboard run`` in the background; its progress lines come on stderr."""
    return subprocess.Popen(
        command("run", grid, "--data", data), cwd=ROOT, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True
    )


def wait_for_cells(process: subprocess.Popen[str], count: int) -> None:
    """Return when ``count`` cells have been reported done: the process's own words, no clock."""
    assert process.stderr is not None
    seen = 0
    for line in process.stderr:
        seen += " spp" in line and "/" in line.split()[0]
        if seen == count:
            return
    raise AssertionError(f"the run ended after {seen} of {count} cells")


def render_processes(owner: int) -> list[int]:
    """Living render processes that were started by ``owner``."""
    found = []
    for folder in Path("/proc").glob("[0-9]*"):
        try:
            words = (folder / "cmdline").read_bytes().split(b"\0")
            environment = (folder / "environ").read_bytes().split(b"\0")
        except OSError:
            continue
        if b"jobs.render_process" in words and f"DARTBOARD_OWNER={owner}".encode() in environment:
            found.append(int(folder.name))
    return found


def wait_gone(pids: list[int]) -> None:
    """Return when none of the processes lives; the test's timeout is the limit."""
    for pid in pids:
        try:
            handle = os.pidfd_open(pid)
        except ProcessLookupError:
            continue
        import select

        ended, _, _ = select.select([handle], [], [], 5)
        os.close(handle)
        assert ended, f"process {pid} is still there after 5 s"


def rows(data: Path) -> list[dict[str, str]]:
    done = dartboard("results", "small", "--format", "csv", "--data", data)
    assert done.returncode == 0, done.stderr
    return list(csv.DictReader(io.StringIO(done.stdout)))


def images(data: Path) -> dict[str, int]:
    """Every picture with its inode: a picture that is drawn again is another file."""
    return {str(path.relative_to(data)): path.stat().st_ino for path in data.glob("images/*/*/*.exr")}


@pytest.fixture
def complete(grid: Path, data: Path) -> Iterator[None]:
    """After the test's accident: the next run completes the grid, keeps what was there, and then has nothing to do."""
    yield
    before = images(data)
    done = dartboard("run", grid, "--data", data)
    assert done.returncode == 0, done.stderr
    after = images(data)
    assert len(after) == PICTURES
    found = rows(data)
    assert len(found) == 24
    assert {row["state"] for row in found} == {"done"}
    assert all(row[name] for row in found for name in ("mse", "mse_cross", "relmse", "render_seconds"))
    kept = {name for name in before if after[name] == before[name]}
    # only a picture whose row had not been committed when its process died may be drawn again
    assert len(before) - len(kept) <= 1, sorted(set(before) - kept)
    assert not list((data / "work").glob("*.exr"))


def test_a_grid_becomes_falling_errors(grid: Path, data: Path) -> None:
    """Every curve falls; a second run renders nothing; the CSV, the JSON and the pictures agree."""
    done = dartboard("run", grid, "--data", data)
    assert done.returncode == 0, done.stderr
    assert "cornell_box · path" in done.stdout
    found = rows(data)
    head = ["experiment", "scene", "integrator", "sampler", "spp", "spp_actual", "replicate"]
    assert list(found[0])[:7] == head
    assert list(found[0])[-3:] == ["render_seconds", "compile_seconds", "state"]
    for scene in ("cornell_box", "defocus"):
        for sampler in ("independent", "stratified"):
            curve = [
                sum(float(r["relmse"]) for r in found if (r["scene"], r["sampler"], r["spp"]) == (scene, sampler, spp))
                for spp in ("4", "16", "256")
            ]
            assert curve == sorted(curve, reverse=True), (scene, sampler, curve)

    before = images(data)
    again = dartboard("run", grid, "--data", data)
    assert again.returncode == 0
    assert "nothing to do" in again.stderr
    assert images(data) == before
    listed = json.loads(dartboard("results", "small", "--format", "json", "--data", data).stdout)
    assert [{k: "" if v is None else str(v) for k, v in row.items()} for row in listed] == found

    picture = next(data.glob("images/*/*/cell-000.exr"))
    header = read_header(picture)
    spec = json.loads(header["spec"])
    assert (spec["estimand"]["width"], spec["estimand"]["height"]) == (24, 16)
    assert read_picture(picture).shape == (16, 24, 3)
    assert header["digest"] == picture.parent.name
    assert set(json.loads(header["versions"])) == {"mitsuba", "drjit"}


def test_adding_an_spp_renders_only_that(grid: Path, data: Path) -> None:
    assert dartboard("run", grid, "--data", data).returncode == 0
    before = images(data)
    grid.write_text(GRID.replace("spp = [4, 16, 256]", "spp = [4, 16, 36, 256]"))
    checked = json.loads(dartboard("check", grid, "--data", data, "--json").stdout)
    assert checked["reused"] == PICTURES
    assert dartboard("run", grid, "--data", data).returncode == 0
    after = images(data)
    assert before.items() <= after.items()
    assert len(after) == PICTURES + 8


@pytest.mark.parametrize("cells", [1, 5, 9, 12])
def test_a_killed_owner_loses_nothing(grid: Path, data: Path, complete: None, cells: int) -> None:
    """kill -9 of the owner: its render process dies with it, and the next run goes on."""
    process = start(grid, data)
    wait_for_cells(process, cells)
    process.send_signal(signal.SIGSTOP)  # so that it does not get any further while we look
    children = render_processes(process.pid)
    assert len(children) == 1
    process.kill()
    process.wait()
    wait_gone(children)


def test_a_killed_render_process_is_replaced(grid: Path, data: Path, complete: None) -> None:
    """kill -9 of the child, twice: the run itself goes on to its end."""
    process = start(grid, data)
    for _ in range(2):
        wait_for_cells(process, 3)
        for child in render_processes(process.pid):
            os.kill(child, signal.SIGKILL)
    assert process.stderr is not None
    process.stderr.read()
    assert process.wait() == 0


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_signals_end_everything(grid: Path, data: Path, complete: None, number: signal.Signals) -> None:
    """Ctrl-C and SIGTERM: exit code 130 within 5 s, no orphan, what is finished is kept."""
    process = start(grid, data)
    wait_for_cells(process, 4)
    children = render_processes(process.pid)
    process.send_signal(number)
    assert process.wait(timeout=5) == 130
    wait_gone(children)
    assert len(images(data)) >= 8


def test_cancel_reaches_a_running_owner(grid: Path, data: Path) -> None:
    """``cancel`` from another terminal ends the run; ``retry`` and another run complete it."""
    process = start(grid, data)
    wait_for_cells(process, 3)
    process.send_signal(signal.SIGSTOP)  # a busy owner: it answers when it can
    with subprocess.Popen(command("cancel", "small", "--data", data), cwd=ROOT, stderr=subprocess.PIPE) as asking:
        while not list((data / "inbox").glob("*.json")):
            assert asking.poll() is None, asking.stderr
        process.send_signal(signal.SIGCONT)
    assert asking.returncode == 0
    assert process.wait(timeout=10) == 1
    states = {row["state"] for row in rows(data)}
    assert states == {"done", "cancelled"}
    assert dartboard("retry", "small", "--data", data).returncode == 0
    assert dartboard("run", grid, "--data", data).returncode == 0
    assert {row["state"] for row in rows(data)} == {"done"}


def test_one_owner_at_a_time(grid: Path, data: Path) -> None:
    """A second run on the same data directory is refused with the owner's pid, and disturbs nothing."""
    process = start(grid, data)
    wait_for_cells(process, 1)
    process.send_signal(signal.SIGSTOP)  # an owner that takes its time still owns
    refused = dartboard("run", grid, "--data", data)
    assert refused.returncode == 3
    assert str(process.pid) in refused.stderr
    assert "Traceback" not in refused.stderr
    status = json.loads(dartboard("status", "--data", data, "--json").stdout)
    assert status["owner"]["pid"] == process.pid
    process.send_signal(signal.SIGCONT)
    assert process.stderr is not None
    process.stderr.read()
    assert process.wait() == 0
    assert len(images(data)) == PICTURES
