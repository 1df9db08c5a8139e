"""
Reading a grid: TOML or JSON in, a ``GridSpec`` without open questions out.

Every name is resolved by the catalog, every scene is found and vetted, every limit is checked, and all problems are
told together (``GridError``). Which cells follow is the business of ``plan.py``. No Mitsuba is imported.

A grid has these keys; all but ``scenes`` may be left out. Where a list is expected one value may stand alone.

    name         how people call the experiment (default: the name of the file)
    scenes       names of built-in scenes, and paths relative to the grid's own folder
    samplers     NAME, NAME:key=value or { type = NAME, key = value } (default: independent); the file of a pointset
                 is a path relative to the grid's own folder
    integrators  the same (default: path)
    spp          samples per pixel, 1 to 10⁷ (default: 16, 64, 256); every sampler rounds by its own rule
    replicates   pictures of each cell with different seeds, 1 to 1000 (default: 4, enough to see a spread)
    resolution   [width, height] in pixels (default: the scene's)
    crop         [x, y, width, height] in pixels (default: the scene's, in its place at any resolution)
    max_depth    edges of the longest path, -1 is unlimited (default: the scene's)
    rfilter      reconstruction filter (default: the one that the scene file names, else box, which keeps pixels
                 independent; all built-in scenes have box)
    colour       "rgb" or "spectral" (default: rgb)
    reference    what to measure against: { integrator, sampler, spp, replicates }, or false for no reference
                 (default, key by key: what comes with a built-in scene, else path, independent, 4096 spp in total,
                 2 replicates)
    sweep        tables [[sweep]]: parameter of a scene ("sphere.bsdf.nu"), values (numbers, or colours [r, g, b]), and
                 scenes, where it does not apply to all; several multiply
    scene        tables [scene.NAME]: resolution, crop, max_depth, rfilter, reference where one scene differs
"""

from __future__ import annotations

import math
import tomllib
from collections.abc import Iterable, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any

from jobs import gridsweeps
from jobs.errors import GridError
from jobs.fields import Problems, Table, choice
from jobs.gridpoints import PointFinder, bind, check_count, file_of, nowhere, points_of
from jobs.gridscenes import Finder, scenes_of
from jobs.gridspec import MAX_CELLS, MAX_REPLICATES, GridSpec, ReferenceRequest, SceneRequest, Sweep
from jobs.gridsweeps import Lister, nobody
from renderer import catalog
from renderer.errors import UnknownName, shown
from renderer.samplers import pointfile
from renderer.samplers.pointfile import PointSource
from renderer.scenes import sources
from renderer.spec import Choice

__all__ = ["GridSpec", "ReferenceRequest", "SceneRequest", "Sweep", "parse", "read"]

MAX_NAME = 200  # characters
MAX_BYTES = 2**24  # of a grid file

GRID_KEYS = (
    "name", "scenes", "samplers", "integrators", "spp", "replicates", "resolution", "crop", "max_depth", "rfilter",
    "colour", "reference", "sweep", "scene",
)  # fmt: skip
EXAMPLE = "examples/first.toml shows a whole grid"


def read(path: Path, lister: Lister = nobody) -> GridSpec:
    """The grid in a TOML file; ``lister`` as for ``parse``. Raises ``GridError`` with every problem found."""
    try:
        if path.is_dir():
            raise GridError([f"{path} is a folder; give the grid file itself, such as {path / 'grid.toml'}"])
        with path.open("rb") as file:
            content = file.read(MAX_BYTES + 1)
    except FileNotFoundError:
        raise GridError([f"there is no grid file {path}; check its name, or start from examples/first.toml"]) from None
    except (OSError, ValueError) as error:  # ValueError: a name that no file system takes
        reason = error.strerror if isinstance(error, OSError) else error
        raise GridError([f"cannot read the grid {shown(str(path))}: {reason}; check its name and rights"]) from None
    if len(content) > MAX_BYTES:
        raise GridError([f"{path} has more than {MAX_BYTES >> 20} MiB, too much for a grid; {EXAMPLE}"])
    try:
        text = content.decode("utf-8-sig")  # editors on Windows put a byte order mark first
    except UnicodeDecodeError as error:
        line = content.count(b"\n", 0, error.start) + 1
        raise GridError([f"{path} is not UTF-8 text (line {line}); save it as UTF-8"]) from None
    data = loads(text, str(path))
    return parse(
        data, find=partial(sources.find, base=path.parent), points=partial(pointfile.find, base=path.parent),
        origin=path.name, lister=lister,
    )  # fmt: skip


def loads(text: str, origin: str) -> dict[str, Any]:
    """The tables in the text of a grid file. Raises ``GridError`` for what is no TOML."""
    if not text.strip():
        raise GridError([f'{origin} is empty; a grid needs at least scenes = ["cornell_box"]; {EXAMPLE}'])
    try:
        return tomllib.loads(text)
    except RecursionError:
        raise GridError([f"{origin} is not a grid: its lists are nested too deeply; {EXAMPLE}"]) from None
    except ValueError as error:  # TOMLDecodeError says "Reason (at line 3, column 5)"
        reason, _, place = str(error).removesuffix(")").partition(" (at ")
        where = f" at {place}" if place else ""
        raise GridError([f"{origin} is not TOML{where}: {reason}; correct it there; {EXAMPLE}"]) from None


