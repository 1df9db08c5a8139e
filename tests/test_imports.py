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

# What of ``renderer`` the owner of a data directory may load; of the other packages it is everything.
WITHOUT_MITSUBA = (
    "renderer.spec", "renderer.catalog", "renderer.errors", "renderer.metrics", "renderer.images", "renderer.variant",
    "renderer.llvm", "renderer.devices", "renderer.previews", "renderer.scenes.sources", "renderer.scenes.builtin",
    "renderer.scenes.vet", "renderer.samplers.pointfile", "renderer.samplers.packing", "renderer.zips",
    "renderer.bsdfs.parameters", "renderer.bsdfs.formula", "renderer.parameters",
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


def test_the_owner_never_loads_mitsuba() -> None:
    """One module after the other, in one process: whatever brings it in is named."""
    names = [*WITHOUT_MITSUBA, *(name_of(file) for package in ("jobs", "service") for file in modules(package))]
    code = (
        "import importlib, sys\n"
        "for name in sys.argv[1:]:\n"
        "    importlib.import_module(name)\n"
        "    assert not {'mitsuba', 'drjit'} & set(sys.modules), f'{name} loads it'\n"
    )
    done = subprocess.run([sys.executable, "-c", code, *names], cwd=ROOT, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr


@pytest.mark.parametrize("module", ["service.app", "service.serve", "service.cli"])
def test_what_is_started_alone_loads_no_mitsuba(module: str) -> None:
    code = f"import sys, {module}; assert not {{'mitsuba', 'drjit'}} & set(sys.modules), 'loaded'"
    done = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr


def test_the_dashboard_holds_no_python() -> None:
    """``web`` is files that a browser loads: no package, and nobody imports it."""
    files = [file for file in (ROOT / "web").rglob("*.py") if "node_modules" not in file.parts]
    assert files == []
    users = {
        file for package in PACKAGES for file in modules(package) if "web" in {n.split(".")[0] for n in imported(file)}
    }
    assert users == set()


def name_of(file: Path) -> str:
    parts = file.relative_to(ROOT).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)
