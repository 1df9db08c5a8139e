"""
A data directory with a large, finished experiment in it, without rendering it: for benchmarks of what reads.

Rows are those that a render would leave, through the queue and the measurer's own statements; the picture files are
hard links to a few real ones.
"""

from __future__ import annotations

import os
from functools import partial
from pathlib import Path

import numpy as np

from jobs import experiments, grid, plan, points, queue
from jobs.artifacts import Artifacts
from jobs.store import Store
from renderer.images import write_picture
from renderer.metrics import METRICS
from renderer.scenes import sources

SIDE = 64  # pixels


def large_grid(cells: int, replicates: int) -> dict[str, object]:
    """A grid of about ``cells`` cells: 2 scenes × 5 integrators × 5 samplers × as many spp as it takes."""
    count = max(1, cells // 50)
    return {
        "name": f"{cells} cells", "scenes": ["cornell_box", "defocus"], "replicates": replicates,
        "samplers": ["independent", "stratified", "stratified:jitter=false", "multijitter", "multijitter:jitter=false"],
        "integrators": ["path", "direct", *(f"path:max_depth={depth}" for depth in (2, 3, 4))],
        "spp": [n * n for n in range(1, count + 1)], "resolution": [SIDE, SIDE], "reference": {"spp": 10**6},
    }  # fmt: skip


def fill(data: Path, cells: int, replicates: int = 4) -> int:
    """Make ``data`` hold the experiment; its id."""
    artifacts = Artifacts(data)
    artifacts.prepare()
    store = Store.open(data)
    asked = grid.parse(large_grid(cells, replicates), find=partial(sources.find, base=data), origin="a benchmark")
    found, _ = experiments.submit(store, plan.expand(asked), artifacts.scenes)
    rng = np.random.default_rng(1)
    originals = []
    for index in range(8):
        originals.append(data / f"original-{index}.exr")
        write_picture(originals[-1], rng.gamma(2.0, 0.1, (SIDE, SIDE, 3)), {})
    with store.transaction():
        while work := queue.claim(store, machine="a benchmark", device="llvm"):
            for role, k in work.missing:
                image = artifacts.picture(work.digest, role, k)
                path = artifacts.path(image)
                path.parent.mkdir(parents=True, exist_ok=True)
                os.link(originals[rng.integers(8)], path)
                replicate = queue.finish_replicate(
                    store, work, role, k, image=image, seed=k, render_seconds=1e-5 * work.spec.spp,
                    compile_seconds=0.0, threads=2, neighbours=0,
                )  # fmt: skip
                if role == "cell":
                    store.run_many("add_metric", _numbers(store, replicate, work.cell_id, work.spec.spp, rng))
            queue.finish(store, work)
    points.refresh_experiment(store, found.id)
    store.close()
    return found.id


def _numbers(store: Store, replicate: int, cell: int, spp: int, rng: np.random.Generator) -> list[dict[str, object]]:
    rows = [
        {"reference_id": reference, "replicates": 2}
        for (reference,) in store.connection.execute(
            "select distinct reference_id from experiment_cell where cell_id = ? and role = 'cell'", (cell,)
        )
    ]
    return [
        {
            "replicate_id": replicate, "reference_id": row["reference_id"], "reference_replicates": row["replicates"],
            "name": name, "version": metric.version, "value": float(rng.gamma(50.0, 0.02 / spp)), "reason": None,
        }
        for row in rows
        for name, metric in METRICS.items()
    ]  # fmt: skip
