"""
What our samplers have in common: which pixel a lane belongs to, which of its samples it draws, which dimension is next.

Mitsuba tells a Python sampler its seed and the size of a wavefront, not how the wavefront is cut into passes. Our pass
loop does: ``frame`` comes before ``seed`` and before each ``advance`` (renderer/render.py). Without it a wavefront is
taken for a whole picture of ``sample_count`` neighbouring lanes a pixel, as plain ``mi.render`` makes it.

All numbers are functions of (seed, absolute pixel, sample, dimension). So a picture does not depend on how it is cut
into passes, a crop has the samples of the whole film, and a lane needs no state but two counters.

This module derives from ``mi.Sampler``: import it when a variant has been set.
"""

from __future__ import annotations

from typing import Any

import drjit as dr
import mitsuba as mi

from renderer.samplers.bits import GOLDEN, Divisor, mix, unit


class Lanes:
    """
    Who the lanes of a wavefront are. Not a Dr.Jit structure, so that loops leave it alone: nothing in it changes.

    key     hash of (seed, pixel), different for every pixel
    index   sample number in its pixel, 0 … spp − 1
    x, y    absolute pixel on the film; None where no frame was told
    """

    __slots__ = ("index", "key", "x", "y")

    def __init__(self, key: Any, index: Any, x: Any = None, y: Any = None):
        self.key, self.index, self.x, self.y = key, index, x, y


class Picture:
    """What ``frame`` was told: film size, crop (x, y, width, height), samples of a pass and the first of them."""

    __slots__ = ("crop", "first", "height", "samples", "width")

    def __init__(self, width: int, height: int, crop: tuple[int, int, int, int], samples: int, first: int):
        self.width, self.height, self.crop, self.samples, self.first = width, height, crop, samples, first


class PixelSampler(mi.Sampler):
    """
    Base of our samplers. A subclass says what ``fraction_1d`` and ``fraction_2d`` are, and what it needs to
    ``prepare``.

    ones, twos  how many 1D and 2D samples were drawn; the only state that a loop carries along
    """

    def __init__(self, props: mi.Properties):
        super().__init__(props)
        self.set_sample_count(props.get("sample_count", 16))
        self.picture: Picture | None = None
        self.lanes: Lanes | None = None
        self.base_seed: Any = None
        self.ones, self.twos = mi.UInt32(0), mi.UInt32(0)

    # -- what a subclass says --------------------------------------------------------------------------------

    def prepare(self) -> None:
        """Load or compute what is the same for all pixels, before the first sample."""

    def fraction_1d(self, lanes: Lanes, dimension: Any) -> Any:
        """The 1D sample number ``dimension`` of each lane as a 0.32 fixed-point fraction."""
        raise NotImplementedError

    def fraction_2d(self, lanes: Lanes, dimension: Any) -> tuple[Any, Any]:
        """The 2D sample number ``dimension`` of each lane as two 0.32 fixed-point fractions."""
        raise NotImplementedError

    # -- what Mitsuba and the pass loop call -----------------------------------------------------------------

    def frame(
        self, width: int, height: int, crop: tuple[int, int, int, int], spp_per_pass: int, first_sample: int
    ) -> None:
        """Film size and crop in pixels, and the samples of each pixel that the next pass draws."""
        self.picture = Picture(width, height, crop, spp_per_pass, first_sample)

    def stream(self, number: int, of: int) -> None:
        """
        Told that this is sampler ``number`` of several that serve the same lanes, seeded differently. Nothing to do
        where a seed makes all dimensions new.
        """

    def seed(self, seed: Any, wavefront_size: int = 2**32 - 1) -> None:
        if wavefront_size >= 2**31:
            raise RuntimeError(
                f"a wavefront of {wavefront_size} samples: at most 2^31 − 1, so cut the picture into passes"
            )
        super().seed(seed, wavefront_size)
        self.base_seed = mi.UInt32(seed)
        dr.make_opaque(self.base_seed)
        self.prepare()
        self._start()

    def advance(self) -> None:
        if self.picture is None:
            raise RuntimeError(
                f"{type(self).__name__} draws a picture in one pass unless it is told the pass: call "
                "sampler.frame(width, height, crop, spp_per_pass, first_sample) before advance(), or render less"
            )
        super().advance()
        self._start()

    def next_1d(self, active: Any = True) -> Any:
        value = unit(self.fraction_1d(self._seeded(), self.ones))
        self.ones += 1
        return value

    def next_2d(self, active: Any = True) -> Any:
        x, y = self.fraction_2d(self._seeded(), self.twos)
        self.twos += 1
        return mi.Point2f(unit(x), unit(y))

    def schedule_state(self) -> None:
        """Nothing: the counters start afresh with every pass, the rest follows from the lane's number."""

    def fork(self) -> PixelSampler:
        copy = type(self)(self.properties())
        copy.picture = self.picture
        return copy

    def clone(self) -> PixelSampler:
        copy = self.fork()
        copy.adopt(self)
        if self.lanes is not None:
            copy.seed(mi.UInt32(self.base_seed), self.wavefront_size())
            copy.lanes, copy.ones, copy.twos = self.lanes, mi.UInt32(self.ones), mi.UInt32(self.twos)
        return copy

    def properties(self) -> mi.Properties:
        """Fresh properties that make a sampler like this one: those that it was made with are gone by now."""
        props = mi.Properties()
        props["sample_count"] = self.sample_count()
        return props

    def adopt(self, other: Any) -> None:
        """Take over what ``prepare`` made in another sampler of this class."""

    def to_string(self) -> str:
        return f"{type(self).__name__}[sample_count = {self.sample_count()}]"

    def key(self, dimension: Any, salt: int) -> Any:
        """A fresh 32-bit key for a dimension of each lane's pixel; ``salt`` tells kinds of dimension apart."""
        return mix(self._seeded().key + (dimension * 2 + salt) * GOLDEN)

    # -- lanes -------------------------------------------------------------------------------------------------

    def _seeded(self) -> Lanes:
        if self.lanes is None:
            raise RuntimeError(f"{type(self).__name__} was asked for a sample before seed(seed, wavefront_size)")
        return self.lanes

    def _start(self) -> None:
        """
        The lanes of the next pass, and dimension 0.

        Whatever differs between cells or passes is opaque, that is a number in memory and not in the code: one kernel
        serves every seed, spp and pass.
        """
        self.ones, self.twos = mi.UInt32(0), mi.UInt32(0)
        picture = self.picture
        lane = dr.arange(mi.UInt32, self.wavefront_size())
        samples = Divisor(picture.samples if picture else self.sample_count())
        pixel = samples.quotient(lane)
        index = samples.remainder(lane, pixel) + dr.opaque(mi.UInt32, picture.first if picture else 0)
        x = y = None
        if picture:
            left, top, crop_width, _ = picture.crop
            width = Divisor(crop_width)
            row = width.quotient(pixel)
            x = width.remainder(pixel, row) + dr.opaque(mi.UInt32, left)
            y = row + dr.opaque(mi.UInt32, top)
            pixel = y * dr.opaque(mi.UInt32, picture.width) + x
        self.lanes = Lanes(mix(pixel ^ mix(self.base_seed)), index, x, y)
