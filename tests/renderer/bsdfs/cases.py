"""Settings and directions for the tests of ``anisophong``, and the plugin called on many of them at once."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from renderer.bsdfs.formula import AnisoPhong

Array = NDArray[np.float64]
REFERENCE: dict[str, Any] = json.loads((Path(__file__).parent / "as_reference.json").read_text())
ROWS: list[dict[str, Any]] = REFERENCE["rows"]
LIT = [row for row in ROWS if row["f"]]


def model(row: dict[str, Any]) -> AnisoPhong:
    """The float64 model of a row of the table."""
    return AnisoPhong(row["Rd"], row["Rs"], row["nu"], row["nv"])


def single(numbers: Array) -> Array:
    """Numbers as float32 holds them, so that both sides of a comparison get the same."""
    return numbers.astype(np.float32).astype(np.float64)


def direction(theta: Any, phi: Any) -> Array:
    """Unit vectors from angles in radians."""
    theta, phi = np.broadcast_arrays(theta, phi)
    return np.stack([np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)], axis=-1)


def random_settings(count: int, seed: int) -> tuple[AnisoPhong, Array, Array]:
    """
    Settings and pairs of directions from everywhere: exponents 0 … 10 000, half of the wo inside the lobe, a quarter of
    the wi within a degree of the horizon, a tenth of all pairs mirrored or retroreflecting exactly.
    """
    random = np.random.default_rng(seed)

    def exponents() -> Array:
        values = 10 ** random.uniform(-2, 4, count)
        values[random.random(count) < 0.1] = 0
        values[random.random(count) < 0.1] = 10_000
        return values

    rd, rs = random.random((2, count))
    rs[random.random(count) < 0.1] = 0
    rs[random.random(count) < 0.1] = 1
    material = AnisoPhong(single(rd), single(rs), single(exponents()), single(exponents()))
    theta = np.arccos(random.random(count))
    grazing = random.random(count) < 0.25
    theta[grazing] = np.radians(random.uniform(89, 89.99, grazing.sum()))
    wi = direction(theta, random.uniform(0, 2 * np.pi, count))
    wo = direction(np.arccos(random.random(count)), random.uniform(0, 2 * np.pi, count))
    h = material.sample_half(random.random(count), random.random(count))
    lobe = 2 * (wi * h).sum(-1, keepdims=True) * h - wi
    inside = (random.random(count) < 0.5) & (lobe[:, 2] > 1e-4)
    wo[inside] = lobe[inside]
    special = random.random(count)
    wo[special < 0.05] = wi[special < 0.05]
    wo[special > 0.95] = wi[special > 0.95] * [-1, -1, 1]
    return material, single(wi), single(wo)


class PerLane:
    """Stands in for a texture: its own value at every lane."""

    def __init__(self, values: Any):
        self.values = values

    def eval(self, si: Any, active: Any = True) -> Any:
        import mitsuba as mi

        return mi.Color3f(mi.Float(np.asarray(self.values, np.float32)))

    def eval_1(self, si: Any, active: Any = True) -> Any:
        import mitsuba as mi

        return mi.Float(np.asarray(self.values, np.float32))


def plugin(material: AnisoPhong = AnisoPhong(), **more: Any) -> Any:  # noqa: B008 - frozen
    """The plugin with the parameters of ``material``, which may be arrays: one value a lane."""
    import mitsuba as mi

    values = {"rd": material.rd, "rs": material.rs, "nu": material.nu, "nv": material.nv}
    numbers = {name: value for name, value in values.items() if np.ndim(value) == 0}
    made: Any = mi.load_dict({"type": "anisophong", "normalization": material.normalization, **numbers, **more})
    for name, value in values.items():
        if np.ndim(value):
            setattr(made, name, PerLane(value))
    return made


def facing(wi: Any) -> Any:
    """Surface interactions that are seen from ``wi``, (N, 3) or (3,)."""
    import drjit as dr
    import mitsuba as mi

    wi = np.atleast_2d(wi)
    si: Any = dr.zeros(mi.SurfaceInteraction3f, len(wi))
    si.wi = vectors(wi)
    return si


def vectors(directions: Any) -> Any:
    import mitsuba as mi

    return mi.Vector3f(np.atleast_2d(directions).T.astype(np.float32))


def context(component: int | None = None, mask: int = 511) -> Any:
    import mitsuba as mi

    if component is None:
        return mi.BSDFContext(mi.TransportMode.Radiance, mask)
    return mi.BSDFContext(mi.TransportMode.Radiance, mask, component)


def red(value: Any) -> Array:
    """The first channel of a spectrum, or a number, as float64."""
    import mitsuba as mi

    return np.array(value if isinstance(value, mi.Float) else value[0], np.float64)


def drawn(bsdf: Any, wi: Any, count: int, seed: int, ctx: Any = None) -> tuple[Any, Any, Any]:
    """``count`` samples for one wi: the interactions, the samples, their weights."""
    import mitsuba as mi

    random = np.random.default_rng(seed)
    numbers = random.random((3, count)).astype(np.float32).clip(0, np.float32(1 - 2**-24))
    si = facing(np.tile(wi, (count, 1)))
    bs, weight = bsdf.sample(ctx or context(), si, mi.Float(numbers[0]), mi.Point2f(numbers[1], numbers[2]))
    return si, bs, weight
