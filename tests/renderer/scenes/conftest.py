"""Scene folders written for one test, and Mitsuba where a test loads them."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

Write = Callable[..., Path]


@pytest.fixture
def write(tmp_path: Path) -> Write:
    """``write(body, "mesh.ply"=b"...")``: a scene folder whose scene.xml holds ``body`` in a <scene> element."""

    def write_scene(body: str, files: dict[str, bytes | str] | None = None) -> Path:
        folder = tmp_path / "scene"
        everything = {"scene.xml": f'<scene version="3.0.0">\n{body}\n</scene>\n', **(files or {})}
        for name, content in everything.items():
            path = folder / name
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_bytes(content if isinstance(content, bytes) else content.encode())
        return folder

    return write_scene


@pytest.fixture(scope="session")
def llvm(variant: str) -> None:
    """Mitsuba with our plugins, which scenes use."""
