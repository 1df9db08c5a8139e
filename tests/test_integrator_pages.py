"""The pages of the integrators say what the catalog says now, and show the pictures that are there."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

from renderer import catalog

ROOT = Path(__file__).resolve().parent.parent
FOLDER = ROOT / "docs" / "integrators"


def test_tables_are_up_to_date() -> None:
    done = subprocess.run(
        [sys.executable, "docs/make_integrators.py", "--check"], cwd=ROOT, capture_output=True, text=True, timeout=60
    )
    assert done.returncode == 0, done.stderr


def test_every_integrator_has_a_page_with_its_parameters() -> None:
    for name in catalog.entries("integrator"):
        assert f"<!-- made: parameters of {name} -->" in (FOLDER / f"{name}.md").read_text("utf-8")


def test_every_picture_is_shown_and_small() -> None:
    shown = set(re.findall(r"\]\(([^)]+\.jpg)\)", (FOLDER / "gallery.md").read_text("utf-8")))
    assert shown == {file.name for file in FOLDER.glob("*.jpg")}
    assert all(file.stat().st_size < 100_000 for file in FOLDER.glob("*.jpg"))


def test_links_lead_somewhere() -> None:
    for page in FOLDER.glob("*.md"):
        for target in re.findall(r"\]\(([^)#:]+)(?:#[^)]*)?\)", page.read_text("utf-8")):
            assert (FOLDER / target).exists(), f"{page.name} links to {target}"
