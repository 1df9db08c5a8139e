"""
The command line beside a server: the same grids, words, tables and exit codes as without one, while servers die, come
back, and terminals are closed. Real processes, real sockets; what happens when is read from the processes' own words.
"""

from __future__ import annotations

import json
import os
import re
import signal
import socket
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from jobs import grid as grids
from renderer.errors import DartboardError
from service.remote import submit_grid

ROOT = Path(__file__).resolve().parent.parent.parent
GRID = """
name = "small"
scenes = ["cornell_box"]
samplers = ["independent", "stratified"]
spp = [4, 16]
replicates = 2
resolution = [24, 16]
reference = { spp = 64 }
"""
PICTURES = 2 * 2 * 2 + 2
LONG = GRID.replace("[4, 16]", "[4, 16, 400, 401]").replace("[24, 16]", "[64, 64]")


MANY = list(range(1, 1001))


def command(*words: object) -> list[str]:
    return [sys.executable, "-m", "service.cli", *map(str, words)]


def environment(**more: str) -> dict[str, str]:
    kept = {name: value for name, value in os.environ.items() if not name.startswith("DARTBOARD_")}
    return {**kept, "PYTHONPATH": str(ROOT), "COLUMNS": "120", **more}


def dartboard(*words: object, cwd: Path = ROOT, **more: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        command(*words), cwd=cwd, capture_output=True, text=True, timeout=300, env=environment(**more)
    )


def start(*words: object) -> subprocess.Popen[str]:
    """A command in the background that hears Ctrl-C, whatever the shell of these tests makes of it."""
    return subprocess.Popen(
        command(*words), cwd=ROOT, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, env=environment(),
        process_group=0,
    )  # fmt: skip


def wait_for(process: subprocess.Popen[str], pattern: str) -> str:
    """Read stderr up to a line with this pattern; what was read."""
    assert process.stderr is not None
    seen = ""
    for line in process.stderr:
        seen += line
        if re.search(pattern, line):
            return seen
    raise AssertionError(f"it ended without {pattern!r}:\n{seen}")


class Server:
    """``dartboard serve`` on a free port; ``again`` starts it anew on the same one."""

    def __init__(self, data: Path):
        self.data, self.port = data, 0
        self.start()

    def start(self) -> None:
        self.process = start("serve", "--port", self.port, "--data", self.data)
        match = re.search(r"(http://127\.0\.0\.1:(\d+)) shows", wait_for(self.process, " shows "))
        assert match
        self.url, self.port = match[1], int(match[2])

    def stop(self, number: signal.Signals = signal.SIGTERM) -> None:
        self.process.send_signal(number)
        self.process.communicate(timeout=30)


@contextmanager
def serving(data: Path) -> Iterator[Server]:
    server = Server(data)
    try:
        yield server
    finally:
        if server.process.poll() is None:
            server.stop(signal.SIGKILL)


@pytest.fixture
def server(tmp_path: Path) -> Iterator[Server]:
    with serving(tmp_path / "data") as server:
        yield server


@pytest.fixture(scope="module")
def done(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Server]:
    """A server with the small grid finished, for tests that only read, or are refused."""
    folder = tmp_path_factory.mktemp("done")
    (folder / "grid.toml").write_text(GRID)
    with serving(folder / "data") as server:
        assert dartboard("submit", folder / "grid.toml", "--server", server.url, "--wait").returncode == 0
        yield server


@pytest.fixture
def grid(tmp_path: Path) -> Path:
    (tmp_path / "grid.toml").write_text(GRID)
    return tmp_path / "grid.toml"


@pytest.fixture
def long(tmp_path: Path) -> Path:
    """A grid that is still running when a test has seen its first cells."""
    (tmp_path / "long.toml").write_text(LONG)
    return tmp_path / "long.toml"


def experiment(where: Server, name: str = "small") -> dict:
    told = json.loads(dartboard("status", name, "--server", where.url, "--json").stdout)
    return told["experiments"][0]


# -- submitting --


