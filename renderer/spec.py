"""
What a cell is: frozen values, one canonical text, one digest.

An ``Estimand`` says what the *expected* picture is, so that only pictures with equal expectations are ever
compared. A ``CellSpec`` adds how it is estimated: integrator, sampler and the spp that is really rendered.
The digest of a cell is its identity everywhere: in the database, in file names, in the seeds. Whatever
changes a picture is in it (plugin versions included); what does not (the device, how many replicates) is not.

Values come here fully resolved: defaults, aliases and rounding are the catalog's business. No Mitsuba here.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

Scalar = bool | int | float | str

FORMAT = 1  # shape of the canonical text; a new number is a new identity for every cell
PASS_LOOP = 1  # renderer/render.py: how passes are cut, seeded and summed
SCENE_LOADER = 1  # renderer/scenes/load.py: how a scene file becomes a scene
PRECISION = "single"  # Mitsuba's floats; its double variants are not shipped as wheels
SEED_BITS = 31  # the top bit of a 32-bit seed tells reference replicates from ordinary ones


def canonical(value: Any) -> str:
    """
    The one JSON text of a value: sorted keys, no blanks, ASCII, and one spelling per number.

    10 and 10.0 are the same parameter and so the same text; -0.0 is 0. Raises ``ValueError`` for NaN and
    infinities, which JSON cannot say, and ``TypeError`` for what is not JSON.
    """
    return json.dumps(_plain(value), sort_keys=True, separators=(",", ":"), allow_nan=False)


def _plain(value: Any) -> Any:
    if isinstance(value, float) and value.is_integer() and abs(value) < 2**53:
        return int(value)
    if isinstance(value, Mapping):
        return {str(key): _plain(item) for key, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [_plain(item) for item in value]
    return value


def digest_of(text: str) -> str:
    """SHA-256 of a canonical text, 64 hexadecimal digits."""
    return hashlib.sha256(text.encode("ascii")).hexdigest()


@dataclass(frozen=True)
class Choice:
    """
    One value of an axis (a sampler, an integrator, a reconstruction filter) with *every* parameter resolved.

    ``parameters`` are sorted (name, value) pairs; ``version`` is the plugin's own, raised when its pictures
    change. Made by ``catalog.resolve``, which also gives the short label that people read.
    """

    name: str
    version: int
    parameters: tuple[tuple[str, Scalar], ...] = ()

    @cached_property
    def text(self) -> str:
        """Canonical JSON."""
        return canonical({"type": self.name, "version": self.version, **dict(self.parameters)})

    @classmethod
    def of(cls, data: Mapping[str, Any]) -> Choice:
        """The inverse of ``text``, from its parsed JSON."""
        rest = {key: value for key, value in data.items() if key not in ("type", "version")}
        return cls(data["type"], data["version"], tuple(sorted(rest.items())))


@dataclass(frozen=True)
class Estimand:
    """
    What the expected picture is. References and metrics hang on it.

    scene          digest of the scene's snapshot
    width, height  of the film, in pixels
    crop           (x, y, width, height) in pixels, or None for the whole film
    max_depth      edges of the longest path that counts (Mitsuba's count; -1: unlimited)
    hide_emitters  True: lamps are not seen directly
    rfilter        reconstruction filter
    colour         "rgb" or "spectral"
    strategy       "s-t": only paths made of s vertices from a lamp and t from the camera, each by its weight;
                   "s-t alone": in full. Empty: all of them
    sweep          sorted (parameter, value) pairs that this cell sets in the scene, colours as tuples
    """

    scene: str
    width: int
    height: int
    max_depth: int
    rfilter: Choice
    crop: tuple[int, int, int, int] | None = None
    hide_emitters: bool = False
    colour: str = "rgb"
    strategy: str = ""
    sweep: tuple[tuple[str, Any], ...] = ()

    @cached_property
    def text(self) -> str:
        """Canonical JSON."""
        return canonical(
            {
                "colour": self.colour,
                "crop": self.crop,
                "height": self.height,
                "hide_emitters": self.hide_emitters,
                "max_depth": self.max_depth,
                "rfilter": json.loads(self.rfilter.text),
                "scene": self.scene,
                "sweep": dict(self.sweep),
                "width": self.width,
                **({"strategy": self.strategy} if self.strategy else {}),  # a debugging aid: no name for its absence
            }
        )

    @cached_property
    def digest(self) -> str:
        return digest_of(self.text)

    @property
    def size(self) -> tuple[int, int]:
        """(width, height) of the picture that is rendered, in pixels: the crop's where there is one."""
        return (self.crop[2], self.crop[3]) if self.crop else (self.width, self.height)

    @classmethod
    def of(cls, data: Mapping[str, Any]) -> Estimand:
        """The inverse of ``text``, from its parsed JSON."""
        fields = dict(data)
        fields["rfilter"] = Choice.of(fields["rfilter"])
        fields["crop"] = tuple(fields["crop"]) if fields["crop"] else None
        fields["sweep"] = tuple(
            (name, tuple(value) if isinstance(value, list) else value)
            for name, value in sorted(fields["sweep"].items())
        )
        return cls(**fields)


@dataclass(frozen=True)
class CellSpec:
    """
    One cell of a grid: an estimand and the way to estimate it.

    ``spp`` is what is rendered, after the sampler's rounding; what was asked belongs to the experiment.
    """

    estimand: Estimand
    integrator: Choice
    sampler: Choice
    spp: int

    @property
    def text(self) -> str:
        """Canonical JSON, put together from the cached parts: grids of 10⁵ cells share most of them."""
        return (
            f'{{"estimand":{self.estimand.text},"format":{FORMAT},"integrator":{self.integrator.text},'
            f'"pass_loop":{PASS_LOOP},"precision":"{PRECISION}","sampler":{self.sampler.text},'
            f'"scene_loader":{SCENE_LOADER},"spp":{self.spp}}}'
        )

    @cached_property
    def digest(self) -> str:
        return digest_of(self.text)

    @classmethod
    def parse(cls, text: str) -> CellSpec:
        """The inverse of ``text``. Versions of the loop that wrote it are part of its digest, not of the value."""
        data = json.loads(text)
        return cls(
            Estimand.of(data["estimand"]), Choice.of(data["integrator"]), Choice.of(data["sampler"]), data["spp"]
        )


def seed(digest: str, replicate: int, *, reference: bool = False) -> int:
    """
    The 32-bit seed of one replicate: hashed, so that no two seeds differ by a multiple of spp on purpose.

    Mitsuba seeds lane i of the wavefront with TEA(base, i + seed): arithmetic seeds would repeat the same
    samples shifted by some pixels (science.md G2). The top bit is set for replicates of a reference and
    clear for all others, so a reference never shares a picture with a cell it is compared with.
    """
    bits = int.from_bytes(hashlib.sha256(f"{digest}:{replicate}".encode("ascii")).digest()[:4], "big")
    return bits >> (32 - SEED_BITS) | (int(reference) << SEED_BITS)


def stream_seed(seed: int, number: int) -> int:
    """
    The seed of sampler ``number`` of the same lanes: integrators that trace two subpaths draw them from two samplers.

    The first is the cell's own; the others are hashed, so that no two differ by a multiple of spp on purpose.
    """
    if number == 0:
        return seed
    return int.from_bytes(hashlib.sha256(f"{seed}/{number}".encode("ascii")).digest()[:4], "big")
