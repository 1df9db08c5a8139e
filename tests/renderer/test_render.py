"""Laws of the pass loop: it draws what Mitsuba draws, however it is cut, and says what it really did."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from renderer.errors import BadParameter
from renderer.spec import CellSpec, Choice
from tests.renderer.conftest import make_cell


@pytest.mark.parametrize("rfilter", ["box", "tent", "gaussian"])
@pytest.mark.parametrize("crop", [None, (5, 7, 20, 11)])
@pytest.mark.parametrize("integrator", ["path", "direct"])
def test_one_pass_is_mitsubas_own_render(
    load_for: Callable[..., Any], rfilter: str, crop: tuple[int, int, int, int] | None, integrator: str
) -> None:
    """The same seed gives the picture of ``mi.render``: same rays, same sample dimensions, same filter, same window."""
    import mitsuba as mi

    from renderer.render import render

    spec = make_cell(rfilter=rfilter, crop=crop, integrator=integrator, max_depth=2 if integrator == "direct" else 6)
    loaded = load_for(spec)
    ours = next(render(spec, loaded, [123])).picture
    native = mi.load_dict({"type": integrator} | ({"max_depth": 6} if integrator == "path" else {}))
    loaded.sensor.sampler().set_sample_count(16)
    theirs = np.array(native.render(loaded.scene, loaded.sensor, seed=123, spp=16))
    np.testing.assert_allclose(ours, theirs, rtol=2e-5, atol=2e-6)


@pytest.mark.parametrize("sampler", ["stratified", "multijitter", "orthogonal", "ldsampler"])
def test_strata_span_all_passes(load_for: Callable[..., Any], monkeypatch: pytest.MonkeyPatch, sampler: str) -> None:
    """Cutting a cell into more passes leaves the error of a stratified sampler what it was, not one of smaller sets."""
    import renderer.render as module

    size = (16, 16)
    spec = make_cell(sampler=sampler, spp=64, size=size)
    loaded = load_for(spec)
    reference = next(module.render(make_cell(spp=4096, size=size), loaded, [9])).picture

    def error(lanes: int) -> float:
        monkeypatch.setattr(module, "PASS_LANES", lanes)
        monkeypatch.setattr(module, "MAX_PASS_LANES", lanes)
        pictures = [r.picture for r in module.render(spec, loaded, range(1, 9))]
        # relative, and trimmed: the visible lamp's edge would rule a plain mean
        errors = np.array([(p - reference) ** 2 / (reference**2 + 0.01) for p in pictures])
        return float(np.sort(errors.ravel())[: int(0.98 * errors.size)].mean())

    whole, cut = error(2**20), error(16 * 16 * 11)  # 8 passes of 8 samples, or 11 of 11
    assert 0.8 < cut / whole < 1.25, (whole, cut)


def test_progress_counts_every_pass_and_ends_with_the_picture(
    load_for: Callable[..., Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    import renderer.render as module

    monkeypatch.setattr(module, "PASS_LANES", 32 * 24 * 4)
    spec = make_cell(spp=16)
    seen: list[tuple[int, int]] = []
    pictures = []

    def on_pass(progress: Any) -> None:
        seen.append((progress.passes_done, progress.passes))
        pictures.append(progress.picture())

    rendering = next(module.render(spec, load_for(spec), [5], on_pass))
    assert seen == [(1, 4), (2, 4), (3, 4), (4, 4)]
    np.testing.assert_array_equal(pictures[-1], rendering.picture)
    # previews refine: each is closer to the final picture than the one before
    distances = [float(np.mean((p - rendering.picture) ** 2)) for p in pictures]
    assert distances == sorted(distances, reverse=True)


FRESH_PROCESS = """
import os
from pathlib import Path
from tests.renderer.conftest import make_cell
from renderer.scenes import sources
from renderer.variant import use
use("VARIANT")
from renderer.render import render
from renderer.scenes.load import load
source = sources.find("cornell_box", Path())
loaded = load(source.folder, source.main, width=32, height=24)
def kernels():
    return len(list(Path(os.environ["DRJIT_CACHE_DIR"]).glob("*.bin")))
"""


def fresh_process(code: str, caches: Path, variant: str = "llvm_ad_rgb") -> list[float]:
    """The numbers that a new process with an empty kernel cache prints."""
    environment = {**os.environ, "DRJIT_CACHE_DIR": str(caches)}
    done = subprocess.run(
        [sys.executable, "-c", FRESH_PROCESS.replace("VARIANT", variant) + code],
        env=environment,
        capture_output=True,
        text=True,
        check=True,
    )
    return [float(word) for word in done.stdout.split()]


def test_compile_time_is_kept_apart(tmp_path: Path) -> None:
    """With an empty kernel cache the first replicate pays for code generation, the second finds it done."""
    first, second = fresh_process(
        "for rendering in render(make_cell(), loaded, [1, 2]): print(rendering.compile_seconds)", tmp_path
    )
    assert first > 10 * second


def test_one_kernel_serves_every_spp(tmp_path: Path) -> None:
    """Asking for more samples compiles nothing new where the sampler itself has no constant in its code."""
    first, *more = fresh_process(
        "for spp in (4, 16, 100): next(render(make_cell(spp=spp), loaded, [1])); print(kernels())", tmp_path
    )
    assert first > 0
    assert more == [first, first]


SPECTRAL = """
import numpy as np
import mitsuba as mi
native = mi.load_dict({"type": "path", "max_depth": 6})
loaded.sensor.sampler().set_sample_count(16)
for cell in (make_cell(), make_cell(rfilter="tent")):
    e = cell.estimand
    loaded = load(source.folder, source.main, width=32, height=24, rfilter=e.rfilter.name)
    loaded.sensor.sampler().set_sample_count(16)
    ours = next(render(cell, loaded, [3])).picture
    theirs = np.array(native.render(loaded.scene, loaded.sensor, seed=3, spp=16))
    print(float(np.abs(ours - theirs).max()), float(ours.mean()))
