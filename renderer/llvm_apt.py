"""
Getting a libLLVM from apt where there is none that works: the system's package, or unpacked without root.

``DARTBOARD_LLVM`` says what ``install`` may do: `system` (apt-get install, the default for root), `unpack` (the same
package under `.llvm/`, the default for everybody else) or `off`. Standard library only, like ``llvm``.
"""

from __future__ import annotations

import os
import re
import shutil
from collections.abc import Callable
from pathlib import Path

from renderer import llvm
from renderer.errors import EnvironmentProblem

PACKAGES = ("libllvm19", "libllvm20", "libllvm21", "libllvm22", "libllvm18", "libllvm17t64", "libllvm17")


def install(say: Callable[[str], None], inherit: tuple[int, ...] = ()) -> None:
    """
    Put a libLLVM on this machine, or raise ``EnvironmentProblem`` with the reason (``choose`` then tells the cure).

    Root gets the system's package; where that fails, and for everybody else, the package is unpacked under
    `.llvm/`, which changes nothing outside the checkout. ``inherit`` are descriptors that the commands keep
    open: the launcher's lock, so that a killed launcher's apt-get still holds it.
    """
    how = os.environ.get("DARTBOARD_LLVM") or ("system" if os.geteuid() == 0 else "unpack")
    if how not in ("system", "unpack", "off"):
        raise EnvironmentProblem(f"unknown value {how!r} of DARTBOARD_LLVM; known: off, system, unpack")
    if how == "off" or not shutil.which("apt-get"):
        reason = "DARTBOARD_LLVM=off" if how == "off" else "this machine has no apt-get"
        raise EnvironmentProblem(f"no LLVM {llvm.OLDEST} or newer is here, and none is installed: {reason}")
    if how == "system":
        package, trouble = _install_system(say, inherit)
        if not trouble:
            return
        say(f"apt-get install {package} failed ({trouble}); unpacking it under .llvm instead")
    fetch(PACKAGES, say, inherit)


def _install_system(say: Callable[[str], None], inherit: tuple[int, ...]) -> tuple[str, str]:
    for lists in ("as they are", "updated"):
        if lists == "updated":
            llvm.run_tool(["apt-get", "update"], inherit=inherit)
        if package := _available(PACKAGES, []):
            say(f"installing {package} with apt-get")
            answer = llvm.run_tool(["apt-get", "install", "-y", "--no-install-recommends", package], inherit=inherit)
            if answer.returncode == 0:
                return package, ""
    return package or PACKAGES[0], llvm.last_line(answer.stderr) if package else "apt knows no such package"


def fetch(packages: tuple[str, ...], say: Callable[[str], None], inherit: tuple[int, ...] = ()) -> Path:
    """
    Unpack the first of ``packages`` that apt knows, with the dependencies this machine lacks; no root needed.

    Returns the folder, `.llvm/PACKAGE`. It appears whole or not at all: files are unpacked beside it and renamed.
    """
    home = llvm.state_folder()
    home.mkdir(parents=True, exist_ok=True)
    for leftover in home.glob("unpacking-*"):
        shutil.rmtree(leftover, ignore_errors=True)
    beside = home / f"unpacking-{os.getpid()}"
    (beside / "debs").mkdir(parents=True)
    try:
        trouble = "apt knows no such package"
        for options in ([], _private_lists(beside)):  # the machine's lists may be absent (containers) or stale
            if options:
                trouble = (
                    llvm.last_line(llvm.run_tool(["apt-get", *options, "update"], inherit=inherit).stderr) or trouble
                )
            if package := _available(packages, options):
                say(f"unpacking {package} under {home.name}, without root")
                if not (trouble := _unpack(package, beside, options, inherit)):
                    shutil.rmtree(home / package, ignore_errors=True)
                    (beside / "root").replace(home / package)
                    return home / package
    finally:
        shutil.rmtree(beside, ignore_errors=True)
    raise EnvironmentProblem(f"could not get {packages[0]} or another of its kind: {trouble}")


def _unpack(package: str, beside: Path, options: list[str], inherit: tuple[int, ...]) -> str:
    """Download and unpack into ``beside``; the trouble in words, or ''."""
    simulated = llvm.run_tool(["apt-get", *options, "-s", "install", "--no-install-recommends", package]).stdout
    missing = set(re.findall(r"^Inst (\S+)", simulated, re.M)) - {"libc6"}  # a second libc cannot be mixed in
    got = llvm.run_tool(
        ["apt-get", *options, "download", *sorted({package} | missing)], cwd=beside / "debs", inherit=inherit
    )
    if got.returncode:
        return llvm.last_line(got.stderr)
    for deb in sorted((beside / "debs").glob("*.deb")):
        done = llvm.run_tool(["dpkg-deb", "-x", str(deb), str(beside / "root")], inherit=inherit)
        if done.returncode:
            return llvm.last_line(done.stderr)
    return ""


def _available(packages: tuple[str, ...], options: list[str]) -> str:
    """The first of ``packages`` that apt could install, or ''."""
    policy = llvm.run_tool(["apt-cache", *options, "policy", *packages]).stdout
    candidates = dict(re.findall(r"^(\S+):\n.*\n\s+Candidate: (\S+)", policy, re.M))
    return next((name for name in packages if candidates.get(name, "(none)") != "(none)"), "")


def _private_lists(folder: Path) -> list[str]:
    """apt's options for package lists of our own, which need no root; what is installed is still read from dpkg."""
    (folder / "lists/partial").mkdir(parents=True)
    (folder / "cache/archives/partial").mkdir(parents=True)
    settings = {"Dir::State::Lists": folder / "lists", "Dir::Cache": folder / "cache", "APT::Sandbox::User": "root"}
    return [word for name, value in settings.items() for word in ("-o", f"{name}={value}")]
