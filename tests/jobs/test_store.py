"""The store: transactions, readers beside a writer, and what it says when a disk or a file is bad."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import apsw
import pytest

from jobs import experiments
from jobs.errors import DataDirectoryProblem
from jobs.store import FILE, Store, refuse_unsound
from tests.jobs.conftest import assert_sound, dump, select, submit, without_rights, work_off

PAGE = 4096  # bytes


def test_what_was_committed_is_read_by_the_next_owner(data):
    store = Store.open(data)
    submit(store)
    work_off(store)
    before = dump(store)
    store.close()
    again = Store.open(data)
    assert dump(again) == before
    again.close()


def test_a_transaction_is_all_or_nothing_also_inside_another(store):
    submit(store)
    before = dump(store)
    with pytest.raises(ZeroDivisionError), store.transaction():
        with store.transaction():
            store.insert("add_event", at="now", what="submit", cell_id=None, experiment_id=None)
        raise ZeroDivisionError
    assert dump(store) == before


def test_the_revision_grows_with_every_event_and_survives(data):
    store = Store.open(data)
    assert store.revision() == 0
    seen = [store.insert("add_event", at="now", what="x", cell_id=None, experiment_id=None) for _ in range(3)]
    assert seen == [1, 2, 3]
    assert store.revision() == 3
    store.close()
    assert Store.read(data).revision() == 3


def test_a_reader_sees_the_last_commit_and_cannot_write(store, data):
    reader = Store.read(data)
    with store.transaction():
        store.insert("add_event", at="now", what="x", cell_id=None, experiment_id=None)
        assert reader.revision() == 0
    assert reader.revision() == 1
    with pytest.raises(DataDirectoryProblem, match="cannot be written"):
        reader.insert("add_event", at="now", what="x", cell_id=None, experiment_id=None)


def test_queries_of_one_moment_agree_while_the_owner_writes(store, data):
    reader = Store.read(data)
    with reader.moment():
        assert reader.revision() == 0
        store.insert("add_event", at="now", what="x", cell_id=None, experiment_id=None)
        with reader.moment():
            assert reader.revision() == 0
    assert reader.revision() == 1
    with pytest.raises(ZeroDivisionError), reader.moment():
        raise ZeroDivisionError
    with store.moment(), reader.moment():
        assert store.revision() == reader.revision() == 1
    with store.transaction(), store.moment():  # an owner's look at what it is about to commit
        store.insert("add_event", at="now", what="x", cell_id=None, experiment_id=None)
        assert store.revision() == 2
    assert reader.revision() == 2


WRITER = """
import sys
from pathlib import Path
from jobs.store import Store
from tests.jobs.conftest import submit, work_off
store = Store.open(Path(sys.argv[1]))
for replicates in range(1, 1000):
    submit(store, spp=list(range(1, 9)), replicates=replicates, reference=False)
    work_off(store)
    print(replicates, flush=True)
"""


def test_readers_beside_a_writing_process_always_see_a_consistent_state(data):
    """Each look is one moment: what experiments had of pictures is what there is of them."""
    command = [sys.executable, "-c", WRITER, str(data)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, cwd=_root(), env=_environment()) as writer:
        try:
            writer.stdout.readline()
            moments = set()
            for _ in range(300):
                reader = Store.read(data)
                ((had, newest, pictures, replicates),) = select(
                    reader,
                    "select sum(had), (select max(id) from experiment), (select count(*) from replicate), "
                    "max(replicates) from experiment_cell where experiment_id = (select max(id) from experiment)",
                )
                assert had == pictures, "an experiment and the pictures were read at different moments"
                assert newest == replicates
                moments.add(pictures)
                reader.close()
            assert len(moments) > 1, "the writer did not move"
        finally:
            writer.kill()
    store = Store.open(data)
    assert_sound(store)
    store.close()


@pytest.mark.parametrize("version", ["3.7.0", "3.40.1", "3.51.2"])
def test_an_sqlite_with_the_wal_reset_bug_is_refused_with_the_cure(version):
    with pytest.raises(DataDirectoryProblem, match=f"SQLite {version}, which can corrupt .* pip install .* apsw"):
        refuse_unsound(version)


@pytest.mark.parametrize("version", ["3.51.3", "3.54.1", "4.0.0", apsw.sqlite_lib_version()])
def test_a_sound_sqlite_is_used(version):
    refuse_unsound(version)


@pytest.mark.parametrize("make", [lambda data: None, Path.mkdir, lambda data: (data.mkdir(), (data / FILE).touch())])
def test_reading_where_nothing_is_says_how_to_make_something(data, make):
    make(data)
    told = f"no experiments in {data}.* make one with .dartboard run GRID"
    with pytest.raises(DataDirectoryProblem, match=told) as error:
        Store.read(data)
    assert error.value.exit_code == 3


def test_a_file_in_place_of_the_directory_is_named(tmp_path):
    file = tmp_path / "notes.txt"
    file.write_text("mine")
    with pytest.raises(DataDirectoryProblem, match=r"notes.txt is a file, .* choose another --data DIR"):
        Store.open(file)
    with pytest.raises(DataDirectoryProblem, match=r"no experiments in .*notes.txt"):
        Store.read(file)
    assert file.read_text() == "mine"


@pytest.mark.parametrize("open_store", [Store.open, Store.read])
def test_a_file_that_is_no_database_is_named_and_left_alone(data, open_store):
    data.mkdir()
    (data / FILE).write_bytes(b"something else entirely" * 100)
    with pytest.raises(DataDirectoryProblem, match=r"is damaged or no database of ours .* choose another --data DIR"):
        open_store(data)
    assert (data / FILE).read_bytes() == b"something else entirely" * 100


def test_a_damaged_page_is_named_when_it_is_met(data):
    store = Store.open(data)
    submit(store, spp=list(range(1, 200)))
    store.close()
    with (data / FILE).open("r+b") as file:
        file.seek(PAGE)  # the first one holds the header and the schema
        file.write(b"\xee" * ((data / FILE).stat().st_size - PAGE))
    with pytest.raises(DataDirectoryProblem, match="is damaged"):
        experiments.everything(Store.read(data))


def test_a_full_disk_rolls_back_and_says_so_and_work_goes_on_when_there_is_space(store):
    submit(store)
    before = dump(store)
    (pages,) = select(store, "pragma page_count")[0]
    store.connection.pragma("max_page_count", pages + 2)
    with pytest.raises(DataDirectoryProblem, match=r"the disk of the data directory .* is full; free some space"):
        submit(store, spp=list(range(1, 500)))
    assert dump(store) == before
    store.connection.pragma("max_page_count", 2**30)
    submit(store, spp=list(range(1, 500)))
    assert_sound(store)


FULL = """
import sys
from pathlib import Path
from jobs import experiments
from jobs.errors import DataDirectoryProblem
from jobs.store import Store
from tests.jobs.conftest import assert_sound, submit
data = Path(sys.argv[1]) / "data"
try:
    store = Store.open(data)
    for replicates in range(1, 100):
        submit(store, spp=list(range(1, 200)), replicates=replicates)
