"""One picture outside of the queue: ``dartboard render``. What is not given comes from the scene file."""

from __future__ import annotations

import re
import shutil
import tempfile
from pathlib import Path
from typing import Any

from jobs.executors.base import Failed, Finished, Order, Passed
from jobs.executors.local import LocalExecutor
from jobs.gridpoints import check_count, file_of, with_points
from jobs.gridspec import MAX_PIXELS, MAX_SIDE, Crop
from renderer import catalog, devices
from renderer.errors import BadParameter, DartboardError, EnvironmentProblem, SceneError, UnknownName
from renderer.samplers import pointfile
from renderer.samplers.pointfile import PointSource
from renderer.scenes import sources
from renderer.spec import CellSpec, Choice, Estimand
from service.progress import single_bar
from service.settings import usable_kernel_caches


def render_one(
    scene: str,
    output: Path,
    *,
    integrator: str | None,
    sampler: str | None,
    spp: int | None,
    seed: int,
    size: str | None,
    max_depth: int | None,
    crop: str | None,
    rfilter: str | None,
    device: str,
) -> dict[str, Any]:
    """
    Render a scene to ``output`` and say what was rendered.

    ``seed`` k is replicate k of the cell, the same picture that replicate k of a grid would be. Raises
    ``DartboardError`` with one sentence for any bad value, before anything is rendered.
    """
    if not output.parent.is_dir():
        raise BadParameter(f"no folder {output.parent} to write {output.name} to; make it first")
    if output.suffix.lower() != ".exr":
        raise BadParameter(f"cannot write {output.name}: pictures are OpenEXR files; give a name that ends in .exr")
    source = sources.find(scene, Path())
    points = _point_file(sampler)
    spec = cell(
        source, integrator=integrator, sampler=sampler, spp=spp, size=size, max_depth=max_depth, crop=crop,
        rfilter=rfilter, points=points,
    )  # fmt: skip
    with tempfile.TemporaryDirectory(prefix="dartboard-") as folder:
        out = Path(folder)
        snapshot = sources.snapshot(source, out / "scenes")
        if points:
            pointfile.snapshot(points, out / "points")
        (out / "work").mkdir()
        order = Order(
            order=1, spec=spec.text, colour="rgb", scene=snapshot, main=source.main,
            trust="builtin" if source.builtin else source.digest, replicates=(("cell", seed),), out=out / "work",
            points=out / "points",
        )  # fmt: skip
        executor = LocalExecutor(
            devices.pick(device), kernels=usable_kernel_caches(out), logs=out / "logs", cwd=out / "empty"
        )
        try:
            finished = _draw(executor, order)
        finally:
            executor.close()
        part = output.with_name(output.name + ".part")
        shutil.move(order.out / finished.file, part)
        part.replace(output)
    width, height = spec.estimand.size
    return {
        "output": str(output), "scene": source.name, "width": width, "height": height,
        "integrator": catalog.label("integrator", spec.integrator), "sampler": catalog.label("sampler", spec.sampler),
        "max_depth": spec.estimand.max_depth, "crop": spec.estimand.crop,
        "rfilter": catalog.label("rfilter", spec.estimand.rfilter),
        "spp_actual": spec.spp, "seed": seed, "digest": spec.digest,
        "render_seconds": finished.render_seconds, "compile_seconds": finished.compile_seconds,
        "device": finished.device,
    }  # fmt: skip


