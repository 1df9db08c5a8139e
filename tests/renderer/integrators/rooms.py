"""
Small scenes that hold one lamp of every kind against three materials: where integrators are compared.

A ball, a block and a floor before two walls, and a lamp out of the picture. Lamps are large and rooms plain, so that a
path tracer's pictures have a mean that a few replicates can tell.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from renderer import catalog
from renderer.spec import CellSpec, Choice, Estimand, seed
from tests.renderer.scene_of import scene_of

SIZE = (16, 16)
# Its lower side is above the floor: of two faces in one plane, light from above meets one, light from below the other,
# and a block of glass loses a thousandth of the picture's light.
BLOCK = [0.6, -0.63, 0.1]


def _transform() -> Any:
    import mitsuba as mi

    return mi.ScalarTransform4f()


def _rgb(*value: float) -> dict[str, Any]:
    return {"type": "rgb", "value": list(value)}


def _bitmap(values: Any) -> dict[str, Any]:
    import mitsuba as mi

    return {"type": "bitmap", "bitmap": mi.Bitmap(np.ascontiguousarray(values, np.float32)), "raw": True}


def _pattern(height: int, width: int) -> Any:
    """Smooth, coloured, and brighter at one side."""
    v, u = np.mgrid[0:height, 0:width] / np.array([height, width]).reshape(2, 1, 1)
    red = 1 + 0.9 * np.sin(2 * np.pi * u) * np.sin(np.pi * v)
    return np.stack([red, 0.4 + 0.8 * v, 0.5 + np.cos(2 * np.pi * u) ** 2], -1)


def lamps() -> dict[str, dict[str, Any]]:
    """Lamps by kind; as parts of a scene."""
    t = _transform()
    down = t.translate([0.2, 1.5, 0.3]) @ t.rotate([1, 0, 0], 90) @ t.scale(0.6)
    area = {"type": "area", "radiance": _rgb(5, 4, 3)}
    several = {
        f"lamp{k}": {"type": "point", "position": [x, 1.1 + 0.2 * (k % 3), z], "intensity": _rgb(*rgb)}
        for k, (x, z, rgb) in enumerate(
            [(-0.9, 0.2, (0.5, 0.1, 0.1)), (0.2, 0.9, (0.1, 0.6, 0.1)), (0.9, 0.0, (0.2, 0.2, 1.5))]
        )
    }
    return {
        "rectangle": {"lamp": {"type": "rectangle", "to_world": down, "emitter": area}},
        "sphere": {"lamp": {"type": "sphere", "center": [0.3, 1.45, 0.5], "radius": 0.35, "emitter": area}},
        "mesh": {"lamp": {"type": "cube", "to_world": t.translate([0.2, 1.4, 0.4]) @ t.rotate([0.6, 0.8, 0], 30)
                          @ t.scale(0.25), "emitter": area}},
        "textured": {"lamp": {"type": "rectangle", "to_world": down,
                              "emitter": {"type": "area", "radiance": _bitmap(4 * _pattern(4, 8))}}},
        "point": {"lamp": {"type": "point", "position": [0.3, 1.2, 0.8], "intensity": _rgb(2, 1.6, 1.2)}},
        "spot": {"lamp": {"type": "spot", "intensity": _rgb(5, 5, 4), "cutoff_angle": 35, "beam_width": 20,
                          "to_world": t.look_at([0.1, 1.6, 1.0], [0, -0.7, 0], [0, 0, 1])}},
        "directional": {"lamp": {"type": "directional", "direction": [0.4, -1, -0.5], "irradiance": _rgb(1, 1.2, 1)}},
        "constant": {"lamp": {"type": "constant", "radiance": _rgb(0.5, 0.6, 0.7)}},
        "envmap": {"lamp": {"type": "envmap", "bitmap": _bitmap(_pattern(8, 16))["bitmap"], "scale": 0.5}},
        "turned envmap": {"lamp": {"type": "envmap", "bitmap": _bitmap(_pattern(8, 16))["bitmap"], "scale": 0.5,
                                   "to_world": t.rotate([0.8, 0.36, 0.48], 70)}},
        "several": {
            **several,
            "lamp": {"type": "rectangle", "to_world": down, "emitter": {"type": "area", "radiance": _rgb(1, 0.5, 1)}},
            "sky": {"type": "constant", "radiance": _rgb(0.1, 0.15, 0.2)},
        },
    }  # fmt: skip


def rarer_lamps() -> dict[str, dict[str, Any]]:
    """Lamps of other shapes and plugins, by kind; a projector starts no light paths."""
    t = _transform()
    area = {"type": "area", "radiance": _rgb(5, 4, 3)}
    down = t.translate([0.2, 1.5, 0.3]) @ t.rotate([1, 0, 0], 90) @ t.scale(0.6)
    return {
        "disk": {"lamp": {"type": "disk", "to_world": down, "emitter": area}},
        "cylinder": {"lamp": {"type": "cylinder", "p0": [-0.4, 1.3, 0.5], "p1": [0.6, 1.3, 0.3], "radius": 0.15,
                              "emitter": area}},
        "textured sphere": {"lamp": {"type": "sphere", "center": [0.3, 1.45, 0.5], "radius": 0.35,
                                     "emitter": {"type": "area", "radiance": _bitmap(4 * _pattern(4, 8))}}},
        "sky": {"lamp": {"type": "sunsky", "to_world": t.rotate([1, 0, 0], -90), "sun_direction": [0.3, 0.3, 0.9],
                         "sun_scale": 0.05}},
        "projector": {"lamp": {"type": "projector", "irradiance": _bitmap(4 * _pattern(8, 8)), "fov": 45,
                               "to_world": t.look_at([0.1, 1.6, 1.0], [0, -0.7, 0], [0, 0, 1])}},
    }  # fmt: skip


DIRAC_LAMPS = ("point", "spot", "directional")  # that no path tracer's ray hits


def materials() -> dict[str, dict[str, Any]]:
    """Materials by name."""
    bumps = {"type": "bumpmap", "arbitrary": _bitmap(0.03 * _pattern(8, 8)[..., :1]), "bsdf": {"type": "diffuse"}}
    return {
        "diffuse": {"type": "diffuse", "reflectance": _rgb(0.7, 0.4, 0.3)},
        "textured": {"type": "diffuse", "reflectance": {"type": "checkerboard", "to_uv": _transform().scale(6)}},
        "bumps": bumps,
        "gloss": {"type": "anisophong", "rd": 0.3, "rs": 0.4, "nu": 20, "nv": 300},
        "sharp gloss": {"type": "anisophong", "rd": 0.2, "rs": 0.5, "nu": 10000, "nv": 10000},
        "two sides": {"type": "twosided", "bsdf": {"type": "anisophong", "rd": 0.5, "rs": 0.1, "nu": 50, "nv": 10}},
        "rough metal": {"type": "roughconductor", "material": "Cu", "alpha": 0.2},
        "rough glass": {"type": "roughdielectric", "alpha": 0.25},
        "plastic": {"type": "plastic", "diffuse_reflectance": _rgb(0.2, 0.4, 0.6)},
        "principled": {"type": "principled", "base_color": _rgb(0.5, 0.6, 0.3), "metallic": 0.4, "roughness": 0.4},
        "mask": {"type": "mask", "opacity": 0.6, "bsdf": {"type": "twosided", "bsdf": {"type": "diffuse"}}},
        "glass": {"type": "dielectric"},
        "metal": {"type": "conductor", "material": "Ag"},
    }


# That send on some light in one direction only, or nearly so. A path tracer never finds a Dirac lamp's light by them.
MIRRORS = ("plastic", "mask", "glass", "metal", "sharp gloss")

SLOTS = ("ball", "block", "back", "left", "floor")  # what can be made of any material


def room(
    lamp: Mapping[str, Any],
    made_of: Mapping[str, Mapping[str, Any]],
    *,
    camera: Mapping[str, Any] | None = None,
    rfilter: str = "box",
    crop: tuple[int, int, int, int] | None = None,
    size: tuple[int, int] = SIZE,
    smooth_block: bool = False,
) -> Any:
    """
    A ``LoadedScene``. ``made_of`` gives materials by slot, plain where it says nothing; ``smooth_block`` gives the
    block the shading normals of a ball.
    """
    import mitsuba as mi

    from renderer.scenes.load import LoadedScene

    t = _transform()
    film: dict[str, Any] = {"type": "hdrfilm", "width": size[0], "height": size[1], "rfilter": {"type": rfilter}}
    if crop:
        names = ("crop_offset_x", "crop_offset_y", "crop_width", "crop_height")
        film |= dict(zip(names, crop, strict=True))
    seen = {"type": "perspective", "fov": 34, "to_world": t.look_at([0, 0.3, 4.2], [0, -0.35, 0], [0, 1, 0])}
    sensor = {**(camera or seen), "film": film}
    plain = {"type": "diffuse", "reflectance": _rgb(0.5, 0.55, 0.6)}
    material = {slot: dict(made_of.get(slot, plain)) for slot in SLOTS}
    placed = t.translate(BLOCK) @ t.rotate([0, 1, 0], 25) @ t.scale(0.35)
    made = {
        "sensor": sensor,
        "ball": {"type": "sphere", "center": [-0.55, -0.5, 0], "radius": 0.5, "bsdf": material["ball"]},
        "block": {"type": "cube", "to_world": placed, "bsdf": material["block"]},
        "floor": {"type": "rectangle", "to_world": t.translate([0, -1, 0]) @ t.rotate([1, 0, 0], -90) @ t.scale(2),
                  "bsdf": material["floor"]},
        "back": {"type": "rectangle", "to_world": t.translate([0, 0, -1.2]) @ t.scale(2), "bsdf": material["back"]},
        "left": {"type": "rectangle", "to_world": t.translate([-1.6, 0, 0]) @ t.rotate([0, 1, 0], 90) @ t.scale(2),
                 "bsdf": material["left"]},
        **lamp,
    }  # fmt: skip
    scene = scene_of(made)
    if smooth_block:
        parameters = mi.traverse(scene)
        corners = np.array(parameters["block.vertex_positions"]).reshape(-1, 3) - BLOCK
        parameters["block.vertex_normals"] = (corners / np.linalg.norm(corners, axis=1)[:, None]).ravel()
        parameters.update()
    return LoadedScene(scene, scene.sensors()[0], *size, crop or (0, 0, *size))


def draw(
    loaded: Any,
    integrator: str | Mapping[str, Any],
    count: int,
    spp: int = 64,
    *,
    max_depth: int = 5,
    rfilter: str = "box",
    sampler: str = "independent",
    hide_emitters: bool = False,
    salt: str = "",
) -> Any:
    """(count, H, W, 3) replicates of a room by an integrator as people write it; ``salt`` makes other seeds."""
    from renderer.render import render

    how = catalog.resolve("integrator", integrator)
    moved = [item.name for item in catalog.find("integrator", how.name).parameters if item.estimand]
    kept = tuple(pair for pair in how.parameters if pair[0] not in moved)
    whole = (0, 0, loaded.width, loaded.height)
    estimand = Estimand(
        "0" * 64, loaded.width, loaded.height, max_depth, catalog.resolve("rfilter", rfilter),
        None if loaded.crop == whole else loaded.crop, hide_emitters, strategy=catalog.strategy(how),
    )  # fmt: skip
    points = catalog.resolve("sampler", sampler)
    spec = CellSpec(estimand, Choice(how.name, how.version, kept), points, catalog.rendered_spp(points, spp))
    seeds = [seed(spec.digest + salt, k) for k in range(count)]
    return np.array([one.picture for one in render(spec, loaded, seeds)], np.float64)
