"""
The anisotropic Phong model of Ashikhmin and Shirley (2000) in float64, to be read and to be compared with.

``anisophong.py`` computes the same in float32 on a device. No Mitsuba here.

Directions are float64 arrays (..., 3) in the local frame: n = (0, 0, 1), u = (1, 0, 0), v = (0, 1, 0). k1 points to the
viewer, k2 to the light, both away from the surface and of unit length. Parameters that are arrays go with the
directions by numpy's broadcasting. Equations: "An Anisotropic Phong BRDF Model", Journal of Graphics Tools 5(2).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
NODES = 100  # of the Gauss-Legendre quadrature for albedos, in u2 and in each quarter of u1


@dataclass(frozen=True)
class AnisoPhong:
    """
    rd, rs         diffuse and specular reflectance, 0 … 1; floats or arrays
    nu, nv         exponents along u and v, ≥ 0
    normalization  "as2000": the paper's; "pbrt": sqrt((nu+2)(nv+2)) instead of sqrt((nu+1)(nv+1)) in f_s
    """

    rd: Any = 0.5
    rs: Any = 0.5
    nu: Any = 100.0
    nv: Any = 100.0
    normalization: str = "as2000"

    def specular(self, k1: Any, k2: Any) -> Array:
        """f_s (eq. 4), per steradian; 0 where a direction is below the horizon."""
        k1, k2 = np.asarray(k1, np.float64), np.asarray(k2, np.float64)
        h, kh = half(k1, k2)
        highest = np.maximum(k1[..., 2], k2[..., 2])
        value = self.pdf_half(h) * self.fresnel(kh) / (4 * kh * np.where(highest > 0, highest, 1))
        if self.normalization == "pbrt":
            value = value * np.sqrt((self.nu + 2) * (self.nv + 2) / ((self.nu + 1) * (self.nv + 1)))
        return np.where(above(k1, k2), value, 0)

    def diffuse(self, k1: Any, k2: Any) -> Array:
        """f_d (eq. 5), per steradian; 0 where a direction is below the horizon."""
        k1, k2 = np.asarray(k1, np.float64), np.asarray(k2, np.float64)
        value = 28 * self.rd / (23 * np.pi) * (1 - self.rs) * base(k1[..., 2]) * base(k2[..., 2])
        return np.where(above(k1, k2), value, 0)

    def f(self, k1: Any, k2: Any) -> Array:
        """The whole BRDF, f_s + f_d, without the cosine."""
        return self.specular(k1, k2) + self.diffuse(k1, k2)

    def fresnel(self, c: Any) -> Array:
        """Schlick's F (eq. 3) for c = k·h."""
        return self.rs + (1 - self.rs) * (1 - c) ** 5

    def pdf_half(self, h: Array) -> Array:
        """Density of half vectors per steradian (eq. 6 normalised): its integral over the hemisphere is 1."""
        tangential = h[..., 0] ** 2 + h[..., 1] ** 2
        exponent = (self.nu * h[..., 0] ** 2 + self.nv * h[..., 1] ** 2) / np.where(tangential > 0, tangential, 1)
        low = tangential < 0.5  # log(n·h), from whichever of sin² and cos is small
        log = np.where(
            low,
            0.5 * np.log1p(-np.where(low, tangential, 0)),
            np.log(np.where(low | (h[..., 2] <= 0), 1, h[..., 2])),
        )
        return np.sqrt((self.nu + 1) * (self.nv + 1)) / (2 * np.pi) * np.exp(exponent * log)

    def pdf_specular(self, k1: Any, k2: Any) -> Array:
        """Density of k2 by half vectors (eq. 8); its integral is below 1 by what reflects below the horizon."""
        k1, k2 = np.asarray(k1, np.float64), np.asarray(k2, np.float64)
        h, kh = half(k1, k2)
        return np.where(above(k1, k2), self.pdf_half(h) / (4 * kh), 0)

    def pdf(self, k1: Any, k2: Any, p: Any = None) -> Array:
        """Density of k2 by the mixture that ``anisophong`` samples; ``p`` overrides the glossy lobe's probability."""
        k1, k2 = np.asarray(k1, np.float64), np.asarray(k2, np.float64)
        p = self.p(k1) if p is None else p
        return p * self.pdf_specular(k1, k2) + (1 - p) * np.where(above(k1, k2), k2[..., 2] / np.pi, 0)

    def p(self, k1: Any) -> Array:
        """Probability of the glossy lobe: Fresnel reflectance by all that is reflected, at least 0.1, at most 0.9."""
        mirror = self.fresnel(np.asarray(k1)[..., 2])
        return np.clip(mirror / np.maximum(mirror + self.albedo_diffuse(k1), 1e-30), 0.1, 0.9)

    def albedo_diffuse(self, k1: Any) -> Array:
        """The part of the light along k1 that the base reflects: Rd (1 − Rs) A(n·k1), exactly."""
        return self.rd * (1 - self.rs) * base(np.asarray(k1)[..., 2])

    def albedo_specular(self, k1: Any, nodes: int = NODES) -> Array:
        """
        The part of the light along one k1, (3,), that the lobe reflects: the mean of F cos2 / max(cos1, cos2) over
        half vectors, by quadrature in (u1, u2) with ``nodes`` nodes. Good to 1e-4 (20 nodes: 1e-3).
        """
        k1 = np.asarray(k1, np.float64)
        x, w = np.polynomial.legendre.leggauss(nodes)
        x, w = (x + 1) / 2, w / 2
        u1, u2 = np.meshgrid(np.concatenate([(x + quarter) / 4 for quarter in range(4)]), x, indexing="ij")
        h = self.sample_half(u1, u2)
        kh = h @ k1
        cos2 = 2 * kh * h[..., 2] - k1[2]
        weight = np.where(cos2 > 0, self.fresnel(kh) * cos2 / np.maximum(k1[2], cos2), 0)
        if self.normalization == "pbrt":
            weight *= np.sqrt((self.nu + 2) * (self.nv + 2) / ((self.nu + 1) * (self.nv + 1)))
        return np.einsum("ij,i,j", weight, np.tile(w, 4) / 4, w)

    def sample_half(self, u1: Any, u2: Any) -> Array:
        """A half vector from two uniform numbers (eqs. 9 and 10), all four quadrants in one formula."""
        u1, u2 = np.asarray(u1, np.float64), np.asarray(u2, np.float64)
        c, s = np.cos(2 * np.pi * u1), np.sin(2 * np.pi * u1)
        a, b = self.nv + 1, self.nu + 1
        d = a * c**2 + b * s**2
        log_cos = np.log1p(-u2) * d / (a * b)
        sine = np.sqrt(-np.expm1(2 * log_cos))
        return np.stack([np.sqrt(a / d) * c * sine, np.sqrt(b / d) * s * sine, np.exp(log_cos)], axis=-1)


def base(c: Any) -> Array:
    """A(c) = 1 − (1 − c/2)^5 of the diffuse term."""
    return -np.expm1(5 * np.log1p(-np.asarray(c, np.float64) / 2))


def half(k1: Array, k2: Array) -> tuple[Array, Array]:
    """The half vector h, and k·h as half the length of k1 + k2: exact for unit vectors, also at grazing angles."""
    m = k1 + k2
    length = np.linalg.norm(m, axis=-1)
    length = np.where(length > 0, length, 1)
    return m / length[..., None], length / 2


def above(k1: Array, k2: Array) -> NDArray[np.bool_]:
    """Whether both directions are above the horizon."""
    return (k1[..., 2] > 0) & (k2[..., 2] > 0)
