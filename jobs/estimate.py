"""
What a grid will cost, before anything is rendered: pictures, seconds, bytes.

``check`` prints it. Pictures that are already there cost nothing, and cells that two requests share are counted once.
Seconds are samples divided by a rate; without measured rates they are a rough guess and say so. No Mitsuba here.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from jobs.plan import Plan, PlannedCell, Role
from renderer import catalog

ROUGH_RATE = 3e6  # samples per second: path tracing of the built-in scenes on 2 cores
KERNEL_SECONDS = 0.2  # compiling for one scene, integrator and sampler; nearly nothing when cached on disk
PICTURE_SECONDS = 0.005  # writing, measuring and recording one small picture
EXR_BYTES_PER_PIXEL = 12  # float32 RGB with ZIP: noise hardly shrinks
EXR_HEADER_BYTES = 2000  # the spec, versions and timings

Rates = Mapping[tuple[str, str], float]  # (scene, integrator label) → measured samples per second
Had = Mapping[tuple[str, Role], int]  # (digest, role) → how many replicates are there


@dataclass(frozen=True)
class Rounded:
    """A sampler that does not render the spp that was asked."""

    sampler: str
    asked: int
    rendered: int


@dataclass(frozen=True)
class Estimate:
    """
    cells       of all curves, without references
    references  one for each estimand
    replicates  pictures wanted of all of them, each counted once
    reused      how many of these are there already
    rounded     where the spp differs from what was asked, references included
    samples     still to be rendered
    seconds     for these, with compiling and writing
    disk_bytes  for the pictures still to be rendered, if all are kept
    rough       True: for some scene and integrator no rate was measured, ROUGH_RATE and the integrator's cost stand in
    """

    cells: int
    references: int
    replicates: int
    reused: int
    rounded: tuple[Rounded, ...]
    samples: int
    seconds: float
    disk_bytes: int
    rough: bool


def estimate(plan: Plan, rates: Rates | None = None, had: Had | None = None) -> Estimate:
    """The cost of what ``plan`` wants beyond what is ``had``, at the given ``rates``."""
    rates, had = rates or {}, had or {}
    wanted: dict[tuple[str, Role], PlannedCell] = {}
    for cell in plan.cells:
        wanted.setdefault((cell.spec.digest, cell.role), cell)
    reused = samples = disk_bytes = 0
    seconds, rough = 0.0, False
    kernels = set()
    for key, cell in wanted.items():
        there = min(had.get(key, 0), cell.replicates)
        missing = cell.replicates - there
        reused += there
        if not missing:
            continue
        width, height = cell.spec.estimand.size
        rate = rates.get((cell.scene, cell.integrator))
        rough = rough or rate is None
        guess = ROUGH_RATE / catalog.find("integrator", cell.spec.integrator.name).cost
        kernels.add((cell.scene, cell.integrator, cell.sampler))
        samples += missing * width * height * cell.spec.spp
        seconds += missing * (width * height * cell.spec.spp / (rate or guess) + PICTURE_SECONDS)
        disk_bytes += missing * (width * height * EXR_BYTES_PER_PIXEL + EXR_HEADER_BYTES)
    return Estimate(
        cells=sum(cell.role == "cell" for cell in plan.cells),
        references=sum(cell.role == "reference" for cell in plan.cells),
        replicates=sum(cell.replicates for cell in wanted.values()),
        reused=reused,
        rounded=_rounded(plan),
        samples=samples,
        seconds=seconds + KERNEL_SECONDS * len(kernels),
        disk_bytes=disk_bytes,
        rough=rough,
    )


def _rounded(plan: Plan) -> tuple[Rounded, ...]:
    """Each rounding once: first those of the grid's samplers, then those of references."""
    grid = plan.grid
    asked = [(sampler, spp) for sampler in grid.samplers for spp in grid.spp]
    asked += [(scene.reference.sampler, scene.reference.asked) for scene in grid.scenes if scene.reference]
    found = {
        Rounded(catalog.label("sampler", sampler), spp, catalog.rendered_spp(sampler, spp)): None
        for sampler, spp in asked
    }
    return tuple(item for item in found if item.asked != item.rendered)
