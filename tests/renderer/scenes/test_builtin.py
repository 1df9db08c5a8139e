"""The scenes that we ship are described, well exposed, and sound in both colour modes."""

from __future__ import annotations

import dataclasses
import json
import subprocess
import sys
from pathlib import Path

import pytest

from renderer.scenes.builtin import BUILTIN
from renderer.scenes.sources import find

# Loads and renders each scene in one colour mode, in a process of its own: a variant cannot be taken back.
RENDER = """
import json, sys, time
import mitsuba as mi
mi.set_variant(sys.argv[1])
import numpy as np
from renderer.scenes.builtin import BUILTIN
from renderer.scenes.load import load
out = {}
for name, scene in BUILTIN.items():
    start = time.perf_counter()
    loaded = load(scene.folder, "scene.xml", width=96, height=96)
    seconds = time.perf_counter() - start
    integrator = mi.load_dict({"type": "path", "max_depth": 6})
    image = np.array(mi.render(loaded.scene, integrator=integrator, spp=64, seed=3), dtype=np.float64)
    y = image @ [0.2126, 0.7152, 0.0722]
    hit = np.array(loaded.scene.ray_test(loaded.sensor.sample_ray(0, 0.5, mi.Point2f(
        mi.Float(np.random.default_rng(1).random(10_000)), mi.Float(np.random.default_rng(2).random(10_000))),
        mi.Point2f(0.5), True)[0]))
    out[name] = {"finite": bool(np.isfinite(image).all()), "mean": y.mean(), "median": float(np.median(y)),
                 "black": int((y <= 0).sum()), "max": y.max(), "load": seconds, "misses": int((~hit).sum())}
print(json.dumps(out))
"""


def test_every_scene_is_described() -> None:
    """What the catalog tells people is there, in whole sentences, one line each."""
    assert set(BUILTIN) >= {"cornell_box", "defocus"}
    for name, scene in BUILTIN.items():
        assert scene.name == name == scene.folder.name
        for field in dataclasses.fields(scene):
            text = getattr(scene, field.name)
            if isinstance(text, str) and field.name != "name":
                assert text and "\n" not in text, (name, field.name)


def test_scenes_are_256_square_at_depth_6() -> None:
    """The defaults of the house, written in the files."""
    for name in BUILTIN:
        defaults = find(name, Path()).defaults
        assert (defaults.width, defaults.height, defaults.max_depth, defaults.integrator) == (256, 256, 6, "path")


@pytest.mark.parametrize("variant", ["llvm_ad_rgb", "llvm_ad_spectral"])
def test_pictures_are_finite_well_exposed_and_closed(variant: str) -> None:
    """Mean luminance near 0.2 (relMSE's ε = 0.01 expects it), no black pixel, no ray that leaves the scene."""
    done = subprocess.run([sys.executable, "-c", RENDER, variant], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    for name, seen in json.loads(done.stdout.splitlines()[-1]).items():
        assert seen["finite"] and seen["black"] == 0 and seen["misses"] == 0, (name, seen)
        assert 0.15 < seen["mean"] < 0.35 and 0.08 < seen["median"] < 0.25, (name, seen)
        if BUILTIN[name].lamp_in_frame is None:
            assert seen["max"] < 3, (name, seen)  # no lamp seen, no firefly


def test_reading_scenes_needs_no_mitsuba() -> None:
    """Only render processes import Mitsuba; numpy is not needed either."""
    code = """
import sys
from pathlib import Path
from renderer.scenes import builtin, sources, vet
source = sources.find("cornell_box", Path())
assert vet.vet(source.folder, source.main) == []
print(sorted({"mitsuba", "drjit", "numpy"} & set(sys.modules)))
"""
    assert subprocess.check_output([sys.executable, "-c", code], text=True).strip() == "[]"