"""


def test_spectral_pictures_are_mitsubas_own_too(tmp_path: Path) -> None:
    """``llvm_ad_spectral``: wavelengths are drawn in Mitsuba's order and gathered to the same linear sRGB."""
    box_error, box_mean, tent_error, tent_mean = fresh_process(SPECTRAL, tmp_path, variant="llvm_ad_spectral")
    assert max(box_error, tent_error) < 2e-4
    assert min(box_mean, tent_mean) > 0.05


def test_seeds_give_other_pictures_and_the_same_seed_the_same(load_for: Callable[..., Any]) -> None:
    from renderer.render import render

    spec = make_cell(sampler="multijitter")
    one, two, again = (r.picture for r in render(spec, load_for(spec), [11, 12, 11]))
    np.testing.assert_allclose(one, again, rtol=2e-5, atol=1e-6)
    assert np.mean(one != two) > 0.5


def test_a_sampler_that_rounds_otherwise_than_the_catalog_is_refused(load_for: Callable[..., Any]) -> None:
    from renderer.render import render

    good = make_cell()
    bad = CellSpec(good.estimand, good.integrator, Choice("stratified", 1, (("jitter", True),)), 5)
    with pytest.raises(BadParameter, match="would render 9 samples per pixel, the cell says 5"):
        next(render(bad, load_for(bad), [1]))


@given(st.integers(1, 2**24), st.integers(1, 10**6))
def test_passes_divide_the_samples_and_bound_the_memory(pixels: int, spp: int) -> None:
    from renderer.render import MAX_PASS_LANES, samples_per_pass

    k = samples_per_pass(pixels, spp)
    assert spp % k == 0
    assert k == 1 or pixels * k <= MAX_PASS_LANES


def test_a_python_sampler_is_told_its_frame(load_for: Callable[..., Any], monkeypatch: pytest.MonkeyPatch) -> None:
    """
    The seam for samplers of ours: ``frame`` is called before the seed and before every advance, so a sampler that
    needs the picture's width and its sample index draws the same picture however the passes are cut.
    """
    import drjit as dr
    import mitsuba as mi

    import renderer.catalog as catalog
    import renderer.render as module

    told: list[tuple[Any, ...]] = []

    class FrameProbe(mi.Sampler):
        """Every number is a hash of (pixel of the film, index of the sample, dimension): passes cannot matter."""

        def __init__(self, props: mi.Properties):
            mi.Sampler.__init__(self, props)
            self.dimension = mi.UInt32(0)

        def frame(self, width: int, height: int, crop: tuple[int, ...], spp_per_pass: int, first_sample: int) -> None:
            told.append((width, height, crop, spp_per_pass, first_sample))
            self.place = (crop, width, spp_per_pass, first_sample)

        def seed(self, seed: int, wavefront_size: int = 2**32 - 1) -> None:
            self.seed_value = seed
            self._begin()

        def advance(self) -> None:
            self._begin()

        def _begin(self) -> None:
            (x0, y0, width, height), film_width, k, first = self.place
            lane = dr.arange(mi.UInt32, width * height * k)
            pixel = lane // k
            row = pixel // width
            self.key = (row + y0) * film_width + (pixel - row * width) + x0
            self.index = lane - pixel * k + first
            self.dimension = mi.UInt32(0)

        def next_1d(self, active: bool = True) -> Any:
            self.dimension += 1
            a, b = mi.sample_tea_32(self.key ^ self.seed_value, self.index * 1000 + self.dimension)
            return mi.Float(mi.sample_tea_32(a, b)[0] >> 8) * 2**-24

        def next_2d(self, active: bool = True) -> Any:
            return mi.Point2f(self.next_1d(), self.next_1d())

        def schedule_state(self) -> None:
            dr.schedule(self.dimension)

    mi.register_sampler("frame_probe", lambda props: FrameProbe(props))
    shipped, probe = catalog.entries, catalog.Entry("sampler", "frame_probe", "", "", "frame_probe")
    monkeypatch.setattr(catalog, "entries", lambda axis: {**shipped(axis), "frame_probe": probe})
    good = make_cell(crop=(3, 2, 16, 12))
    spec = CellSpec(good.estimand, good.integrator, Choice("frame_probe", 1), 16)
    loaded = load_for(spec)

    whole = next(module.render(spec, loaded, [77])).picture
    assert told == [(32, 24, (3, 2, 16, 12), 16, 0)]
    told.clear()
    monkeypatch.setattr(module, "PASS_LANES", 16 * 12 * 4)
    cut = next(module.render(spec, loaded, [77])).picture
    assert told == [(32, 24, (3, 2, 16, 12), 4, first) for first in (0, 4, 8, 12)]
    np.testing.assert_allclose(cut, whole, rtol=1e-4, atol=1e-5)
