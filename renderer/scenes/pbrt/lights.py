"""
pbrt's light sources as Mitsuba's emitters: point, spot, distant, infinite, and the radiance of area lights.

Source: pbrt-v3, src/lights.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from renderer.errors import shown
from renderer.scenes.pbrt import spectra, transforms, xml
from renderer.scenes.pbrt.output import Output
from renderer.scenes.pbrt.parameters import SPECTRA, Parameters
from renderer.scenes.pbrt.parser import Folder
from renderer.scenes.pbrt.report import Report
from renderer.scenes.pbrt.transforms import Matrix
from renderer.scenes.pbrt.xml import Xml

# pbrt's map has z up and its azimuth from x to y; Mitsuba's y up, and its azimuth from −z to x. It mirrors.
ENVIRONMENT: Matrix = np.array([[0, 0, -1, 0], [1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 0, 1.0]])


@dataclass(frozen=True, eq=False)
class Lamp:
    """
    What makes shapes shine.

    radiance  linear RGB
    twosided  True: to both sides; False: to that of the normal
    """

    radiance: spectra.Rgb
    twosided: bool


class LightReader:
    """Makes emitters of ``LightSource`` and ``AreaLightSource``."""

    def __init__(self, folder: Folder, report: Report, output: Output):
        self.folder = folder
        self.report = report
        self.output = output

    def area(self, kind: str, given: Parameters) -> Lamp:
        """What an area light makes of shapes."""
        if kind not in ("diffuse", "area"):
            self.report.lacks(given.place, f"the area light {shown(kind)} is not supported; there is diffuse")
        given.ignore("samples", "nsamples")
        return Lamp(self._colour(given, "L", 1.0), given.flag("twosided", False))

    def source(self, kind: str, given: Parameters, to_world: Matrix) -> Xml | None:
        """The emitter of a ``LightSource``; None (and an error in the report) for a kind that we lack."""
        given.ignore("samples", "nsamples")
        match kind:
            case "point":
                place = transforms.points(to_world, given.vector("from", (0, 0, 0))[None])[0]
                return xml.plugin(
                    "emitter",
                    "point",
                    xml.point("position", place),
                    xml.rgb("intensity", self._colour(given, "I", 1.0)),
                )
            case "spot":
                return self._spot(given, to_world)
            case "distant":
                along = given.vector("to", (0, 0, 1)) - given.vector("from", (0, 0, 0))
                along = to_world[:3, :3] @ along
                if not along.any():
                    self.report.lacks(given.place, "a distant light from a point to itself has no direction")
                    return None
                return xml.plugin(
                    "emitter", "directional",
                    xml.point("direction", along / np.linalg.norm(along), "vector"),
                    xml.rgb("irradiance", self._colour(given, "L", 1.0)),
                )  # fmt: skip
            case "infinite" | "exinfinite":
                return self._infinite(given, to_world)
        self.report.lacks(
            given.place, f"the light {shown(kind)} is not supported; there are point, spot, distant and infinite"
        )
        given.ignore(*given.items)
        return None

    def _spot(self, given: Parameters, to_world: Matrix) -> Xml | None:
        ends = np.stack([given.vector("from", (0, 0, 0)), given.vector("to", (0, 0, 1))])
        start, end = transforms.points(to_world, ends)
        if np.allclose(start, end):
            self.report.lacks(given.place, "a spot light from a point to itself has no direction")
            return None
        cone = given.number("coneangle", 30)
        soft = given.number("conedelta", given.number("conedeltaangle", 5))
        self.report.note(
            given.place,
            "a spot light fades towards its rim linearly in the angle here, a little differently",
            once="rim",
        )
        placed = np.eye(4)
        placed[:3, :3], placed[:3, 3] = _frame(end - start), start
        return xml.plugin(
            "emitter", "spot", xml.transform("to_world", placed), xml.rgb("intensity", self._colour(given, "I", 1.0)),
            xml.value("float", "cutoff_angle", cone), xml.value("float", "beam_width", max(cone - soft, 1e-3)),
        )  # fmt: skip

    def _infinite(self, given: Parameters, to_world: Matrix) -> Xml:
        radiance = self._colour(given, "L", 1.0)
        name = given.text("mapname")
        if not name:
            return xml.plugin("emitter", "constant", xml.rgb("radiance", radiance))
        path = self.folder.locate(name, given.place, "the environment map")
        if not np.allclose(radiance, radiance[0]):
            self.report.note(given.place, "L of an environment map is drawn as its mean: the map is scaled, not tinted")
        if transforms.similarity(to_world) is None:
            self.report.note(given.place, "an environment map is turned only: the uneven scale is left out")
        turned = np.eye(4)
        u, _, v = np.linalg.svd(to_world[:3, :3])
        turned[:3, :3] = u @ v  # the nearest rotation, or mirrored rotation
        return xml.plugin(
            "emitter", "envmap", xml.value("string", "filename", self.output.picture(path, given.place)),
            xml.value("float", "scale", float(radiance.mean())), xml.transform("to_world", turned @ ENVIRONMENT),
        )  # fmt: skip

    def _colour(self, given: Parameters, name: str, default: float) -> spectra.Rgb:
        """A colour times "scale", which is a colour as well. Negative light is clamped: pbrt's films do so."""
        found, scale = given.get(name, *SPECTRA), given.get("scale", *SPECTRA, "float")
        value = np.full(3, default) if found is None else spectra.colour(found, self.folder)
        if scale is not None:
            value = value * (scale.numbers[0] if scale.kind == "float" else spectra.colour(scale, self.folder))
        if (value < 0).any():
            self.report.note(given.place, f"{name} of {given.owner} has a negative channel, which becomes 0")
        return np.maximum(value, 0)


def _frame(ahead: spectra.Rgb) -> Matrix:
    """A rotation whose z is ``ahead``."""
    z = ahead / np.linalg.norm(ahead)
    x = np.cross([1.0, 0, 0] if abs(z[0]) < 0.9 else [0, 1.0, 0], z)
    x /= np.linalg.norm(x)
    return np.stack([x, np.cross(z, x), z], axis=1)
