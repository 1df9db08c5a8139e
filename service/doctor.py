"""
The doctor: what this machine has, what is missing, and the cure.

One ``Line`` per thing that a render, the database or the disk depends on. Green needs nothing, yellow works but
says what would be better, red does not work and always carries its remedy. Versions are read from the installed
packages' metadata and trials run in child processes: nothing here imports Mitsuba, so it answers where Mitsuba cannot.
"""

from __future__ import annotations

import json
import os
import platform
import shutil
import sqlite3
import sys
from dataclasses import asdict, dataclass
from importlib import metadata
from pathlib import Path
from typing import Literal

from renderer import devices, llvm
from renderer.errors import DartboardError, EnvironmentProblem
from service.settings import kernel_caches

State = Literal["ok", "warn", "bad"]
WAL_RESET_BUG = ((3, 7, 0), (3, 51, 2))  # SQLite versions that may corrupt a WAL database with two connections
COMFORTABLE_MEMORY_GB = 4.0  # a render process at 2^22 lanes, its scene, and the owner
LITTLE_DISK_GB, COMFORTABLE_DISK_GB = 0.5, 5.0
PREPARE = "start the program with ./dartboard, which installs it"


@dataclass(frozen=True)
class Line:
    """One finding: what was looked at, how it is, what was found, and for anything not green what to do."""

    name: str
    state: State
    value: str
    remedy: str = ""


def run_doctor(data: Path, as_json: bool = False) -> int:
    """Print the findings; the exit code is 3 if any of them is red, else 0."""
    lines = doctor(data)
    healthy = all(line.state != "bad" for line in lines)
    if as_json:
        print(json.dumps({"ok": healthy, "lines": [asdict(line) for line in lines]}, indent=2))
    else:
        show(lines)
    return 0 if healthy else EnvironmentProblem.exit_code


def doctor(data: Path) -> list[Line]:
    """Every finding, in the order of the chain that a picture needs: programs, devices, machine, disk."""
    return [
        _python(),
        _package("Mitsuba", "mitsuba"),
        _package("Dr.Jit", "drjit"),
        *_devices(),
        _sqlite(),
        _cores(),
        _memory(),
        _disk(data),
        _data_directory(data),
        _kernel_cache(),
    ]


def show(lines: list[Line]) -> None:
    """The findings as a table on stdout, coloured where the terminal can."""
    from rich.console import Console
    from rich.table import Column, Table
    from rich.text import Text

    looks = {"ok": ("ok", "green"), "warn": ("so-so", "yellow"), "bad": ("bad", "bold red")}
    table = Table(Column(), Column(), Column(overflow="fold"), box=None, show_header=False, padding=(0, 2, 0, 0))
    for line in lines:
        word, colour = looks[line.state]
        value = Text(line.value)
        if line.remedy:
            value.append(f"\n→ {line.remedy}", style=colour)
        table.add_row(Text(word, style=colour), Text(line.name, style="bold"), value)
    Console().print(table)


# ------------------------------------------------------------------------------------------ programs and devices


def _python() -> Line:
    return Line("Python", "ok", f"{platform.python_version()} at {sys.executable}")


def _package(name: str, distribution: str) -> Line:
    try:
        return Line(name, "ok", metadata.version(distribution))
    except metadata.PackageNotFoundError:
        return Line(name, "bad", f"not installed for {sys.executable}", PREPARE)


def _devices() -> list[Line]:
    """LLVM and CUDA: one of them is enough, so a missing LLVM is red only where CUDA does not draw."""
    cuda = devices.cuda_trouble()
    try:
        choice = llvm.choose()
        first = Line("LLVM", "ok", f"{choice.version} at {choice.path}: {choice.why}")
    except DartboardError as error:
        first = Line("LLVM", "bad" if cuda else "warn", str(error).partition(" The cure: ")[0], llvm.CURE)
    if not cuda:
        return [first, Line("CUDA", "ok", f"yes: {devices.pick('cuda').description}")]
    has_driver = any(Path(file).exists() for file in devices.DRIVER_FILES)
    return [first, Line("CUDA", "warn" if has_driver else "ok", f"no: {cuda}", devices.CUDA_CURE if has_driver else "")]


def _sqlite() -> Line:
    """The SQLite that holds the results, which is not Python's own."""
    try:
        import apsw
    except ImportError:
        return Line("SQLite", "bad", "apsw is not installed", PREPARE)
    version = apsw.sqlite_lib_version()
    span = " to ".join(".".join(map(str, end)) for end in WAL_RESET_BUG)
    value = f"{version}, bundled with apsw (Python's own, {sqlite3.sqlite_version}, is not used)"
    if WAL_RESET_BUG[0] <= tuple(map(int, version.split("."))) <= WAL_RESET_BUG[1]:
        return Line("SQLite", "bad", f"{value}: {span} can corrupt a database when its WAL is reset", PREPARE)
    return Line("SQLite", "ok", f"{value}: outside {span}, whose WAL reset can corrupt a database")