def test_submit_says_where_to_look(server: Server, grid: Path) -> None:
    """And submitting the same grid again makes nothing new."""
    told = dartboard("submit", grid, "--server", server.url)
    assert told.returncode == 0, told.stderr
    assert told.stdout == (
        f"small is experiment 1: 4 cells, 1 for reference, 0 of 10 pictures are there\n{server.url}/experiments/1\n"
    )
    again = json.loads(dartboard("submit", grid, "--json", DARTBOARD_SERVER=server.url).stdout)
    assert (again["id"], again["new"], again["wanted"]) == (1, False, PICTURES)


def test_submit_and_wait_is_like_run(server: Server, grid: Path) -> None:
    """A line per cell, the table at the end; the table of the data directory is the same."""
    waited = dartboard("submit", grid, "--server", server.url, "--wait")
    assert waited.returncode == 0, waited.stderr
    assert len(re.findall(r"^ +\d+/10  cornell_box · path · ", waited.stderr, re.MULTILINE)) >= 4
    assert waited.stdout == dartboard("results", "small", "--data", server.data, "--format", "table").stdout
    as_json = json.loads(dartboard("submit", grid, "--server", server.url, "--wait", "--json").stdout)
    assert (as_json["state"], as_json["pictures"], as_json["interrupted"]) == ("done", PICTURES, False)
    assert {point["metric"] for point in as_json["points"]} >= {"mse", "mse_cross", "relmse", "mean_ratio"}
    assert as_json == json.loads(dartboard("run", grid, "--data", server.data, "--json").stdout)


def test_run_beside_a_server_submits_to_it(server: Server, grid: Path) -> None:
    """The owner stays the owner; without the server, nothing is left to do."""
    ran = dartboard("run", grid, "--data", server.data, "--device", "llvm")
    assert ran.returncode == 0, ran.stderr
    assert f"the server at {server.url} owns {server.data}" in ran.stderr
    assert "--device llvm does not count here" in ran.stderr
    assert server.process.poll() is None
    assert ran.stdout == dartboard("results", "small", "--server", server.url, "--format", "table").stdout
    server.stop()
    alone = dartboard("run", grid, "--data", server.data)
    assert alone.returncode == 0
    assert "nothing to do: all 10 pictures" in alone.stderr
    assert alone.stdout == ran.stdout


def test_scenes_beside_the_grid_are_sent(server: Server, tmp_path: Path) -> None:
    """Once, with nothing but their files; the same grid run without a server is the same experiment."""
    room = tmp_path / "grids/rooms/one"
    (room / "meshes").mkdir(parents=True)
    (room / "room.xml").write_text(ROOM)
    (room / "meshes/wall.obj").write_text("v -9 -9 -5\nv 9 -9 -5\nv 9 9 -5\nv -9 9 -5\nf 1 2 3 4\n")
    (room / "notes.txt").write_text("not part of it")
    grid = tmp_path / "grids/grid.toml"
    grid.write_text(GRID.replace("cornell_box", "rooms/one/room.xml").replace("[4, 16]", "[4]"))
    sent = dartboard("submit", grid, "--server", server.url, "--wait", cwd=tmp_path)
    assert sent.returncode == 0, sent.stderr
    assert "sending scene rooms/one/room.xml: 2 files" in sent.stderr
    (kept,) = (path for path in (server.data / "scenes").iterdir() if (path / "room.xml").exists())
    assert sorted(path.name for path in kept.rglob("*") if path.is_file()) == ["room.xml", "wall.obj"]
    again = dartboard("submit", grid, "--server", server.url, "--wait")
    assert "sending" not in again.stderr and "that grid was there already" in again.stderr
    server.stop()
    assert "nothing to do" in dartboard("run", grid, "--data", server.data).stderr


ROOM = """<scene version="3.0.0">
  <integrator type="path"><integer name="max_depth" value="3"/></integrator>
  <sensor type="perspective"><film type="hdrfilm"/></sensor>
  <emitter type="constant"/>
  <shape type="obj"><string name="filename" value="meshes/wall.obj"/></shape>
</scene>"""


