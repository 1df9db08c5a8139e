"""The set-up: what was asked, in the words of the catalog."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

from jobs.store import Row
from renderer import catalog
from renderer.scenes.builtin import BUILTIN, BuiltinScene
from renderer.spec import Choice
from service.report.panels import label
from service.report.reading import Reading

DIGEST_SHOWN = 16  # hexadecimal digits


@dataclass(frozen=True)
class Plugin:
    """
    A sampler or an integrator as the grid has it.

    parameters  every one with its value
    spp         samplers: what was asked → what is rendered
    """

    label: str
    line: str
    source: str
    parameters: list[tuple[str, str]]
    spp: list[tuple[int, int]]


@dataclass(frozen=True)
class Scene:
    """
    A scene with its settings.

    about      what the catalog says of a built-in one
    width, height  of its pictures, in pixels
    reference  how it is made, None where none was asked
    uploaded   digest of its snapshot, where it is not built in
    """

    name: str
    about: BuiltinScene | None
    width: int
    height: int
    max_depth: int
    reference: str | None
    uploaded: str | None


@dataclass(frozen=True)
class Sweep:
    """
    What is set in loaded scenes, value by value.

    scenes  where it applies; empty for all
    """

    parameter: str
    values: list[str]
    scenes: list[str]


@dataclass(frozen=True)
class Setup:
    scenes: list[Scene]
    sweeps: list[Sweep]
    samplers: list[Plugin]
    integrators: list[Plugin]
    rfilter: str  # with the scenes that have another
    colour: str

    def sizes(self) -> dict[str, tuple[int, int]]:
        """Of pictures, by scene."""
        return {scene.name: (scene.width, scene.height) for scene in self.scenes}

    @property
    def rounded(self) -> bool:
        """Whether any sampler renders another spp than was asked."""
        return any(asked != rendered for sampler in self.samplers for asked, rendered in sampler.spp)


def of(reading: Reading) -> Setup:
    grid = reading.grid
    return Setup(
        [_scene(scene, reading) for scene in grid["scenes"]],
        [_sweep(sweep, len(grid["scenes"])) for sweep in grid.get("sweeps", ())],
        [_plugin("sampler", item, grid["spp"]) for item in grid["samplers"]],
        [_plugin("integrator", item, []) for item in grid["integrators"]],
        _filters(grid), grid["colour"],
    )  # fmt: skip


def _filters(grid: Row) -> str:
    """The filter of the grid, and those of scenes that have another."""
    common = label("rfilter", grid["rfilter"])
    own = [(scene["name"], label("rfilter", scene["rfilter"])) for scene in grid["scenes"] if "rfilter" in scene]
    others = [f"{rfilter} in {name}" for name, rfilter in own if rfilter != common]
    return ", ".join([common, *others])


def _plugin(axis: str, item: Row, spp: list[int]) -> Plugin:
    choice = Choice.of(item)
    entry = catalog.find(axis, choice.name)
    return Plugin(
        catalog.label(axis, choice), entry.line, entry.source,
        [(key, _shown(value)) for key, value in _told(choice)],
        [(asked, catalog.rendered_spp(choice, asked)) for asked in spp],
    )  # fmt: skip


def _told(choice: Choice) -> Iterator[tuple[str, Any]]:
    """What is set, with a digest as long as it takes to tell files apart."""
    for key, value in choice.parameters:
        if value != "":
            yield key, str(value)[:DIGEST_SHOWN] if key == catalog.POINTS else value


def _shown(value: Any) -> str:
    return str(value).lower() if isinstance(value, bool) else str(value)


def _scene(scene: Row, reading: Reading) -> Scene:
    uploaded = reading.uploaded.get(scene["name"])
    width, height = (scene["crop"] or [0, 0, scene["width"], scene["height"]])[2:]
    return Scene(
        scene["name"], None if uploaded else BUILTIN.get(scene["name"]), width, height, scene["max_depth"],
        _reference(scene["reference"]), uploaded,
    )  # fmt: skip


def _sweep(sweep: Row, scenes: int) -> Sweep:
    everywhere = len(sweep["scenes"]) == scenes
    return Sweep(sweep["parameter"], [str(value) for value in sweep["values"]], [] if everywhere else sweep["scenes"])


def _reference(reference: Row | None) -> str | None:
    if reference is None:
        return None
    made = f"{label('integrator', reference['integrator'])}, {label('sampler', reference['sampler'])}"
    return f"{made}, {reference['replicates']} × {reference['spp']} spp"
