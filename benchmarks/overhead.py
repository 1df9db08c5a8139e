"""
What recording costs: a grid of 48 small cells through the queue, against a bare loop that draws the same pictures.

    python -m benchmarks.overhead [--runs 5]

Both sides have a warm render process and write the same EXR files; the queue's side also commits, fsyncs and moves
every picture. Runs are interleaved, and the ratio is that of the medians (science: one ratio of two single runs says
nothing on a machine with neighbours). Start-up of the render process is printed apart.
"""

from __future__ import annotations

import argparse
import json
import platform
import statistics
import subprocess
import sys
import tempfile
import time
from functools import partial
from pathlib import Path
from typing import Any

from jobs import experiments, owner, plan
from jobs import grid as grids
from jobs.artifacts import Artifacts
from jobs.dispatcher import Dispatcher, News
from jobs.executors.base import Order
from jobs.executors.local import LocalExecutor
from jobs.store import Store
from renderer import devices, variant
from renderer.scenes import sources
from renderer.spec import CellSpec, seed
from service.settings import kernel_caches

AIM = 1.10
GRID = {
    "name": "overhead",
    "scenes": ["cornell_box", "defocus"],
    "samplers": ["independent", "stratified", "multijitter", "orthogonal"],
    "integrators": ["path", "direct"],
    "spp": [16, 36, 64],  # 48 cells that no sampler rounds onto each other
    "replicates": 1,
    "resolution": [64, 64],
    "reference": False,
}


def queued(folder: Path, planned: plan.Plan, local: LocalExecutor, device: str) -> float:
    """Seconds from the first claim to the last finish, in a data directory of its own."""
    artifacts = Artifacts(folder)
    last = 0.0

    def hear(news: News) -> None:
        nonlocal last
        if news.kind == "done":
            last = time.perf_counter()

    with owner.own(folder):
        artifacts.prepare()
        store = Store.open(folder)
        experiment, _ = experiments.submit(store, planned, artifacts.scenes)
        dispatcher = Dispatcher(
            store, artifacts, local, machine=platform.node(), device=device, experiment=experiment.id, on_news=hear
        )
        start = time.perf_counter()
        dispatcher.run()
        standing = experiments.standing(store, experiment.id)
        store.close()
    assert standing.had == standing.wanted == len(planned.cells), standing
    return last - start


class Bare:
    """A warm process that draws the cells one after another and writes their files: the loop a script would have."""

    def __init__(self, device: devices.Device):
        import os

        self.process = subprocess.Popen(
            [sys.executable, "-m", "benchmarks.overhead", "--bare", variant.name(device.name, "rgb")], text=True,
            stdin=subprocess.PIPE, stdout=subprocess.PIPE, env={**os.environ, **device.environment},
        )  # fmt: skip

    def run(self, folder: Path, planned: plan.Plan) -> float:
        cells = []
        for planned_cell in planned.cells:
            source = sources.find(planned_cell.scene, Path())
            cells.append([planned_cell.spec.text, str(source.folder), source.main])
        assert self.process.stdin is not None and self.process.stdout is not None
        self.process.stdin.write(json.dumps({"folder": str(folder), "cells": cells}) + "\n")
        self.process.stdin.flush()
        return float(self.process.stdout.readline())

    def close(self) -> None:
        assert self.process.stdin is not None
        self.process.stdin.close()
        self.process.wait()


def serve_bare(name: str) -> None:
    from renderer.variant import use

    use(name)
    from renderer.images import write_picture
    from renderer.render import render
    from renderer.scenes.load import load

    for line in sys.stdin:
        asked: dict[str, Any] = json.loads(line)
        start = time.perf_counter()
        scene, loaded = "", None
        for text, folder, main in asked["cells"]:
            spec = CellSpec.parse(text)
            if folder != scene:
                loaded = load(Path(folder), main, width=spec.estimand.width, height=spec.estimand.height)
                scene = folder
            assert loaded is not None
            for rendering in render(spec, loaded, [seed(spec.digest, 0)]):
                write_picture(Path(asked["folder"]) / f"{spec.digest}.exr", rendering.picture, {"spec": spec.text})
        print(time.perf_counter() - start, flush=True)


def start_up(local: LocalExecutor, planned: plan.Plan, folder: Path) -> float:
    """Seconds until a new render process has drawn its first cell."""
    cell = planned.cells[0]
    source = sources.find(cell.scene, Path())
    start = time.perf_counter()
    local.submit(Order(0, cell.spec.text, "rgb", source.folder, source.main, "builtin", (("cell", 0),), folder))
    while not any(type(event).__name__ in ("Done", "Failed") for event in local.events(1.0)):
        pass
    return time.perf_counter() - start


def main() -> int:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.overhead")
    parser.add_argument("--runs", type=int, default=5)
    parser.add_argument("--bare", metavar="VARIANT", help="serve as the bare side")
    arguments = parser.parse_args()
    if arguments.bare:
        serve_bare(arguments.bare)
        return 0
    device = devices.pick()
    with tempfile.TemporaryDirectory() as name:
        root = Path(name)
        planned = plan.expand(grids.parse(GRID, find=partial(sources.find, base=root), origin="benchmark"))
        assert len({cell.spec.digest for cell in planned.cells}) == 48
        (root / "first").mkdir()
        local = LocalExecutor(device, kernels=kernel_caches(), logs=root / "logs", cwd=root / "empty")
        bare = Bare(device)
        seconds = start_up(local, planned, root / "first")
        times: dict[str, list[float]] = {"queue": [], "bare": []}
        for index in range(-1, arguments.runs):  # the first pair fills the caches and is not counted
            (root / f"bare{index}").mkdir()
            pair = (
                queued(root / f"queue{index}", planned, local, device.name),
                bare.run(root / f"bare{index}", planned),
            )
            if index >= 0:
                times["queue"].append(pair[0])
                times["bare"].append(pair[1])
        local.close()
        bare.close()
    print(f"48 cells of 64×64, 16 to 64 spp, on {device.description}; start-up to the first cell {seconds:.2f} s")
    print(f"{'':8}{'median s':>10}{'all':>8}")
    for side, found in times.items():
        print(f"{side:8}{statistics.median(found):10.3f}   {' '.join(f'{value:.3f}' for value in found)}")
    ratio = statistics.median(times["queue"]) / statistics.median(times["bare"])
    print(f"ratio {ratio:.3f} (aim ≤ {AIM})")
    return 0


if __name__ == "__main__":
    sys.exit(main())
