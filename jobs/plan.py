"""
The cells of a grid, in the order in which they are to be rendered.

Scene by scene, because every loaded scene slows all kernels; all swept values of a scene inside it, because they are
set in the loaded scene and share its kernels. In a scene first the lowest spp of every curve, so that each shows
something early; then the references, so that errors can be measured; then all curves at the next spp, and so on: a grid
that is stopped early has complete curves up to some spp.

An integrator's parameters that change the expected picture (max_depth, hide_emitters) move into the estimand here,
so that cells are only ever compared with a reference of the same expectation. Nothing here renders or remembers.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import chain, product
from typing import Literal

from jobs.gridspec import GridSpec, SceneRequest, path_lengths
from jobs.gridsweeps import points_of
from renderer import catalog
from renderer.parameters import Value
from renderer.spec import CellSpec, Choice, Estimand, Scalar

Role = Literal["cell", "reference"]


@dataclass(frozen=True, slots=True)
class PlannedCell:
    """
    One cell that an experiment wants, and what the experiment calls it.

    role        "cell", or "reference" of its estimand
    replicates  how many pictures of it are wanted
    spp_asked   before the sampler's rounding, per replicate; two requests may be rounded to the same spec
    scene, integrator, sampler  canonical labels
    reference   digest of the reference that a cell is measured against; None for none, and for references
    """

    spec: CellSpec
    role: Role
    replicates: int
    spp_asked: int
    scene: str
    integrator: str
    sampler: str
    reference: str | None


@dataclass(frozen=True)
class Plan:
    """The cells of ``grid``; an index into ``cells`` is the order of rendering."""

    grid: GridSpec
    cells: tuple[PlannedCell, ...]


def expand(grid: GridSpec) -> Plan:
    """The cells and references of a grid; no (spec, role, spp_asked) occurs twice."""
    samplers = [
        _Column(sampler, catalog.label("sampler", sampler), [catalog.rendered_spp(sampler, spp) for spp in grid.spp])
        for sampler in grid.samplers
    ]
    cells: list[PlannedCell] = []
    seen: set[tuple[str, ...]] = set()
    for scene in grid.scenes:
        rows = list(_rows(grid, scene, seen))
        steps = list(zip(*(_curve(grid, scene, row, column) for row in rows for column in samplers), strict=True))
        cells += chain(*steps[:1], _references(scene, rows, seen), *steps[1:])
    return Plan(grid, tuple(cells))


@dataclass(frozen=True)
class _Column:
    """A sampler with its label and what it renders for each spp of the grid."""

    sampler: Choice
    label: str
    rendered: list[int]


@dataclass(frozen=True)
class _Row:
    """An integrator in a scene: its label, what is left of it beside the estimand, and the reference's spec."""

    label: str
    integrator: Choice
    estimand: Estimand
    reference: CellSpec | None


def _rows(grid: GridSpec, scene: SceneRequest, seen: set[tuple[str, ...]]) -> Iterator[_Row]:
    """
    One row for each combination of swept values and each integrator, if its cells are not planned yet (two spellings
    may mean the same cells).
    """
    for sweep, choice in product(points_of(grid.sweeps, scene.source.name), grid.integrators):
        estimand = _estimand(grid, scene, choice, sweep)
        integrator = _without_estimand(choice)
        key = (estimand.text, integrator.text)
        if key in seen:
            continue
        seen.add(key)
        reference = None
        if scene.reference:
            reference = CellSpec(
                estimand, _without_estimand(scene.reference.integrator), scene.reference.sampler, scene.reference.spp
            )
        yield _Row(catalog.label("integrator", choice), integrator, estimand, reference)


def _curve(grid: GridSpec, scene: SceneRequest, row: _Row, column: _Column) -> Iterator[PlannedCell]:
    """One integrator and one sampler in a scene, at every spp of the grid, ascending."""
    spec = {spp: CellSpec(row.estimand, row.integrator, column.sampler, spp) for spp in column.rendered}
    reference = row.reference.digest if row.reference else None
    for asked, spp in zip(grid.spp, column.rendered, strict=True):
        yield PlannedCell(
            spec[spp], "cell", grid.replicates, asked, scene.source.name, row.label, column.label, reference
        )


def _references(scene: SceneRequest, rows: list[_Row], seen: set[tuple[str, ...]]) -> Iterator[PlannedCell]:
    """One reference for each estimand of a scene."""
    request = scene.reference
    for row in rows:
        spec = row.reference
        if spec is None or request is None or (spec.digest,) in seen:
            continue
        seen.add((spec.digest,))
        label, sampler = _reference_label(scene, spec), catalog.label("sampler", request.sampler)
        yield PlannedCell(spec, "reference", request.replicates, request.asked, scene.source.name, label, sampler, None)


def _estimand(
    grid: GridSpec, scene: SceneRequest, integrator: Choice, sweep: tuple[tuple[str, Value], ...]
) -> Estimand:
    """What the pictures of this integrator converge to in this scene."""
    return Estimand(
        scene=scene.source.digest,
        width=scene.width,
        height=scene.height,
        crop=scene.crop,
        max_depth=path_lengths(integrator, scene.max_depth),
        hide_emitters=bool(dict(integrator.parameters).get("hide_emitters", False)),
        rfilter=scene.rfilter,
        colour=grid.colour,
        strategy=catalog.strategy(integrator),
        sweep=sweep,
    )


def _without_estimand(integrator: Choice) -> Choice:
    """The integrator without the parameters that the estimand holds."""
    moved = {item.name for item in catalog.find("integrator", integrator.name).parameters if item.estimand}
    kept = tuple(pair for pair in integrator.parameters if pair[0] not in moved)
    return Choice(integrator.name, integrator.version, kept)


def _reference_label(scene: SceneRequest, spec: CellSpec) -> str:
    """The label of a reference, with its max_depth where that is not the scene's: two references differ by it."""
    moved: dict[str, Scalar] = {"hide_emitters": spec.estimand.hide_emitters}
    if spec.estimand.max_depth != scene.max_depth:
        moved["max_depth"] = spec.estimand.max_depth
    known = {item.name for item in catalog.find("integrator", spec.integrator.name).parameters}
    pairs = [*spec.integrator.parameters, *((key, value) for key, value in moved.items() if key in known)]
    return catalog.label("integrator", Choice(spec.integrator.name, spec.integrator.version, tuple(sorted(pairs))))
