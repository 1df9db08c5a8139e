"""
What the pass loop costs: samples per second of a Cornell box, against one bare ``mi.render``, and peak memory.

    python -m benchmarks.throughput [--runs 5] [--spp 256] [--size 512] [--memory-spp 1024]

Both sides draw the same scene with the same integrator and sampler in one process, interleaved, kernels warm.
Memory is the peak of a process that draws one cell of ``--memory-spp``.
"""

from __future__ import annotations

import argparse
import multiprocessing
import queue
import resource
import statistics
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

from renderer import catalog, devices
from renderer.scenes import sources
from renderer.spec import CellSpec, Estimand
from renderer.variant import name as variant_name

AIM_RATIO = 0.95
AIM_MEMORY_GIB = 3.0


def prepare(variant: str, size: int, spp: int) -> tuple[Any, CellSpec]:
    from renderer.variant import use

    use(variant)
    from renderer.scenes.load import load

    source = sources.find("cornell_box", Path())
    spec = CellSpec(
        Estimand(source.digest, size, size, 6, catalog.resolve("rfilter", "box")),
        catalog.resolve("integrator", "path"), catalog.resolve("sampler", "independent"), spp,
    )  # fmt: skip
    return load(source.folder, source.main, width=size, height=size), spec


def peak_memory(variant: str, size: int, spp: int, answer: Any) -> None:
    loaded, spec = prepare(variant, size, spp)
    from renderer.render import render  # it names types of the variant

    next(render(spec, loaded, [1]))
    answer.put(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 2**20)


def compare(variant: str, size: int, spp: int, runs: int, answer: Any) -> None:
    import mitsuba as mi

    loaded, spec = prepare(variant, size, spp)
    from renderer.render import render  # it names types of the variant

    native: Any = mi.load_dict({"type": "path", "max_depth": 6})

    def bare(seed: int) -> None:
        native.render(loaded.scene, loaded.sensor, seed=seed, spp=spp).numpy()

    def ours(seed: int) -> None:
        next(render(spec, loaded, [seed]))

    def timed(side: Callable[[int], None], seed: int) -> float:
        start = time.perf_counter()
        side(seed)
        return time.perf_counter() - start

    pairs = [(timed(ours, seed), timed(bare, seed)) for seed in range(runs + 1)][1:]
    answer.put(pairs)


class ChildDied(Exception):
    """A measurement in a process of its own gave no answer."""


def child(work: Callable[..., None], *arguments: Any) -> Any:
    """
    Run in a fresh process, so that neither memory nor kernels of one measurement are another's. Raises ``ChildDied``
    where it gives no answer; it has said why by then.
    """
    context = multiprocessing.get_context("spawn")
    answer = context.Queue()
    process = context.Process(target=work, args=(*arguments, answer))
    process.start()
    while True:
        try:
            result = answer.get(timeout=1)
            break
        except queue.Empty:
            if not process.is_alive():
                raise ChildDied(f"the measurement ended with exit code {process.exitcode}") from None
    process.join()
    return result


def main() -> int:
    import os

    parser = argparse.ArgumentParser(prog="python -m benchmarks.throughput")
    parser.add_argument("--runs", type=int, default=5)
    parser.add_argument("--spp", type=int, default=256)
    parser.add_argument("--size", type=int, default=512)
    parser.add_argument("--memory-spp", type=int, default=1024)
    asked = parser.parse_args()
    device = devices.pick()
    os.environ.update(device.environment)
    variant, samples = variant_name(device.name, "rgb"), asked.size**2 * asked.spp
    pairs = child(compare, variant, asked.size, asked.spp, asked.runs)
    rates = [samples / statistics.median(column) / 1e6 for column in zip(*pairs, strict=True)]
    print(f"cornell_box {asked.size}×{asked.size} × {asked.spp} spp, path, on {device.description}")
    print(f"  pass loop  {rates[0]:6.2f} Msamples/s\n  mi.render  {rates[1]:6.2f} Msamples/s")
    print(f"  ratio      {rates[0] / rates[1]:6.3f} (aim ≥ {AIM_RATIO}), medians of {asked.runs} interleaved runs")
    memory = child(peak_memory, variant, asked.size, asked.memory_spp)
    print(f"  peak memory at {asked.memory_spp} spp: {memory:.2f} GiB (aim < {AIM_MEMORY_GIB})")
    return 0


if __name__ == "__main__":
    sys.exit(main())
