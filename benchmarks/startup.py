"""
How long the command line takes to answer, and that it does so without Mitsuba.

    python -m benchmarks.startup [--runs 7]

Medians of fresh processes. ``check`` and ``results`` read the example grid and a data directory that holds it,
unrendered; what is timed is everything from the shell's point of view.
"""

from __future__ import annotations

import argparse
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from jobs import experiments, grid, plan
from jobs.store import Store

ROOT = Path(__file__).resolve().parent.parent
AIM_SECONDS = 0.8
LOADED = (
    "import sys\nsys.argv[1:] = {words!r}\nfrom service import cli\n"
    "try:\n    cli.main()\nexcept SystemExit:\n    pass\n"
    "print('mitsuba' in sys.modules, file=sys.stderr)"
)


def main() -> int:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.startup")
    parser.add_argument("--runs", type=int, default=7)
    runs = parser.parse_args().runs
    example = ROOT / "examples" / "first.toml"
    with tempfile.TemporaryDirectory() as name:
        data = Path(name)
        store = Store.open(data)
        planned = plan.expand(grid.read(example))
        experiments.submit(store, planned, data / "scenes")
        store.close()
        commands = {
            "--help": ["--help"],
            "check": ["check", str(example), "--data", str(data)],
            "results": ["results", "1", "--format", "csv", "--data", str(data)],
            "status": ["status", "--data", str(data)],
            "catalog": ["catalog", "--json"],
        }
        print(f"{'command':10}{'median s':>10}{'aim':>8}  Mitsuba loaded")
        for title, words in commands.items():
            seconds = []
            for _ in range(runs):
                start = time.perf_counter()
                subprocess.run(
                    [sys.executable, "-m", "service.cli", *words], cwd=ROOT, stdout=subprocess.DEVNULL, check=True
                )
                seconds.append(time.perf_counter() - start)
            told = subprocess.run(
                [sys.executable, "-c", LOADED.format(words=words)], cwd=ROOT, stdout=subprocess.DEVNULL,
                stderr=subprocess.PIPE, text=True,
            )  # fmt: skip
            loaded = told.stderr.split()[-1] == "True"
            print(f"{title:10}{statistics.median(seconds):10.2f}{AIM_SECONDS:8}  {'yes' if loaded else 'no'}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
