"""
Laws of `./dartboard`: it prepares once, survives being killed, never runs twice at a time, and becomes the command.

Each test has a small checkout of its own: the real launcher and the real renderer.llvm, a lock with one tiny wheel
that is found in a folder, and a service.cli that tells what it was given. So pip, venv, flock and exec are real and the
network is not needed; the slow test at the end uses this checkout's own lock.
"""

from __future__ import annotations

import ast
import hashlib
import json
import os
import re
import shutil
import signal
import subprocess
import sys
import tempfile
import time
import zipfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

HOME = Path(__file__).resolve().parent.parent
NOBODY = 65534
CLI = """
import json, os, sys
print(json.dumps({"pid": os.getpid(), "args": sys.argv[1:], "prefix": sys.prefix, "path": sys.path,
                  "llvm": os.environ.get("DRJIT_LIBLLVM_PATH")}))
"""


class Checkout:
    """A small checkout in a folder that other users may enter."""

    def __init__(self, folder: Path):
        self.folder = folder
        self.wheels = folder / "wheels"
        for name in (
            "dartboard",
            "renderer/__init__.py",
            "renderer/errors.py",
            "renderer/llvm.py",
            "renderer/llvm_apt.py",
        ):
            (folder / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy(HOME / name, folder / name)
        (folder / "service").mkdir()
        (folder / "service/__init__.py").touch()
        (folder / "service/cli.py").write_text(CLI)
        self.lock("1.0")

    def lock(self, version: str) -> None:
        """One package, `tiny`, and its hash in both locks."""
        self.wheels.mkdir(exist_ok=True)
        wheel = self.wheels / f"tiny-{version}-py3-none-any.whl"
        info = f"tiny-{version}.dist-info"
        with zipfile.ZipFile(wheel, "w") as archive:
            archive.writestr("tiny.py", f"version = {version!r}\n")
            archive.writestr(f"{info}/METADATA", f"Metadata-Version: 2.1\nName: tiny\nVersion: {version}\n")
            archive.writestr(f"{info}/WHEEL", "Wheel-Version: 1.0\nRoot-Is-Purelib: true\nTag: py3-none-any\n")
            archive.writestr(f"{info}/RECORD", "".join(f"{name},,\n" for name in archive.namelist()))
        digest = hashlib.sha256(wheel.read_bytes()).hexdigest()
        for name in ("requirements.lock", "requirements-dev.lock"):
            (self.folder / name).write_text(f"tiny=={version} --hash=sha256:{digest}\n")

    def start(self, *args: str, python: str = sys.executable, **options) -> subprocess.Popen[str]:
        keep = {name: os.environ[name] for name in ("PATH", "LANG") if name in os.environ}
        environment = {
            **keep,
            "HOME": str(self.folder / "home"),
            "PIP_FIND_LINKS": str(self.wheels),
            "PIP_NO_INDEX": "1",
            "DARTBOARD_LLVM": "off",
            **options.pop("env", {}),
        }
        command = [python, str(self.folder / "dartboard"), *args]
        pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True}
        return subprocess.Popen(command, env=environment, **pipes, **options)

    def run(self, *args: str, **options) -> tuple[int, str, str]:
        with self.start(*args, **options) as process:
            out, err = process.communicate(timeout=120)
        assert "Traceback" not in err, err
        return process.returncode, out, err


@contextmanager
def new_checkout() -> Iterator[Checkout]:
    folder = Path(tempfile.mkdtemp(prefix="dartboard-"))  # not tmp_path, whose parents only its owner may enter
    folder.chmod(0o755)
    yield Checkout(folder)
    subprocess.run(["chmod", "-R", "u+w", str(folder)], check=True)
    shutil.rmtree(folder)


@pytest.fixture
def checkout() -> Iterator[Checkout]:
    """A bare one."""
    with new_checkout() as checkout:
        yield checkout


@pytest.fixture(scope="module")
def prepared() -> Iterator[Checkout]:
    """One that a start has prepared; pip takes seconds, so tests that only start again share it."""
    with new_checkout() as checkout:
        code, _, err = checkout.run("results")
        assert code == 0 and "DARTBOARD_LLVM=off" in err  # it says what a command that draws would lack
        shutil.rmtree(checkout.wheels)  # from here on, asking pip for anything fails
        yield checkout


