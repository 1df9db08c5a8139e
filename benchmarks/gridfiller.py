"""
A data directory with a large, finished experiment in it, without rendering it: for benchmarks of what reads.

Rows are those that a render would leave: cells go through the queue, replicates are measured by the measurer, and only
the numbers and the pictures are made up. Errors fall with spp at the rate of their sampler and spread over replicates,
pictures lose their noise, a few cells fail. The picture files are hard links to a few hundred originals.
"""

from __future__ import annotations

import math
import os
import zlib
from functools import partial
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from jobs import experiments, grid, measure, plan, points, queue
from jobs.artifacts import Artifacts
from jobs.queue import Work
from jobs.store import Row, Store
from renderer.images import write_picture
from renderer.metrics import METRICS
from renderer.scenes import sources
from renderer.spec import CellSpec

SIDE = 128  # pixels, as in the demo grid
VARIANTS = 4  # pictures of one look that differ in their noise
FAILED = 0.002  # of all cells: a picture with NaN in it, or a render process that dies of it
FLOOR = 1e-6  # relative squared error that the reference leaves
# error ~ spp^-rate; about what these samplers do in scenes with soft shadows
RATES = {"independent": 1.0, "stratified": 1.2, "multijitter": 1.35}

Floats = NDArray[np.float64]


