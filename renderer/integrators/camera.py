"""
The camera as bidirectional methods need it: where a point of the scene falls on the film, and how densely its rays go.

Perspective, thin-lens and orthographic sensors are one model here, read off the sensor's own rays, so that field of
view, principal point and crop window mean what they mean to Mitsuba. Its ``sample_direction`` is not used: orthographic
sensors have none, and for a lens it cannot say how likely a ray was that is there already.

All densities are those of one camera sample a lane, spread evenly over the *window* that is rendered.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import drjit as dr
import mitsuba as mi

from renderer.errors import SceneError

PERSPECTIVE, THINLENS, ORTHOGRAPHIC = "PerspectiveCamera", "ThinLensCamera", "OrthographicCamera"
CENTRE = (0.5, 0.5)  # of the lens, in the square that is mapped to it
RIM = (1.0, 0.5)  # a point on its edge


@dataclass
class Connection:
    """
    A way from a point of the scene to the camera.

    active     it falls on the window, in front of the camera and within its clipping planes
    direction  unit vector from the point to the camera
    target     where the ray to the camera ends: on the near clipping plane
    position   on the film, in pixels, as ``Frame.camera_rays`` has it
    density    of camera samples at the point, for an area seen head-on: 1 / (area); both the value and its MIS weight
    """

    active: Any
    direction: Any
    target: Any
    position: Any
    density: Any


class Camera:
    """
    ``sensor`` as loaded; ``offset`` is the corner of the window on the film and ``size`` its size, in pixels.

    Raises ``SceneError`` for sensors that are none of the three kinds.
    """

    __slots__ = ("distance", "far", "forward", "kind", "near", "offset", "origin", "per_area", "radius", "right",
                 "size", "to_film", "up")  # fmt: skip

    def __init__(self, sensor: Any, offset: tuple[int, int], size: tuple[int, int]):
        self.kind = sensor.class_name()
        if self.kind not in (PERSPECTIVE, THINLENS, ORTHOGRAPHIC):
            raise SceneError(
                f"bdpt connects light paths to perspective, thinlens and orthographic sensors; this scene has a "
                f"{self.kind}: use path, which follows any sensor"
            )
        self.offset, self.size = mi.Vector2f(*offset), mi.Vector2f(*size)
        world = sensor.world_transform()
        self.origin = world @ mi.Point3f(0)
        self.right, self.up, self.forward = (
            dr.normalize(world @ mi.Vector3f(*axis)) for axis in ((1, 0, 0), (0, 1, 0), (0, 0, 1))
        )
        self.near, self.far = mi.Float(sensor.near_clip()), mi.Float(sensor.far_clip())
        lens = self.kind == THINLENS
        self.distance = mi.Float(sensor.focus_distance() if lens else 1)
        corner, right, down = (self._plane(sensor, mi.Point2f(*uv)) for uv in ((0, 0), (1, 0), (0, 1)))
        self.radius = self._radius(sensor) if lens else mi.Float(0)
        edges = mi.Matrix2f(right - corner, down - corner).T  # window coordinates → plane
        self.to_film = dr.rcp(dr.det(edges)), dr.rcp(edges), corner
        self.per_area = dr.abs(self.to_film[0])
        dr.make_opaque(self.offset, self.size, self.origin, self.right, self.up, self.forward, self.near, self.far,
                       self.distance, self.radius, self.to_film, self.per_area)  # fmt: skip

    # -- reading the sensor ------------------------------------------------------------------------------------

    def _local(self, vector: Any) -> Any:
        return mi.Vector3f(dr.dot(vector, self.right), dr.dot(vector, self.up), dr.dot(vector, self.forward))

    def _ray(self, sensor: Any, uv: Any, aperture: tuple[float, float]) -> Any:
        return sensor.sample_ray(mi.Float(0), mi.Float(0.5), uv, mi.Point2f(*aperture))[0]

    def _plane(self, sensor: Any, uv: Any) -> Any:
        """Where the window's point ``uv`` is on the plane at distance 1, or across an orthographic camera."""
        ray = self._ray(sensor, uv, CENTRE)
        local = self._local(ray.o - self.origin if self.kind == ORTHOGRAPHIC else ray.d)
        return mi.Point2f(local.x, local.y) if self.kind == ORTHOGRAPHIC else mi.Point2f(local.x, local.y) / local.z

    def _radius(self, sensor: Any) -> Any:
        ray = self._ray(sensor, mi.Point2f(0.5), RIM)
        local = self._local(ray.o - self.origin)
        slope = self._local(ray.d)
        return dr.norm(mi.Point2f(local.x, local.y) - mi.Point2f(slope.x, slope.y) * (local.z / slope.z))

    # -- what an integrator asks ---------------------------------------------------------------------------------

    @property
    def parallel(self) -> bool:
        """Whether all rays go one way, so that nothing thins out with distance."""
        return self.kind == ORTHOGRAPHIC

    @property
    def has_lens(self) -> bool:
        """Whether ``connect`` uses its random numbers."""
        return self.kind == THINLENS

    def start(self, ray: Any) -> tuple[Any, Any]:
        """
        Where a ray of this camera comes from, and its density given that point.

        The point on the lens with a density of solid angle; of parallel rays the point on the film with one of area.
        """
        if self.parallel:
            return ray.o, self.per_area
        cos = dr.dot(ray.d, self.forward)
        return ray.o - ray.d * (self.near / cos), self._of_directions(cos)  # the ray starts on the clipping plane

    def _of_directions(self, cos: Any) -> Any:
        """From the even density on the plane at distance 1: 1/cos³ makes it one of solid angle."""
        return self.per_area / (cos * dr.square(cos))

    def connect(self, p: Any, sample: Any, active: Any) -> Connection:
        """From ``p`` to the camera; ``sample`` picks a point of the lens, with the density that camera rays have."""
        at = self._local(p - self.origin)
        if self.parallel:
            on_plane = mi.Point2f(at.x, at.y)
            toward, density = -self.forward, self.per_area
            target = p - self.forward * (at.z - self.near)
        else:
            disk = self.radius * mi.warp.square_to_uniform_disk_concentric(sample) if self.has_lens else mi.Point2f(0)
            to_point = at - mi.Vector3f(disk.x, disk.y, 0)
            squared = dr.squared_norm(to_point)
            cos = to_point.z * dr.rsqrt(squared)
            in_focus = disk + mi.Point2f(to_point.x, to_point.y) * (self.distance / to_point.z)
            on_plane = in_focus / self.distance
            toward = -(to_point.x * self.right + to_point.y * self.up + to_point.z * self.forward) * dr.rsqrt(squared)
            density = self._of_directions(cos) / squared
            target = p + toward * (dr.sqrt(squared) - self.near / cos)
        active = active & (at.z > self.near) & (at.z < self.far)
        _, to_window, corner = self.to_film
        uv = to_window @ mi.Vector2f(on_plane - corner)
        active = active & (uv.x >= 0) & (uv.x < 1) & (uv.y >= 0) & (uv.y < 1)
        position = mi.Point2f(uv * self.size + self.offset)
        return Connection(active, toward, target, position, dr.select(active, density, 0))
