"""
Panels: what may be compared, side by side.

A panel holds the curves of one scene that are measured against one reference, so all that stands in it has the same
expected picture. That is one integrator with all samplers, or several integrators that count the same paths. Cells of
different panels are never compared: the lower number would mean nothing.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

from jobs.store import Row
from renderer import catalog
from renderer.metrics import METRICS
from renderer.parameters import told
from renderer.spec import Choice
from service.report.reading import Reading


@dataclass
class Line:
    """
    One curve: an integrator with a sampler.

    name    in its panel: the sampler, and the integrator where there are several
    cells   by the spp that was asked
    points  metric → spp that was asked → ``schemas.Point``
    slopes  metric → ``schemas.Slope`` or None
    alike   its renders were timed under the conditions that most of the experiment's were
    replay  its sampler shows a published mistake: it is shown, and never best
    """

    integrator: str
    sampler: str
    name: str
    replay: bool = False
    cells: dict[int, Row] = field(default_factory=dict)
    points: dict[str, dict[int, Row]] = field(default_factory=lambda: {metric: {} for metric in METRICS})
    slopes: dict[str, Row | None] = field(default_factory=lambda: dict.fromkeys(METRICS))
    alike: bool = True

    def point(self, metric: str, spp: int | None) -> Row | None:
        return None if spp is None else self.points[metric].get(spp)


@dataclass
class Panel:
    """
    lines      integrator by integrator, in each sampler by sampler, as the grid names them
    reference  the cell that is measured against; None where the grid asked for none
    """

    id: str
    scene: str
    sweep: dict[str, Any]
    integrators: list[str]
    lines: list[Line]
    reference: Row | None

    @property
    def title(self) -> str:
        """The integrators, and what is set in the scene."""
        return " and ".join(self.integrators) + "".join(f" · {item}" for item in told(self.sweep))

    @cached_property
    def spp(self) -> list[int]:
        """All that were asked, ascending."""
        return sorted({spp for line in self.lines for spp in line.cells})

    @property
    def baseline(self) -> Line:
        """What the others are compared with: the grid's first sampler that is no replay, with its first integrator."""
        return next((line for line in self.lines if not line.replay), self.lines[0])

    @property
    def alike(self) -> bool:
        """Whether the seconds of its lines may be compared."""
        return all(line.alike for line in self.lines)

    @property
    def timed(self) -> bool:
        return any(cell["seconds"] is not None for line in self.lines for cell in line.cells.values())

    @cached_property
    def metrics(self) -> list[str]:
        """Those that have any values."""
        return [metric for metric in METRICS if self.measured(metric)]

    def measured(self, metric: str) -> list[Line]:
        return [line for line in self.lines if line.points[metric]]

    def common_spp(self, metric: str) -> int | None:
        """The highest spp at which every curve that has any errors has one; None where there are none."""
        lines = self.measured(metric)
        shared = set.intersection(*(set(line.points[metric]) for line in lines)) if lines else set()
        return max(shared, default=None)

    def lowest(self, metric: str, spp: int) -> float | None:
        """The best error at that spp, replays left out; None where there is nothing to choose from."""
        return self._lowest.get((metric, spp))

    @cached_property
    def _lowest(self) -> dict[tuple[str, int], float]:
        found: dict[tuple[str, int], list[float]] = {}
        for line in self.lines:
            for metric, points in line.points.items() if not line.replay else ():
                for spp, point in points.items():
                    found.setdefault((metric, spp), []).append(point["mean"])
        return {key: min(means) for key, means in found.items() if len(means) > 1 and METRICS[key[0]].lower_is_better}


@dataclass(frozen=True)
class Section:
    """A scene with its panels."""

    id: str
    scene: str
    panels: list[Panel]


def sections(reading: Reading) -> list[Section]:
    """Scene by scene as the grid names them, in each the panels in the grid's order of integrators."""
    cells = [cell for cell in reading.cells if cell["role"] == "cell"]
    series = _series(reading)
    references = {cell["cell"]: cell for cell in reading.cells if cell["role"] == "reference"}
    grouped: dict[str, dict[str, list[Row]]] = {scene["name"]: {} for scene in reading.grid["scenes"]}
    for cell in _in_order(cells, reading):
        alone = cell["integrator"] if cell["reference"] is None else ""
        key = json.dumps([cell["sweep"], cell["reference"], alone])
        grouped[cell["scene"]].setdefault(key, []).append(cell)
    return [
        Section(
            f"scene-{place}", scene,
            [
                _panel(f"panel-{place}-{index}", found, series, references)
                for index, found in enumerate(groups.values())
            ],
        )
        for place, (scene, groups) in enumerate(grouped.items())
    ]  # fmt: skip


def _panel(name: str, cells: list[Row], series: dict[str, dict[str, Row]], references: dict[int, Row]) -> Panel:
    first = cells[0]
    integrators = list(dict.fromkeys(cell["integrator"] for cell in cells))
    lines: dict[tuple[str, str], Line] = {}
    for cell in cells:
        key = (cell["integrator"], cell["sampler"])
        if key not in lines:
            lines[key] = _line(cell, series, alone=len(integrators) == 1)
        lines[key].cells[cell["spp"]] = cell
    return Panel(
        name, first["scene"], first["sweep"], integrators, list(lines.values()), references.get(first["reference"])
    )


def _line(cell: Row, series: dict[str, dict[str, Row]], *, alone: bool) -> Line:
    sampler, integrator = cell["sampler"], cell["integrator"]
    line = Line(integrator, sampler, sampler if alone else f"{sampler} with {integrator}", cell["replay"])
    for metric, found in series.get(_curve(cell), {}).items():
        line.points[metric] = {point["spp"]: point for point in found["points"]}
        line.slopes[metric] = found["slope"]
        line.alike = line.alike and found["alike"]
    return line


def _series(reading: Reading) -> dict[str, dict[str, Row]]:
    """Curve → metric → ``schemas.Series``."""
    found: dict[str, dict[str, Row]] = {}
    for metric, convergence in reading.curves.items():
        for one in convergence["series"]:
            found.setdefault(_curve(one), {})[metric] = one
    return found


def _curve(of: Row) -> str:
    return json.dumps([of["scene"], of["integrator"], of["sampler"], of["sweep"]])


def _in_order(cells: Iterable[Row], reading: Reading) -> Iterator[Row]:
    """Integrator by integrator, sampler by sampler, as the grid names them; the plan goes spp by spp."""
    places = {
        axis: {label(axis, item): place for place, item in enumerate(reading.grid[f"{axis}s"])}
        for axis in ("integrator", "sampler")
    }
    rows = sorted(cells, key=lambda cell: [places[axis].get(cell[axis], 0) for axis in places])
    yield from rows


def label(axis: str, choice: Row) -> str:
    """The canonical label of a choice in a grid's JSON."""
    return catalog.label(axis, Choice.of(choice))