def test_failed_cells_are_told_with_their_logs(server: Server, tmp_path: Path) -> None:
    """A mesh that nobody can read: the cells fail, the command says why and where to read more, exit code 1."""
    (tmp_path / "room").mkdir()
    (tmp_path / "room/scene.xml").write_text(ROOM.replace("meshes/wall.obj", "wall.obj"))
    (tmp_path / "room/wall.obj").write_text("f 1 2 3\n")
    (tmp_path / "grid.toml").write_text(GRID.replace("cornell_box", "room"))
    waited = dartboard("submit", tmp_path / "grid.toml", "--server", server.url, "--wait")
    assert waited.returncode == 1, waited.stderr
    assert "scene_error in room · path · independent · 4 spp" in waited.stderr
    assert f"(log: {server.url}/api/cells/" in waited.stderr
    assert "Traceback" not in waited.stderr
    told = dartboard("status", "small", "--server", server.url)
    assert "failed" in told.stdout and "cells failed" in told.stderr
    retried = dartboard("retry", "small", "--server", server.url)
    assert "pictures of 'small' are queued" in retried.stdout


# -- accidents --


def test_a_server_that_is_killed_is_waited_for(server: Server, long: Path) -> None:
    """kill -9 while a command follows: it says so, connects again, and ends as if nothing had been."""
    with start("submit", long, "--server", server.url, "--wait") as waiting:
        wait_for(waiting, r"^ +\d+/\d+ ")
        server.stop(signal.SIGKILL)
        wait_for(waiting, f"the server at {server.url} does not answer; trying again")
        server.start()
        wait_for(waiting, f"the server at {server.url} is back")
        out, err = waiting.communicate(timeout=300)
    assert waiting.returncode == 0, err
    assert "cornell_box · path" in out
    assert experiment(server)["state"] == "done"


@pytest.mark.parametrize(
    ("number", "words"), [(signal.SIGINT, ("submit", "--wait", "--server")), (signal.SIGTERM, ("run", "--data"))]
)
def test_ctrl_c_lets_go(server: Server, long: Path, number: signal.Signals, words: tuple[str, ...]) -> None:
    """The command ends with 130 and says how to stop the server, which works on."""
    place = server.url if words[-1] == "--server" else server.data
    with start(words[0], long, *words[1:], place) as waiting:
        wait_for(waiting, r"^ +\d+/\d+ ")
        waiting.send_signal(number)
        out, err = waiting.communicate(timeout=10)
    assert waiting.returncode == 130, err
    assert f"the server at {server.url} goes on with 'small'" in err
    assert f"`dartboard cancel 1 --server {server.url}` stops it" in err
    assert "Traceback" not in err and out == ""
    assert experiment(server)["state"] in ("running", "queued", "done")
    cancelled = dartboard("cancel", "1", "--server", server.url)
    assert "'small' is cancelled; " in cancelled.stdout


def test_an_experiment_that_is_deleted_ends_the_waiting(server: Server, long: Path) -> None:
    import httpx

    with start("submit", long, "--server", server.url, "--wait") as waiting:
        wait_for(waiting, r"^ +\d+/\d+ ")
        httpx.delete(f"{server.url}/api/experiments/1", trust_env=False).raise_for_status()
        _, err = waiting.communicate(timeout=30)
    assert waiting.returncode == 2
    assert "experiment 1 was deleted" in err and "Traceback" not in err


def test_a_cancelled_experiment_ends_the_waiting(server: Server, long: Path) -> None:
    """Cancelled from another terminal: exit code 1, and the way to go on."""
    with start("run", long, "--data", server.data) as waiting:
        wait_for(waiting, r"^ +\d+/\d+ ")
        assert dartboard("cancel", "small", "--data", server.data).returncode == 0
        _, err = waiting.communicate(timeout=30)
    assert waiting.returncode == 1
    assert f"`dartboard retry 1 --server {server.url}` goes on" in err


