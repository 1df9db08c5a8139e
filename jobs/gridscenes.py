"""
What holds for each scene of a grid: resolution, crop, max_depth, filter and reference.

They may be said for the whole grid, again in ``[scene.NAME]`` for one scene, and the scene file has its own (a built-in
scene also a reference): the nearest one counts, for a reference field by field. The checks that need a scene are here,
too. No Mitsuba.
"""

from __future__ import annotations

import logging
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import product
from pathlib import Path
from typing import Any

from jobs.fields import Problems, Table, choice
from jobs.gridspec import MAX_PIXELS, MAX_REPLICATES, MAX_SIDE, Crop, ReferenceRequest, SceneRequest, path_lengths
from renderer import catalog
from renderer.errors import DartboardError, UnknownName, shown
from renderer.scenes import sources
from renderer.spec import Choice

Finder = Callable[[str], sources.SceneSource]  # raises DartboardError for what is no scene

SCENE_KEYS = ("resolution", "crop", "max_depth", "rfilter", "reference")
REFERENCE_KEYS = ("integrator", "sampler", "spp", "replicates")

log = logging.getLogger(__name__)


def scenes_of(grid: Table, names: Mapping[str, str], integrators: Sequence[Choice], find: Finder) -> list[SceneRequest]:
    """
    The scenes of a grid with their settings. ``names`` gives each scene as written and its place in sentences, ``find``
    the scene itself.

    What is wrong is noted in the grid's problems; a scene that cannot be found is left out.
    """
    common = _Settings.of(grid, f"[reference] of {grid.where}")
    own = _own_settings(grid, names)
    scenes = [_scene(name, place, find, own.get(name), common) for name, place in names.items()]
    found = [scene for scene in scenes if scene]
    _check_depths(grid, found, integrators)
    _check_references(grid, found, integrators)
    _check_twins(grid, found)
    return found


@dataclass(frozen=True)
class _Settings:
    """
    What may be said for the whole grid and again for one scene; None where it is not said (or wrong, and noted).

    reference  False: none wanted; else what is said about it, by the names of ``ReferenceRequest``
    """

    table: Table
    resolution: tuple[int, ...] | None
    crop: tuple[int, ...] | None
    max_depth: int | None
    rfilter: Choice | None
    reference: Mapping[str, Any] | bool | None

    @classmethod
    def of(cls, table: Table, reference_place: str) -> _Settings:
        """The settings in ``table``; ``reference_place`` is how sentences call its table ``reference``."""
        depth = table.integer("max_depth", -1, catalog.MAX_DEPTH)
        if depth == 0:
            table.wrong(table.place("max_depth"), 0, "no path has 0 edges: give 1 or more, or -1 for unlimited")
        return cls(
            table,
            table.integers("resolution", "width, height", 1, MAX_SIDE),
            table.integers("crop", "x, y, width, height", 0, MAX_SIDE),
            depth,
            choice(table, "rfilter", table.data["rfilter"], table.place("rfilter")) if "rfilter" in table else None,
            _reference_fields(table, reference_place),
        )

    def failed(self, key: str) -> bool:
        return key in self.table and getattr(self, key) is None


def _own_settings(grid: Table, names: Iterable[str]) -> dict[str, _Settings]:
    """The [scene.NAME] tables by the scene's full name."""
    found: dict[str, _Settings] = {}
    for key, value in grid.table("scene", "write tables [scene.NAME]").items():
        where = f"[scene.{key}] of {grid.where}"
        matches = named(key, names)
        if not isinstance(value, Mapping):
            grid.wrong(where, value, f"write a table with some of {', '.join(SCENE_KEYS)}")
            continue
        own = _Settings.of(Table(value, where, SCENE_KEYS, grid.problems), f"[scene.{key}.reference] of {grid.where}")
        if not matches:
            grid.problems.add(str(UnknownName("scene", key, where, names)))
        elif len(matches) > 1:
            grid.problems.add(f"{where} means {' and '.join(matches)}; quote the whole path, as in scenes")
        elif matches[0] in found:
            grid.problems.add(f"{where} is the second table for {matches[0]}; put both into one")
        else:
            found[matches[0]] = own
    return found


def named(key: str, names: Iterable[str]) -> list[str]:
    """The scenes that a table means: one by its full name, or all of that name without folders and extension."""
    known = list(names)
    return [key] if key in known else [name for name in known if Path(name).stem == key]


