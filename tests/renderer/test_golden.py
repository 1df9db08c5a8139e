"""
Golden pictures: a change that alters a picture must raise a version, so that old and new never share a digest.

Each small picture is kept under its cell's digest. A picture that changes under the same digest fails here: raise
PASS_LOOP or SCENE_LOADER (renderer/spec.py) or the plugin's version (renderer/catalog.py), then make new ones with
``python -m tests.renderer.test_golden``, which keeps the others. If nothing was meant to change, the change is a bug.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from renderer.images import read_picture, write_picture
from renderer.spec import CellSpec, seed
from tests.renderer.conftest import make_cell

FOLDER = Path(__file__).parent / "golden"
CELLS = {
    "independent": ("cornell_box", {"sampler": "independent"}),
    "stratified": ("cornell_box", {"sampler": "stratified"}),
    "multijitter": ("cornell_box", {"sampler": "multijitter"}),
    "orthogonal": ("cornell_box", {"sampler": "orthogonal"}),
    "ldsampler": ("cornell_box", {"sampler": "ldsampler"}),
    "halton": ("cornell_box", {"sampler": "halton"}),
    "sobol": ("cornell_box", {"sampler": "sobol"}),
    "zsobol": ("cornell_box", {"sampler": "zsobol"}),
    "pmj02bn": ("cornell_box", {"sampler": "pmj02bn"}),
    "poissondisk": ("cornell_box", {"sampler": "poissondisk"}),
    "relaxedpoissondisk": ("cornell_box", {"sampler": "relaxedpoissondisk"}),
    "eliminated": ("cornell_box", {"sampler": "eliminated"}),
    "zeros": ("cornell_box", {"sampler": "poissondisk:replay=zeros"}),
    "direct": ("cornell_box", {"integrator": "direct", "max_depth": 2}),
    "spatial": ("many_lights", {"integrator": "path:light_sampler=spatial"}),
    "power": ("many_lights", {"integrator": "path:light_sampler=power"}),
    "bdpt": ("cornell_box", {"integrator": "bdpt"}),
    "bdpt_spatial": ("many_lights", {"integrator": "bdpt:light_sampler=spatial,heuristic=balance"}),
    "bdpt_aimed": ("glass_caustic", {"integrator": "bdpt"}),
    "bdpt_lens": ("defocus", {"integrator": "bdpt", "rfilter": "gaussian"}),
    "ptracer": ("cornell_box", {"integrator": "ptracer"}),
    "volpath": ("cornell_box", {"integrator": "volpath"}),
    "gaussian": ("cornell_box", {"rfilter": "gaussian"}),
    "crop": ("cornell_box", {"crop": (4, 3, 12, 10)}),
    "defocus": ("defocus", {}),
}


def cell(name: str) -> CellSpec:
    scene, options = CELLS[name]
    return make_cell(scene, **options)  # type: ignore[arg-type]


def draw(name: str, load_for: Callable[..., Any]) -> Any:
    from renderer.render import render

    spec = cell(name)
    return next(render(spec, load_for(spec, CELLS[name][0]), [seed(spec.digest, 0)])).picture


@pytest.mark.parametrize("name", CELLS)
def test_pictures_change_only_with_their_version(load_for: Callable[..., Any], name: str, tmp_path: Path) -> None:
    """The picture of a digest is the one that was kept, but for single pixels whose paths part at a rounding."""
    golden = FOLDER / f"{cell(name).digest}.exr"
    assert golden.exists(), f"no golden picture of {name!r} under its digest: see the top of this file"
    ours, kept = draw(name, load_for), read_picture(golden)
    close = np.isclose(ours, kept, rtol=1e-3, atol=1e-4).all(axis=-1)
    if np.mean(close) < 0.98:
        evidence = tmp_path / f"{name}.exr"
        write_picture(evidence, ours, {"spec": cell(name).text})
        pytest.fail(f"{np.sum(~close)} of {close.size} pixels of {name!r} changed; it is now {evidence}")


def test_no_golden_picture_is_left_over() -> None:
    assert {file.stem for file in FOLDER.glob("*.exr")} == {cell(name).digest for name in CELLS}


if __name__ == "__main__":
    from renderer.scenes import sources
    from renderer.scenes.load import load
    from renderer.variant import use

    def _load(spec: CellSpec, scene: str) -> Any:
        source, e = sources.find(scene, Path()), spec.estimand
        return load(source.folder, source.main, width=e.width, height=e.height, crop=e.crop, rfilter=e.rfilter.name,
                    rfilter_parameters=dict(e.rfilter.parameters))  # fmt: skip

    use("llvm_ad_rgb")
    FOLDER.mkdir(exist_ok=True)
    for old in FOLDER.glob("*.exr"):
        if old.stem not in {cell(name).digest for name in CELLS}:
            old.unlink()
    for each in CELLS:
        if (FOLDER / f"{cell(each).digest}.exr").exists():
            continue
        write_picture(FOLDER / f"{cell(each).digest}.exr", draw(each, _load), {"spec": cell(each).text, "name": each})