def test_the_first_start_prepares_and_becomes_the_command(checkout):
    """One process from start to end: the command has the pid that the user's shell knows."""
    with checkout.start("status", "--data", "x y") as process:
        out, err = process.communicate(timeout=120)
    told = json.loads(out)
    assert process.returncode == 0
    assert told["pid"] == process.pid
    assert told["args"] == ["status", "--data", "x y"]
    assert told["prefix"] == str(checkout.folder / ".venv")
    assert re.search(r"ready in [\d.]+ s: \.venv [\d.]+ s, packages [\d.]+ s, .*LLVM meanwhile [\d.]+ s", err)


def test_the_second_start_does_nothing_but_exec(prepared):
    made = {path: path.stat().st_mtime_ns for path in (prepared.folder / ".venv").iterdir()}
    code, out, err = prepared.run("status")
    assert (code, err) == (0, "")
    assert made == {path: path.stat().st_mtime_ns for path in (prepared.folder / ".venv").iterdir()}
    assert json.loads(out)["args"] == ["status"]


def test_a_changed_lock_is_installed(checkout):
    checkout.run("status")
    checkout.lock("1.1")
    code, _, err = checkout.run("status")
    assert code == 0 and "installing the 1 packages" in err and "making .venv" not in err
    assert list(checkout.folder.glob(".venv/lib/*/site-packages/tiny-1.1.dist-info"))


def test_a_moved_checkout_is_prepared_again(checkout):
    checkout.run("status")
    moved = Path(f"{checkout.folder}-moved")
    checkout.folder.rename(moved)
    try:
        checkout.folder = moved
        checkout.wheels = moved / "wheels"
        _, out, err = checkout.run("status")
        assert "making .venv" in err
        assert str(moved) in json.loads(out)["path"]
    finally:
        moved.rename(str(moved).removesuffix("-moved"))


@pytest.mark.parametrize("after_seconds", [0.05, 0.3, 1.0])
def test_a_killed_preparation_recovers(checkout, after_seconds):
    """kill -9 at any moment: the next start waits for what the dead one left running, and begins afresh."""
    with checkout.start("status") as first:
        time.sleep(after_seconds)
        first.kill()
    code, out, err = checkout.run("status")
    assert code == 0, err
    assert json.loads(out)["args"] == ["status"]
    assert not list(checkout.folder.glob(".venv.old-*"))


def test_a_removal_that_was_killed_halfway_recovers(checkout):
    """What is left of an old .venv has another name, so it is never taken for one, and it is swept away."""
    (checkout.folder / ".venv.old-1/bin").mkdir(parents=True)
    code, _, _ = checkout.run("status")
    assert code == 0
    assert not list(checkout.folder.glob(".venv.old-*"))


def test_a_preparation_that_was_killed_at_its_very_beginning_recovers(checkout):
    """Between the folder and its stamp: what is there is the stamp's unfinished file, and nobody's .venv."""
    (checkout.folder / ".venv").mkdir()
    (checkout.folder / ".venv/dartboard.json.new").touch()
    assert checkout.run("status")[0] == 0


@pytest.mark.parametrize(("number", "code"), [(signal.SIGINT, 130), (signal.SIGTERM, 130)])
def test_an_interrupted_preparation_says_so(checkout, number, code):
    signal.signal(signal.SIGINT, signal.default_int_handler)  # a background job ignores it, and children inherit that
    with checkout.start("status") as process:
        assert process.stderr is not None
        assert "making .venv" in process.stderr.readline()
        process.send_signal(number)
        rest = process.stderr.read()
    assert process.returncode == code
    assert "interrupted; the next start goes on" in rest and "Traceback" not in rest
    assert checkout.run("status")[0] == 0


def test_two_starts_at_once_prepare_once(checkout):
    with checkout.start("status") as one, checkout.start("check") as other:
        texts = [process.communicate(timeout=120) for process in (one, other)]
    assert [one.returncode, other.returncode] == [0, 0]
    errors = "".join(err for _, err in texts)
    assert errors.count("making .venv") == 1
    assert "another start is preparing this checkout; waiting for it" in errors


