"""
pbrt's cameras as Mitsuba's sensors.

pbrt's camera space is left-handed (x right, y up, z ahead), and in Mitsuba's x points left: so the camera is mirrored,
and pictures are not left-right swapped. The field of view is along the shorter side in both.
Source: pbrt-v3, src/cameras.
"""

from __future__ import annotations

import math

import numpy as np

from renderer.errors import SceneError, shown
from renderer.scenes.pbrt import transforms, xml
from renderer.scenes.pbrt.parameters import Parameters
from renderer.scenes.pbrt.report import Report
from renderer.scenes.pbrt.transforms import Matrix
from renderer.scenes.pbrt.xml import Xml

MIRROR: Matrix = np.diag([-1.0, 1, 1, 1])
NEAR = 1e-2
FAR = 1e7  # rays end there in Mitsuba; pbrt's do not end
SUPPORTED = "there are perspective and orthographic"


def sensor(
    kind: str, given: Parameters, world_to_camera: Matrix, size: tuple[int, int], report: Report, parts: list[Xml]
) -> Xml:
    """
    The sensor. ``size``: of the film in pixels; ``parts``: its film and sampler.

    Raises ``SceneError`` for a camera that Mitsuba cannot have: another kind, or pixels that are not square.
    """
    if kind not in ("perspective", "orthographic"):
        raise SceneError(f"{given.place}: the camera {shown(kind)} is not supported; {SUPPORTED}")
    to_world: Matrix = np.asarray(np.linalg.inv(world_to_camera), np.float64)
    scale = transforms.similarity(to_world)
    if scale is None:
        raise SceneError(
            f"{given.place}: the transform of the camera stretches the picture; scale it evenly, or mirror it, only"
        )
    to_world = to_world @ MIRROR
    to_world[:3, :3] /= scale
    given.ignore("shutteropen", "shutterclose")
    half, offset = _window(given, size)
    clips = [xml.value("float", "near_clip", NEAR * scale), xml.value("float", "far_clip", FAR * scale)]
    radius = given.number("lensradius", 0)
    focus = given.number("focaldistance", 1e6)
    if kind == "orthographic":
        if radius or any(offset):
            report.note(given.place, "an orthographic camera has no lens and no shifted window here; both are left out")
        wide = half * max(size[0] / size[1], 1) * scale  # Mitsuba's film is 2 wide
        local = to_world @ np.diag([wide, wide, 1, 1])
        return xml.plugin("sensor", "orthographic", xml.transform("to_world", local), *clips, *parts)
    fov = given.number("fov", 90)
    if "halffov" in given:
        fov = 2 * given.number("halffov", 45)
    if not 0 < fov < 180:
        raise SceneError(f"{given.place}: fov = {fov:g} of the camera; give degrees between 0 and 180")
    fov = 2 * math.degrees(math.atan(math.tan(math.radians(fov / 2)) * half))
    moved = {f"principal_point_offset_{axis}": shift for axis, shift in zip("xy", offset, strict=True) if shift}
    shifts = [xml.value("float", key, shift) for key, shift in moved.items()]
    lens = [] if radius <= 0 else [xml.value("float", "aperture_radius", radius * scale),
                                   xml.value("float", "focus_distance", focus * scale)]  # fmt: skip
    if lens and shifts:
        report.note(given.place, "a shifted screen window goes with no lens here; the lens is left out")
        lens = []
    return xml.plugin(
        "sensor", "thinlens" if lens else "perspective", xml.value("string", "fov_axis", "smaller"),
        xml.value("float", "fov", fov), *lens, *shifts, *clips, xml.transform("to_world", to_world), *parts,
    )  # fmt: skip


def _window(given: Parameters, size: tuple[int, int]) -> tuple[float, tuple[float, float]]:
    """
    The screen window: half its shorter side, in units where 1 is what ``fov`` spans, and how far its centre is off, as
    Mitsuba's fractions of the film.
    """
    window = given.array("screenwindow", 4, "float")
    aspect = given.number("frameaspectratio", size[0] / size[1], positive=True)
    if window is not None:
        x0, x1, y0, y1 = window[0].tolist()
    else:
        x1, y1 = max(aspect, 1), max(1 / aspect, 1)
        x0, y0 = -x1, -y1
    wide, high = x1 - x0, y1 - y0
    if wide <= 0 or high <= 0:
        raise SceneError(f"{given.place}: screenwindow of the camera is x0 x1 y0 y1, with x0 < x1 and y0 < y1")
    if abs(wide / high * size[1] / size[0] - 1) > 0.01:
        raise SceneError(
            f"{given.place}: the camera's window is {wide:g} × {high:g} and the film {size[0]} × {size[1]}: pixels "
            "that are not square are not supported; give both the same proportions"
        )
    return min(wide, high) / 2, ((x0 + x1) / 2 / wide, -(y0 + y1) / 2 / high)
