"""Small pbrt scenes written for one test, converted, vetted, and loaded where a test renders."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from renderer.scenes import sources
from renderer.scenes.sources import SceneSource

CAMERA = 'LookAt 0 0 -5  0 0 0  0 1 0\nCamera "perspective" "float fov" 40\n'
FILM = 'Film "image" "integer xresolution" 32 "integer yresolution" 32\n'


class Scenes:
    """Writes ``scene.pbrt`` into a folder of its own, and makes a Mitsuba scene of it."""

    def __init__(self, folder: Path):
        self.folder = folder

    def write(self, world: str, *, options: str = CAMERA + FILM, files: dict[str, bytes | str] | None = None) -> None:
        self.raw(f"{options}\nWorldBegin\n{world}\nWorldEnd\n", files=files)

    def raw(self, text: str | bytes, *, files: dict[str, bytes | str] | None = None) -> None:
        for name, content in {"scene.pbrt": text, **(files or {})}.items():
            path = self.folder / name
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_bytes(content if isinstance(content, bytes) else content.encode())

    def find(self) -> SceneSource:
        return sources.find("scene.pbrt", self.folder)

    def __call__(self, world: str, **how: Any) -> SceneSource:
        self.write(world, **how)
        return self.find()


@pytest.fixture
def scenes(tmp_path: Path) -> Scenes:
    folder = tmp_path / "pbrt"
    folder.mkdir()
    return Scenes(folder)


@pytest.fixture
def picture(variant: str) -> Callable[..., np.ndarray]:
    """``picture(source)``: (H, W, 3) of a converted scene."""

    def render(source: SceneSource, spp: int = 64, width: int = 32, height: int = 32, depth: int = 2) -> np.ndarray:
        import mitsuba as mi

        from renderer.scenes.load import load

        loaded = load(source.folder, source.main, width=width, height=height)
        integrator = mi.load_dict({"type": "path", "max_depth": depth})
        return np.array(mi.render(loaded.scene, sensor=loaded.sensor, integrator=integrator, spp=spp, seed=1))

    return render
