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

    def read(self) -> tuple[NDArray[np.float64], NDArray[np.float64] | float]:
        """Wait for the pass: sums as (width·height, 3), weights as (width·height, 1) or a constant."""
        sums = np.stack([channel.numpy() for channel in self.sums], axis=-1).astype(np.float64)
        if isinstance(self.weight, float):
            return sums, self.weight
        return sums, self.weight.numpy().astype(np.float64)[:, None]


class Frame:
    """
    The pixels of a loaded scene, cut for passes of ``samples`` (k) per pixel.

    diff_scale  scales ray differentials to the sample spacing, 1/√spp over *all* passes
    """

    def __init__(self, loaded: LoadedScene, samples: int, spp: int):
        self.scene, self.sensor = loaded.scene, loaded.sensor
        film = self.sensor.film()
        self.film_size = tuple(int(n) for n in film.size())
        self.width, self.height = (int(n) for n in film.crop_size())
        self.offset = tuple(int(n) for n in film.crop_offset())
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
        rgb = mi.xyz_to_srgb(mi.spectrum_to_xyz(light, wavelengths)) if mi.is_spectral else light
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
