"""
What integrators and light samplers gain at equal time, and what they cost.

    python -m benchmarks.integrators [--parts error time start] [--scenes NAME …] [--size 128] [--spp 64]
                                     [--replicates 16] [--reference-spp 1024] [--rounds 3]

About five minutes on two cores.

*error*: K pictures by each integrator, interleaved. At equal time each gets the spp that take as long as ``path`` takes
for ``--spp``, by a measurement just before; the seconds that were really used stand beside. With I a picture, R the
reference, s² the variance of a pixel over the K pictures:

    relMSE    mean over pictures, pixels and channels of (I − R)² / (R² + 0.01), as in renderer/metrics.py
    scatter   standard deviation over mean of the relMSE of *one* picture: fireflies make it large
    variance  mean over pixels and channels of s²: needs no reference, and means the same as all are unbiased

Ratios are to ``path``, with a 95 % interval by bootstrap over the pictures of both. The reference is drawn in two
halves, with seeds that no picture has; *floor* is what its own noise adds to every relMSE.

*time*: seconds of cells of ``cornell_box``, divided by the mean of the two renders by Mitsuba's C++ ``path`` around
them, median of the rounds. ``path_lights`` is forced there; ``path`` takes it only where there is a choice of lamps.

*start*: the first call in a new process, with an empty kernel cache and then with a filled one; peak memory of a
process that draws one large cell.
"""

from __future__ import annotations

import argparse
import os
import resource
import statistics
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from benchmarks.throughput import child
from renderer import catalog, devices
from renderer.errors import DartboardError
from renderer.metrics import METRICS, RELMSE_EPSILON, Reference
from renderer.scenes import sources
from renderer.spec import CellSpec, Estimand, seed
from renderer.variant import name as variant_name

Pictures = NDArray[np.floating]  # (K, H, W, 3)

BASELINE = "path"
SPATIAL = "path:light_sampler=spatial"
PARTS = ("error", "time", "start")
RESAMPLINGS = 4000
START_SCENES = ("cornell_box", "glass_caustic", "many_lights")
MEMORY_SIZE, MEMORY_SPP = 512, 64
AIM_PATH, AIM_BDPT = 1.10, 0.25  # time of path / Mitsuba's; samples per second of bdpt / those of path
AIM_COLD_SECONDS, AIM_CACHED_SECONDS, AIM_MEMORY_GIB = 6.0, 1.0, 2.0


@dataclass(frozen=True)
class Trial:
    """
    labels     of the integrators that are compared with ``path``
    reference  the integrator of the reference
    aims       (label, metric) → the largest ratio that is wanted, at equal time
    even       the same at equal spp, where light samplers of ``path`` are compared; empty where nobody asks
    """

    labels: tuple[str, ...]
    reference: str
    aims: dict[tuple[str, str], float]
    even: dict[tuple[str, str], float]


TRIALS = {
    "hidden_lamp": Trial(("bdpt",), "bdpt", {("bdpt", "relMSE"): 1 / 5}, {}),
    "glass_caustic": Trial(("bdpt:aim=false", "bdpt"), "bdpt", {("bdpt", "relMSE"): 1 / 3}, {}),
    "many_lights": Trial(
        ("path:light_sampler=power", SPATIAL, "path:light_sampler=bvh", "bdpt", "bdpt:light_sampler=spatial"), SPATIAL,
        {(SPATIAL, "variance"): 1 / 10}, {(SPATIAL, "variance"): 1 / 15},
    ),
}  # fmt: skip


def main() -> int:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.integrators")
    parser.add_argument("--parts", nargs="+", choices=PARTS, default=PARTS)
    parser.add_argument("--scenes", nargs="+", choices=tuple(TRIALS), default=tuple(TRIALS), help="of the part error")
    parser.add_argument("--size", type=int, default=128)
    parser.add_argument("--spp", type=int, default=64, help="of path")
    parser.add_argument("--replicates", type=int, default=16)
    parser.add_argument("--reference-spp", type=int, default=1024)
    parser.add_argument("--rounds", type=int, default=3)
    options = parser.parse_args()
    device = devices.pick("auto")
    os.environ.update(device.environment)
    variant = variant_name(device.name, "rgb")
    print(f"{device.description}; independent samples, box filter, the scenes' own max_depth")
    if "start" in options.parts:  # first: this process holds no memory and no thread yet
        show_start(variant)
    from renderer.variant import use

    use(variant)
    if "time" in options.parts:
        show_time(Stage("cornell_box", options.size), options.spp, options.rounds)
    if "error" in options.parts:
        for scene in options.scenes:
            stage = Stage(scene, options.size)
            show_error(stage, TRIALS[scene], options.spp, options.replicates, options.reference_spp, options.rounds)
    return 0