except DataDirectoryProblem as error:
    print(error)
for file in data.parent.glob("*.bin"):
    file.unlink()
store = Store.open(data)
assert_sound(store)
assert [item.id for item in experiments.everything(store)] == list(range(1, replicates))
"""


def test_a_disk_that_is_really_full_is_told_and_nothing_is_half_written(tmp_path):
    """On a small file system of its own, with the rest of it taken by another file."""
    alone = ["unshare", "--user", "--map-root-user", "--mount"]
    if (
        not shutil.which("unshare")
        or subprocess.run([*alone, "mount", "-t", "tmpfs", "none", str(tmp_path)], capture_output=True).returncode
    ):
        pytest.skip("this machine lets no user mount a small file system")
    script = 'mount -t tmpfs -o size=3m none "$1" && head -c 1m /dev/zero > "$1/other.bin" && "$2" -c "$3" "$1"'
    command = [*alone, "sh", "-c", script, "sh", str(tmp_path), sys.executable, FULL]
    told = subprocess.run(command, capture_output=True, text=True, cwd=_root(), env=_environment())
    assert told.returncode == 0, told.stderr
    assert "is full; free some space" in told.stdout


def test_a_directory_without_rights_is_named(public_folder):
    (public_folder / "data").mkdir(mode=0o755)
    for data in (public_folder / "data", public_folder / "new"):
        error = without_rights(lambda data=data: Store.open(data))
        assert isinstance(error, DataDirectoryProblem)
        assert f"{data}" in str(error) and "writable" in str(error) and "--data DIR" in str(error)


def test_a_directory_that_cannot_be_written_is_read(public_folder):
    """A finished study on a read-only medium, or of another user."""
    store = Store.open(public_folder)
    submit(store)
    work_off(store)
    expected = dump(store)
    store.close()
    assert sorted(path.name for path in public_folder.iterdir()) == [FILE, "scenes"]
    assert without_rights(lambda: dump(Store.read(public_folder))) == expected
    refused = without_rights(lambda: submit(Store.read(public_folder), spp=[7]))
    assert isinstance(refused, DataDirectoryProblem)


def test_commits_that_a_killed_owner_left_in_the_log_are_read_also_where_nobody_can_write(public_folder):
    """Immutable mode, the usual way to read such a file, would not see them."""
    child = os.fork()
    if child == 0:
        store = Store.open(public_folder)
        submit(store)
        work_off(store)
        os.kill(os.getpid(), 9)
    os.waitpid(child, 0)
    assert (public_folder / f"{FILE}-wal").stat().st_size > 0
    (public_folder / f"{FILE}-shm").unlink()
    for file in public_folder.glob(f"{FILE}*"):
        file.chmod(0o444)
    seen = without_rights(lambda: dump(Store.read(public_folder)))
    assert len(seen["replicate"]) == 6
    assert seen == dump(Store.read(public_folder))


def test_a_database_held_by_another_program_is_told_after_a_while(store, data, monkeypatch):
    other = apsw.Connection(str(data / FILE))
    other.execute("begin immediate")
    store.connection.set_busy_timeout(1)
    with pytest.raises(DataDirectoryProblem, match="another program has held"), store.transaction():
        pass
    other.execute("rollback")
    with store.transaction():
        pass


def test_the_store_is_light_to_import():
    """`status` and `--help` answer at once: no numpy, no Mitsuba."""
    code = "import sys; from jobs import artifacts, inbox, owner, store; print({'numpy', 'mitsuba'} & {*sys.modules})"
    told = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, cwd=_root(), env=_environment())
    assert told.stdout == "set()\n", told.stderr


def _root() -> Path:
    return Path(__file__).parents[2]


def _environment() -> dict[str, str]:
    return {**os.environ, "PYTHONPATH": str(_root())}
