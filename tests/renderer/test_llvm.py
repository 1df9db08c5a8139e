"""
Laws of the LLVM choice: only what compiled in a child counts, and nobody's library can take this process down.

Fake libraries are files with a library's name; the real ones are this machine's.
"""

import os
import sys
from pathlib import Path

import pytest

from renderer import llvm, llvm_apt
from renderer.errors import EnvironmentProblem

LLVM_15 = Path("/usr/lib/x86_64-linux-gnu/libLLVM-15.so.1")


@pytest.fixture
def usable() -> llvm.Library:
    """A libLLVM that draws here: the one that the launcher prepared."""
    try:
        choice = llvm.choose()
    except EnvironmentProblem as error:
        pytest.skip(str(error))
    return llvm.Library(choice.path, choice.version, "system")


@pytest.fixture
def own_state(tmp_path, monkeypatch):
    """Verdicts of this test alone."""
    monkeypatch.setattr(llvm, "state_folder", lambda: tmp_path / "state")
    return tmp_path / "state"


def library_file(folder: Path, name: str, content: bytes = b"not a library") -> Path:
    folder.mkdir(parents=True, exist_ok=True)
    (folder / name).write_bytes(content)
    return folder / name


@pytest.mark.parametrize(
    ("name", "version"),
    [
        ("libLLVM-14.0.6.so.1", "14.0.6"),
        ("libLLVM-15.so.1", "15"),
        ("libLLVM-17.so", "17"),
        ("libLLVM.so.19.1", "19.1"),
        ("libLLVM.so", ""),
        ("libLLVM.dylib", ""),
    ],
)
def test_a_file_name_tells_the_version(tmp_path, name, version):
    path = library_file(tmp_path, name)
    assert llvm.find({}, [str(tmp_path)]) == [llvm.Library(path, version, "system")]


@pytest.mark.parametrize("name", ["libLLVM-18-rust-1.79.so", "libLLVM-C.so", "LLVMgold.so", "libLLVM.so.19.1.dwz"])
def test_other_libraries_are_not_candidates(tmp_path, name):
    library_file(tmp_path, name)
    assert llvm.find({}, [str(tmp_path)]) == []


def test_versions_known_to_work_are_tried_first_and_newest_first(tmp_path):
    for version in ("15", "18", "23", "19", "22"):
        library_file(tmp_path, f"libLLVM.so.{version}.1")
    (tmp_path / "libLLVM-19.so").symlink_to("libLLVM.so.19.1")  # the same library once more
    assert [one.major for one in llvm.find({}, [str(tmp_path)])] == [22, 19, 23, 18, 15]


def test_only_old_versions_give_the_cure_in_words(tmp_path):
    """A machine with 14 and 15 only: no library is tried, and the sentence names both and the commands."""
    for name in ("libLLVM-14.so.1", "libLLVM-15.so.1"):
        library_file(tmp_path, name)
    with pytest.raises(EnvironmentProblem, match="only 14 and 15.*apt-get install libllvm19") as caught:
        llvm.decide(llvm.find({}, [str(tmp_path)]))
    assert caught.value.exit_code == 3


def test_none_at_all_gives_the_cure_in_words():
    with pytest.raises(EnvironmentProblem, match="none was found.*DRJIT_LIBLLVM_PATH"):
        llvm.decide([])


@pytest.mark.skipif(not LLVM_15.exists(), reason=f"{LLVM_15} is not on this machine")
def test_llvm_15_aborts_its_probe_and_not_us():
    """SIGABRT inside code generation ends the child; the reason comes back as words."""
    posing_as_newer = llvm.Library(LLVM_15, "19.1", "system")
    version, trouble = llvm.probe(posing_as_newer)
    assert version == ""
    assert "aborts" in trouble and "Cannot select" in trouble
    assert not list(Path.cwd().glob("core*"))


def test_a_library_that_does_not_load_is_refused(tmp_path):
    fake = library_file(tmp_path, "libLLVM.so.19.1")
    version, trouble = llvm.probe(llvm.Library(fake, "19.1", "system"))
    assert version == "" and str(fake) in trouble


def test_a_library_without_version_in_its_name_is_asked(usable, tmp_path):
    (tmp_path / "libLLVM.so").hardlink_to(usable.path) if same_disk(usable.path, tmp_path) else pytest.skip("two disks")
    assert llvm.probe(llvm.Library(tmp_path / "libLLVM.so", "", "system")) == (usable.version, "")


def same_disk(one: Path, other: Path) -> bool:
    return one.stat().st_dev == other.stat().st_dev and os.access(one, os.W_OK)


@pytest.mark.parametrize("broken", ["missing.so", "libLLVM.so.19.1"])
def test_a_broken_DRJIT_LIBLLVM_PATH_falls_through_to_one_that_works(usable, tmp_path, broken):
    library_file(tmp_path, "libLLVM.so.19.1")
    asked = llvm.Library(tmp_path / broken, "19.1", "DRJIT_LIBLLVM_PATH")
    choice = llvm.decide([asked, usable])
    assert choice.path == usable.path and choice.version == usable.version
    assert f"refused {asked.path} (from DRJIT_LIBLLVM_PATH)" in choice.why