class Stage:
    """A built-in scene as it is drawn here; only one is alive at a time, because others slow every kernel."""

    def __init__(self, scene: str, size: int):
        from renderer.scenes.load import load

        source = sources.find(scene, Path())
        depth = source.defaults.max_depth
        self.scene, self.size = scene, size
        self.estimand = Estimand(source.digest, size, size, depth, catalog.resolve("rfilter", "box"))
        self.loaded = load(source.folder, source.main, width=size, height=size)

    def spec(self, label: str, spp: int) -> CellSpec:
        return CellSpec(
            self.estimand, catalog.resolve("integrator", label), catalog.resolve("sampler", "independent"), spp
        )

    def draw(self, label: str, spp: int, replicate: int, reference: bool = False) -> tuple[float, Any]:
        """Seconds without code generation, and the picture."""
        from renderer.render import render

        spec = self.spec(label, spp)
        drawn = next(render(spec, self.loaded, [seed(spec.digest, replicate, reference=reference)]))
        return drawn.render_seconds, drawn.picture


# ------------------------------------------------------------------------------------------ error


@dataclass
class Measured:
    """K pictures of one integrator at one spp, the seconds of each, and their reference."""

    label: str
    spp: int
    seconds: list[float]
    pictures: list[Any]
    reference: Reference

    @cached_property
    def relmse(self) -> NDArray[np.floating]:
        """One a picture."""
        return np.array([METRICS["relmse"].value(picture, self.reference) for picture in self.pictures])

    @cached_property
    def products(self) -> NDArray[np.floating]:
        """(K, K): mean over pixels of the products of two pictures' deviations, enough for any resampled variance."""
        flat = np.stack(self.pictures).astype(np.float64).reshape(len(self.pictures), -1)
        flat -= flat.mean(0)
        return flat @ flat.T / flat.shape[1]

    def value(self, metric: str, counts: NDArray[np.integer] | None = None) -> float:
        """``relMSE`` or ``variance``; ``counts`` says how often each picture counts, once by default."""
        number = len(self.pictures)
        counted = np.ones(number) if counts is None else counts
        if metric == "relMSE":
            return float(counted @ self.relmse / number)
        return float((counted @ self.products.diagonal() - counted @ self.products @ counted / number) / (number - 1))

    @property
    def mean_ratio(self) -> float:
        return float(np.mean([METRICS["mean_ratio"].value(picture, self.reference) for picture in self.pictures]))


