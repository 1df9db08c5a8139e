"""
The BSDFs that people may name, with their parameters: what ``dartboard bsdf`` reads. No Mitsuba here.

Scenes give spectra and textures; on a command line a reflectance is a number, or red, green and blue with spaces
between them, as in Mitsuba's ``<rgb value="0.8 0.5 0.3"/>``.
"""

from __future__ import annotations

from dataclasses import replace

from renderer.catalog_types import Entry, Parameter
from renderer.errors import BadParameter, DartboardError, UnknownName, shown
from renderer.spec import Scalar

REFLECTANCES = ("rd", "rs")

PARAMETERS = (
    Parameter("rd", float, 0.5, "diffuse reflectance; above 1 energy may be gained", "", 0),
    Parameter("rs", float, 0.5, "specular reflectance at normal incidence", "", 0, 1),
    Parameter("nu", float, 100.0, "exponent along the tangent u = dp/du", "", 0),
    Parameter("nv", float, 100.0, "exponent along v", "", 0),
    Parameter("importance_sampling", bool, True, "directions are drawn from the lobe; false: by the cosine alone"),
    Parameter(
        "normalization", str, "as2000", "the glossy term's factor",
        options=("as2000", "pbrt"), meanings=("the paper's, (nu + 1)(nv + 1)", "pbrt's, (nu + 2)(nv + 2)"),
    ),
)  # fmt: skip

BSDFS = {
    "anisophong": Entry(
        "bsdf", "anisophong", "anisotropic Phong reflection over a diffuse base (Ashikhmin and Shirley 2000)",
        "Dartboard", "anisophong", parameters=PARAMETERS,
    )
}  # fmt: skip

Reflectance = tuple[float, float, float]


def read(text: str, where: str = "BSDF") -> tuple[str, dict[str, Scalar | Reflectance]]:
    """
    ``NAME:key=value,key=value`` → the BSDF's name and every parameter, defaults included.

    Raises ``UnknownName`` for a BSDF or parameter that is not known, ``BadParameter`` for a value out of range.
    """
    name, _, rest = text.partition(":")
    name = name.strip()
    if name not in BSDFS:
        raise UnknownName("bsdf", name, where, BSDFS)
    known = {parameter.name: parameter for parameter in BSDFS[name].parameters}
    values: dict[str, Scalar | Reflectance] = {
        key: parameter.default for key, parameter in known.items() if parameter.default is not None
    }
    for part in rest.split(",") if rest else []:
        key, sign, value = (piece.strip() for piece in part.partition("="))
        if not key or not sign:
            raise DartboardError(f"cannot read {shown(text)} in {where}; write NAME or NAME:key=value,key=value")
        if key not in known:
            raise UnknownName(f"parameter of bsdf {name!r}:", key, where, known)
        place = f"bsdf {name!r} in {where}"
        channels = value.split()
        if key in REFLECTANCES and len(channels) > 1:
            values[key] = _colour(known[key], channels, place)
        else:
            values[key] = known[key].read(value, place)
    return name, values


def _colour(parameter: Parameter, channels: list[str], place: str) -> Reflectance:
    if len(channels) != 3:
        raise BadParameter(
            f"{parameter.name} = {shown(' '.join(channels))} of {place} is not allowed; it is a number, or red, green "
            "and blue with spaces between"
        )
    within = replace(parameter, maximum=1)  # Mitsuba refuses colours above 1
    red, green, blue = (float(within.read(channel, place)) for channel in channels)
    return red, green, blue
