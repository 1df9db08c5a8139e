"""
A grid as a value: what somebody asked to have rendered, with nothing left open.

Names are resolved, defaults filled in, every scene has its own settings. ``grid.py`` makes these values from files
and requests and checks them; ``plan.py`` turns them into cells. Nothing here reads or renders.
"""

from __future__ import annotations

import json
from dataclasses import dataclass
from functools import cached_property
from typing import Any

from renderer import catalog
from renderer.parameters import Value
from renderer.samplers.pointfile import PointSource
from renderer.scenes.sources import SceneSource
from renderer.spec import FORMAT, PASS_LOOP, PRECISION, SCENE_LOADER, Choice, canonical, digest_of

MAX_CELLS = 100_000  # of one grid
MAX_REPLICATES = 1000  # of one cell; a mean error is known to 3 % of its spread by then
MAX_SIDE = 16_384  # pixels
MAX_PIXELS = 2**26  # of one picture: 0.8 GB as float32 RGB, and measuring holds several of them

Crop = tuple[int, int, int, int]  # x, y, width, height in pixels


@dataclass(frozen=True)
class ReferenceRequest:
    """
    How the reference of a scene is rendered. Path lengths and visible lamps follow the cells that it serves.

    spp          of one replicate, as the sampler renders it
    asked        of one replicate, before the sampler's rounding
    asked_total  of all replicates together, as the grid says it
    replicates   even: the halves R1 and R2 are the means of the even and the odd ones
    """

    integrator: Choice
    sampler: Choice
    spp: int
    asked: int
    asked_total: int
    replicates: int

    def as_json(self) -> dict[str, Any]:
        return {
            "integrator": json.loads(self.integrator.text),
            "sampler": json.loads(self.sampler.text),
            "spp": self.spp,
            "asked_total": self.asked_total,
            "replicates": self.replicates,
        }


@dataclass(frozen=True)
class SceneRequest:
    """
    One scene of a grid with the settings that hold for it: its own, else the grid's, else the scene file's.

    crop       None for the whole film
    max_depth  holds for integrators that have none of their own
    rfilter    reconstruction filter
    reference  None for no reference
    """

    source: SceneSource
    width: int
    height: int
    crop: Crop | None
    max_depth: int
    rfilter: Choice
    reference: ReferenceRequest | None

    @property
    def size(self) -> tuple[int, int]:
        """(width, height) of the picture that is rendered, in pixels."""
        return (self.crop[2], self.crop[3]) if self.crop else (self.width, self.height)

    def as_json(self, rfilter: Choice) -> dict[str, Any]:
        """
        As part of a grid whose filter is ``rfilter``. The scene's own is told where it is another, or where the file
        has one that would come back if nobody spoke; so is the whole film where the file has a crop.
        """
        told = self.rfilter != rfilter or self.source.defaults.rfilter != "box"
        whole = (0, 0, self.width, self.height) if self.source.defaults.crop else None
        return {
            **({"rfilter": json.loads(self.rfilter.text)} if told else {}),
            "name": self.source.name,
            "digest": self.source.digest,
            "width": self.width,
            "height": self.height,
            "crop": self.crop or whole,
            "max_depth": self.max_depth,
            "reference": self.reference and self.reference.as_json(),
        }


@dataclass(frozen=True)
class Sweep:
    """
    An axis that is set in the loaded scene.

    parameter  as it was written; what it means in a scene is the business of ``renderer.parameters``
    values     numbers, or colours (linear RGB); none twice
    scenes     names of the scenes that it applies to
    """

    parameter: str
    values: tuple[Value, ...]
    scenes: tuple[str, ...]

    def as_json(self) -> dict[str, Any]:
        return {"parameter": self.parameter, "values": self.values, "scenes": self.scenes}


@dataclass(frozen=True)
class GridSpec:
    """
    A grid that was read and checked. ``samplers``, ``integrators`` and ``spp`` hold no value twice; spp ascends.

    points  the files behind ``pointset`` samplers, which know them by digest
    """

    name: str
    scenes: tuple[SceneRequest, ...]
    samplers: tuple[Choice, ...]
    integrators: tuple[Choice, ...]
    spp: tuple[int, ...]
    replicates: int
    colour: str
    points: tuple[PointSource, ...] = ()
    sweeps: tuple[Sweep, ...] = ()

    @property
    def rfilter(self) -> Choice:
        """The filter of the first scene, which is that of the others unless they say otherwise."""
        return self.scenes[0].rfilter

    @property
    def axes(self) -> dict[str, int]:
        """How many values each axis has; a sweep by the name of its parameter, over all scenes."""
        sweeps: dict[str, set[Value]] = {}
        for sweep in self.sweeps:
            sweeps.setdefault(sweep.parameter, set()).update(sweep.values)
        return {
            "scenes": len(self.scenes), "samplers": len(self.samplers), "integrators": len(self.integrators),
            "spp": len(self.spp), "replicates": self.replicates,
            **{parameter: len(values) for parameter, values in sweeps.items()},
        }  # fmt: skip

    @cached_property
    def text(self) -> str:
        """Canonical JSON of all that decides which pictures are made, with the scenes by digest."""
        sweeps = {"sweeps": [sweep.as_json() for sweep in self.sweeps]} if self.sweeps else {}
        return canonical(
            {
                **sweeps,  # left out where there are none: such grids keep the digest that they had before sweeps
                "colour": self.colour,
                "format": FORMAT,
                "integrators": [json.loads(choice.text) for choice in self.integrators],
                "name": self.name,
                "pass_loop": PASS_LOOP,
                "precision": PRECISION,
                "replicates": self.replicates,
                "rfilter": json.loads(self.rfilter.text),
                "samplers": [json.loads(choice.text) for choice in self.samplers],
                "scene_loader": SCENE_LOADER,
                "scenes": [scene.as_json(self.rfilter) for scene in self.scenes],
                "spp": self.spp,
            }
        )

    @cached_property
    def digest(self) -> str:
        """Identity of the experiment: the same request is the same experiment, however it was spelled."""
        return digest_of(self.text)


def path_lengths(integrator: Choice, otherwise: int) -> int:
    """The max_depth that this integrator renders: its fixed one, its own parameter, or else the scene's."""
    fixed = catalog.find("integrator", integrator.name).depth
    return fixed if fixed is not None else int(dict(integrator.parameters).get("max_depth", otherwise))
