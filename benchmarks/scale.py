"""
The largest grid, 100 000 cells: how long does ``check`` take, and how long until it is in the database?

    python -m benchmarks.scale

Prints seconds per step, each the median of several fresh processes; ``check`` is the real command, from the command
line to the answer. No cell is rounded onto another, which is the most work there can be.
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

CHECK_AIM_SECONDS, INSERT_AIM_SECONDS = 3.0, 5.0

STEPS = {
    "import": "Python modules (without Mitsuba)",
    "read": "read and check the file, find the scenes",
    "expand": "make the cells, in order",
    "estimate": "digests of all cells, pictures, seconds, bytes",
    "insert": f"into an empty database; aim: < {INSERT_AIM_SECONDS:g} s",
    "claim": "the first cell of 100 000",
    "again": "submitting the same grid once more, which changes nothing",
    "check": f"the whole command `dartboard check`; aim: < {CHECK_AIM_SECONDS:g} s",
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
        from jobs import estimate, experiments, grid, plan, queue, store

        return estimate, experiments, grid, plan, queue, store

    estimate, experiments, grid, plan, queue, store = timed("import", load)
    spec = timed("read", lambda: grid.read(path))
    cells = timed("expand", lambda: plan.expand(spec))
    told = timed("estimate", lambda: estimate.estimate(cells))
    assert told.cells == grid.MAX_CELLS, told.cells
    with tempfile.TemporaryDirectory() as folder:
        database = store.Store.open(Path(folder))
        scenes = Path(folder) / "scenes"
        experiment, created = timed("insert", lambda: experiments.submit(database, cells, scenes))
        assert created == told.cells + told.references, created
        assert timed("claim", lambda: queue.claim(database, machine="m", device="d", experiment=experiment.id))
        assert timed("again", lambda: experiments.submit(database, cells, scenes))[1] == 0
        database.close()
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
            command = [sys.executable, "-m", "benchmarks.scale", "--one", str(path)]
            spent = json.loads(subprocess.run(command, check=True, capture_output=True, text=True).stdout)
            start = time.perf_counter()
            check = [sys.executable, "-m", "service.cli", "check", str(path), "--data", folder]
            subprocess.run(check, check=True, capture_output=True)
            runs.append(spent | {"check": time.perf_counter() - start})
    print(f"{'step':10} {'median':>8} {'worst':>8}   what")
    for name, line in STEPS.items():
        values = [run[name] for run in runs]
        print(f"{name:10} {statistics.median(values):6.2f} s {max(values):6.2f} s   {line}")


if __name__ == "__main__":
    main()