def show_error(stage: Stage, trial: Trial, spp: int, replicates: int, reference_spp: int, rounds: int) -> None:
    """A table at equal time, and one at equal spp where that is asked for."""
    labels = (BASELINE, *trial.labels)
    costs = seconds_per_spp(stage, labels, spp, rounds)
    half = max(1, reference_spp // 2)
    reference = Reference(*(stage.draw(trial.reference, half, k, reference=True)[1] for k in (0, 1)))
    floor = METRICS["relmse"].floor
    assert floor is not None
    size, depth = stage.size, stage.estimand.max_depth
    told = f"reference {trial.reference}, 2 × {half} spp, floor {floor(reference):.2e}, ε {RELMSE_EPSILON}"
    print(f"\n{stage.scene} {size}×{size}, max_depth {depth}, {replicates} pictures each")
    print(told)
    same_time = {label: max(1, round(spp * costs[BASELINE] / costs[label])) for label in labels}
    tables = [("equal time", same_time, trial.aims)]
    if trial.even:
        pickers = [label for label in labels if label.partition(":")[0] == BASELINE]
        tables.append(("equal spp", dict.fromkeys(pickers, spp), trial.even))
    for title, counts, aims in tables:
        show_ratios(title, measure(stage, counts, replicates, reference), aims)


def seconds_per_spp(stage: Stage, labels: tuple[str, ...], spp: int, rounds: int) -> dict[str, float]:
    """Median seconds of one sample per pixel, warm; all are drawn in each round."""
    for label in labels:
        stage.draw(label, spp, 0)
    found: dict[str, list[float]] = {label: [] for label in labels}
    for number in range(rounds):
        for label in rotated(labels, number):
            found[label].append(stage.draw(label, spp, number)[0] / spp)
    return {label: statistics.median(seconds) for label, seconds in found.items()}


def measure(stage: Stage, counts: dict[str, int], replicates: int, reference: Reference) -> list[Measured]:
    """``replicates`` pictures by each integrator with its spp, drawn in turn."""
    found = {label: Measured(label, spp, [], [], reference) for label, spp in counts.items()}
    for k in range(replicates):
        for label in rotated(tuple(counts), k):
            seconds, picture = stage.draw(label, counts[label], k)
            found[label].seconds.append(seconds)
            found[label].pictures.append(picture)
    return list(found.values())


def show_ratios(title: str, found: list[Measured], aims: dict[tuple[str, str], float]) -> None:
    first = found[0]
    print(f"{title:<30}{'spp':>6}{'seconds':>9}{'relMSE':>10}{'scatter':>9}{'brightness':>12}"
          f"{'relMSE / ' + BASELINE:>16}{'95 %':>16}{'variance':>11}{'/ ' + BASELINE:>9}{'95 %':>16}  aim")  # fmt: skip
    for one in found:
        scatter = one.relmse.std(ddof=1) / one.relmse.mean()
        line = (f"{one.label:<30}{one.spp:>6}{statistics.median(one.seconds):>9.3f}{one.value('relMSE'):>10.3e}"
                f"{scatter:>9.2f}{one.mean_ratio:>12.4f}")  # fmt: skip
        for metric, wide in (("relMSE", 16), ("variance", 9)):
            ratio, low, high = ratio_of(one, first, metric)
            value = f"{one.value(metric):>11.3e}" if metric == "variance" else ""
            line += value + (f"{one_in(ratio):>{wide}}{f'{one_in(high)} … {one_in(low)}':>16}" if one is not first
                             else " " * (wide + 16))  # fmt: skip
        told = [f"{metric} ≤ {one_in(most)}" for (label, metric), most in aims.items() if label == one.label]
        print((line + "  " + ", ".join(told)).rstrip())


def ratio_of(one: Measured, other: Measured, metric: str) -> tuple[float, float, float]:
    """The ratio of two, and the ends of its 95 % interval: pictures of both are drawn again with replacement."""
    ratio = one.value(metric) / other.value(metric)
    generator = np.random.default_rng(1)

    def again(measured: Measured) -> float:
        number = len(measured.pictures)
        return measured.value(metric, generator.multinomial(number, np.full(number, 1 / number)))

    pairs = np.array([(again(one), again(other)) for _ in range(RESAMPLINGS)])
    with np.errstate(divide="ignore", invalid="ignore"):  # a variance of one picture, drawn again and again
        low, high = np.nanquantile(pairs[:, 0] / pairs[:, 1], [0.025, 0.975])
    return ratio, float(low), float(high)


def one_in(ratio: float) -> str:
    """``1/25`` for small ratios, as the aims are written."""
    return f"1/{1 / ratio:.3g}" if 0 < ratio < 1 else f"{ratio:.3g}"


def rotated(labels: tuple[str, ...], number: int) -> tuple[str, ...]:
    return (*labels[number % len(labels) :], *labels[: number % len(labels)])


# ------------------------------------------------------------------------------------------ time


def show_time(stage: Stage, spp: int, rounds: int) -> None:
    """Cells of one scene against Mitsuba's own renderer in the same rounds."""
    import mitsuba as mi

    depth = stage.estimand.max_depth
    native: Any = mi.load_dict({"type": "path", "max_depth": depth})

    def bare(number: int) -> float:
        start = time.perf_counter()
        native.render(stage.loaded.scene, stage.loaded.sensor, seed=seed("bare", number), spp=spp).numpy()
        return time.perf_counter() - start

    sides: dict[str, Callable[[int], float]] = {
        label: lambda k, label=label: stage.draw(label, spp, k)[0]  # type: ignore[misc]
        for label in ("path", "path:light_sampler=power", SPATIAL, "path:light_sampler=bvh")
    }
    for light_sampler in ("uniform", "spatial"):
        sides[f"path_lights, {light_sampler}"] = forced(stage, light_sampler, spp)
    sides |= {
        label: lambda k, label=label: stage.draw(label, spp, k)[0]  # type: ignore[misc]
        for label in ("volpath", "ptracer", "bdpt")
    }
    ratios: dict[str, list[float]] = {label: [] for label in sides}
    seconds: dict[str, list[float]] = {label: [] for label in sides}
    for number in range(-1, rounds):  # the first round makes kernels and is not counted
        before = bare(2 * number)
        for label in rotated(tuple(sides), max(number, 0)):
            took = sides[label](number)
            after = bare(2 * number + 1)
            if number >= 0:
                seconds[label].append(took)
                ratios[label].append(took / ((before + after) / 2))
            before = after
    samples = stage.size**2 * spp / 1e6
    print(f"\n{stage.scene} {stage.size}×{stage.size}, {spp} spp, max_depth {depth}, one lamp, {rounds} rounds")
    print(f"{'time / Mitsuba C++ path':<30}{'median':>8}{'low':>7}{'high':>7}{'Msamples/s':>12}{'aim':>8}")
    for label, found in ratios.items():
        aim = f"≤ {AIM_PATH:.2f}" if label.startswith("path") and "path_lights" not in label else ""
        rate = samples / statistics.median(seconds[label])
        print(f"{label:<30}{statistics.median(found):>8.3f}{min(found):>7.2f}{max(found):>7.2f}{rate:>12.2f}{aim:>8}")
    share = statistics.median(p / b for p, b in zip(seconds["path"], seconds["bdpt"], strict=True))
    print(f"samples per second of bdpt / those of path: {one_in(share)} (aim ≥ {one_in(AIM_BDPT)})")


def forced(stage: Stage, light_sampler: str, spp: int) -> Callable[[int], float]:
    """Seconds of a cell that is drawn by ``path_lights``, although Mitsuba's ``path`` would draw the same."""
    import mitsuba as mi

    from renderer.frame import Frame
    from renderer.integrators.adapter import CameraPaths
    from renderer.render import draw, make_sampler, samples_per_pass

    plugin: Any = mi.load_dict(
        {"type": "path_lights", "light_sampler": light_sampler, "max_depth": stage.estimand.max_depth}
    )
    plugin.use(stage.loaded.scene, stage.loaded.lights.get(light_sampler, ()))
    k = samples_per_pass(stage.size**2, spp)
    frame = Frame(stage.loaded, k, spp)
    sampler = make_sampler(catalog.resolve("sampler", "independent"), spp)

    def timed(number: int) -> float:
        start = time.perf_counter()
        draw(frame, CameraPaths(plugin), [sampler], seed(light_sampler, number), spp // k)
        return time.perf_counter() - start

    return timed


# ------------------------------------------------------------------------------------------ start


def show_start(variant: str) -> None:
    """First calls, and the memory of a large cell."""
    print(f"\n{'first call, 64×64, 1 spp':<38}{'cold s':>9}{'compile':>9}{'cached s':>10}{'compile':>9}{'again s':>9}")
    for scene in START_SCENES:
        for label in ("path", SPATIAL, "bdpt") if scene == "many_lights" else ("path", "bdpt"):
            with empty_kernel_cache():
                cold, cached = child(first_call, variant, scene, label), child(first_call, variant, scene, label)
            print(f"{f'{scene} {label}':<38}{cold[0]:>9.2f}{cold[1]:>9.2f}{cached[0]:>10.2f}{cached[1]:>9.2f}"
                  f"{cached[2]:>9.3f}")  # fmt: skip
    print(f"aims of bdpt: cold < {AIM_COLD_SECONDS:g} s, cached < {AIM_CACHED_SECONDS:g} s")
    memory = child(peak_memory, variant, "cornell_box", "bdpt")
    print(f"peak memory of bdpt, cornell_box {MEMORY_SIZE}×{MEMORY_SIZE}, {MEMORY_SPP} spp: {memory:.2f} GiB "
          f"(aim < {AIM_MEMORY_GIB:g})")  # fmt: skip


@contextmanager
def empty_kernel_cache() -> Iterator[None]:
    """Child processes keep their kernels in a folder that is empty at first."""
    kept = os.environ.get("DRJIT_CACHE_DIR")
    with tempfile.TemporaryDirectory() as folder:
        os.environ["DRJIT_CACHE_DIR"] = folder
        try:
            yield
        finally:
            os.environ.pop("DRJIT_CACHE_DIR")
            if kept is not None:
                os.environ["DRJIT_CACHE_DIR"] = kept


def first_call(variant: str, scene: str, label: str, answer: Any) -> None:
    """(seconds of the first picture, of these in code generation, seconds of the second picture)."""
    from renderer.variant import use

    use(variant)
    from renderer.render import render  # it names types of the variant

    stage = Stage(scene, 64)
    spec = stage.spec(label, 1)
    start = time.perf_counter()
    drawn = next(render(spec, stage.loaded, [1]))
    first = time.perf_counter() - start
    start = time.perf_counter()
    next(render(spec, stage.loaded, [2]))
    answer.put((first, drawn.compile_seconds, time.perf_counter() - start))


def peak_memory(variant: str, scene: str, label: str, answer: Any) -> None:
    """GiB that a process had at most."""
    from renderer.variant import use

    use(variant)
    Stage(scene, MEMORY_SIZE).draw(label, MEMORY_SPP, 0)
    answer.put(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 2**20)


if __name__ == "__main__":
    try:
        sys.exit(main())
    except DartboardError as error:
        sys.exit(str(error))
