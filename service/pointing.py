"""
The points of a sampler as a file, a picture and numbers: ``dartboard points``.

They are drawn by the plugin itself, in a child process (``renderer.samplers.draw``) that ends when it has written them:
what is measured here is what a render uses. Measuring and drawing the figure need no Mitsuba.
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from jobs.executors.local import explain_exit
from jobs.gridpoints import check_count, file_of, with_points
from renderer import catalog, devices
from renderer.errors import BadParameter, EnvironmentProblem
from renderer.samplers import pointfile
from renderer.samplers.pointfile import PointSource
from renderer.spec import Choice
from renderer.variant import name as variant_name
from service.output import whole
from service.settings import usable_kernel_caches

MAX_SAMPLES = 4_000_000  # of all sets together: what a point file may hold, so that every one can be read again
ROOT = Path(__file__).resolve().parent.parent

Points = NDArray[np.float64]


def points_of(
    sampler: str, output: Path, *, spp: int, sets: int, seed: int, plot: Path | None, device: str
) -> dict[str, Any]:
    """
    Write the first 2D samples of ``sets`` pixels to ``output`` (.npz), a figure of them to ``plot`` (.png) if one is
    wanted, and say what they are: ``renderer.samplers.analysis.summary``, the sampler and its spp.

    The file holds ``points``, (K, N, 2) float64 in [0, 1), ``sampler``, ``spp`` and ``seed``; N is the spp that the
    sampler renders. Raises ``DartboardError`` with one sentence for any bad value, before anything is drawn.
    """
    _check_file(output, ".npz", "points are numpy archives")
    if plot:
        _check_file(plot, ".png", "figures are PNG pictures")
    choice, source = _choice(sampler)
    rendered = catalog.rendered_spp(choice, spp, "--spp")
    if source:
        check_count(source, rendered, "--spp")
    if sets * rendered > MAX_SAMPLES:
        raise BadParameter(
            f"{sets} sets of {rendered} points are more than {MAX_SAMPLES}, the most that a point file holds; ask for "
            f"fewer with --sets or --spp"
        )
    points = _draw(choice, source, rendered, sets, seed, device)

    from renderer.samplers.analysis import summary  # SciPy takes a second to import: not while options may be wrong

    label = catalog.label("sampler", choice)
    numbers = summary(points)
    pointfile.write(output, points, sampler=label, spp=rendered, seed=seed)
    if plot:
        from renderer.samplers.figure import figure_png

        with whole(plot) as file:
            file.write(figure_png(points, label, numbers))
    return {
        "output": str(output), "plot": str(plot) if plot else None, "sampler": label, "spp": spp,
        "spp_actual": rendered, "sets": sets, "seed": seed, "replay": catalog.is_replay(choice),
        "maximal": _maximal(choice), "numbers": numbers,
    }  # fmt: skip


def show(told: dict[str, Any]) -> None:
    """What ``points_of`` says, as a table for people."""
    from rich import box
    from rich.console import Console
    from rich.table import Table

    from renderer.samplers.analysis import full_grids

    numbers = told["numbers"]
    distance, void, discrepancy = (numbers[key] for key in ("min_distance", "coverage_radius", "l2_star"))
    rounded = f" ({told['spp']} asked)" if told["spp"] != told["spp_actual"] else ""
    console = Console(highlight=False)
    what = f"{told['sets']} sets of {told['spp_actual']} points{rounded} of {told['sampler']}"
    console.print(f"{told['output']}: {what}", soft_wrap=True)
    table = Table(box=box.SIMPLE_HEAD)
    for column in ("measure", "value", "relative", "to"):
        table.add_column(column, justify="right" if column in ("value", "relative") else "left")
    table.add_row("smallest distance", f"{distance['value']:.5f}", f"{distance['relative']:.3f}", "hexagonal bound")
    table.add_row("  in the worst set", "", f"{distance['worst']:.3f}", "hexagonal bound")
    table.add_row("radius of the largest void", f"{void['value']:.5f}", f"{void['relative']:.3f}", "hexagonal lattice")
    if discrepancy:
        table.add_row("L2-star discrepancy", f"{discrepancy['value']:.5f}", f"{discrepancy['relative']:.3f}", "random")
    table.add_row("power at the lowest frequencies", "", f"{numbers['low_frequency_power']:.3f}", "random")
    console.print(table)
    if numbers["sets"] < told["sets"]:
        console.print(f"measured: the first {numbers['sets']} of the sets")
    full = full_grids(numbers)
    every = " (all there are)" if len(full) == len(numbers["intervals"]) else ""
    console.print(f"one point in each box of these grids: {', '.join(full) or 'none'}{every}")
    if told["maximal"] is False:
        console.print("not maximal: darts at this distance leave room for more")
    if told["replay"]:
        console.print("a replay: it shows a published mistake")


def _maximal(choice: Choice) -> bool | None:
    """Whether Poisson-disk sets are maximal; None for samplers of which nobody would ask."""
    values = dict(choice.parameters)
    if choice.name != "poissondisk" or catalog.is_replay(choice):
        return None
    return "min_dist" not in values and not values["lloyd_iterations"]


def _check_file(file: Path, suffix: str, what: str) -> None:
    if not file.parent.is_dir():
        raise BadParameter(f"no folder {file.parent} to write {file.name} to; make it first")
    if file.suffix.lower() != suffix:
        raise BadParameter(f"cannot write {file.name}: {what}; give a name that ends in {suffix}")


def _choice(sampler: str) -> tuple[Choice, PointSource | None]:
    """The sampler, and the file of a ``pointset``, which lies where the command was typed."""
    choice = catalog.resolve("sampler", sampler, "SAMPLER")
    name = file_of(choice)
    if not name:
        return choice, None
    source = pointfile.find(name, Path())
    return with_points(choice, source, Path(name).name), source


def _draw(choice: Choice, source: PointSource | None, spp: int, sets: int, seed: int, device: str) -> Points:
    """The points as the plugin draws them: (sets, spp, 2)."""
    with tempfile.TemporaryDirectory(prefix="dartboard-") as name:
        folder = Path(name)
        drawing = devices.pick(device)
        kernels = usable_kernel_caches(folder)
        caches = {"DRJIT_CACHE_DIR": kernels / "builtin", "DARTBOARD_TABLES": kernels.with_name("tables") / "builtin"}
        empty = folder / "empty"  # to work in: Mitsuba looks for plugins in the working directory
        for place in (*caches.values(), empty):
            place.mkdir(parents=True, exist_ok=True)
        file, variant = folder / "points.npy", variant_name(drawing.name, "rgb")
        command = [
            sys.executable, "-m", "renderer.samplers.draw", "--sampler", choice.text, "--spp", str(spp),
            "--sets", str(sets), "--seed", str(seed), "--variant", variant, "-o", str(file),
        ]  # fmt: skip
        if source:
            pointfile.snapshot(source, folder / "points")
            command += ["--points", str(folder / "points")]
        environment = {
            **os.environ,
            **drawing.environment,
            **{key: str(place) for key, place in caches.items()},
            "PYTHONPATH": os.pathsep.join(filter(None, [str(ROOT), os.environ.get("PYTHONPATH")])),
        }
        done = subprocess.run(command, cwd=empty, env=environment, capture_output=True, text=True, errors="replace")
        if done.returncode:
            said = done.stderr.strip().splitlines() or ["nothing"]
            if done.returncode == BadParameter.exit_code:
                raise BadParameter(said[-1])
            raise EnvironmentProblem(
                f"the points were not drawn: {explain_exit(done.returncode, False)[1]}; its last words: {said[-1]}; "
                "`dartboard doctor` says what is missing here"
            )
        return np.asarray(np.load(file, allow_pickle=False), np.float64)
