"""
The weights of all ways to make a path sum to one, and each is its density over the sum of all.

Paths are made of random densities, cosines and distances; weights come from the numbers that are carried along both
subpaths, as ``bdpt`` does it, and are compared with the densities written out in full.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

pytestmark = pytest.mark.usefixtures("variant")

COUNT = 500


class Path:
    """
    Random paths of ``edges`` edges: vertex 0 is on the lamp, ``edges`` is the camera.

    to_camera[i], to_lamp[i]  density of solid angle at vertex i of going on that way
    towards_camera[i], towards_lamp[i]  cosines at vertex i
    """

    def __init__(self, edges: int, mirror: int | None, lamp: str, seed: int):
        rng = np.random.default_rng(seed)
        self.edges, self.mirror, self.lamp = edges, mirror, lamp

        def numbers(low: float = 0.2, high: float = 3.0) -> Any:
            return rng.uniform(low, high, (edges + 1, COUNT))

        self.to_camera, self.to_lamp = numbers(), numbers()
        self.towards_camera, self.towards_lamp = numbers(0.1, 1), numbers(0.1, 1)
        self.squared = numbers(0.5, 4)  # of the edge from vertex i to i + 1
        self.emission, self.direct, self.film = numbers()[0], numbers()[0], numbers()[0]
        if mirror is not None:
            self.to_lamp[mirror] = self.to_camera[mirror]  # of a Dirac lobe: the probability to pick it
        if lamp != "area":
            self.towards_camera[0] = 1

    def densities(self) -> Any:
        """(edges + 1, COUNT): of making the path with s vertices from the lamp, but for a common factor."""
        n = self.edges
        from_lamp = [np.ones(COUNT)]  # of vertex i by the lamp's subpath, with those before
        for i in range(1, n):
            density = self.emission if i == 1 else self.to_camera[i - 1]
            from_lamp.append(from_lamp[-1] * density * self.towards_lamp[i] / self.squared[i - 1])
        from_camera = [np.ones(COUNT)]  # of vertex n - i by the camera's subpath, with those nearer to it
        for i in range(n - 1, 0, -1):
            density = self.film if i == n - 1 else self.to_lamp[i + 1]
            from_camera.append(from_camera[-1] * density * self.towards_camera[i] / self.squared[i])
        found = np.zeros((n + 1, COUNT))
        hit = self.to_lamp[1] * self.towards_camera[0] / self.squared[0] if n > 1 else np.zeros(COUNT)
        found[0] = from_camera[n - 1] * hit * (self.lamp == "area")
        found[1] = from_camera[n - 1] * self.direct * self.towards_camera[0] / self.squared[0]
        for s in range(2, n + 1):
            found[s] = from_lamp[s - 1] * from_camera[n - s]
        return self.without_joints(found)

    def weights(self, heuristic: str) -> Any:
        """The same as weights, from what the subpaths carry."""
        import drjit as dr
        import mitsuba as mi

        from renderer.integrators.mis import Heuristic, weight

        h = Heuristic(heuristic)
        n = self.edges

        def f(values: Any) -> Any:
            return mi.Float(np.ascontiguousarray(values, np.float32))

        lamp = []  # (vcm, vc) on arrival at vertex 1, 2, …
        delta = mi.Bool(self.lamp != "area")
        carried = h.leave_lamp(f(self.direct), f(self.towards_camera[0]), f(self.emission), f(self.squared[0]), delta)
        for i in range(1, n):
            carried = h.arrive(*carried, f(self.squared[i - 1]), f(self.towards_lamp[i]))
            lamp.append(carried)
            carried = h.scatter(*carried, f(self.to_camera[i]), f(self.to_lamp[i]), f(self.towards_camera[i]),
                                mi.Bool(self.mirror == i))  # fmt: skip
        camera = {}
        carried = h.leave_camera(f(self.film))
        for i in range(n - 1, 0, -1):
            carried = h.arrive(*carried, f(self.squared[i]), f(self.towards_camera[i]))
            camera[i] = carried
            carried = h.scatter(*carried, f(self.to_lamp[i]), f(self.to_camera[i]), f(self.towards_lamp[i]),
                                mi.Bool(self.mirror == i))  # fmt: skip
        vcm, vc = carried
        found = np.zeros((n + 1, COUNT))
        cos = f(self.towards_camera[0])
        if self.lamp == "area":
            found[0] = weight(h(f(self.direct)) * vcm + h(f(self.emission) / cos) * vc)
        rest = h.rest(*camera[1], f(self.to_camera[1]))
        hit = h(f(self.to_lamp[1]) / f(self.direct)) if self.lamp == "area" else mi.Float(0)
        found[1] = weight(hit + h(f(self.emission) * f(self.towards_lamp[1]) / (f(self.direct) * cos)) * rest)
        for s in range(2, n):
            mine, other = s - 1, s  # vertices that are joined
            reach = f(self.to_lamp[other] * self.towards_camera[mine] / self.squared[mine])
            back = f(self.to_camera[mine] * self.towards_lamp[other] / self.squared[mine])
            found[s] = weight(
                h(reach) * h.rest(*lamp[mine - 1], f(self.to_lamp[mine]))
                + h(back) * h.rest(*camera[other], f(self.to_camera[other]))
            )
        seen = f(self.film * self.towards_camera[n - 1] / self.squared[n - 1])
        found[n] = weight(h(seen) * h.rest(*lamp[n - 2], f(self.to_lamp[n - 1])))
        assert dr.all(dr.isfinite(vcm))
        return self.without_joints(found)

    def without_joints(self, found: Any) -> Any:
        """Nothing can be joined at a Dirac lobe."""
        for s in range(self.edges + 1):
            joined = {0: (), 1: (1,)}.get(s, (s - 1, s))
            if self.mirror in joined:
                found[s] = 0
        return found


@pytest.mark.parametrize("heuristic", ["balance", "power"])
@pytest.mark.parametrize("lamp", ["area", "point"])
@pytest.mark.parametrize(
    ("edges", "mirror"),
    [(edges, mirror) for edges in (2, 3, 4, 6, 9) for mirror in (None, 1, 2) if edges > (mirror or 0)],
)
def test_weights_are_densities_over_their_sum(edges: int, mirror: int | None, lamp: str, heuristic: str) -> None:
    path = Path(edges, mirror, lamp, seed=edges)
    densities = path.densities() ** (2 if heuristic == "power" else 1)
    weights = path.weights(heuristic)
    if densities.sum() == 0:  # a Dirac lamp behind a mirror, at two edges: no way at all
        assert not weights.any()
        return
    assert weights == pytest.approx(densities / densities.sum(0), abs=2e-5)
    assert weights.sum(0) == pytest.approx(1, abs=5e-5)


def test_what_outweighs_everything_weighs_nothing() -> None:
    import mitsuba as mi

    from renderer.integrators.mis import weight

    assert weight(mi.Float(float("inf")))[0] == 0
    assert weight(mi.Float(1e38) * 1e38, mi.Float(0) * (mi.Float(1e38) * 1e38))[0] == 0
