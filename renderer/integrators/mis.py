"""
How much a bidirectional sample counts: weights of multiple importance sampling that are carried along the subpaths.

A path with k edges can be made in k + 1 ways, by s vertices from a lamp and t from the camera. The weight of one of
them is its density over the sum of all, or the same with squares (balance and power heuristic). Each subpath carries
two numbers that are enough to know that sum at its end, whatever was before, so that no vertex is visited twice:

    vcm   1 / (density of the last vertex), times what the next connection multiplies it with
    vc    the sum, over all ways that end earlier on this subpath, of their density over that of the subpath

Densities of directions are per solid angle; they turn into densities of area by the geometric cosine, never by the one
of a shading normal. Where a lobe is a Dirac delta, its density cancels: nothing can be connected there, and both
numbers just pass on.

Source: Georgiev, "Implementing Vertex Connection and Merging" (2012), eqs. 31 to 45 without merging; van Antwerpen,
"Recursive MIS Computation for Streaming BDPT on the GPU" (2011). The notes' section C.2 lists every case.
"""

from __future__ import annotations

from typing import Any

import drjit as dr
import mitsuba as mi

HEURISTICS = ("balance", "power")


class Heuristic:
    """Applied to every ratio of densities: as it is, or squared."""

    __slots__ = ("squared",)

    def __init__(self, name: str):
        self.squared = name == "power"

    def __call__(self, ratio: Any) -> Any:
        return dr.square(ratio) if self.squared else ratio

    # -- along a subpath -------------------------------------------------------------------------------------------

    def leave_lamp(self, direct: Any, cos: Any, emission: Any, squared_distance: Any, delta: Any) -> tuple[Any, Any]:
        """
        (vcm, vc) on the way from a lamp to the first vertex, which the ray hits at ``squared_distance``.

        ``direct`` is the density of picking the lamp, and the point on it, from that vertex, ``emission`` that of
        having started there, ``cos`` the cosine at the lamp (1 where it has no area).
        """
        vcm = self(direct * cos / (emission * squared_distance))
        return vcm, dr.select(delta, 0, self(cos / emission))

    def leave_camera(self, density: Any) -> tuple[Any, Any]:
        """(vcm, vc) on the way from the camera, whose rays have this ``density``."""
        return self(dr.rcp(density)), mi.Float(0)

    def arrive(self, vcm: Any, vc: Any, squared_distance: Any, cos: Any) -> tuple[Any, Any]:
        """At a vertex: ``cos`` is that between the ray and the geometric normal."""
        inverse = self(dr.rcp(cos))
        return vcm * self(squared_distance) * inverse, vc * inverse

    def scatter(self, vcm: Any, vc: Any, forward: Any, reverse: Any, cos: Any, delta: Any) -> tuple[Any, Any]:
        """
        On from a vertex: ``forward`` is the density of the direction that was taken, ``reverse`` that of having come
        from there, ``cos`` the cosine at the vertex of the new direction, ``delta`` whether the lobe is a Dirac delta.
        """
        inverse = dr.rcp(forward)
        onward = self(cos * inverse) * (vc * self(reverse) + vcm)
        return dr.select(delta, 0, self(inverse)), dr.select(delta, vc * self(cos), onward)

    # -- at the ends -----------------------------------------------------------------------------------------------

    def rest(self, vcm: Any, vc: Any, reverse: Any) -> Any:
        """
        Of all ways that end earlier on a subpath, relative to its own: times what the other side multiplies it with.
        """
        return vcm + vc * self(reverse)


def weight(*others: Any) -> Any:
    """1 / (1 + the other ways); 0 where they outweigh this one beyond what a float holds."""
    total = mi.Float(1)
    for other in others:
        total = total + other
    return dr.select(dr.isfinite(total), dr.rcp(total), 0)
