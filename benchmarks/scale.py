"""
The largest grid, 100 000 cells: how long until ``check`` knows what it would cost?

    python -m benchmarks.scale

Prints seconds per step, each the median of several fresh processes, and what they add up to; the aim is less than
3 s from the command line to the answer. No cell is rounded onto another, which is the most work there can be.
"""

from __future__ import annotations

import argparse
import json
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

AIM_SECONDS = 3.0

STEPS = {
    "import": "Python modules (without Mitsuba)",
    "read": "read and check the file, find the scenes",
    "expand": "make the cells, in order",
    "estimate": "digests of all cells, pictures, seconds, bytes",
}


def write_grid(path: Path) -> None:
    """2 scenes × 100 integrators × 5 samplers × 100 spp, all different."""
    integrators = [f"path:rr_depth={depth}" for depth in range(1, 101)]
    samplers = ["independent", "stratified", "stratified:jitter=false", "multijitter", "multijitter:jitter=false"]
    axes = {
        "scenes": ["cornell_box", "defocus"],
        "integrators": integrators,
        "samplers": samplers,
        "spp": [side**2 for side in range(1, 101)],
    }
    path.write_text("".join(f"{key} = {json.dumps(values)}\n" for key, values in axes.items()), "utf-8")


def steps(path: Path) -> dict[str, float]:
    """Seconds of each step, in this process."""
    spent: dict[str, float] = {}

    def timed(name: str, step: Callable[[], Any]) -> Any:
        start = time.perf_counter()
        result = step()
        spent[name] = time.perf_counter() - start
        return result

    def load() -> Any:
        from jobs import estimate, grid, plan

        return estimate, grid, plan

    estimate, grid, plan = timed("import", load)
    spec = timed("read", lambda: grid.read(path))
    cells = timed("expand", lambda: plan.expand(spec))
    told = timed("estimate", lambda: estimate.estimate(cells))
    assert told.cells == grid.MAX_CELLS, told.cells
    return spent


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").strip().splitlines()[0])
    parser.add_argument("--runs", type=int, default=5, help="fresh processes (default 5)")
    parser.add_argument("--one", type=Path, help=argparse.SUPPRESS)  # what each fresh process is asked
    given = parser.parse_args()
    if given.one:
        print(json.dumps(steps(given.one)))
        return
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "largest.toml"
        write_grid(path)
        runs = []
        for _ in range(given.runs):
            start = time.perf_counter()
            command = [sys.executable, "-m", "benchmarks.scale", "--one", str(path)]
            spent = json.loads(subprocess.run(command, check=True, capture_output=True, text=True).stdout)
            runs.append(spent | {"whole": time.perf_counter() - start})
    print(f"{'step':10} {'median':>8} {'worst':>8}   what")
    for name, line in {**STEPS, "whole": f"the whole process; aim: < {AIM_SECONDS:g} s"}.items():
        values = [run[name] for run in runs]
        print(f"{name:10} {statistics.median(values):6.2f} s {max(values):6.2f} s   {line}")


if __name__ == "__main__":
    main()
