"""
The study that students hand in, by ``dartboard run``: how long its 144 cells take, cold and warm.

    python -m benchmarks.study [--grid examples/study.toml] [--runs 3]

Seconds from the first claim to the last finish, as the database has them, each run in a new data directory. *cold*: the
user's caches (compiled kernels, point tables, the found LLVM) are empty, once. *warm*: they are filled. *bare*: a loop
without queue, database and owner that draws the same cells and writes the same files, with the same caches. Every run,
of either kind, starts a render process of its own, and that is within its seconds. Runs of both alternate; the ratio is
that of the medians. *command*: from the shell's point of view.

pbrt-v3 took 266 s on two cores for a study of that shape (4 scenes, 4 samplers, path, bdpt and mlt, 8, 16 and 32 spp,
128 × 128) with the students' plugins, 159 s of these to throw darts.
"""

from __future__ import annotations

import argparse
import datetime
import os
import statistics
import subprocess
import sys
import tempfile
import time
from dataclasses import astuple, dataclass, replace
from pathlib import Path

from benchmarks.overhead import Bare
from jobs import grid as grids
from jobs import plan
from jobs.store import Store
from renderer import devices

ROOT = Path(__file__).resolve().parent.parent
PBRT_SECONDS = 266.0
AIM_SECONDS = 45.0
TRUST = "builtin"  # the trust class of the kernels and tables of our scenes


@dataclass(frozen=True)
class Run:
    """
    seconds  from the first claim to the last finish
    command  of the whole command
    render   of all pictures, without code generation
    compile  of code generation
    """

    seconds: float
    command: float
    render: float
    compile: float


def main() -> int:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.study")
    parser.add_argument("--grid", type=Path, default=ROOT / "examples" / "study.toml")
    parser.add_argument("--runs", type=int, default=3)
    options = parser.parse_args()
    device = devices.pick()
    planned = plan.expand(grids.read(options.grid))
    if any(cell.replicates != 1 for cell in planned.cells):
        parser.error(f"{options.grid} wants replicates or references, and the bare loop draws one picture a cell")
    with tempfile.TemporaryDirectory() as name:
        root, caches = Path(name), Path(name) / "cache"
        print(f"{options.grid.name}: {len(planned.cells)} cells on {device.description}", flush=True)
        cold = run(options.grid, root / "cold", caches)
        warm, loop = [], []
        bare(device, caches, root / "bare", planned)  # its kernels are not all those of ``run``: not counted
        for index in range(options.runs):
            warm.append(run(options.grid, root / f"warm{index}", caches))
            loop.append(bare(device, caches, root / f"bare{index}", planned))
    show(cold, warm, loop)
    return 0


def run(grid: Path, data: Path, caches: Path) -> Run:
    """One ``dartboard run`` in a data directory of its own, with its user's caches in ``caches``."""
    start = time.perf_counter()
    subprocess.run(
        [sys.executable, "-m", "service.cli", "run", str(grid), "--data", str(data)], cwd=ROOT, check=True,
        stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, env={**os.environ, "XDG_CACHE_HOME": str(caches)},
    )  # fmt: skip
    command = time.perf_counter() - start
    store = Store.read(data)
    try:
        results = store.rows("results", experiment_id=1)
        attempts = [row for cell in range(1, len(results) + 1) for row in store.rows("attempts", cell_id=cell)]
    finally:
        store.close()
    assert all(row["state"] == "done" for row in results), "some cells failed"
    began, ended = (
        side(datetime.datetime.fromisoformat(row[column]) for row in attempts)
        for side, column in ((min, "started_at"), (max, "ended_at"))
    )
    render, compiled = (sum(row[f"{what}_seconds"] for row in results) for what in ("render", "compile"))
    return Run((ended - began).total_seconds(), command, render, compiled)


def bare(device: devices.Device, caches: Path, pictures: Path, planned: plan.Plan) -> float:
    """Seconds of the bare loop, its start included, with the kernels and point tables that ``run`` has made."""
    pictures.mkdir()
    folder = caches / "dartboard"
    own = {"DRJIT_CACHE_DIR": str(folder / "kernels" / TRUST), "DARTBOARD_TABLES": str(folder / "tables" / TRUST)}
    start = time.perf_counter()
    loop = Bare(replace(device, environment=device.environment | own))
    loop.run(pictures, planned)
    seconds = time.perf_counter() - start
    loop.close()
    return seconds


def show(cold: Run, warm: list[Run], loop: list[float]) -> None:
    print(f"{'':8}{'seconds':>9}{'command':>9}{'render':>9}{'compile':>9}")
    middle = Run(*(statistics.median(column) for column in zip(*map(astuple, warm), strict=True)))
    for title, one in (("cold", cold), ("warm", middle)):
        print(f"{title:8}{one.seconds:9.2f}{one.command:9.2f}{one.render:9.2f}{one.compile:9.2f}")
    print(f"{'bare':8}{statistics.median(loop):9.2f}")
    print(f"medians of {len(loop)}; all warm {' '.join(f'{one.seconds:.2f}' for one in warm)},"
          f" bare {' '.join(f'{seconds:.2f}' for seconds in loop)}")  # fmt: skip
    print(f"ratio to the bare loop {middle.seconds / statistics.median(loop):.3f}")
    print(f"pbrt-v3 {PBRT_SECONDS:.0f} s; aim of warm < {AIM_SECONDS:.0f} s")


if __name__ == "__main__":
    sys.exit(main())
