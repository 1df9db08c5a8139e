"""The scenes that we ship are described, well exposed, and sound in both colour modes."""

from __future__ import annotations

import dataclasses
import json
import re
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from renderer import catalog
from renderer.scenes.builtin import BUILTIN
from renderer.scenes.sources import find
from renderer.scenes.xmlfile import parse

GLOSSY = {"cornell_aniso", "glass_nested", "hidden_lamp", "many_lights", "sphere_figure"}  # highlights brighter than 3
CAUSTIC = {"glass_caustic"}  # made of what are fireflies elsewhere

# Loads and renders each scene by its own integrator in one colour mode, in a process of its own: a variant cannot be
# taken back.
RENDER = """
import json, sys
import mitsuba as mi
from renderer.variant import use
use(sys.argv[1])
import drjit as dr
import numpy as np
from renderer.scenes.builtin import BUILTIN
from renderer.scenes.load import load
from renderer.scenes.sources import find
from pathlib import Path
own = {name: find(name, Path()).defaults.integrator for name in BUILTIN}
x, y = (mi.Float(np.random.default_rng(k).random(10_000)) for k in (1, 2))
out = {}
for name, scene in BUILTIN.items():
    seen = out[name] = {"misses": 0, "lamps": 0}
    for width, height in ((96, 24), (24, 96), (64, 64)):
        loaded = load(scene.folder, "scene.xml", width=width, height=height)
        ray, _ = loaded.sensor.sample_ray(0, 0.5, mi.Point2f(x, y), mi.Point2f(0.5), True)
        hit = loaded.scene.ray_intersect(ray)
        lamp = hit.emitter(loaded.scene).eval(hit)
        seen["misses"] += int(dr.count(~hit.is_valid())[0])
        seen["lamps"] += int(dr.count(dr.max(lamp) > 0)[0])
    integrator = mi.load_dict({"type": own[name], "max_depth": 6})
    image = np.array(mi.render(loaded.scene, integrator=integrator, spp=64, seed=3), dtype=np.float64)
    light = image @ [0.2126, 0.7152, 0.0722]
    seen |= {"finite": bool(np.isfinite(image).all()), "mean": light.mean(), "median": float(np.median(light)),
             "black": int((light <= 0).sum()), "bright": float((light > 3).mean()), "max": float(light.max())}
print(json.dumps(out))
"""


def test_every_scene_is_described() -> None:
    """What the catalog tells people is there, in whole sentences, one line each."""
    assert set(BUILTIN) >= {
        "cornell_box", "defocus", "sphere_figure", "moon_shadow", "cornell_aniso", "glass_caustic", "glass_nested",
        "many_lights", "hidden_lamp",
    }  # fmt: skip
    for name, scene in BUILTIN.items():
        assert scene.name == name == scene.folder.name
        for field in dataclasses.fields(scene):
            text = getattr(scene, field.name)
            if isinstance(text, str) and field.name != "name":
                assert text and "\n" not in text, (name, field.name)


def test_every_scene_has_a_reference() -> None:
    """Which the catalog tells, and which a grid takes as it is."""
    told = {scene["name"]: scene["reference"] for scene in catalog.as_json()["scenes"]}
    for name, scene in BUILTIN.items():
        assert told[name] == scene.reference == find(name, Path()).reference
        assert catalog.resolve("integrator", scene.reference["integrator"])
        assert 2**12 <= scene.reference["spp"] <= 2**16, name


OWN = {"glass_caustic": (8, "bdpt"), "glass_nested": (10, "path"), "hidden_lamp": (6, "bdpt")}  # max_depth, integrator


def test_scenes_are_256_square_at_depth_6() -> None:
    """
    The defaults of the house, written in the files; light that crosses glass needs more edges, and some need bdpt.
    """
    for name in BUILTIN:
        defaults = find(name, Path()).defaults
        assert (defaults.width, defaults.height) == (256, 256)
        assert (defaults.max_depth, defaults.integrator) == OWN.get(name, (6, "path")), name
        assert (defaults.crop, defaults.rfilter) == (None, "box")


