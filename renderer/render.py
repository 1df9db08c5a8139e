"""
Rendering one cell: the pass loop.

A picture of spp samples is cut into passes of k samples per pixel that keep memory bounded, give progress
and previews, and can be interrupted between two of them. k is a function of the cell alone, never of the
machine, so a cell is the same picture everywhere. Strata and nets span all passes: the sampler knows the
full spp. Sums are kept in float64 on the host, one pass behind the device, so neither waits for the other.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from renderer import catalog
from renderer.errors import BadParameter
from renderer.frame import Frame, PassSum
from renderer.integrators.adapter import IntegratorAdapter, adapter
from renderer.scenes.load import LoadedScene
from renderer.spec import CellSpec, Choice, stream_seed

# Aimed at, about 340 MB of wavefront: 16 samples per pixel of a 512×512 picture, so that the lanes of one SIMD packet
# start in one pixel and stay together. 2**20 (4 samples) is up to 7 % slower; 2**24 no faster, with passes of seconds.
PASS_LANES = 2**22
MAX_PASS_LANES = 2**24  # never more, about 480 MB, unless one sample per pixel already is


@dataclass(frozen=True)
class Progress:
    """
    What is known between two passes of one replicate.

    picture  makes the mean of the samples so far, (H, W, 3) float32; costs nothing unless called
    """

    replicate: int
    passes_done: int
    passes: int
    seconds: float
    picture: Callable[[], NDArray[np.float32]]


@dataclass(frozen=True)
class Rendering:
    """
    One finished replicate.

    picture          (H, W, 3) float32, linear radiance, rows from the top
    render_seconds   wall time of its passes without code generation
    compile_seconds  wall time of code generation (0 when every kernel was cached in memory)
    """

    replicate: int
    seed: int
    picture: NDArray[np.float32]
    render_seconds: float
    compile_seconds: float


def samples_per_pass(pixels: int, spp: int) -> int:
    """
    k: the divisor of spp whose pass is closest to PASS_LANES on a logarithmic scale, within MAX_PASS_LANES.

    A divisor, because Mitsuba's samplers cut their strata evenly over passes. 1 where even that is too large.
    """
    fitting = [k for k in _divisors(spp) if pixels * k <= MAX_PASS_LANES]
    return min(fitting, key=lambda k: (max(pixels * k / PASS_LANES, PASS_LANES / (pixels * k)), k), default=1)


def render(
    spec: CellSpec,
    loaded: LoadedScene,
    seeds: Iterable[int],
    on_pass: Callable[[Progress], None] = lambda progress: None,
    points: Path | None = None,
) -> Iterator[Rendering]:
    """
    Draw one picture of ``spec`` per seed, each as soon as it is done.

    ``loaded`` is the scene of ``spec.estimand``; ``on_pass`` is called after every pass but costs only what it
    does itself. ``points`` is the folder of the point sets that people brought along, by digest. Raises
    ``BadParameter`` if the sampler does not take the spp of the spec, or the scene not what the sweep sets in it.
    """
    loaded.settings.apply(spec.estimand.sweep)
    width, height = spec.estimand.size
    k = samples_per_pass(width * height, spec.spp)
    frame = Frame(loaded, k, spec.spp)
    integrator = adapter(spec, frame)
    samplers = [make_sampler(spec.sampler, spec.spp, points) for _ in range(integrator.streams)]
    for replicate, seed in enumerate(seeds):
        with dr.scoped_set_flag(dr.JitFlag.KernelHistory, True):
            dr.kernel_history_clear()
            start = time.perf_counter()
            picture = draw(frame, integrator, samplers, seed, spec.spp // k, replicate, on_pass)
            seconds = time.perf_counter() - start
            compiled = _compile_seconds()
        yield Rendering(replicate, seed, picture, max(seconds - compiled, 0.0), compiled)


def draw(
    frame: Frame,
    integrator: IntegratorAdapter,
    samplers: Sequence[Any],
    seed: int,
    passes: int,
    replicate: int = 0,
    on_pass: Callable[[Progress], None] = lambda progress: None,
) -> NDArray[np.float32]:
    """All passes of one replicate, as ``render`` does it: (H, W, 3) float32."""
    total = np.zeros((frame.height * frame.width, 3))
    weight: Any = np.zeros((frame.height * frame.width, 1))
    start = time.perf_counter()

    def add(pass_sum: PassSum) -> None:
        nonlocal total, weight
        sums, weights = pass_sum.read()
        total += sums
        weight += weights

    def picture() -> NDArray[np.float32]:
        with np.errstate(invalid="ignore"):
            mean = np.divide(total, weight, out=np.zeros_like(total), where=weight != 0)
        return mean.astype(np.float32).reshape(frame.height, frame.width, 3)

    def report(done: int) -> None:
        on_pass(Progress(replicate, done, passes, time.perf_counter() - start, picture))

    for number, sampler in enumerate(samplers):
        sampler.set_samples_per_wavefront(frame.samples)
        if hasattr(sampler, "stream"):
            sampler.stream(number, len(samplers))
    under_way: PassSum | None = None
    for index in range(passes):
        for number, sampler in enumerate(samplers):
            _tell_frame(sampler, frame, index * frame.samples)
            if index == 0:
                sampler.seed(stream_seed(seed, number), frame.lanes)
            else:
                sampler.advance()
        launched = integrator.render_pass(frame, samplers)
        if under_way is not None:
            add(under_way)
            report(index)
        under_way = launched
    if under_way is not None:
        add(under_way)
        report(passes)
    return picture()


def _tell_frame(sampler: Any, frame: Frame, first_sample: int) -> None:
    """
    Tell a sampler of ours what ``mi.render`` never tells a Python sampler: picture, crop and pass.

    ``sampler.frame(width, height, crop, spp_per_pass, first_sample)`` is called before ``seed`` and before each
    ``advance``; width and height are the whole film's, crop is (x, y, width, height), all in pixels.
    """
    tell = getattr(sampler, "frame", None)
    if tell is not None:
        crop = (*frame.offset, frame.width, frame.height)
        tell(*frame.film_size, crop, frame.samples, first_sample)


def make_sampler(choice: Choice, spp: int, points: Path | None = None) -> Any:
    """
    The plugin of a sampler, for ``spp`` samples per pixel; ``points`` as for ``render``.

    Raises ``BadParameter`` if it takes another number of samples, or if its point set is not in the folder.
    """
    entry = catalog.find("sampler", choice.name)
    parameters = dict(choice.parameters)
    if (digest := parameters.pop("points", None)) is not None:
        parameters["path"] = str(_point_file(points, str(digest), str(parameters.pop("file", ""))))
    sampler = mi.load_dict({"type": entry.plugin, "sample_count": spp, **parameters})
    if sampler.sample_count() != spp:
        raise BadParameter(
            f"the sampler {choice.name!r} would render {sampler.sample_count()} samples per pixel, "
            f"the cell says {spp}; its rounding rule in the catalog is wrong"
        )
    return sampler


def _point_file(points: Path | None, digest: str, name: str) -> Path:
    """The snapshot of a point set."""
    file = points / f"{digest}.npz" if points else None
    if file is None or not file.is_file():
        raise BadParameter(f"the points of {name} are not in the data directory; submit the grid again with its file")
    return file


def _compile_seconds() -> float:
    """Code generation since the history was cleared: Dr.Jit's own and the backend's, in seconds."""
    kernels = dr.kernel_history([dr.KernelType.JIT])
    return sum(kernel.get("codegen_time", 0.0) + kernel.get("backend_time", 0.0) for kernel in kernels) / 1000


def _divisors(number: int) -> list[int]:
    small = [k for k in range(1, int(number**0.5) + 1) if number % k == 0]
    return sorted({*small, *(number // k for k in small)})