def test_pause_and_resume(server: Server, long: Path) -> None:
    """With the server's address, or with the data directory that it owns: either way the server does it."""
    there, beside = ("--server", server.url), ("--data", server.data)
    with start("submit", long, "--server", server.url, "--wait") as waiting:
        wait_for(waiting, r"^ +\d+/\d+ ")
        assert "'small' is paused; " in dartboard("pause", "small", *there).stdout
        wait_for(waiting, "paused: `dartboard resume 1 ")
        assert experiment(server)["state"] == "paused"
        assert "pictures of 'small' are queued" in dartboard("resume", "1", *beside).stdout
        wait_for(waiting, r"^ +\d+/\d+ ")
        waiting.send_signal(signal.SIGINT)
        waiting.communicate(timeout=10)
    assert "'small' is cancelled; " in dartboard("cancel", "small", *beside).stdout
    assert "'small' is cancelled; " in dartboard("resume", "small", *there).stdout  # it was not paused
    assert "pictures of 'small' are queued" in dartboard("retry", "small", *beside).stdout


# -- reading --


@pytest.mark.parametrize("form", ["csv", "json"])
def test_results_are_those_of_the_data_directory(done: Server, tmp_path: Path, form: str) -> None:
    over_http = dartboard("results", "small", "--server", done.url, "--format", form)
    assert over_http.returncode == 0, over_http.stderr
    assert over_http.stdout == dartboard("results", "small", "--data", done.data, "--format", form).stdout
    written = dartboard("results", "1", "--server", done.url, "--format", form, "-o", tmp_path / "out")
    assert written.returncode == 0
    assert (tmp_path / "out").read_text() == over_http.stdout


def test_status_over_http(done: Server) -> None:
    told = dartboard("status", "--server", done.url)
    assert re.search(r"1\s+small\s+done\s+4/4\s+1/1\s+10/10", told.stdout)
    assert f"the server at {done.url} is idle; 0 cells wait" in told.stdout
    beside = dartboard("status", "--data", done.data)
    assert f"is in use by process {done.process.pid}, a server at {done.url}" in beside.stdout


def test_a_report_is_written_by_the_server_or_beside_it(done: Server, tmp_path: Path) -> None:
    for place in (("--server", done.url), ("--data", done.data)):
        file = tmp_path / f"{place[0][2:]}.html"
        told = dartboard("report", "small", *place, "--format", "html", "-o", file)
        assert told.returncode == 0, told.stderr
        assert "<html" in file.read_text()[:500]
    (tmp_path / "grid.toml").write_text(GRID)
    ran = dartboard("run", tmp_path / "grid.toml", "--data", done.data, "--report", tmp_path / "run.html")
    assert ran.returncode == 0, ran.stderr
    assert "<html" in (tmp_path / "run.html").read_text()[:500]


