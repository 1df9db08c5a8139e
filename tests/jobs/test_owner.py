"""One owner per data directory: by a lock that dies with its process."""

from __future__ import annotations

import errno
import fcntl
import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from jobs import owner
from jobs.errors import DataDirectoryProblem
from tests.jobs.conftest import without_rights

ROOT = Path(__file__).parents[2]

CANDIDATE = """
import sys
from pathlib import Path
from jobs import owner
from jobs.errors import DataDirectoryProblem
print("ready", flush=True)
sys.stdin.readline()
try:
    with owner.own(Path(sys.argv[1])):
        print("won", flush=True)
        sys.stdin.read()
except DataDirectoryProblem as error:
    print(error, flush=True)
"""


def candidate(data: Path) -> subprocess.Popen:
    command = [sys.executable, "-c", CANDIDATE, str(data)]
    process = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, cwd=ROOT)
    assert process.stdout.readline() == "ready\n"
    return process


def refused(data: Path, told: str) -> None:
    with pytest.raises(DataDirectoryProblem, match=told), owner.own(data):
        pass


def test_of_several_processes_exactly_one_wins(data):
    """All start at the same moment; the others name the winner."""
    racers = [candidate(data) for _ in range(3)]
    for racer in racers:
        racer.stdin.write("go\n")
        racer.stdin.flush()
    told = [racer.stdout.readline().strip() for racer in racers]
    assert told.count("won") == 1
    winner = racers[told.index("won")]
    for racer, line in zip(racers, told, strict=True):
        assert racer is winner or "is in use by" in line
    refused(data, f"in use by process {winner.pid}; wait .* or choose another --data DIR")
    assert owner.peek(data)["pid"] == winner.pid
    for racer in racers:
        racer.kill()
        racer.communicate()


def test_the_lock_of_a_killed_owner_is_taken_over(data):
    process = candidate(data)
    process.stdin.write("go\n")
    process.stdin.flush()
    assert process.stdout.readline() == "won\n"
    process.kill()
    process.communicate()
    assert json.loads((data / owner.FILE).read_text())["pid"] == process.pid, "the file still names the dead"
    assert owner.peek(data) is None
    with owner.own(data):
        assert owner.peek(data)["pid"] == os.getpid()


def test_owning_ends_with_the_block_also_when_it_breaks(data):
    with pytest.raises(ZeroDivisionError), owner.own(data):
        raise ZeroDivisionError
    assert owner.peek(data) is None
    with owner.own(data):
        pass


def test_the_owner_tells_where_it_is(data):
    with owner.own(data, "http://127.0.0.1:8000"):
        told = owner.peek(data)
        assert (told["pid"], told["url"]) == (os.getpid(), "http://127.0.0.1:8000")
        assert told["started"].startswith("20")
        refused(data, "at http://127.0.0.1:8000; wait")


def test_peeking_where_nobody_is_creates_nothing(data):
    assert owner.peek(data) is None
    assert not data.exists()


def test_somebody_who_peeks_does_not_keep_an_owner_out(data, monkeypatch):
    """A peek holds the lock for an instant; an owner tries again."""
    data.mkdir()
    peeking = os.open(data / owner.FILE, os.O_RDWR | os.O_CREAT)
    fcntl.flock(peeking, fcntl.LOCK_SH)
    monkeypatch.setattr(owner.time, "sleep", lambda seconds: fcntl.flock(peeking, fcntl.LOCK_UN))
    with owner.own(data):
        assert owner.peek(data)["pid"] == os.getpid()
    os.close(peeking)


@pytest.mark.parametrize("content", ["", "{", "[1]", "null", '{"pid": "?"}'])
def test_what_the_file_says_is_never_trusted(data, content):
    data.mkdir()
    (data / owner.FILE).write_text(content)
    assert owner.peek(data) is None
    with owner.own(data):
        (data / owner.FILE).write_text(content)
        assert isinstance(owner.peek(data), dict)
        refused(data, "is in use by")


def test_a_file_in_place_of_the_directory_is_named(tmp_path):
    (tmp_path / "notes.txt").write_text("mine")
    for data in (tmp_path / "notes.txt", tmp_path / "notes.txt" / "below"):
        refused(data, "a data directory is a folder; choose another --data DIR")


def test_a_directory_without_rights_is_named(public_folder):
    (public_folder / "data").mkdir(mode=0o755)

    def try_to_own(data):
        with owner.own(data):
            return "owned"

    for data in (public_folder / "data", public_folder / "new"):
        error = without_rights(lambda data=data: try_to_own(data))
        assert isinstance(error, DataDirectoryProblem)
        assert f"the data directory {data} cannot be written (Permission denied)" in str(error)


def test_a_full_disk_is_named(data, monkeypatch):
    def no_space(*arguments):
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(owner.os, "pwrite", no_space)
    refused(data, "is full; free some space")


def test_a_network_file_system_is_refused(data, monkeypatch):
    monkeypatch.setattr(owner, "file_system", lambda folder: "nfs4")
    refused(data, r"on a network file system \(nfs4\).* on a local disk")


def test_a_file_system_without_locks_is_named(data, monkeypatch):
    def no_locks(*arguments):
        raise OSError(errno.ENOLCK, "No locks available")

    monkeypatch.setattr(owner.fcntl, "flock", no_locks)
    refused(data, "without locks .* choose a --data DIR on a local disk")


def test_the_file_system_of_a_folder_is_that_of_the_nearest_mount():
    assert owner.file_system(Path("/proc/self")) == "proc"
    assert owner.file_system(Path("/")) not in ("", "proc")
