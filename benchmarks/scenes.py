"""
How long the built-in scenes take to load: the aim is less than a second each.

    python -m benchmarks.scenes [--runs 7] [--colour rgb|spectral]

One process that has Mitsuba already. *first* is the first load of the scene in it; *median* is over all runs, each at a
film of 256 × 256. *vet* is what the owner does without Mitsuba: read the file, check it, work out its digest.
"""

from __future__ import annotations

import argparse
import os
import statistics
import time
from pathlib import Path

from renderer import devices
from renderer.catalog import COLOURS
from renderer.scenes.builtin import BUILTIN
from renderer.scenes.sources import find

AIM_SECONDS = 1.0


def main() -> int:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.scenes")
    parser.add_argument("--runs", type=int, default=7)
    parser.add_argument("--colour", choices=sorted(COLOURS), default="rgb")
    options = parser.parse_args()
    device = devices.pick("auto")
    os.environ.update(device.environment)
    from renderer.scenes.load import load
    from renderer.variant import name, use

    use(name(device.name, options.colour))
    print(f"{'scene':16}{'vet s':>9}{'first s':>9}{'median s':>10}{'aim':>6}")
    worst = 0.0
    for scene in BUILTIN:
        start = time.perf_counter()
        source = find(scene, Path())
        vetted = time.perf_counter() - start
        seconds = []
        for _ in range(options.runs):
            start = time.perf_counter()
            load(source.folder, source.main, width=256, height=256)
            seconds.append(time.perf_counter() - start)
        worst = max(worst, *seconds)
        print(f"{scene:16}{vetted:>9.3f}{seconds[0]:>9.3f}{statistics.median(seconds):>10.3f}{AIM_SECONDS:>6.1f}")
    return 0 if worst < AIM_SECONDS else 1


if __name__ == "__main__":
    raise SystemExit(main())
