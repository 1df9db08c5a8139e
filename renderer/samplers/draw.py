"""
Samples as a plugin draws them, without a scene: what ``dartboard points`` writes and the tests look at.

``python -m renderer.samplers.draw --sampler TEXT --spp N --sets K --seed S [--variant V] [--points FOLDER] -o
FILE.npy`` does it in a process of its own; TEXT is the canonical text of a ``Choice``.
"""

from __future__ import annotations

import argparse
import json
import math
import os
import sys
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from renderer.errors import DartboardError
from renderer.spec import Choice


def draw(
    sampler: Choice, spp: int, sets: int, seed: int, *, kinds: str = "2", points: Path | None = None
) -> list[NDArray[np.float64]]:
    """
    The first samples of ``sets`` pixels, in the order in which an integrator would ask for them.

    The pixels are those of a nearly square picture, row by row. ``kinds`` says what is asked for: "2112" is a 2D
    sample, two 1D samples and a 2D sample. For each an array comes back: (sets, spp, 2), or (sets, spp) for 1D. Needs a
    variant.
    """
    from renderer.render import make_sampler, samples_per_pass

    width = math.isqrt(sets - 1) + 1
    height = -(-sets // width)
    plugin: Any = make_sampler(sampler, spp, points)
    k = samples_per_pass(width * height, spp)
    plugin.set_samples_per_wavefront(k)
    passes: list[list[NDArray[np.float64]]] = []
    for first in range(0, spp, k):
        if hasattr(plugin, "frame"):
            plugin.frame(width, height, (0, 0, width, height), k, first)
        if first == 0:
            plugin.seed(seed, width * height * k)
        else:
            plugin.advance()
        passes.append([_asked(plugin, kind, width * height, k) for kind in kinds])
    return [np.concatenate(parts, axis=1)[:sets] for parts in zip(*passes, strict=True)]


def _asked(plugin: Any, kind: str, pixels: int, samples: int) -> NDArray[np.float64]:
    """One sample of every lane, as (pixels, samples) or (pixels, samples, 2)."""
    if kind == "1":
        return np.array(plugin.next_1d(), dtype=np.float64).reshape(pixels, samples)
    x, y = plugin.next_2d()
    return np.stack([np.array(x, dtype=np.float64), np.array(y, dtype=np.float64)], axis=-1).reshape(pixels, samples, 2)


def main() -> int:
    parser = argparse.ArgumentParser(prog="python -m renderer.samplers.draw")
    parser.add_argument("--sampler", required=True)
    for name in ("--spp", "--sets", "--seed"):
        parser.add_argument(name, type=int, required=True)
    parser.add_argument("--variant", default="llvm_ad_rgb")
    parser.add_argument("--points", type=Path)
    parser.add_argument("-o", dest="output", type=Path, required=True)
    options = parser.parse_args()
    from renderer.variant import use

    use(options.variant, int(os.environ.get("DARTBOARD_THREADS", "0")) or None)
    try:
        choice = Choice.of(json.loads(options.sampler))
        points = draw(choice, options.spp, options.sets, options.seed, points=options.points)[0]
    except DartboardError as error:
        print(error, file=sys.stderr)
        return 2
    np.save(options.output, points)
    return 0


if __name__ == "__main__":
    sys.exit(main())
