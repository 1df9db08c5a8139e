"""
The frame: where the samples of one pass start, and where their light is gathered.

A pass is a wavefront of width × height × k lanes, k neighbouring lanes to a pixel. ``camera_rays`` starts them
as Mitsuba's own renderer does, in the same order of sample dimensions; ``gather`` sums what they bring home
per pixel. With the box filter that is a sum over k neighbouring lanes; any other filter goes through an image
block. Either way a pass yields (sum, weight), and pictures are Σ sum / Σ weight over the passes.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from renderer.scenes.load import LoadedScene


@dataclass
class PassSum:
    """
    What one pass brings: Dr.Jit arrays that are being computed while Python goes on.

    sums    three arrays of width·height values, one a colour channel
    weight  an array of width·height filter weights, or the constant number of samples of each pixel
    """

    sums: tuple[Any, Any, Any]
    weight: Any | float

    def with_splats(self, splats: Splats) -> PassSum:
        """With light that arrived at other pixels than its lane's: it counts like the lane's own, filter and all."""
        red, green, blue = (own + other for own, other in zip(self.sums, splats.channels(), strict=True))
        sums = red, green, blue
        dr.schedule(sums)
        return PassSum(sums, self.weight)

    def read(self) -> tuple[NDArray[np.float64], NDArray[np.float64] | float]:
        """Wait for the pass: sums as (width·height, 3), weights as (width·height, 1) or a constant."""
        sums = np.stack([channel.numpy() for channel in self.sums], axis=-1).astype(np.float64)
        if isinstance(self.weight, float):
            return sums, self.weight
        return sums, self.weight.numpy().astype(np.float64)[:, None]


EVEN = 16  # samples along a pixel's side, where weights of a filter are summed


class Frame:
    """
    The pixels of a loaded scene, cut for passes of ``samples`` (k) per pixel.

    diff_scale  scales ray differentials to the sample spacing, 1/√spp over *all* passes
    """

    def __init__(self, loaded: LoadedScene, samples: int, spp: int):
        self.scene, self.sensor, self.lights = loaded.scene, loaded.sensor, loaded.lights
        film = self.sensor.film()
        self.film_size = tuple(int(n) for n in film.size())
        self.width, self.height = (int(n) for n in film.crop_size())
        x, y = (int(n) for n in film.crop_offset())
        self.offset = x, y
        self.samples = samples
        self.diff_scale = 1 / math.sqrt(spp)
        rfilter = film.rfilter()
        self.rfilter = None if rfilter.is_box_filter() else rfilter

    @property
    def lanes(self) -> int:
        """Samples of one pass over the whole frame."""
        return self.width * self.height * self.samples

    def camera_rays(self, sampler: Any) -> tuple[Any, Any, Any]:
        """
        One ray a lane → (rays, their weights, film positions in pixels).

        Draws film 2D, lens 2D if the sensor has one, time 1D if the shutter opens, wavelength 1D in spectral
        modes. k is opaque, as is the scale of differentials: one kernel serves every spp.
        """
        lane = dr.arange(mi.UInt32, self.lanes)
        pixel = lane // dr.opaque(mi.UInt32, self.samples)
        row = pixel // dr.opaque(mi.UInt32, self.width)
        column = pixel - row * dr.opaque(mi.UInt32, self.width)
        corner = mi.Vector2f(mi.Float(column), mi.Float(row)) + mi.Vector2f(*self.offset)
        position = mi.Point2f(corner + sampler.next_2d())
        lens = sampler.next_2d() if self.sensor.needs_aperture_sample() else mi.Point2f(0.5)
        time = mi.Float(self.sensor.shutter_open())
        if self.sensor.shutter_open_time() > 0:
            time += sampler.next_1d() * self.sensor.shutter_open_time()
        wavelength = sampler.next_1d() if mi.is_spectral else mi.Float(0)
        on_film = (position - mi.Vector2f(*self.offset)) / mi.Vector2f(self.width, self.height)
        rays, weights = self.sensor.sample_ray_differential(time, wavelength, mi.Point2f(on_film), lens)
        rays.scale_differential(dr.opaque(mi.Float, self.diff_scale))
        return rays, weights, position

    def gather(self, position: Any, light: Any, wavelengths: Any) -> PassSum:
        """
        Sum ``light`` (a spectrum per lane, [N]) of the samples at ``position`` into the frame's pixels.

        Starts the computation: everything that hangs on the lanes is evaluated once, here.
        """
        rgb = _rgb(light, wavelengths)
        if self.rfilter is None:
            # Reductions evaluate their own input: without this the pass would be traced once per channel.
            dr.eval(rgb)
            sums = tuple(dr.block_sum(channel, self.samples) for channel in (rgb.x, rgb.y, rgb.z))
            dr.schedule(sums)
            return PassSum(sums, float(self.samples))
        block = mi.ImageBlock([self.width, self.height], list(self.offset), 4, self.rfilter)
        block.put(position, [rgb.x, rgb.y, rgb.z, mi.Float(1)])
        channels = dr.unravel(mi.Vector4f, block.tensor().array)
        dr.eval(channels)
        return PassSum((channels.x, channels.y, channels.z), channels.w)

    def from_splats(self, splats: Splats) -> PassSum:
        """The pass of an integrator that has no camera samples: divided by what theirs would sum to."""
        channels = splats.channels()
        dr.eval(channels)
        return PassSum(channels, float(self.samples) if self.rfilter is None else self._even_weights * self.samples)

    @cached_property
    def _even_weights(self) -> Any:
        """The sum of filter weights in each pixel, for samples as dense as one a pixel: less at the film's edge."""
        count = self.width * self.height * EVEN**2
        number = dr.arange(mi.UInt32, count)
        row, column = number // (self.width * EVEN), number % (self.width * EVEN)
        block = _block(self, 1)
        at = (mi.Vector2f(mi.Float(column), mi.Float(row)) + 0.5) / EVEN + mi.Vector2f(*self.offset)
        block.put(mi.Point2f(at), [mi.Float(1 / EVEN**2)], mi.Bool(True))
        return dr.opaque(mi.Float, 0) + block.tensor().array


class Splats:
    """
    Light of one pass that lands anywhere on the film: put into the pixels of ``frame`` with its filter.

    A splat is the light of one of the pass's lanes. Filter weights are not collected: the camera's samples, as many and
    spread as evenly, have the same expected sum of them, and their sums are what a pixel is divided by.

    block  an image block of Mitsuba's, with channels for red, green, blue and a weight that is not used
    """

    def __init__(self, frame: Frame):
        self.block = _block(frame, 4)

    def put(self, position: Any, light: Any, wavelengths: Any, active: Any) -> None:
        """Add ``light`` (a spectrum per lane) at ``position``, in pixels of the film, inside of the frame's window."""
        rgb = _rgb(light, wavelengths)
        self.block.put(position, [rgb.x, rgb.y, rgb.z, mi.Float(0)], active)

    def channels(self) -> tuple[Any, Any, Any]:
        """Three arrays of width·height values."""
        channels = dr.unravel(mi.Vector4f, self.block.tensor().array)
        return channels.x, channels.y, channels.z


def _block(frame: Frame, channels: int) -> Any:
    # Not coalesced: splats of neighbouring lanes have nothing to do with each other.
    size, offset = [frame.width, frame.height], list(frame.offset)
    return mi.ImageBlock(size, offset, channels, frame.rfilter, coalesce=False)


def _rgb(light: Any, wavelengths: Any) -> Any:
    return mi.xyz_to_srgb(mi.spectrum_to_xyz(light, wavelengths)) if mi.is_spectral else light
