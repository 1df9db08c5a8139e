"""The pages of the samplers say what the catalog and the plugins' docstrings say now."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent


def test_pages_are_up_to_date() -> None:
    done = subprocess.run(
        [sys.executable, "docs/make_samplers.py", "--check"], cwd=ROOT, capture_output=True, text=True, timeout=60
    )
    assert done.returncode == 0, done.stderr


def test_every_page_has_its_picture() -> None:
    folder = ROOT / "docs" / "samplers"
    named = {line.rpartition("(")[2].rstrip(")") for page in folder.glob("*.md") for line in pictures(page)}
    assert named == {file.name for file in folder.glob("*.png")}
    assert all(file.stat().st_size < 150_000 for file in folder.glob("*.png"))


def pictures(page: Path) -> list[str]:
    return [line for line in page.read_text("utf-8").splitlines() if line.startswith("![")]