@pytest.mark.parametrize("variant", ["llvm_ad_rgb", "llvm_ad_spectral"])
def test_pictures_are_finite_well_exposed_and_closed(variant: str) -> None:
    """
    Mean luminance near 0.2 (relMSE's ε = 0.01 expects it), no black pixel, no ray that leaves the scene, no lamp in a
    picture of any shape unless its description says so, and nothing brighter than 3 but highlights and caustics.
    """
    done = subprocess.run([sys.executable, "-c", RENDER, variant], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    for name, seen in json.loads(done.stdout.splitlines()[-1]).items():
        assert seen["finite"] and seen["misses"] == 0, (name, seen)
        assert 0.15 < seen["mean"] < 0.35 and 0.08 < seen["median"] < 0.25, (name, seen)
        assert bool(seen["lamps"]) == (BUILTIN[name].lamp_in_frame is not None), (name, seen)
        assert seen["black"] == 0, (name, seen)
        if BUILTIN[name].lamp_in_frame is None and name not in CAUSTIC:
            assert seen["bright"] < 0.005, (name, seen)
            assert seen["max"] < 3 or name in GLOSSY, (name, seen)


def test_materials_have_short_names() -> None:
    """A sweep says sphere.bsdf.nu in every scene that has the anisotropic material, and most have it."""
    found = 0
    for name in BUILTIN:
        shapes = [e for e in parse((BUILTIN[name].folder / "scene.xml").read_bytes()).children if e.tag == "shape"]
        anisotropic = [e for e in shapes for b in e.children if b.attributes.get("type") == "anisophong"]
        found += bool(anisotropic)
        assert not anisotropic or "sphere" in {e.attributes["id"] for e in anisotropic}, name
        assert all(e.attributes.get("id") for e in shapes), name
        assert not any("id" in b.attributes for e in anisotropic for b in e.children), name  # it would rename the key
    assert found >= 4


def test_the_caustic_covers_a_seventh_of_its_scene(variant: str, tmp_path: Path) -> None:
    """
    The caustic is the part of the floor that the glass brightens by a quarter and more: what comes straight from the
    lamp through the glass, against all light that is there with a black ball in its place.

    Straight is what paths of at most four edges (camera, floor, glass, glass, lamp) gain by the glass: one by way of a
    wall has five.
    """
    import mitsuba as mi

    from renderer.scenes.load import load

    side, folder = 24, BUILTIN["glass_caustic"].folder
    text = (folder / "scene.xml").read_text("utf-8")
    black = '<bsdf type="diffuse"><rgb name="reflectance" value="0"/></bsdf>'
    (tmp_path / "scene.xml").write_text(re.sub('<bsdf type="dielectric">.*?</bsdf>', black, text, flags=re.DOTALL))
    with_glass, with_ball = (load(place, "scene.xml", width=side, height=side) for place in (folder, tmp_path))

    def light(scene: Any, depth: int, passes: int) -> np.ndarray:
        integrator = mi.load_dict({"type": "path", "max_depth": depth})
        seeds = range(0, 1_000_003 * passes, 1_000_003)  # further apart than a pass has samples
        drawn = [np.array(mi.render(scene.scene, integrator=integrator, spp=1024, seed=seed)) for seed in seeds]
        return np.mean(drawn, axis=0, dtype=np.float64) @ [0.2126, 0.7152, 0.0722]

    caustic = light(with_glass, 4, 32) - light(with_ball, 4, 1)
    y, x = (np.mgrid[:side, :side] + 0.5).reshape(2, -1) / side
    ray, _ = with_glass.sensor.sample_ray(0, 0.5, mi.Point2f(x, y), mi.Point2f(0.5), True)
    floor = next(shape for shape in with_glass.scene.shapes() if shape.id() == "floor")
    on_floor = np.array(with_glass.scene.ray_intersect(ray).shape == mi.ShapePtr(floor)).reshape(side, side)
    share = (on_floor & (caustic > light(with_ball, 10, 1) / 4)).mean()
    assert share >= 0.15, share


def test_corridor_has_64_lamps_of_very_different_power() -> None:
    children = parse((BUILTIN["many_lights"].folder / "scene.xml").read_bytes()).children
    lamps = [e for shape in children for e in shape.children if e.tag == "emitter"]
    radiance = [max(map(float, lamp.children[0].attributes["value"].split())) for lamp in lamps]
    assert len(radiance) == 64 and max(radiance) > 1000 * min(radiance)


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
