"""
The sweeps of a grid: ``[[sweep]]`` tables, and whether the scenes have what they set.

A sweep is an axis whose values are set in the loaded scene: a number or a colour of a material, a lamp, a lens. Several
sweeps multiply. What a name means in a scene (``renderer.parameters``) is known to a process that has loaded it; where
there is somebody to ask (``Lister``), a grid with a name that a scene does not have is refused before anything is
rendered, else the render process fails its cells with the same sentence. No Mitsuba is imported.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import partial

from jobs.fields import Table
from jobs.gridscenes import named
from jobs.gridspec import MAX_CELLS, SceneRequest, Sweep
from renderer.errors import BadParameter, UnknownName, shown
from renderer.parameters import Parameter, Value, as_value, check_value, find
from renderer.scenes.sources import SceneSource

# (scene, colour mode) → its parameters by key; None where nobody can tell. Raises DartboardError for a scene that does
# not load.
Lister = Callable[[SceneSource, str], Mapping[str, Parameter] | None]

SWEEP_KEYS = ("parameter", "values", "scenes")
MAX_PARAMETER = 200  # characters
EXAMPLE = 'parameter = "sphere.bsdf.nu"'


def nobody(scene: SceneSource, colour: str) -> None:
    """The lister of who cannot ask: the render process will tell."""
    return None


def sweeps_of(grid: Table, names: Sequence[str]) -> list[Sweep]:
    """The sweeps of a grid whose scenes have these names, in the order of the file. What is wrong is noted."""
    written = grid.data.get("sweep", [])
    if isinstance(written, Mapping):
        written = [written]  # JSON, or [sweep] with single brackets
    if not isinstance(written, list) or not all(isinstance(item, Mapping) for item in written):
        grid.wrong(grid.place("sweep"), written, f"write tables [[sweep]], each with {EXAMPLE} and values = [10, 100]")
        return []
    tables = [
        Table(item, f"[[sweep]] {index} of {grid.where}", SWEEP_KEYS, grid.problems)
        for index, item in enumerate(written)
    ]
    read = [(table.where, sweep) for table in tables if (sweep := _sweep(table, names))]
    _check_twins(grid, read)
    return [sweep for _, sweep in read]


def points_of(sweeps: Iterable[Sweep], scene: str) -> list[tuple[tuple[str, Value], ...]]:
    """Every combination of swept values in a scene, the last sweep fastest; one empty one where nothing is swept."""
    axes = [[(sweep.parameter, value) for value in sweep.values] for sweep in sweeps if scene in sweep.scenes]
    return [tuple(sorted(point)) for point in itertools.product(*axes)]


def count(sweeps: Iterable[Sweep], scene: str) -> int:
    """How many ``points_of`` there are."""
    return math.prod(len(sweep.values) for sweep in sweeps if scene in sweep.scenes)


def check(grid: Table, sweeps: Sequence[Sweep], scenes: Sequence[SceneRequest], colour: str, lister: Lister) -> None:
    """Notes what the scenes do not have, or do not take; asks for a scene only where something is swept in it."""
    for scene in scenes:
        swept = [sweep for sweep in sweeps if scene.source.name in sweep.scenes]
        known = grid.problems.attempt(partial(lister, scene.source, colour)) if swept else None
        if known is not None:
            _check_scene(grid, swept, scene.source.name, known, others=len(scenes) > 1)


def _check_scene(grid: Table, swept: Sequence[Sweep], scene: str, known: Mapping[str, Parameter], others: bool) -> None:
    """``others``: whether the grid has more scenes than this one."""
    where = f"sweep of {grid.where}: in scene {shown(scene)}"
    names: dict[str, str] = {}
    for sweep in swept:
        try:
            parameter = find(sweep.parameter, known)
        except BadParameter as error:
            elsewhere = "; or say where it applies, scenes = [...]" if others else ""
            grid.problems.add(f"{where} {error}{elsewhere}")
            continue
        if other := names.get(parameter.key):
            grid.problems.add(f"{where} {other} and {sweep.parameter} are one parameter; leave one out")
        names[parameter.key] = sweep.parameter
        for value in sweep.values:
            try:
                check_value(parameter, value)
            except BadParameter as error:
                grid.problems.add(f"{where} {error}")


def _sweep(table: Table, names: Sequence[str]) -> Sweep | None:
    """One table, None where something of it is wrong."""
    parameter, values, scenes = _parameter(table), _values(table), _scenes(table, names)
    return Sweep(parameter, values, scenes) if parameter and values and scenes else None


def _parameter(table: Table) -> str | None:
    value = table.data.get("parameter")
    if not isinstance(value, str) or not value.strip() or "parameter" not in table:
        table.wrong(table.place("parameter"), value, f"name a parameter of the scene, {EXAMPLE}")
    elif len(value) > MAX_PARAMETER or not value.isprintable():
        table.wrong(table.place("parameter"), value, f"give at most {MAX_PARAMETER} printable characters, {EXAMPLE}")
    elif "." not in value.strip().strip("."):
        table.wrong(table.place("parameter"), value, f"name the object first, then what of it is swept, {EXAMPLE}")
    else:
        return value.strip()
    return None


def _values(table: Table) -> tuple[Value, ...]:
    """Each once, in the order of the file."""
    if "values" not in table:
        table.problems.add(f"values is missing in {table.where}; give a list of numbers or of colours [r, g, b]")
        return ()
    if table.data["values"] == []:
        table.problems.add(f"{table.place('values')} is empty; give at least one number or colour, or leave it out")
        return ()
    read: dict[Value, None] = {}
    items = table.values("values", None, MAX_CELLS)
    for item, place in items:
        value = as_value(item)
        if value is None:
            way_out = "give a finite number, or a colour of three: values = [10, 100] or [[0.8, 0.2, 0.1], [0, 0, 0]]"
            table.wrong(place, item, way_out)
        else:
            read[value] = None
    return tuple(read) if len(items) and None not in [as_value(item) for item, _ in items] else ()


def _scenes(table: Table, names: Sequence[str]) -> tuple[str, ...]:
    """The full names of the scenes that it applies to: all of the grid's, where nothing is said."""
    if "scenes" not in table:
        return tuple(names)
    found: dict[str, None] = {}
    for value, place in table.values("scenes", None, MAX_CELLS):
        if not isinstance(value, str):
            table.wrong(place, value, "give the name of a scene of this grid")
        elif len(matches := named(value, names)) == 1:
            found[matches[0]] = None
        elif matches:
            table.problems.add(f"{place} means {' and '.join(matches)}; write the whole path, as in the grid's scenes")
        else:
            table.problems.add(str(UnknownName("scene", value, place, names)))
    return tuple(name for name in names if name in found)


def _check_twins(grid: Table, read: Sequence[tuple[str, Sweep]]) -> None:
    for index, (where, sweep) in enumerate(read):
        for _, other in read[:index]:
            shared = set(sweep.scenes) & set(other.scenes)
            if sweep.parameter == other.parameter and shared:
                scene = min(shared)
                grid.problems.add(
                    f"{where} sweeps {sweep.parameter} in {scene} a second time; put all values into one table"
                )