def test_a_folder_of_the_users_does_not_shadow_ours(prepared, tmp_path):
    (tmp_path / "service").mkdir()
    (tmp_path / "service/cli.py").write_text("raise SystemExit('the wrong one')")
    code, out, err = prepared.run("status", cwd=tmp_path)
    assert code == 0, err
    assert str(tmp_path) not in json.loads(out)["path"]


def test_a_venv_of_the_users_is_left_alone(checkout):
    (checkout.folder / ".venv").mkdir()
    (checkout.folder / ".venv/pyvenv.cfg").write_text("mine")
    code, _, err = checkout.run("status")
    assert code == 3
    assert "was not made by ./dartboard; move it away" in err
    assert (checkout.folder / ".venv/pyvenv.cfg").read_text() == "mine"


def test_a_package_that_differs_from_the_lock_is_refused(checkout):
    lock = (checkout.folder / "requirements.lock").read_text()
    (checkout.folder / "requirements.lock").write_text(re.sub("sha256:....", "sha256:0000", lock))
    code, out, err = checkout.run("status")
    assert (code, out) == (3, "")
    assert "a package is not the one that the lock records, so it was refused" in err


def test_no_network_is_one_sentence_without_addresses(checkout):
    offline = {
        "PIP_NO_INDEX": "",
        "PIP_FIND_LINKS": "",
        "PIP_INDEX_URL": "https://127.0.0.1:9/simple",
        "PIP_RETRIES": "1",
    }
    code, _, err = checkout.run("status", env=offline)
    assert code == 3
    assert "the package index cannot be reached; check the network" in err
    assert "127.0.0.1" not in err and "://" not in err
    assert checkout.run("status")[0] == 0  # and the network is back


def test_a_checkout_that_cannot_be_written_says_whose_it_is(checkout):
    """Started by somebody who may only read it; once prepared by its owner, anybody may start it."""
    as_reader = {"user": NOBODY, "group": NOBODY, "extra_groups": []} if os.geteuid() == 0 else {}
    python = "/usr/bin/python3" if as_reader else sys.executable
    if as_reader and subprocess.run([python, "-c", "import sys; sys.exit(sys.version_info < (3, 11))"]).returncode:
        pytest.skip("no Python here that another user may run")
    if not as_reader:
        checkout.folder.chmod(0o555)
    code, _, err = checkout.run("status", python=python, **as_reader)
    assert code == 3
    assert "is not writable for user" in err and "use a clone of your own" in err
    checkout.folder.chmod(0o755)
    checkout.run("status", python=python)
    assert checkout.run("status", python=python, **as_reader)[::2] == (0, "")


def test_without_llvm_a_command_that_draws_looks_for_one_at_each_start(prepared):
    """And one that draws nothing starts at once."""
    assert prepared.run("results")[2] == ""
    for _ in range(2):
        assert "DARTBOARD_LLVM=off" in prepared.run("run")[2]
    assert prepared.run("results")[2] == ""


def test_the_tests_of_the_dashboard_need_node(prepared):
    """A developer without it is told what is left out; CI is told what is missing, before it tests anything."""
    bare = {"PATH": str(prepared.folder / "no such folder")}
    _, _, err = prepared.run("test", env=bare)
    assert "skipped tsc and the tests of the dashboard's modules: there is no node" in err
    assert "test: failed: ruff check, ruff format, mypy, pytest" in err  # this checkout has none of them
    code, _, err = prepared.run("test", env={**bare, "CI": "true"})
    assert code == 3
    assert "cannot check the dashboard: there is no node; install Node.js" in err
    assert "pytest" not in err


