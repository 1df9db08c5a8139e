"""
What a pbrt file says about its rendering, as the XML from which a cell takes its defaults: Film, Sampler and Integrator
(PixelFilter: filters.py). Names that the catalog does not offer are replaced, and reported.

Source: pbrt-v3, src/core/film.cpp, src/samplers, src/integrators (defaults); a student report's Poisson-disk
samplers, whose parameters are numPoints and minDist.
"""

from __future__ import annotations

import math

from renderer import catalog
from renderer.errors import DartboardError, SceneError, shown
from renderer.scenes.pbrt import filters, xml
from renderer.scenes.pbrt.parameters import Floats, Parameters
from renderer.scenes.pbrt.report import Report
from renderer.scenes.pbrt.xml import Xml
from renderer.spec import Scalar

SAMPLERS = {
    "random": "independent", "stratified": "stratified", "halton": "halton", "sobol": "sobol", "02sequence": "sobol",
    "zerotwosequence": "sobol", "lowdiscrepancy": "sobol", "maxmindist": "pmj02bn", "poissondisk": "poissondisk",
    "relaxedpoissondisk": "relaxedpoissondisk",
}  # fmt: skip
INTEGRATORS = {"path": "path", "volpath": "path", "bdpt": "bdpt", "directlighting": "direct", "direct": "direct",
               "whitted": "direct"}  # fmt: skip
STRATEGIES = {"path": "spatial", "volpath": "spatial", "bdpt": "power"}  # how pbrt picks lamps unless it is told
SIDE_MAX = 65535  # pixels; what OpenEXR pictures are made for


def film_size(given: Parameters | None) -> tuple[int, int]:
    """Width and height in pixels. Raises ``SceneError`` for a side that is no size."""
    if given is None:
        return 1280, 720
    size = given.integer("xresolution", 1280), given.integer("yresolution", 720)
    if not all(0 < side <= SIDE_MAX for side in size):
        raise SceneError(f"{given.place}: a film of {size[0]} × {size[1]} pixels; give sides from 1 to {SIDE_MAX}")
    return size


def film(given: Parameters | None, rfilter: tuple[str, Parameters] | None, report: Report) -> Xml:
    """The film: its size, crop window and filter. Raises ``SceneError`` for a window without a pixel."""
    width, height = film_size(given)
    parts = [xml.value("integer", "width", width), xml.value("integer", "height", height)]
    if given is not None:
        given.ignore("filename", "diagonal")
        if given.number("scale", 1) != 1:
            report.note(given.place, "the film's scale is left out: pictures are radiance")
        window = given.array("cropwindow", 4, "float")
        if window is not None:
            (x, wide), (y, high) = _pixels(window[0, :2], width), _pixels(window[0, 2:], height)
            if not wide or not high:
                raise SceneError(
                    f"{given.place}: the cropwindow holds no pixel; give x0 x1 y0 y1, fractions of the film from 0 to 1"
                )
            if (x, y, wide, high) != (0, 0, width, height):
                crop = {"crop_offset_x": x, "crop_offset_y": y, "crop_width": wide, "crop_height": high}
                parts += [xml.value("integer", name, pixels) for name, pixels in crop.items()]
    drawn = filters.rfilter(*rfilter, report) if rfilter else xml.plugin("rfilter", "box")
    return xml.plugin("film", "hdrfilm", *parts, drawn)


def _pixels(window: Floats, side: int) -> tuple[int, int]:
    """The first pixel and the number of pixels between two fractions of a side, rounded as pbrt does."""
    start, end = (math.ceil(fraction * side) for fraction in sorted(window.clip(0, 1).tolist()))
    return start, end - start


def sampler(kind: str, given: Parameters, report: Report) -> Xml:
    """The sampler with its samples per pixel. An invalid minDist warns and gives way to the default."""
    name = SAMPLERS.get(kind)
    values: dict[str, Scalar] = {}
    if name is None:
        report.note(given.place, f"the sampler {shown(kind)} is unknown; independent is used")
        name = "independent"
    if kind == "stratified":
        spp = given.integer("xsamples", 4) * given.integer("ysamples", 4)
        if not given.flag("jitter", True):
            values["jitter"] = False
        given.ignore("dimensions")
    elif name in ("poissondisk", "relaxedpoissondisk"):
        spp = given.integer("numPoints", given.integer("pixelsamples", 16))
        if "minDist" in given:
            values["min_dist"] = given.number("minDist", 0)
        given.ignore("dimensions")
    else:
        spp = given.integer("pixelsamples", 4 if kind == "random" else 16)
        given.ignore("dimensions", "samplepixelcenter")
    if spp < 1:
        raise SceneError(f"{given.place}: {spp} samples per pixel; give at least 1")
    if kind in ("02sequence", "zerotwosequence", "lowdiscrepancy", "maxmindist"):
        report.note(given.place, f"the sampler {kind} is {name} here, a set of the same quality")
    try:
        catalog.rendered_spp(catalog.resolve("sampler", {"type": name, **values}), spp)
    except DartboardError as error:
        if "min_dist" not in values:
            raise SceneError(f"{given.place}: {error}") from None
        report.note(given.place, f"minDist is left out, and the default taken: {error}")
        del values["min_dist"]
    parts = [xml.value("integer", "sample_count", spp)]
    parts += [xml.value("boolean" if isinstance(value, bool) else "float", key, value) for key, value in values.items()]
    return xml.plugin("sampler", name, *parts)


def integrator(kind: str, given: Parameters, report: Report, *, lamps: int) -> Xml:
    """
    The integrator. pbrt's maxdepth counts scattering events, Mitsuba's max_depth edges: one more.

    lamps  in the scene: with one there is nothing to pick, so a file that names no light sampling strategy gets none
    """
    name = INTEGRATORS.get(kind, "")
    if name not in catalog.entries("integrator"):
        report.note(given.place, f"the integrator {shown(kind)} is not offered; path is used")
        name = "path"
    elif kind in ("volpath", "whitted"):
        report.note(given.place, f"the integrator {kind} is {name} here")
    depth = given.integer("maxdepth", 5)
    if depth < 0 or depth >= catalog.MAX_DEPTH:
        raise SceneError(f"{given.place}: maxdepth = {depth}; give 0 to {catalog.MAX_DEPTH - 1}")
    if "rrthreshold" in given:
        report.note(given.place, "rrthreshold is left out: Russian roulette changes the noise, not the picture")
    picking = _light_sampler(name, given, STRATEGIES.get(kind, "") if lamps > 1 else "", report)
    if "pixelbounds" in given:
        report.note(given.place, "pixelbounds are left out: a grid crops pictures")
    given.ignore("rrthreshold", "strategy", "regularize", "pixelbounds", "visualizestrategies", "visualizeweights",
                 "lightsamplestrategy")  # fmt: skip
    parts = [] if name == "direct" else [xml.value("integer", "max_depth", depth + 1)]
    return xml.plugin("integrator", name, *parts, picking)


def _light_sampler(name: str, given: Parameters, default: str, report: Report) -> Xml | None:
    """How lamps are picked, if the catalog's integrator of that name can be told so; the noise hangs on it, no more."""
    strategy = given.text("lightsamplestrategy", default)
    known = {parameter.name: parameter for parameter in catalog.find("integrator", name).parameters}
    offered = known["light_sampler"].options if "light_sampler" in known else ()
    if strategy in offered:
        return xml.value("string", "light_sampler", strategy)
    if "lightsamplestrategy" in given:
        report.note(
            given.place, f"the light sample strategy {shown(strategy)} is left out: the noise changes, not the picture"
        )
    return None
