"""The arrows between the packages point one way, and only render processes import Mitsuba."""

from __future__ import annotations

import ast
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent
PACKAGES = ("renderer", "jobs", "service")
MAY_IMPORT = {"renderer": set(), "jobs": {"renderer"}, "service": {"jobs", "renderer"}}

# What of ``renderer`` the owner of a data directory may load.
WITHOUT_MITSUBA = (
    "renderer.spec", "renderer.catalog", "renderer.errors", "renderer.metrics", "renderer.images", "renderer.variant",
    "renderer.llvm", "renderer.devices", "renderer.scenes.sources", "renderer.scenes.builtin", "renderer.scenes.vet",
    "jobs.grid", "jobs.plan", "jobs.estimate", "jobs.experiments", "jobs.queue", "jobs.results", "jobs.measure",
    "jobs.dispatcher", "jobs.executors.local", "jobs.render_process", "service.cli", "service.runner", "service.single",
    "service.checker", "service.readout", "service.control", "service.doctor", "service.measuring",
)  # fmt: skip


def modules(package: str) -> list[Path]:
    return sorted((ROOT / package).rglob("*.py"))


def imported(file: Path) -> set[str]:
    """Every module that a file names in an import, at the top or inside a function."""
    names: set[str] = set()
    for node in ast.walk(ast.parse(file.read_text())):
        if isinstance(node, ast.Import):
            names |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module:
            names.add(node.module)
    return names


@pytest.mark.parametrize("package", PACKAGES)
def test_arrows_point_one_way(package: str) -> None:
    """renderer knows nobody, jobs knows renderer, service knows both."""
    forbidden = set(PACKAGES) - MAY_IMPORT[package] - {package}
    wrong = {
        f"{file.relative_to(ROOT)} imports {name}"
        for file in modules(package)
        for name in imported(file)
        if name.split(".")[0] in forbidden
    }
    assert not wrong


def test_sql_lives_in_one_place() -> None:
    """Only the store and its statements speak to SQLite."""
    users = {
        str(file.relative_to(ROOT))
        for package in PACKAGES
        for file in modules(package)
        if imported(file) & {"apsw", "sqlite3"}
    }
    assert users <= {"jobs/sql/__init__.py", "jobs/store.py", "service/doctor.py"}  # the doctor asks for its version


@pytest.mark.parametrize("module", WITHOUT_MITSUBA)
def test_the_owner_never_loads_mitsuba(module: str) -> None:
    code = f"import sys, {module}; assert not {{'mitsuba', 'drjit'}} & set(sys.modules), 'loaded'"
    done = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