def large_grid(cells: int, replicates: int) -> dict[str, object]:
    """A grid of about ``cells`` cells: 2 scenes × 10 integrators × 5 samplers × as many spp as it takes."""
    return {
        "name": f"{cells} cells", "scenes": ["cornell_box", "defocus"], "replicates": replicates,
        "samplers": ["independent", "stratified", "stratified:jitter=false", "multijitter", "multijitter:jitter=false"],
        "integrators": ["path", "direct", *(f"path:rr_depth={depth}" for depth in (2, 3, 4, 6, 7, 8, 9, 10))],
        "spp": [n * n for n in range(1, max(1, cells // 100) + 1)], "resolution": [SIDE, SIDE],
        "reference": {"spp": 10**6},
    }  # fmt: skip


def fill(data: Path, cells: int, replicates: int = 4) -> int:
    """Make ``data`` hold the experiment; its id."""
    artifacts = Artifacts(data)
    artifacts.prepare()
    store = Store.open(data)
    asked = grid.parse(large_grid(cells, replicates), find=partial(sources.find, base=data), origin="a benchmark")
    found, _ = experiments.submit(store, plan.expand(asked), artifacts.scenes)
    rng = np.random.default_rng(1)
    album = Album(data / "originals", rng)
    drawn: dict[int, CellSpec] = {}
    with store.transaction():
        while work := queue.claim(store, machine="a benchmark", device="llvm"):
            drawn[work.cell_id] = work.spec
            _draw(store, artifacts, work, album, rng)
    Inventor(store, artifacts, drawn, rng).invent()
    points.refresh_experiment(store, found.id)
    store.close()
    return found.id


def _draw(store: Store, artifacts: Artifacts, work: Work, album: Album, rng: np.random.Generator) -> None:
    """What the dispatcher does with a cell; one in some hundred is the same in all its attempts: it fails."""
    only_cell = all(role == "cell" for role, _ in work.missing)
    fate = zlib.crc32(work.digest.encode()) / 2**32
    fails = only_cell and fate < FAILED
    drawn = work.missing if not fails else work.missing[:1] if fate < FAILED / 4 else ()
    for role, k in drawn:
        image = artifacts.picture(work.digest, role, k)
        path = artifacts.path(image)
        path.parent.mkdir(parents=True, exist_ok=True)
        os.link(album.picture(work.spec), path)
        queue.finish_replicate(
            store, work, role, k, image=image, seed=k, threads=2, neighbours=0, compile_seconds=0.0,
            render_seconds=1e-3 + 2e-4 * work.spec.spp * float(rng.lognormal(0.0, 0.05)),
        )  # fmt: skip
    if not fails:
        queue.finish(store, work)
    elif fate < FAILED / 2:
        _fail(
            store,
            artifacts,
            work,
            "nan_output",
            f"12 of {SIDE * SIDE} pixels of replicate {len(drawn)} are NaN or infinite",
        )
    else:
        _fail(store, artifacts, work, "crash", "the render process was ended by SIGSEGV")


def _fail(store: Store, artifacts: Artifacts, work: Work, error_class: str, message: str) -> None:
    log = "Dr.Jit: jit_eval(): launching 1 kernel\n" * 40
    queue.fail(store, work, error_class, message, artifacts.write_log(work.attempt_id, log))


def _choice(spec: CellSpec) -> int:
    """A number that cells with the same scene and integrator share."""
    return zlib.crc32(f"{spec.estimand.scene} {spec.integrator}".encode())


def _error(spec: CellSpec) -> float:
    """The relative squared error that one replicate is expected to have."""
    scale = 1 + _choice(spec) % 997 / 500
    return scale * float(spec.spp ** -RATES[spec.sampler.name]) + FLOOR


class Album:
    """Pictures that look the part: one ball in a lit corner per scene and integrator, with the noise of an error."""

    def __init__(self, folder: Path, rng: np.random.Generator):
        self.folder, self.rng = folder, rng
        self.made: dict[tuple[int, int], list[Path]] = {}
        folder.mkdir()

    def picture(self, spec: CellSpec) -> Path:
        """A file for a replicate; made when the first one of its kind is asked for."""
        level = round(2 * math.log10(_error(spec)))
        look = _choice(spec)
        key = (look, level)
        if key not in self.made:
            self.made[key] = [self.folder / f"{look}-{level}-{variant}.exr" for variant in range(VARIANTS)]
            for path in self.made[key]:
                write_picture(path, self._noisy(_scene(look), 10 ** (level / 2)), {})
        return self.made[key][int(self.rng.integers(VARIANTS))]

    def _noisy(self, clean: Floats, error: float) -> Floats:
        """Noise whose variance grows with brightness and has the long tail of light that is seldom found."""
        shape = 1 / max(error, 1e-9)
        return clean * self.rng.gamma(shape, 1 / shape, clean.shape)


def _scene(look: int) -> Floats:
    y, x = np.mgrid[0 : 1 : SIDE * 1j, 0 : 1 : SIDE * 1j]
    distance = np.hypot(x - 0.3 - look % 5 / 10, y - 0.6)
    radius = 0.15 + look % 7 / 60
    ball = np.where(distance < radius, 0.2 + 0.6 * np.sqrt(np.clip(1 - (distance / radius) ** 2, 0, 1)), 0)
    wall = 0.15 + 0.5 * (1 - y) * np.exp(-3 * (x - 0.5) ** 2)
    colour = 0.4 + 0.6 * np.array([look % 11, look % 13, look % 17]) / [10, 12, 16]
    return np.asarray(np.where(ball > 0, ball, wall)[..., None] * colour + 0.02)


class Inventor(measure.Measurer):
    """The measurer, with invented numbers where it would read pictures."""

    def __init__(self, store: Store, artifacts: Artifacts, drawn: dict[int, CellSpec], rng: np.random.Generator):
        super().__init__(store, artifacts)
        self.drawn, self.rng = drawn, rng

    def invent(self) -> None:
        """Measure everything, to the end."""
        self.look_for_gaps()
        while self.step(1.0):
            pass

    def _measure(self, pair: Row) -> bool:
        error = _error(self.drawn[pair["cell_id"]])
        relmse = error * float(self.rng.gamma(200.0, 1 / 200.0))  # a few per cent from picture to picture
        mse = 0.2 * relmse * float(self.rng.lognormal(0.0, 0.02))
        values = {
            "relmse": relmse, "mse": mse, "mse_cross": mse - 0.2 * FLOOR * float(self.rng.lognormal(0.0, 0.1)),
            "mean_ratio": 1 + float(self.rng.normal(0.0, math.sqrt(error) / SIDE)),
        }  # fmt: skip
        self.store.run_many(
            "add_metric",
            [
                {
                    "replicate_id": pair["replicate_id"], "reference_id": pair["reference_id"],
                    "reference_replicates": pair["reference_replicates"], "name": name, "version": metric.version,
                    "value": values[name], "reason": None,
                }
                for name, metric in METRICS.items()
            ],
        )  # fmt: skip
        return True