def test_the_type_checker_is_installed_once(checkout):
    """And again when its lock has changed; both before the tests that take longest."""
    (checkout.folder / "web/node_modules").mkdir(parents=True)
    (checkout.folder / "tests/web").mkdir(parents=True)
    (checkout.folder / "tests/web/one.mjs").touch()
    (checkout.folder / "web/package-lock.json").write_text("{}")
    tools = checkout.folder / "tools"
    tools.mkdir()
    for name in ("npm", "node"):
        (tools / name).write_text('#!/bin/sh\n[ "$1" = ci ] && : > node_modules/.package-lock.json\nexit 0\n')
        (tools / name).chmod(0o755)
    path = {"PATH": f"{tools}:{os.environ['PATH']}"}
    ran = [re.findall(r"test: ([\w ]+) ok", checkout.run("test", env=path)[2]) for _ in range(2)]
    assert ran == [["npm ci", "tsc", "node"], ["tsc", "node"]]
    os.utime(checkout.folder / "web/package-lock.json", (2e9, 2e9))
    assert "npm ci ok" in checkout.run("test", env=path)[2]


def test_the_launcher_parses_in_an_old_python():
    ast.parse((HOME / "dartboard").read_text(), feature_version=(3, 8))


def test_an_old_python_says_what_is_needed(checkout):
    """With nothing newer on the path it says so; with something newer it goes on with that."""
    names = [name for minor in (8, 9, 10) for name in (f"python3.{minor}", str(pyenv(f"3.{minor}")))]
    old = next((found for name in names if (found := shutil.which(name)) and runs(found)), None)
    if old is None:
        pytest.skip("no Python older than 3.11 on this machine")
    code, _, err = checkout.run("status", python=old, env={"PATH": str(checkout.folder)})
    assert code == 3
    assert re.search(r"Dartboard needs Python 3\.11 or newer, and this is 3\.\d+\.\d+", err)
    (checkout.folder / "bin").mkdir()
    (checkout.folder / "bin/python3.11").symlink_to(sys.executable)
    code, _, err = checkout.run("status", python=old, env={"PATH": f"{checkout.folder / 'bin'}:/usr/bin:/bin"})
    assert code == 0, err


def pyenv(version: str) -> Path:
    return next(Path.home().glob(f".pyenv/versions/{version}.*/bin/python3"), Path("no such python"))


def runs(python: str) -> bool:
    return subprocess.run([python, "-c", ""], capture_output=True).returncode == 0


def test_the_test_lock_contains_the_core_lock():
    """One installation of the test lock serves both, so versions and hashes must agree."""
    core, dev = (entries(HOME / name) for name in ("requirements.lock", "requirements-dev.lock"))
    assert core.items() <= dev.items()
    assert {"mitsuba", "apsw"} <= {name.partition("==")[0] for name in core}


@pytest.mark.parametrize("name", ["requirements.lock", "requirements-dev.lock"])
def test_a_lock_has_hashes_and_no_addresses(name):
    text = (HOME / name).read_text()
    assert not re.search(r"://|--index|--find-links|file:|@", text)
    assert all(hashes for hashes in entries(HOME / name).values())


def entries(lock: Path) -> dict[str, frozenset[str]]:
    """Requirement (with its marker) → hashes."""
    joined = re.sub(r" \\\n\s*", " ", lock.read_text())
    lines = [line for line in joined.splitlines() if line and not line.startswith("#")]
    return {line.split(" --hash")[0]: frozenset(re.findall(r"--hash=(\S+)", line)) for line in lines}


@pytest.mark.slow  # the network: 100 MB
def test_a_real_first_start_prepares_a_device(checkout):
    """This checkout's lock, an empty HOME, and no LLVM but what the machine or its packages give."""
    for name in ("requirements.lock", "pyproject.toml"):
        shutil.copy(HOME / name, checkout.folder / name)
    for package in ("renderer", "jobs", "service"):
        shutil.copytree(HOME / package, checkout.folder / package, dirs_exist_ok=True)
    real = {name: os.environ[name] for name in os.environ if name.startswith("PIP_")}
    code, out, err = checkout.run("doctor", "--json", env={**real, "PIP_NO_INDEX": "", "DARTBOARD_LLVM": "unpack"})
    assert code == 0, err
    assert "ready in" in err
    assert any(line["name"] == "LLVM" and line["state"] == "ok" for line in json.loads(out)["lines"])