def cell(
    source: sources.SceneSource,
    *,
    integrator: str | None,
    sampler: str | None,
    spp: int | None,
    size: str | None,
    max_depth: int | None,
    crop: str | None = None,
    rfilter: str | None = None,
    points: PointSource | None = None,
) -> CellSpec:
    """
    The cell that these options mean for this scene, with the scene's own settings for what is not given.

    points  the file of a ``pointset`` sampler
    """
    defaults = source.defaults
    how = _choice("integrator", integrator, defaults.integrator, source.name)
    drawing = _choice("sampler", sampler, defaults.sampler, source.name)
    asked = defaults.spp if spp is None else spp
    if points:
        drawing = with_points(drawing, points, Path(points.name).name)
        check_count(points, asked, "--spp")
    width, height = _size(size) if size else (defaults.width, defaults.height)
    entry = catalog.find("integrator", how.name)
    parameters = dict(how.parameters)
    depth = parameters.get("max_depth", defaults.max_depth if max_depth is None else _depth(max_depth))
    depth = entry.depth if entry.depth is not None else int(depth)
    moved = {parameter.name for parameter in entry.parameters if parameter.estimand}
    estimand = Estimand(
        source.digest, width, height, depth, _choice("rfilter", rfilter, defaults.rfilter, source.name),
        _crop(crop, width, height) if crop else defaults.crop_at(width, height),
        hide_emitters=bool(parameters.get("hide_emitters", False)),
        strategy=catalog.strategy(how),
    )  # fmt: skip
    catalog.check_depth(how, depth, source.name)
    how = Choice(how.name, how.version, tuple(pair for pair in how.parameters if pair[0] not in moved))
    return CellSpec(estimand, how, drawing, catalog.rendered_spp(drawing, asked, "--spp"))


def _point_file(sampler: str | None) -> PointSource | None:
    """The file that ``--sampler pointset:file=…`` names; None for any other sampler."""
    name = file_of(catalog.resolve("sampler", sampler, "--sampler")) if sampler else None
    return pointfile.find(name, Path()) if name else None


def _choice(axis: str, given: str | None, default: str, scene: str) -> Choice:
    if given is not None:
        return catalog.resolve(axis, given, f"--{axis}")
    try:
        return catalog.resolve(axis, default)
    except UnknownName as error:
        raise SceneError(f"the {axis} of the scene {scene!r} is {default!r}, which Dartboard does not offer; "
                         f"choose one with --{axis}: {', '.join(catalog.entries(axis))}") from error  # fmt: skip
    except DartboardError as error:
        raise SceneError(f"{error}, as the scene {scene!r} has it; choose one with --{axis}") from error


def _depth(given: int) -> int:
    """``--max-depth`` by the rule that grids follow."""
    rule = next(item for item in catalog.find("integrator", "path").parameters if item.name == "max_depth")
    return int(rule.read(given, "--max-depth"))


def _size(text: str) -> tuple[int, int]:
    match = re.fullmatch(r"(\d{1,6})\s*[x×X]\s*(\d{1,6})", text)
    width, height = (int(match[1]), int(match[2])) if match else (0, 0)
    if not 1 <= width <= MAX_SIDE or not 1 <= height <= MAX_SIDE or width * height > MAX_PIXELS:
        raise BadParameter(
            f"--size {text!r} is not allowed; write WIDTHxHEIGHT in pixels, each from 1 to {MAX_SIDE} and together "
            f"at most {MAX_PIXELS}"
        )
    return width, height


def _crop(text: str, width: int, height: int) -> Crop | None:
    """``--crop``; None where it is the whole film."""
    match = re.fullmatch(r"\s*" + r"\s*,\s*".join([r"(\d{1,6})"] * 4) + r"\s*", text)
    x, y, wide, high = (int(number) for number in match.groups()) if match else (0, 0, 0, 0)
    if not wide or not high or x + wide > width or y + high > height:
        raise BadParameter(
            f"--crop {text!r} is not allowed; write X,Y,WIDTH,HEIGHT in pixels from the top left, inside the "
            f"{width}×{height} film"
        )
    return None if (x, y, wide, high) == (0, 0, width, height) else (x, y, wide, high)


def _draw(executor: LocalExecutor, order: Order) -> Finished:
    """The one picture; a bar on the terminal while it comes."""
    executor.submit(order)
    with single_bar(order.scene.name) as advance:
        while True:
            for event in executor.events(1.0):
                if isinstance(event, Passed):
                    advance(event.done, event.passes)
                elif isinstance(event, Finished):
                    return event
                elif isinstance(event, Failed):
                    kind = SceneError if event.error_class == "scene_error" else EnvironmentProblem
                    raise kind(event.message)