# ------------------------------------------------------------------------------------------ the machine


def _cores() -> Line:
    usable = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    quota = _cgroup("cpu.max").split()
    value = f"{usable} of {os.cpu_count()} for this process"
    if len(quota) == 2 and quota[0] != "max" and (share := int(quota[0]) / int(quota[1])) < usable:
        advice = "give the container more CPU, or start with `taskset -c` on as many cores as it may use"
        return Line("cores", "warn", f"{value}, and the container may use {share:.1f}", advice)
    return Line("cores", "ok", value)


def _memory() -> Line:
    try:
        entries = dict(line.split(":") for line in Path("/proc/meminfo").read_text().splitlines())
        total, free = (int(entries[name].split()[0]) / 2**20 for name in ("MemTotal", "MemAvailable"))
    except (OSError, KeyError, ValueError):
        return Line("memory", "ok", "this system does not tell")
    limit = _cgroup("memory.max").strip()
    if limit.isdigit():
        used = _cgroup("memory.current").strip()
        total = min(total, int(limit) / 2**30)
        free = min(free, (int(limit) - int(used or 0)) / 2**30)
    value = f"{free:.1f} GiB free of {total:.1f}"
    if free < COMFORTABLE_MEMORY_GB:
        advice = f"large pictures want {COMFORTABLE_MEMORY_GB:.0f} GiB; end other programs or draw smaller ones"
        return Line("memory", "warn", value, advice)
    return Line("memory", "ok", value)


def _cgroup(name: str) -> str:
    """A limit of the container this runs in, or ''."""
    try:
        return (Path("/sys/fs/cgroup") / name).read_text()
    except OSError:
        return ""


# ------------------------------------------------------------------------------------------ the disk


def _disk(data: Path) -> Line:
    place = _nearest(data)
    free = shutil.disk_usage(place).free / 2**30
    value = f"{free:.1f} GiB free where the data directory is ({place})"
    if free < COMFORTABLE_DISK_GB:
        state: State = "bad" if free < LITTLE_DISK_GB else "warn"
        return Line("disk", state, value, "make room, or choose another disk with --data or DARTBOARD_DATA")
    return Line("disk", "ok", value)


def _data_directory(data: Path) -> Line:
    name, place = "data directory", _nearest(data)
    if data.exists() and not data.is_dir():
        return Line(name, "bad", f"{data.absolute()} is not a folder", "choose another with --data or DARTBOARD_DATA")
    if not os.access(place, os.W_OK | os.X_OK):
        value = f"{data.absolute()}: {place} is not writable for user {os.geteuid()}"
        return Line(name, "bad", value, f"choose another with --data or DARTBOARD_DATA, or `sudo chown $USER {place}`")
    if not data.exists():
        return Line(name, "ok", f"{data.absolute()}: not there yet, the first run makes it")
    return Line(name, "ok", f"{data.absolute()}: {_owner(data)}")


def _owner(data: Path) -> str:
    """Who writes here, from the lock that an owner leaves."""
    try:
        note = json.loads((data / "owner.lock").read_text("utf-8"))
        pid, url = int(note["pid"]), note.get("url")
    except (OSError, ValueError, KeyError, TypeError, AttributeError):
        return "writable, owned by nobody now"
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return f"writable, last owned by process {pid}, which is gone"
    except PermissionError:
        pass
    return f"owned by process {pid}" + (f", which answers at {url}" if url else "")


def _kernel_cache() -> Line:
    """Compiled kernels: without a common place to keep them every data directory compiles all of them again."""
    folder = kernel_caches()
    if not os.access(_nearest(folder), os.W_OK | os.X_OK):
        told = f"{folder} is not writable: every data directory keeps its own"
        return Line("kernel cache", "warn", told, "set XDG_CACHE_HOME to a folder that is writable")
    files = [file for file in folder.rglob("*.bin") if file.is_file()] if folder.is_dir() else []
    megabytes = sum(file.stat().st_size for file in files) / 2**20
    return Line("kernel cache", "ok", f"{folder}: {len(files)} files, {megabytes:.1f} MiB")


def _nearest(path: Path) -> Path:
    """The path itself if it is there, else the closest folder above it that is."""
    path = path.absolute()
    return next(place for place in (path, *path.parents) if place.exists())
