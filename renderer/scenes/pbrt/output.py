"""The files of a converted scene: where pictures and meshes go, and under which names."""

from __future__ import annotations

import shutil
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from renderer.errors import SceneError
from renderer.scenes.allowed import EXTENSIONS
from renderer.scenes.pbrt import imagefile
from renderer.scenes.pbrt.lexer import Place

FILES_MAX = 10_000
PICTURES = frozenset({".exr", ".hdr", ".rgbe", ".pfm", ".png", ".jpg", ".jpeg", ".bmp", ".tga"}) & EXTENSIONS


class Output:
    """Files are numbered in the order of the scene: the same scene always makes the same files."""

    def __init__(self, folder: Path):
        self.folder = folder
        self.copies: dict[Path, str] = {}
        self.counts = {"meshes": 0, "textures": 0}

    def new(self, kind: str, suffix: str, place: Place) -> tuple[Path, str]:
        """Path and name of a new file below "meshes" or "textures". Raises ``SceneError`` over the limit."""
        self.counts[kind] += 1
        if sum(self.counts.values()) > FILES_MAX:
            raise SceneError(f"{place}: the scene has more than {FILES_MAX} meshes and pictures; join some")
        name = f"{kind}/{self.counts[kind]:05d}{suffix}"
        (self.folder / kind).mkdir(exist_ok=True)
        return self.folder / name, name

    def picture(self, source: Path, place: Place) -> str:
        """A copy of a picture; one for all who use it. Raises ``SceneError`` for what is none."""
        if source not in self.copies:
            if source.suffix.lower() not in PICTURES:
                known = " ".join(sorted(PICTURES))
                raise SceneError(f"{place}: {source.name} is no picture that is read here; allowed: {known}")
            imagefile.check(source, place)
            target, name = self.new("textures", source.suffix.lower(), place)
            shutil.copyfile(source, target)
            self.copies[source] = name
        return self.copies[source]

    def baked(self, picture: NDArray[np.float64], place: Place) -> str:
        """A picture of our own, (H, W, 3) linear."""
        from renderer.images import write_picture

        target, name = self.new("textures", ".exr", place)
        write_picture(target, picture, {})
        return name
