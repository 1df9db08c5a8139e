"""
What ``anisophong`` costs in a render: seconds divided by those of Mitsuba's ``roughconductor`` in the same scene.

    python -m benchmarks.bsdf [--size 192] [--spp 64] [--rounds 15] [--threads N]

*ball*: a sphere fills the frame, over a diffuse plane under a small lamp and a dim sky. *inside*: the camera is in a
sphere of the material, with a lamp: every vertex of a path is the material, the worst case. Path, max_depth 6. Every
material draws the same scene in one process with warm kernels, one after another, in an order that rotates; a ratio is
the median over the rounds of a material's seconds by those of ``roughconductor`` (its default distribution, Beckmann,
as rough as the exponent 100) in the same round. Wall and CPU seconds. ``diffuse`` shows what the rest costs.
"""

from __future__ import annotations

import argparse
import os
import statistics
import sys
import time
from collections.abc import Callable
from typing import Any

from renderer import devices
from renderer.errors import DartboardError

Scene = Callable[[dict[str, Any], int], dict[str, Any]]

AIM = 1.15
BASELINE = "roughconductor"
ROUGH = {"alpha_u": 0.14, "alpha_v": 0.14}  # sqrt(2 / (100 + 2)): the lobe of exponent 100
MATERIALS: dict[str, dict[str, Any]] = {
    BASELINE: {"type": "roughconductor", **ROUGH},
    "roughconductor ggx": {"type": "roughconductor", "distribution": "ggx", **ROUGH},
    "anisophong": {"type": "anisophong", "nu": 100, "nv": 100},
    "anisophong 10000, 10": {"type": "anisophong", "nu": 10_000, "nv": 10},
    "roughplastic": {"type": "roughplastic", "alpha": 0.14},
    "diffuse": {"type": "diffuse"},
}


def main() -> int:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.bsdf")
    parser.add_argument("--size", type=int, default=192)
    parser.add_argument("--spp", type=int, default=64)
    parser.add_argument("--rounds", type=int, default=15)
    parser.add_argument("--threads", type=int, default=None)
    options = parser.parse_args()
    device = devices.pick("auto")
    os.environ.update(device.environment)
    from renderer.variant import name, use

    use(name(device.name, "rgb"), options.threads)
    threads = f"; {options.threads} used" if options.threads else ""
    print(f"{device.description}{threads}; {options.size}², {options.spp} spp, path, {options.rounds} rounds")
    for place, scene in (("ball", ball), ("inside", inside)):
        show(place, *measure(scene, options.size, options.spp, options.rounds))
    print(f"aim of anisophong: ≤ {AIM}")
    return 0


def show(place: str, wall: dict[str, list[float]], cpu: dict[str, list[float]]) -> None:
    """A table: the ratios of every material in one scene."""
    columns = "".join(f"{side:>8}{'low':>7}{'high':>7}" for side in ("wall", "CPU"))
    print(f"{f'{place}: time / {BASELINE}':<30}{columns}{'seconds':>9}")
    for material in MATERIALS:
        cells = ""
        for times in (wall, cpu):
            ratios = [a / b for a, b in zip(times[material], times[BASELINE], strict=True)]
            cells += f"{statistics.median(ratios):>8.3f}{min(ratios):>7.2f}{max(ratios):>7.2f}"
        print(f"{material:<30}{cells}{statistics.median(wall[material]):>9.3f}")


def measure(describe: Scene, size: int, spp: int, rounds: int) -> tuple[dict[str, list[float]], dict[str, list[float]]]:
    """Wall and CPU seconds of each material, one a round."""
    import drjit as dr
    import mitsuba as mi

    def seconds(material: str, seed: int) -> tuple[float, float]:
        scene = mi.load_dict(describe(MATERIALS[material], size))  # one scene alive: others slow every kernel
        dr.eval(mi.render(scene, spp=max(1, spp // 8), seed=seed))
        dr.sync_thread()
        start, used = time.perf_counter(), time.process_time()
        dr.eval(mi.render(scene, spp=spp, seed=seed + 1))
        dr.sync_thread()
        return time.perf_counter() - start, time.process_time() - used

    wall: dict[str, list[float]] = {material: [] for material in MATERIALS}
    cpu: dict[str, list[float]] = {material: [] for material in MATERIALS}
    names = list(MATERIALS)
    for number in range(rounds):
        for material in names[number % len(names) :] + names[: number % len(names)]:
            took, used = seconds(material, 2 * number)
            wall[material].append(took)
            cpu[material].append(used)
    return wall, cpu


def inside(material: dict[str, Any], size: int) -> dict[str, Any]:
    """In a sphere of ``material``, whose front is its inner side, with a lamp."""
    import mitsuba as mi

    return {
        "type": "scene",
        "integrator": {"type": "path", "max_depth": 6},
        "room": {"type": "sphere", "radius": 3, "flip_normals": True, "bsdf": material},
        "lamp": {
            "type": "sphere", "center": [1, 0, 2], "radius": 0.3,
            "emitter": {"type": "area", "radiance": {"type": "rgb", "value": [40, 40, 40]}},
        },
        "sensor": {
            "type": "perspective", "fov": 60,
            "to_world": mi.ScalarTransform4f().look_at([0, -2, 0], [0, 2, 0], [0, 0, 1]),
            "film": {"type": "hdrfilm", "width": size, "height": size, "rfilter": {"type": "box"}},
        },
    }  # fmt: skip


def ball(material: dict[str, Any], size: int) -> dict[str, Any]:
    """A sphere of ``material`` over a diffuse plane."""
    import mitsuba as mi

    transform = mi.ScalarTransform4f()
    return {
        "type": "scene",
        "integrator": {"type": "path", "max_depth": 6},
        "ball": {"type": "sphere", "bsdf": material},
        "ground": {
            "type": "rectangle",
            "to_world": transform.translate([0, 0, -1]) @ transform.scale([20, 20, 1]),
            "bsdf": {"type": "diffuse"},
        },
        "lamp": {
            "type": "sphere", "center": [2, -1, 4], "radius": 0.3,
            "emitter": {"type": "area", "radiance": {"type": "rgb", "value": [40, 40, 40]}},
        },
        "sky": {"type": "constant", "radiance": {"type": "rgb", "value": [0.2, 0.2, 0.2]}},
        "sensor": {
            "type": "perspective", "fov": 28,
            "to_world": transform.look_at([3, 3, 2], [0, 0, 0], [0, 0, 1]),
            "film": {"type": "hdrfilm", "width": size, "height": size, "rfilter": {"type": "box"}},
        },
    }  # fmt: skip


if __name__ == "__main__":
    try:
        sys.exit(main())
    except DartboardError as error:
        sys.exit(str(error))
