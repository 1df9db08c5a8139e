"""Tables are what the generators make, made once, whole or not at all, whoever asks at the same time."""

from __future__ import annotations

import subprocess
import sys
import threading
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from renderer.errors import BadParameter, UnknownName
from renderer.samplers import point_sets, store
from renderer.samplers.packing import MAX_POINTS
from renderer.samplers.pmj import pmj02bn
from renderer.samplers.point_sets import PointSets

ROOT = Path(__file__).resolve().parents[3]


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """An empty folder of tables for each test."""
    monkeypatch.setenv("DARTBOARD_TABLES", str(tmp_path / "tables"))
    return tmp_path / "tables"


class Counted:
    """A generator that counts how often it is asked."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch, kind: str = "poissondisk", version: int = 1):
        self.calls = 0
        make = store.GENERATORS[kind].make

        def counted(*args: int, **parameters: float) -> PointSets:
            self.calls += 1
            return make(*args, **parameters)

        monkeypatch.setitem(store.GENERATORS, kind, store.Generator(version, counted))


def kept(folder: Path) -> list[Path]:
    return sorted(folder.iterdir())


@pytest.mark.parametrize(
    ("kind", "parameters"),
    (("poissondisk", {}), ("poissondisk", {"min_dist": 0.1, "lloyd_iterations": 1}), ("relaxedpoissondisk", {}),
     ("eliminated", {}), ("replay_basic", {"fill": "zeros"}), ("replay_relaxed", {"fill": "zeros"}), ("pmj02bn", {})),
)  # fmt: skip
def test_what_is_read_is_what_was_made(kind: str, parameters: dict[str, float], folder: Path) -> None:
    made = store.load(kind, 16, 4, 3, **parameters)
    read = store.load(kind, 16, 4, 3, **parameters)
    assert [path.name for path in kept(folder)] == [path.name for path in folder.glob(f"{kind}-16-*.points")]
    assert made.points.shape == (4, 16, 2) and made.radius.shape == (4,)
    np.testing.assert_array_equal(read.points, made.points)
    np.testing.assert_array_equal(read.radius, made.radius)
    assert read.maximal == made.maximal == (kind == "poissondisk" and not parameters)


def test_tables_are_made_once(monkeypatch: pytest.MonkeyPatch) -> None:
    counted = Counted(monkeypatch)
    for _ in range(3):
        store.load("poissondisk", 16, 4)
    assert counted.calls == 1


def test_every_argument_and_the_version_make_another_table(monkeypatch: pytest.MonkeyPatch, folder: Path) -> None:
    first = store.load("poissondisk", 16, 4)
    for other in (
        store.load("poissondisk", 17, 4),
        store.load("poissondisk", 16, 5),
        store.load("poissondisk", 16, 4, 1),
        store.load("poissondisk", 16, 4, min_dist=0.1),
        store.load("poissondisk", 16, 4, min_dist=0.2),
        store.load("poissondisk", 16, 4, lloyd_iterations=1),
        store.load("relaxedpoissondisk", 16, 4),
    ):
        assert not np.array_equal(first.points, other.points)
    assert len(kept(folder)) == 8
    counted = Counted(monkeypatch, version=2)
    store.load("poissondisk", 16, 4)
    assert counted.calls == 1 and len(kept(folder)) == 9


def test_what_is_not_given_and_equal_numbers_are_the_same_table(folder: Path) -> None:
    store.load("relaxedpoissondisk", 16, 4, min_dist=None)
    store.load("relaxedpoissondisk", 16, 4)
    assert len(kept(folder)) == 1
    store.load("relaxedpoissondisk", 16, 4, min_dist=1)
    store.load("relaxedpoissondisk", 16, 4, min_dist=1.0)
    assert len(kept(folder)) == 2


@settings(max_examples=25, deadline=None)
@given(data=st.data())
def test_a_damaged_file_is_made_again(data: st.DataObject) -> None:
    """Cut anywhere, a bit turned anywhere, or empty."""
    good = store.load("eliminated", 4, 2)
    (path,) = kept(store.folder())
    whole = path.read_bytes()
    place = data.draw(st.integers(0, len(whole) - 1), "place")
    cut = data.draw(st.booleans(), "cut")
    path.write_bytes(whole[:place] if cut else whole[:place] + bytes([whole[place] ^ 1]) + whole[place + 1 :])
    np.testing.assert_array_equal(store.load("eliminated", 4, 2).points, good.points)
    assert path.read_bytes() == whole


def test_a_file_under_a_wrong_name_is_not_read(folder: Path) -> None:
    right = store.load("poissondisk", 16, 4, 1)
    (path,) = kept(folder)
    store.load("poissondisk", 16, 4, 2)
    (other,) = set(kept(folder)) - {path}
    path.write_bytes(other.read_bytes())
    np.testing.assert_array_equal(store.load("poissondisk", 16, 4, 1).points, right.points)


def test_threads_that_ask_together_make_one_table(monkeypatch: pytest.MonkeyPatch, folder: Path) -> None:
    counted, start = Counted(monkeypatch), threading.Barrier(6)

    def ask(_: int) -> PointSets:
        start.wait()
        return store.load("poissondisk", 32, 4)

    with ThreadPoolExecutor(6) as pool:
        answers = list(pool.map(ask, range(6)))
    assert counted.calls == 1 and len(kept(folder)) == 1
    assert all(np.array_equal(answer.points, answers[0].points) for answer in answers)


def test_processes_that_ask_together_get_the_same_whole_table(folder: Path) -> None:
    """They begin on one word, so that both find the folder empty."""
    code = (
        "import hashlib, sys\n"
        "from renderer.samplers import store\n"
        "print('ready', flush=True); sys.stdin.readline()\n"
        "print(hashlib.sha256(store.load('poissondisk', 64, 16).points.tobytes()).hexdigest())\n"
    )
    asking = [
        subprocess.Popen(
            [sys.executable, "-c", code], cwd=ROOT, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
        )
        for _ in range(2)
    ]
    for process in asking:
        assert process.stdout and process.stdout.readline() == "ready\n"
    for process in asking:
        assert process.stdin
        process.stdin.write("go\n")
        process.stdin.flush()
    answers = {process.communicate(timeout=60)[0] for process in asking}
    assert all(process.returncode == 0 for process in asking)
    assert len(answers) == 1 and len(kept(folder)) == 1


def test_a_folder_that_cannot_be_written_only_keeps_nothing(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    (tmp_path / "file").write_text("not a folder")
    monkeypatch.setenv("DARTBOARD_TABLES", str(tmp_path / "file" / "tables"))
    counted = Counted(monkeypatch)
    first, second = store.load("poissondisk", 16, 4), store.load("poissondisk", 16, 4)
    np.testing.assert_array_equal(first.points, second.points)
    assert counted.calls == 2


def test_a_disk_that_is_full_leaves_nothing_behind(monkeypatch: pytest.MonkeyPatch, folder: Path) -> None:
    def full(*_: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("renderer.samplers.store.os.replace", full)
    assert store.load("poissondisk", 16, 4).points.shape == (4, 16, 2)
    assert kept(folder) == []


def test_the_folder_is_the_users_cache_unless_told(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    assert store.folder() == tmp_path / "tables"
    monkeypatch.delenv("DARTBOARD_TABLES")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    assert store.folder() == tmp_path / "cache" / "dartboard" / "tables"
    monkeypatch.delenv("XDG_CACHE_HOME")
    monkeypatch.setenv("HOME", str(tmp_path))
    assert store.folder() == tmp_path / ".cache" / "dartboard" / "tables"


def test_nets_are_kept_to_the_last_bit() -> None:
    bits = store.load("pmj02bn", 64, 2, 5).points * 2.0**32
    np.testing.assert_array_equal(bits, pmj02bn(64, 2, 5))


@given(n=st.integers(1, MAX_POINTS))
def test_samplers_keep_a_power_of_two_of_sets_and_a_bounded_table(n: int) -> None:
    sets = store.sets_for(n)
    assert sets & (sets - 1) == 0 and 4 <= sets <= 64
    assert sets == 64 or n > 1024
    assert sets == 4 or sets * n <= store.MAX_TABLE_POINTS


def test_what_cannot_be_asked_is_refused_in_a_sentence() -> None:
    with pytest.raises(UnknownName, match="did you mean 'eliminated'"):
        store.load("eliminate", 16, 4)
    for n, sets in ((0, 1), (MAX_POINTS + 1, 1), (16, 0)):
        with pytest.raises(BadParameter, match="sobol"):
            store.load("poissondisk", n, sets)
    with pytest.raises(BadParameter, match=str(MAX_POINTS)):
        store.sets_for(MAX_POINTS + 1)
    with pytest.raises(BadParameter, match="feasible"):
        store.load("poissondisk", 16, 4, min_dist=0.9)


def test_generators_make_what_their_kinds_are_called() -> None:
    for kind in ("poissondisk", "relaxedpoissondisk", "eliminated"):
        direct = getattr(point_sets, kind)(9, 2, 1)
        np.testing.assert_array_equal(store.load(kind, 9, 2, 1).points, direct.points)
