"""What the renderer's tests share: one variant a process, and small cells of the built-in scenes."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from renderer import catalog
from renderer.scenes import sources
from renderer.spec import CellSpec, Choice, Estimand


@pytest.fixture(scope="session", autouse=True)
def tables(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """Point sets are made in, and read from, a folder of this test run."""
    folder = tmp_path_factory.mktemp("tables")
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("DARTBOARD_TABLES", str(folder))
        yield folder


@pytest.fixture(scope="session")
def variant() -> str:
    """Mitsuba in ``llvm_ad_rgb``, or in what DARTBOARD_TEST_VARIANT names, for the whole test process."""
    from renderer.variant import use

    chosen = os.environ.get("DARTBOARD_TEST_VARIANT", "llvm_ad_rgb")
    use(chosen)
    return chosen


def make_cell(
    scene: str = "cornell_box",
    sampler: str = "independent",
    spp: int = 16,
    *,
    size: tuple[int, int] = (32, 24),
    integrator: str = "path",
    rfilter: str = "box",
    crop: tuple[int, int, int, int] | None = None,
    max_depth: int = 6,
) -> CellSpec:
    """A cell of a built-in scene."""
    points = catalog.resolve("sampler", sampler)
    how = catalog.resolve("integrator", integrator)
    moved = ("max_depth", "hide_emitters")
    how = Choice(how.name, how.version, tuple(pair for pair in how.parameters if pair[0] not in moved))
    digest = sources.find(scene, Path()).digest
    estimand = Estimand(digest, *size, max_depth, catalog.resolve("rfilter", rfilter), crop)
    return CellSpec(estimand, how, points, catalog.rendered_spp(points, spp))


@pytest.fixture
def load_for(variant: str) -> Callable[..., Any]:
    """The scene of a cell, loaded as its estimand sees it."""

    def load_scene(spec: CellSpec, scene: str = "cornell_box") -> Any:
        from renderer.scenes.load import load

        source, estimand = sources.find(scene, Path()), spec.estimand
        return load(source.folder, source.main, width=estimand.width, height=estimand.height, crop=estimand.crop,
                    rfilter=estimand.rfilter.name, rfilter_parameters=dict(estimand.rfilter.parameters))  # fmt: skip

    return load_scene
