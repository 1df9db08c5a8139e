"""
pbrt's pixel filters as Mitsuba's.

Widths are radii in pixels in both. Mitsuba's filters are as high as they are wide, and the radius of some follows from
their other parameters; what cannot be matched is said by line. Source: pbrt-v3, src/filters; for equal parameters the
functions are the same: exp(−αx²) − exp(−αr²) with α = 1/(2σ²), 1 − |x|/r, the cubic of Mitchell and Netravali
stretched to radius 2, and sinc(x) · sinc(x/τ).
"""

from __future__ import annotations

import math

from renderer import catalog
from renderer.errors import DartboardError, shown
from renderer.scenes.pbrt import xml
from renderer.scenes.pbrt.parameters import Parameters
from renderer.scenes.pbrt.report import Report
from renderer.scenes.pbrt.xml import Xml
from renderer.spec import Scalar

RADII = {"box": 0.5, "triangle": 2.0, "gaussian": 2.0, "mitchell": 2.0, "sinc": 4.0}  # pbrt's defaults
SAME = 1e-3  # pixels: a smaller difference of two radii is none


def rfilter(kind: str, given: Parameters, report: Report) -> Xml:
    """The filter of a ``PixelFilter``. Raises ``SceneError`` for a width, alpha or tau that is not > 0."""
    if kind not in RADII:
        report.note(given.place, f"the pixel filter {shown(kind)} is unknown; box is used")
        given.ignore(*given.items)
        return xml.plugin("rfilter", "box")
    default = RADII[kind]
    wide, high = (given.number(name, default, positive=True) for name in ("xwidth", "ywidth"))
    name, values, radius = _matched(kind, given, wide, report)
    try:
        catalog.resolve("rfilter", {"type": name, **values})
    except DartboardError as error:
        report.note(given.place, f"the pixel filter {kind} is left out, and box used: {error}")
        return xml.plugin("rfilter", "box")
    if abs(wide - high) > SAME:
        report.note(given.place, f"the pixel filter {kind} is as high as wide here: ywidth = {high:g} is left out")
    if abs(wide - radius) > SAME:
        report.note(given.place, f"the pixel filter {kind} ends {radius:g} pixels from its centre here, not {wide:g}")
    tags = {int: "integer", float: "float"}
    return xml.plugin("rfilter", name, *(xml.value(tags[type(value)], key, value) for key, value in values.items()))


def _matched(kind: str, given: Parameters, wide: float, report: Report) -> tuple[str, dict[str, Scalar], float]:
    """Mitsuba's name of a filter, its parameters, and the radius that it has with them."""
    match kind:
        case "triangle":
            return "tent", {"radius": wide}, wide
        case "gaussian":
            deviation = math.sqrt(0.5 / given.number("alpha", 2, positive=True))
            return "gaussian", {"stddev": deviation}, 4 * deviation
        case "mitchell":
            return "mitchell", {"B": given.number("B", 1 / 3), "C": given.number("C", 1 / 3)}, 2
        case "sinc":
            tau = given.number("tau", 3, positive=True)
            lobes = max(1, round(tau))
            if abs(tau - lobes) > SAME:
                report.note(given.place, f"the pixel filter sinc has tau = {lobes} here, not {tau:g}")
            return "lanczos", {"lobes": lobes}, lobes
    return "box", {}, 0.5