def _scene(name: str, place: str, find: Finder, own: _Settings | None, common: _Settings) -> SceneRequest | None:
    """One scene with its settings, None where it cannot be found."""
    problems = common.table.problems
    try:
        source = find(name)
    except DartboardError as error:
        problems.add(f"{place}: {error}")
        return None
    levels = [own, common] if own else [common]  # the nearer one counts
    default = source.defaults

    def nearest(key: str) -> tuple[Any, str]:
        """The setting and its place in sentences."""
        for level in levels:
            if getattr(level, key) is not None:
                return getattr(level, key), level.table.place(key)
        return None, place

    size, where = nearest("resolution")
    width, height = size or (default.width, default.height)
    if not (1 <= width <= MAX_SIDE and 1 <= height <= MAX_SIDE):
        problems.add(f"{where}: the file asks for {width}×{height} pixels; set resolution, 1 to {MAX_SIDE} per side")
    crop, crop_place = nearest("crop")
    if crop is None and not any(level.failed("crop") for level in levels):
        crop, crop_place = default.crop_at(width, height), f"{place}: the crop of the file"
    if crop and not any(level.failed("resolution") for level in levels):
        crop = _check_crop(problems, crop, crop_place, width, height, name)
    pixels = crop[2] * crop[3] if crop else width * height
    if pixels > MAX_PIXELS:
        problems.add(f"{where}: {name} has {pixels} pixels, more than {MAX_PIXELS}; lower resolution, or set crop")
    depth, where = nearest("max_depth")
    if depth is None:
        depth = default.max_depth
        if not -1 <= depth <= catalog.MAX_DEPTH or depth == 0:
            problems.add(f"{where}: the file asks for max_depth {depth}; set max_depth: 1 or more, or -1 for unlimited")
    rfilter = nearest("rfilter")[0] or problems.attempt(lambda: _own_filter(source, place))
    if rfilter is None:
        return None
    return SceneRequest(source, width, height, crop, depth, rfilter, _reference(source, common, own))


def _own_filter(source: sources.SceneSource, place: str) -> Choice:
    """The filter of the scene file; one that mixes pixels is told, as measuring errors wants independent pixels."""
    rfilter = catalog.resolve("rfilter", source.defaults.rfilter, place)
    if rfilter.name != "box":
        log.warning(
            "%s: the file of %s has the filter %s, which holds as the grid names none; pixels share samples with their "
            'neighbours then, so say rfilter = "box" for independent ones', place, source.name, source.defaults.rfilter,
        )  # fmt: skip
    return rfilter


def _check_crop(problems: Problems, crop: Crop, place: str, width: int, height: int, scene: str) -> Crop | None:
    """The crop, None where it is the whole film, so that both spellings are one estimand."""
    x, y, wide, high = crop
    if min(x, y) < 0 or min(wide, high) < 1 or x + wide > width or y + high > height:
        problems.add(
            f"{place} is {list(crop)}, outside the {width}×{height} film of {scene}; "
            "give [x, y, width, height] inside it, in pixels from the top left"
        )
    return None if crop == (0, 0, width, height) else crop


def _reference_fields(table: Table, place: str) -> Mapping[str, Any] | bool | None:
    """What one level says about the reference."""
    value = table.data.get("reference")
    if value is None or value is False:
        return value
    if value is True:
        return {}
    if not isinstance(value, Mapping):
        table.wrong(table.place("reference"), value, "give a table with integrator, sampler, spp, replicates, or false")
        return None
    fields = Table(value, place, REFERENCE_KEYS, table.problems)
    read: dict[str, Any] = {
        "asked_total": fields.integer("spp", 1, catalog.MAX_SPP),
        "replicates": fields.integer("replicates", 2, MAX_REPLICATES, even=True),
    }
    for axis in ("integrator", "sampler"):
        if axis in fields:
            read[axis] = choice(fields, axis, fields.data[axis], fields.place(axis))
    if read.get("integrator"):
        _check_follows(fields, read["integrator"])
    if read.get("sampler"):
        _check_right(fields, read["sampler"])
    return {key: item for key, item in read.items() if item is not None}


def _check_follows(fields: Table, integrator: Choice) -> None:
    """What is part of the estimand comes from the cells, so a reference cannot set it."""
    given = dict(integrator.parameters)
    for parameter in catalog.find("integrator", integrator.name).parameters:
        if parameter.estimand and given.get(parameter.name) != parameter.default:
            follows = "a reference follows the cells that it is compared with; leave it out"
            fields.wrong(f"{parameter.name} in {fields.place('integrator')}", given[parameter.name], follows)


