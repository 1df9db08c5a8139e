"""
Colours in pbrt's spellings → linear Rec. 709 RGB, as pbrt-v3 itself works: rgb, xyz, blackbody, spectrum.

A spectrum is integrated against the CIE curves from 360 to 830 nm, constant beyond its first and last value; so
pictures agree with those of pbrt's usual build (``RGBSpectrum``). Source: pbrt-v3, src/core/spectrum.h.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from renderer.errors import SceneError, shown
from renderer.scenes.pbrt.cie import WAVELENGTHS, XYZ_TO_RGB, rgb_of
from renderer.scenes.pbrt.lexer import Place
from renderer.scenes.pbrt.parameters import Parameter
from renderer.scenes.pbrt.parser import Folder

Rgb = NDArray[np.float64]  # (3,)

LIGHT_SPEED, PLANCK, BOLTZMANN = 299792458.0, 6.62606957e-34, 1.3806488e-23
WIEN = 2.8977721e-3  # m·K: where a black body is brightest
SPD_MAX = 2**20  # bytes of a spectrum file


def colour(parameter: Parameter, folder: Folder) -> Rgb:
    """The RGB of a colour parameter. Raises ``SceneError`` with file and line."""
    if parameter.kind == "rgb":
        return parameter.numbers[:3].copy()
    if parameter.kind == "xyz":
        return np.asarray(XYZ_TO_RGB @ parameter.numbers[:3])
    if parameter.kind == "blackbody":
        return blackbody(float(parameter.numbers[0]), float(parameter.numbers[1]), parameter.place)
    if isinstance(parameter.values, list):
        return _file(parameter.values[0], parameter.place, folder)
    return sampled(parameter.numbers, parameter.place)


def sampled(numbers: NDArray[np.float64], place: Place) -> Rgb:
    """The RGB of pairs (nm, value), in any order."""
    if len(numbers) < 2 or len(numbers) % 2:
        raise SceneError(f"{place}: a spectrum of {len(numbers)} numbers; give pairs of a wavelength in nm and a value")
    pairs = numbers.reshape(-1, 2)
    pairs = pairs[np.argsort(pairs[:, 0], kind="stable")]
    return rgb_of(np.interp(WAVELENGTHS, pairs[:, 0], pairs[:, 1]))


def blackbody(kelvin: float, scale: float, place: Place) -> Rgb:
    """Planck's law, divided by its own maximum, times ``scale``."""
    if kelvin <= 0:
        raise SceneError(f"{place}: a black body of {kelvin:g} K; give a temperature above 0")
    peak = _planck(np.array([WIEN / kelvin]), kelvin)[0]
    return rgb_of(_planck(WAVELENGTHS * 1e-9, kelvin) / peak) * scale if peak > 0 else np.zeros(3)


def _planck(metres: NDArray[np.float64], kelvin: float) -> NDArray[np.float64]:
    with np.errstate(over="ignore"):  # far in the blue of a cold body: 1/∞
        exponent = PLANCK * LIGHT_SPEED / (metres * BOLTZMANN * kelvin)
        return 2 * PLANCK * LIGHT_SPEED**2 / (metres**5 * np.expm1(exponent))


def _file(written: str, place: Place, folder: Folder) -> Rgb:
    """A .spd file: wavelength and value per line, # starts a comment."""
    path = folder.locate(written, place, "the spectrum file")
    if path.stat().st_size > SPD_MAX:
        raise SceneError(f"{place}: the spectrum file {shown(written)} is larger than {SPD_MAX >> 20} MiB")
    numbers: list[float] = []
    for number, line in enumerate(folder.text(path, written).decode("utf-8", "replace").splitlines(), 1):
        try:
            numbers += [float(word) for word in line.partition("#")[0].split()]
        except ValueError:
            raise SceneError(f"{Place(written, number)}: {shown(line.strip())} is no wavelength with a value") from None
    if not np.isfinite(numbers).all():
        raise SceneError(f"{place}: the spectrum file {shown(written)} holds an infinite value or NaN")
    return sampled(np.array(numbers), place)
