"""
What a sampler costs in a render: seconds of a Cornell box, divided by those of ``independent`` in the same round.

    python -m benchmarks.samplers [--size 192] [--spp 64 256] [--rounds 15] [--only NAME …]

All samplers draw the same scene in one process with warm kernels. A round draws each of them once, in an order that
rotates; a ratio is the median over the rounds of a sampler's seconds by the mean of the two ``independent`` renders
around the round, so that a machine that slows down slows both. Tables: bytes on the device. Making them: cold, without
a cache.
"""

from __future__ import annotations

import argparse
import os
import statistics
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

from renderer import catalog, devices
from renderer.errors import BadParameter
from renderer.scenes import sources
from renderer.spec import CellSpec, Estimand

BASELINE = "independent"
AIMS = {"zsobol": 1.15, "halton": 1.30}
AIM = 1.05
OURS = ("poissondisk", "relaxedpoissondisk", "eliminated", "sobol", "pmj02bn", "zsobol", "halton")
MITSUBAS = ("stratified", "multijitter", "orthogonal", "ldsampler")
AIM_TABLE_MB = 64


def main() -> int:
    parser = argparse.ArgumentParser()
    parser.add_argument("--size", type=int, default=192)
    parser.add_argument("--spp", type=int, nargs="+", default=[64, 256])
    parser.add_argument("--rounds", type=int, default=15)
    parser.add_argument("--only", nargs="+", default=[*MITSUBAS, *OURS])
    options = parser.parse_args()
    device = devices.pick("auto")
    os.environ.update(device.environment)
    with tempfile.TemporaryDirectory() as tables:
        os.environ["DARTBOARD_TABLES"] = tables
        from renderer.variant import name, use

        use(name(device.name, "rgb"))
        print(f"{device.description}; Cornell box {options.size}², path, max_depth 6, {options.rounds} rounds")
        ratios = {spp: measure(options.only, options.size, spp, options.rounds) for spp in options.spp}
        made = {sampler: making(sampler, max(options.spp)) for sampler in options.only if sampler in OURS}
    head = "".join(f"{f'{spp} spp':>10}{'low':>7}{'high':>7}" for spp in options.spp)
    print(f"{'time / ' + BASELINE:<22}{head}{'aim':>8}{'tables MB':>11}{'made in s':>11}")
    for sampler in options.only:
        cells = "".join(f"{statistics.median(r):>10.3f}{min(r):>7.2f}{max(r):>7.2f}"
                        for r in (ratios[spp][sampler] for spp in options.spp))  # fmt: skip
        aim = f"{AIMS.get(sampler, AIM):.2f}" if sampler in OURS else ""
        size, seconds = made.get(sampler, ("", ""))
        print(f"{sampler:<22}{cells}{aim:>8}{size:>11}{seconds:>11}")
    print(f"aim of the tables: < {AIM_TABLE_MB} MB")
    return 0


def measure(samplers: list[str], size: int, spp: int, rounds: int) -> dict[str, list[float]]:
    """Ratios of each sampler, one a round."""
    from renderer.render import render
    from renderer.scenes.load import load

    source = sources.find("cornell_box", Path())
    estimand = Estimand(source.digest, size, size, 6, catalog.resolve("rfilter", "box"))
    loaded = load(source.folder, source.main, width=size, height=size)

    def seconds(sampler: str, seed: int) -> float:
        choice = catalog.resolve("sampler", sampler)
        rendered = catalog.rendered_spp(choice, spp)
        spec = CellSpec(estimand, catalog.resolve("integrator", "path"), choice, rendered)
        return next(render(spec, loaded, [seed])).render_seconds * spp / rendered

    for sampler in (BASELINE, *samplers):  # kernels, tables and caches
        seconds(sampler, 1)
    ratios: dict[str, list[float]] = {sampler: [] for sampler in samplers}
    for number in range(rounds):
        order = samplers[number % len(samplers) :] + samplers[: number % len(samplers)]
        before = seconds(BASELINE, 2 * number)
        for sampler in order:
            took = seconds(sampler, number)
            after = seconds(BASELINE, 2 * number + 1)
            ratios[sampler].append(took / ((before + after) / 2))
            before = after
    return ratios


def making(sampler: str, spp: int) -> tuple[str, str]:
    """Megabytes of the sampler's tables on the device, and seconds to make them without a cache."""
    from renderer.render import make_sampler
    from renderer.samplers.tabled import TABLES

    plugin: Any = make_sampler(catalog.resolve("sampler", sampler), spp)
    if not hasattr(plugin, "sets"):
        return "", ""
    TABLES.clear()
    with tempfile.TemporaryDirectory() as tables:
        os.environ["DARTBOARD_TABLES"] = tables
        start = time.perf_counter()
        plugin.prepare()
        took = time.perf_counter() - start
    size = sum(4 * len(array) for array in (plugin.table.points, plugin.table.ranks))
    return f"{size / 1e6:.2f}", f"{took:.2f}"


if __name__ == "__main__":
    try:
        sys.exit(main())
    except BadParameter as error:
        sys.exit(str(error))