def parse(
    data: Mapping[str, Any], *, find: Finder, origin: str, points: PointFinder = nowhere, lister: Lister = nobody
) -> GridSpec:
    """
    The grid in parsed TOML or JSON. ``find`` gives the scene of a name and ``points`` the point file, ``origin`` is
    what sentences call the request ("grid.toml"). ``lister`` knows what can be swept in a scene and is asked only
    where something is. Raises ``GridError`` with every problem found.
    """
    problems = Problems()
    if not isinstance(data, Mapping):
        raise GridError([f"{origin} is {shown(data)}; a grid is a table with at least scenes; {EXAMPLE}"])
    grid = Table(data, origin, GRID_KEYS, problems)
    samplers = _choices(grid, "samplers", "sampler", "independent")
    integrators = _choices(grid, "integrators", "integrator", "path")
    files = points_of(grid, samplers, points)
    spp = _spp(grid, samplers, files)
    name, colour, replicates = _name(grid), _colour(grid), grid.integer("replicates", 1, MAX_REPLICATES)
    names = _scene_names(grid)
    sweeps = gridsweeps.sweeps_of(grid, list(names))
    _check_count(grid, names, sweeps, {"integrators": integrators, "samplers": samplers, "spp": spp})
    scenes = scenes_of(grid, names, integrators, find)
    gridsweeps.check(grid, sweeps, scenes, colour or "rgb", lister)
    problems.raise_any()
    assert name and colour, "what could not be read is a problem"
    return GridSpec(
        name, tuple(scenes), tuple(bind(samplers, files)), tuple(integrators), tuple(spp), replicates or 4, colour,
        tuple({source.digest: source for source in files.values()}.values()), tuple(sweeps),
    )  # fmt: skip


def _scene_names(grid: Table) -> dict[str, str]:
    """Each scene as written, once, with its place."""
    if "scenes" not in grid:
        grid.problems.add(f'scenes is missing in {grid.where}; name at least one, scenes = ["cornell_box"]; {EXAMPLE}')
        return {}
    names: dict[str, str] = {}
    for value, place in grid.values("scenes", None, MAX_CELLS):
        if isinstance(value, str) and value:
            names.setdefault(value, place)
        else:
            grid.wrong(place, value, "give the name of a built-in scene, or a path, as a text")
    return names


def _choices(grid: Table, key: str, axis: str, default: str) -> list[Choice]:
    """The values of an axis, each once, in the order they are written."""
    read = [choice(grid, axis, value, place) for value, place in grid.values(key, default, MAX_CELLS)]
    return list({item.text: item for item in read if item}.values())


def _spp(grid: Table, samplers: Iterable[Choice], files: Mapping[str, PointSource]) -> list[int]:
    """The spp asked for, ascending, each once."""
    values = grid.values("spp", [16, 64, 256], MAX_CELLS)
    read = [grid.to_integer(value, place, 1, catalog.MAX_SPP) for value, place in values]
    spp = sorted({value for value in read if value is not None})
    for sampler in samplers if spp else ():  # rounding never reverses an order, so the largest tells
        grid.problems.attempt(partial(catalog.rendered_spp, sampler, spp[-1], grid.place("spp")))
        if source := files.get(file_of(sampler) or ""):
            grid.problems.attempt(partial(check_count, source, spp[-1], grid.place("spp")))
    return spp


def _name(grid: Table) -> str | None:
    """A name that can be printed on one line and cannot be taken for an experiment's id."""
    value = grid.data.get("name", Path(grid.where).stem)
    if not isinstance(value, str) or not value.strip():
        grid.wrong(grid.place("name"), value, 'give a text, name = "what is compared"')
    elif len(value) > MAX_NAME or not value.isprintable():
        grid.wrong(grid.place("name"), value, f"give one line of at most {MAX_NAME} printable characters")
    elif value.strip().isdecimal():
        grid.wrong(grid.place("name"), value, 'a number would be taken for an id: add a word, name = "run 3"')
    else:
        return value.strip()
    return None


def _colour(grid: Table) -> str | None:
    value = grid.data.get("colour", "rgb")
    if isinstance(value, str) and value in catalog.COLOURS:
        return value
    if isinstance(value, str) and "polar" in value:
        grid.wrong(grid.place("colour"), value, "polarized rendering is not supported: use rgb or spectral")
    else:
        grid.problems.add(str(UnknownName("colour", value, grid.where, catalog.COLOURS)))
    return None


def _check_count(
    grid: Table, scenes: Iterable[str], sweeps: Sequence[Sweep], axes: Mapping[str, Sequence[object]]
) -> None:
    """Refuses a grid that is too large before any scene is read or cell made."""
    names = list(scenes)
    in_scenes = sum(gridsweeps.count(sweeps, name) for name in names)
    cells = in_scenes * math.prod(len(values) for values in axes.values())
    if cells > MAX_CELLS:
        first = f"{in_scenes} sweep values in {len(names)} scenes" if sweeps else f"{len(names)} scenes"
        product = " × ".join([first, *(f"{len(values)} {axis}" for axis, values in axes.items())])
        grid.problems.add(
            f"{grid.where} asks for {cells} cells ({product}), more than {MAX_CELLS}; leave out values, or split "
            "it into several grids: what they share is rendered once"
        )
        grid.problems.raise_any()