def _check_right(fields: Table, sampler: Choice) -> None:
    """What everything is measured against is neither wrong on purpose nor made of somebody's points."""
    if catalog.is_replay(sampler) or sampler.name == "pointset":
        label = catalog.label("sampler", sampler)
        fields.wrong(fields.place("sampler"), label, "a reference takes a correct sampler, such as independent")


def _reference(source: sources.SceneSource, common: _Settings, own: _Settings | None) -> ReferenceRequest | None:
    """
    The reference of one scene: what the grid says for it, field by field, else what it says for all, else what comes
    with a built-in scene, else the defaults.
    """
    said: list[Any] = [level.reference for level in (common, own) if level and level.reference is not None]
    if said and said[-1] is False:
        return None
    given = [level for level in said if isinstance(level, Mapping)]
    return _reference_with(given, source, common.table.problems, common.table.where)


def own_reference(source: sources.SceneSource) -> ReferenceRequest:
    """The reference of a scene of which a grid says nothing."""
    problems = Problems()
    made = _reference_with((), source, problems, source.name)
    problems.raise_any()
    return made


def _reference_with(
    said: Iterable[Mapping[str, Any]], source: sources.SceneSource, problems: Problems, where: str
) -> ReferenceRequest:
    """What is ``said``, the last first, before what the scene has. ``where`` it was said goes into sentences."""
    fields: dict[str, Any] = {
        "integrator": catalog.resolve("integrator", "path"),
        "sampler": catalog.resolve("sampler", "independent"),
        "asked_total": 4096,
        "replicates": 2,
    }
    if source.reference:
        table = Table({"reference": source.reference}, source.name, ["reference"], problems)
        own = _reference_fields(table, f"[reference] of {source.name}")
        fields |= own if isinstance(own, Mapping) else {}
    for level in said:
        fields |= level
    asked = -(-fields["asked_total"] // fields["replicates"])
    place = f"spp of the reference of {where}"
    spp = problems.attempt(lambda: catalog.rendered_spp(fields["sampler"], asked, place))
    return ReferenceRequest(spp=spp or asked, asked=asked, **fields)


def _check_depths(grid: Table, scenes: Iterable[SceneRequest], integrators: Sequence[Choice]) -> None:
    """Some integrators keep their paths, and have room for so many vertices."""
    for scene, integrator in product(scenes, integrators):
        where = f"{scene.source.name} in {grid.where}"
        depth = path_lengths(integrator, scene.max_depth)
        grid.problems.attempt(partial(catalog.check_depth, integrator, depth, where))


def _check_references(grid: Table, scenes: Iterable[SceneRequest], integrators: Sequence[Choice]) -> None:
    """A reference has to count the same paths as the cells that it serves, and take paths as long."""
    for scene in scenes:
        if scene.reference is None:
            continue
        reference = scene.reference.integrator.name
        fixed = catalog.find("integrator", reference).depth
        for integrator in integrators:
            depth = path_lengths(integrator, scene.max_depth)
            where = f"{scene.source.name} in {grid.where}"
            grid.problems.attempt(partial(catalog.check_depth, scene.reference.integrator, depth, where))
            if catalog.strategy(integrator) and reference != "bdpt":
                grid.problems.add(
                    f"{integrator.name} in {grid.where} draws one strategy, for which {reference} is no reference: "
                    'write reference = false, or [reference] with integrator = "bdpt"'
                )
            if fixed not in (None, depth):
                grid.problems.add(
                    f"the reference of {scene.source.name} in {grid.where} is {reference}, which renders paths of "
                    f"{fixed} edges only, but {integrator.name} has max_depth {depth} there; choose a reference "
                    "integrator that takes any max_depth, such as path"
                )


def _check_twins(grid: Table, scenes: Iterable[SceneRequest]) -> None:
    """The same files with the same settings under two names would be one set of cells with two names."""
    first: dict[tuple[object, ...], str] = {}
    for scene in scenes:
        key = (scene.source.digest, scene.width, scene.height, scene.crop, scene.max_depth, scene.rfilter)
        other = first.setdefault(key, scene.source.name)
        if other != scene.source.name:
            names = f"{shown(other)} and {shown(scene.source.name)}"
            grid.problems.add(f"scenes of {grid.where}: {names} are one scene with the same settings; leave one out")