def test_DRJIT_LIBLLVM_PATH_comes_first_whatever_it_is(tmp_path):
    mine = library_file(tmp_path / "mine", "libLLVM-15.so.1")
    library_file(tmp_path / "usual", "libLLVM.so.19.1")
    usual = [str(tmp_path / "usual")]
    assert llvm.find({"DRJIT_LIBLLVM_PATH": str(mine)}, usual)[0].path == mine
    # A bare file name is looked up in the usual places, as Dr.Jit does.
    bare = llvm.find({"DRJIT_LIBLLVM_PATH": "libLLVM.so.19.1"}, usual)
    assert [(one.path.parent.name, one.origin) for one in bare] == [("usual", "DRJIT_LIBLLVM_PATH")]


def test_a_choice_is_remembered_until_its_file_changes(own_state, tmp_path, monkeypatch):
    library = library_file(tmp_path / "lib", "libLLVM.so.19.1")
    trials: list[Path] = []
    monkeypatch.setattr(llvm, "find", lambda environ: [llvm.Library(library, "19.1", "system")])
    monkeypatch.setattr(llvm, "probe", lambda one, python: (trials.append(one.path), ("19.1.7", ""))[1])
    first = llvm.choose(environ={})
    assert llvm.choose(environ={}) == first and len(trials) == 1
    # The launcher hands its choice on through the variable: still the same choice, with its first reason.
    assert llvm.choose(environ={"DRJIT_LIBLLVM_PATH": str(library)}) == first and len(trials) == 1
    library.write_bytes(b"another version of it")
    llvm.choose(environ={})
    assert len(trials) == 2
    llvm.choose(environ={"DRJIT_LIBLLVM_PATH": "/somewhere/else.so"})
    assert len(trials) == 3


def test_a_damaged_or_unwritable_note_costs_only_time(usable, own_state):
    own_state.mkdir()
    (own_state / "llvm.json").write_text("{half a no")
    assert llvm.remembered() is None
    (own_state / "llvm.json").unlink()
    own_state.rmdir()
    own_state.write_text("a file where the folder should be")
    assert llvm.choose(environ={"DRJIT_LIBLLVM_PATH": str(usable.path)}).path == usable.path


def test_unpacked_dependencies_go_on_the_library_path(own_state):
    """Only an LLVM that came with libraries of its own needs LD_LIBRARY_PATH; the user's entries stay behind them."""
    alone = library_file(own_state / "libllvm19/usr/lib/x86_64-linux-gnu", "libLLVM.so.19.1")
    choice = llvm.Choice(alone, "19.1.7", "")
    assert llvm.environment(choice, {"LD_LIBRARY_PATH": "/mine"}) == {"DRJIT_LIBLLVM_PATH": str(alone)}
    beside = library_file(own_state / "libllvm19/lib/x86_64-linux-gnu", "libedit.so.2").parent
    assert llvm.environment(choice, {"LD_LIBRARY_PATH": "/mine"})["LD_LIBRARY_PATH"] == f"{beside}:/mine"


def test_what_install_may_do_is_the_users_choice(own_state, monkeypatch):
    monkeypatch.setenv("DARTBOARD_LLVM", "off")
    with pytest.raises(EnvironmentProblem, match="DARTBOARD_LLVM=off"):
        llvm_apt.install(print)
    monkeypatch.setenv("DARTBOARD_LLVM", "perhaps")
    with pytest.raises(
        EnvironmentProblem, match="unknown value 'perhaps' of DARTBOARD_LLVM; known: off, system, unpack"
    ):
        llvm_apt.install(print)


APT_OFFLINE = """#!/bin/sh
case "$*" in
  *policy*) printf 'libllvm19:\\n  Installed: (none)\\n  Candidate: 1:19.1.7\\n' ;;
  *) echo "E: Failed to fetch https://mirror.example/libllvm19.deb  Temporary failure resolving" >&2; exit 100 ;;
esac
"""


def test_a_fetch_without_network_says_so_and_leaves_nothing(own_state, tmp_path, monkeypatch):
    """The trouble is apt's own last word without the address, and no half-unpacked folder stays behind."""
    for tool in ("apt-get", "apt-cache"):
        (tmp_path / tool).write_text(APT_OFFLINE)
        (tmp_path / tool).chmod(0o755)
    monkeypatch.setenv("PATH", str(tmp_path), prepend=":")
    said: list[str] = []
    with pytest.raises(EnvironmentProblem, match="Temporary failure resolving") as caught:
        llvm_apt.fetch(("libllvm19",), said.append)
    assert "mirror.example" not in str(caught.value)
    assert list(own_state.iterdir()) == []


@pytest.mark.slow  # 26 MB from the network
@pytest.mark.skipif(not Path("/usr/bin/apt-get").exists(), reason="not a Debian")
def test_an_unpacked_package_draws(own_state, monkeypatch):
    monkeypatch.setenv("DARTBOARD_LLVM", "unpack")
    llvm_apt.install(print)
    unpacked = [one for one in llvm.find({}) if one.origin == ".llvm"]
    choice = llvm.decide(unpacked, sys.executable)
    assert choice.path.is_relative_to(own_state) and int(choice.version.split(".")[0]) >= llvm.OLDEST