@pytest.mark.parametrize("words", [("--help",), ("check", "GRID"), ("results", "small"), ("status",)])
def test_commands_without_a_server_load_no_http(done: Server, tmp_path: Path, words: tuple[str, ...]) -> None:
    (tmp_path / "grid.toml").write_text(GRID)
    words = tuple(str(tmp_path / "grid.toml") if word == "GRID" else word for word in words)
    code = (
        f"import sys; sys.argv[1:] = {list(words)!r}\nfrom service import cli\n"
        "try:\n    cli.main()\nexcept SystemExit as end:\n    assert not end.code\n"
        "assert not {'httpx', 'fastapi', 'uvicorn', 'starlette'} & set(sys.modules)"
    )
    ran = subprocess.run(
        [sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True,
        env=environment(DARTBOARD_DATA=str(done.data)),
    )  # fmt: skip
    assert ran.returncode == 0, ran.stderr


# -- refusals --


@pytest.mark.parametrize(
    "content",
    [
        'scenes = ["cornel_box"]',
        'scenes = ["cornell_box"]\nsamplers = ["poisondisk"]\nspp = [0, -1]',
        'scenes = ["cornell_box"',
        "",
        "scenes = []",
        "name = 3",
        'scenes = ["none.xml", 3]\nsamplers = ["poisondisk"]',
        'scenes = ["plugin.xml"]',
        'scenes = ["cornell_box"]\nspp = [1, 2]\n[scene.elsewhere]\nmax_depth = 3',
        f"scenes = ['cornell_box']\nspp = {MANY}\nintegrators = {[f'path:rr_depth={n}' for n in MANY]}",
    ],
)
def test_a_bad_grid_is_refused_in_the_words_of_check(done: Server, tmp_path: Path, content: str) -> None:
    (tmp_path / "grid.toml").write_text(content)
    (tmp_path / "plugin.xml").write_text('<scene version="3.0.0"><bsdf type="no_such_plugin"/></scene>')
    with pytest.raises(DartboardError) as known:
        grids.read(tmp_path / "grid.toml")
    with pytest.raises(DartboardError) as told:
        submit_grid(tmp_path / "grid.toml", done.url, wait=False, as_json=False)
    assert str(told.value) == str(known.value)
    assert told.value.exit_code == known.value.exit_code == 2


@pytest.mark.parametrize("name", ["none.toml", "latin.toml", "."])
def test_a_grid_that_cannot_be_read_is_refused_in_the_words_of_check(done: Server, tmp_path: Path, name: str) -> None:
    (tmp_path / "latin.toml").write_bytes(b'name = "\xe9"\nscenes = ["cornell_box"]')
    submitted = dartboard("submit", tmp_path / name, "--server", done.url)
    assert (submitted.returncode, submitted.stdout) == (2, "")
    assert submitted.stderr == dartboard("check", tmp_path / name).stderr != ""


def test_unknown_experiments_are_told_with_those_that_are_there(done: Server) -> None:
    for words in (("status", "nobody"), ("cancel", "77"), ("results", "a/b?c=d#e")):
        told = dartboard(*words, "--server", done.url)
        assert (told.returncode, told.stdout) == (2, ""), told.stderr
        assert words[1] in told.stderr and "1 (small)" in told.stderr
        assert "Traceback" not in told.stderr


@pytest.mark.parametrize("words", [("status",), ("submit", "GRID")])
def test_a_server_that_is_not_there(grid: Path, words: tuple[str, ...]) -> None:
    with socket.create_server(("127.0.0.1", 0)) as taken:
        free = f"http://127.0.0.1:{taken.getsockname()[1]}"
    told = dartboard(*(grid if word == "GRID" else word for word in words), "--server", free)
    assert (told.returncode, told.stdout) == (3, "")
    assert told.stderr.startswith(f"dartboard: no server answers at {free} (Connection refused); start one with")
    assert told.stderr.count("\n") == 1


def test_a_port_in_use_and_a_data_directory_in_use(done: Server, tmp_path: Path) -> None:
    told = dartboard("serve", "--port", done.port, "--data", tmp_path / "other")
    assert told.returncode == 3
    assert f"port {done.port}" in told.stderr and "--port" in told.stderr and "Traceback" not in told.stderr
    assert not (tmp_path / "other").exists()
    told = dartboard("up", "--port", 0, "--data", done.data)
    assert told.returncode == 3
    assert str(done.process.pid) in told.stderr and done.url in told.stderr
    assert "Traceback" not in told.stderr


def test_off_loopback_a_token_is_needed(tmp_path: Path) -> None:
    told = dartboard("serve", "--host", "0.0.0.0", "--port", 0, "--data", tmp_path / "data")
    assert told.returncode in (2, 3)
    assert "DARTBOARD_TOKEN" in told.stderr


def test_a_report_that_cannot_be_written_is_refused_before_the_work(tmp_path: Path) -> None:
    (tmp_path / "grid.toml").write_text(GRID)
    told = dartboard("run", tmp_path / "grid.toml", "--data", tmp_path / "data", "--report", tmp_path / "none/out.html")
    assert told.returncode == 3
    assert "there is no folder" in told.stderr
    assert not (tmp_path / "data").exists()
