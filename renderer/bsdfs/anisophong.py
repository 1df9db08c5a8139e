"""
``anisophong``: the anisotropic Phong reflection of Ashikhmin and Shirley (2000), as a Mitsuba BSDF.

A glossy lobe round the half vector h, with exponent ``nu`` along the tangent u and ``nv`` along v, over a diffuse base
that takes what Fresnel reflection leaves ("An Anisotropic Phong BRDF Model", eqs. 2 to 5):

    f_s = sqrt((nu + 1)(nv + 1)) / (8 pi) · (n·h)^e · F / ((k·h) max(n·k1, n·k2)),   e = (nu hx² + nv hy²) / (1 − hz²)
    f_d = 28 Rd / (23 pi) · (1 − Rs) · A(n·k1) · A(n·k2),                             A(c) = 1 − (1 − c/2)^5
    F   = Rs + (1 − Rs)(1 − k·h)^5

``formula.py`` is the same in float64 and readable; here it is written so that float32 holds at exponents of 10 000 and
at grazing angles: (n·h)^e without 0/0 at h = n, k·h as half the length of k1 + k2, A without cancellation.

u is ``si.sh_frame.s``: dp/du made orthogonal to the shading normal. The front side reflects only; wrap it in
``twosided`` for both. Directions are picked from both lobes at once and weighed by the density of the mixture
(one-sample MIS, balance heuristic), so a weight is never above 1/p of its lobe. Half vectors that reflect below the
horizon are rejected and the density is not renormalised: it integrates to less than 1.

This module derives from ``mi.BSDF``: import it when a variant has been set.
"""

from __future__ import annotations

import math
import warnings
from typing import Any

import drjit as dr
import mitsuba as mi

from renderer.bsdfs.numerics import log_ratio, one_minus_exp

DIFFUSE, GLOSSY = 0, 1  # the components, in Mitsuba's numbering
P_MIN, P_MAX = 0.1, 0.9  # of the glossy lobe, where both are in play: neither is ever starved
TINY = 1e-30  # squared length of k1 + k2 that no pair above the horizon falls below
NORMALIZATIONS = ("as2000", "pbrt")


class AnisoPhong(mi.BSDF):
    """
    rd, rs               diffuse and specular reflectance, spectrum or texture in 0 … 1 (0.5, 0.5)
    nu, nv               exponents along u and v, number or texture, ≥ 0 (100, 100)
    importance_sampling  False picks directions by the cosine alone, to show what the lobe's own sampling gains
    normalization        "as2000", or "pbrt": sqrt((nu+2)(nv+2)) in f_s, brighter than the paper's, its pdf unchanged

    ``mi.traverse`` names rd.value, rs.value (or what their textures have), nu and nv. Raises ``RuntimeError`` with one
    sentence for a value out of range; of rd > 1 it warns, because such a surface may give more than it gets.
    """

    def __init__(self, props: mi.Properties):
        super().__init__(props)
        self.rd, self.rs = (_reflectance(props, name) for name in ("rd", "rs"))
        self.nu, self.nv = (_exponent(props, name) for name in ("nu", "nv"))
        self.importance_sampling = bool(props.get("importance_sampling", True))
        self.normalization = props.get("normalization", "as2000")
        if self.normalization not in NORMALIZATIONS:
            raise RuntimeError(
                f"anisophong: normalization = {self.normalization!r} is unknown; it is one of as2000, pbrt"
            )
        side = mi.BSDFFlags.FrontSide
        if any(isinstance(value, mi.Texture) and value.is_spatially_varying() for value in self._values().values()):
            side |= mi.BSDFFlags.SpatiallyVarying
        self.m_components = [
            int(mi.BSDFFlags.DiffuseReflection | side),
            int(mi.BSDFFlags.GlossyReflection | mi.BSDFFlags.Anisotropic | side),
        ]
        self.m_flags = self.m_components[DIFFUSE] | self.m_components[GLOSSY]
        self.parameters_changed([])

    # -- parameters --------------------------------------------------------------------------------------------

    def _values(self) -> dict[str, Any]:
        return {"rd": self.rd, "rs": self.rs, "nu": self.nu, "nv": self.nv}

    def traverse(self, callback: mi.TraversalCallback) -> None:
        for name, value in self._values().items():
            callback.put(name, value, mi.ParamFlags.Differentiable)

    def parameters_changed(self, keys: list[str] = []) -> None:  # noqa: B006 - Mitsuba's own signature
        """Checks new exponents. They become numbers in memory, so that one kernel serves every value of a sweep."""
        for name in ("nu", "nv"):
            value = getattr(self, name)
            if isinstance(value, mi.Float):
                dr.make_opaque(value)
                if name in keys:
                    _check_exponent(name, dr.detach(value)[0])

    def _exponents(self, si: mi.SurfaceInteraction3f, active: Any) -> tuple[Any, Any]:
        nu, nv = (
            value if isinstance(value, mi.Float) else dr.maximum(value.eval_1(si, active), 0)
            for value in (self.nu, self.nv)
        )
        return nu, nv

    # -- what Mitsuba calls --------------------------------------------------------------------------------------

    def sample(self, ctx: Any, si: Any, sample1: Any, sample2: Any, active: Any = True) -> tuple[Any, Any]:
        at = self._at(ctx, si, active)
        glossy = sample1 < at.p
        wo = dr.select(glossy, self._reflected(at, si.wi, sample2), mi.warp.square_to_cosine_hemisphere(sample2))
        value, pdf = self._eval_pdf(at, si, wo)
        bs = dr.zeros(mi.BSDFSample3f)
        bs.wo, bs.pdf, bs.eta = wo, pdf, 1
        bs.sampled_component = dr.select(glossy, mi.UInt32(GLOSSY), mi.UInt32(DIFFUSE))
        bs.sampled_type = dr.select(
            glossy, mi.UInt32(int(mi.BSDFFlags.GlossyReflection)), mi.UInt32(int(mi.BSDFFlags.DiffuseReflection))
        )
        return bs, dr.select(active & (pdf > 0), value / pdf, 0)

    def eval(self, ctx: Any, si: Any, wo: Any, active: Any = True) -> Any:
        return self.eval_pdf(ctx, si, wo, active)[0]

    def pdf(self, ctx: Any, si: Any, wo: Any, active: Any = True) -> Any:
        return self.eval_pdf(ctx, si, wo, active)[1]

    def eval_pdf(self, ctx: Any, si: Any, wo: Any, active: Any = True) -> tuple[Any, Any]:
        value, pdf = self._eval_pdf(self._at(ctx, si, active), si, wo)
        return dr.select(active, value, 0), dr.select(active, pdf, 0)

    def eval_diffuse_reflectance(self, si: Any, active: Any = True) -> Any:
        """The exact directional albedo of the base: Rd (1 − Rs) A(n·k1)."""
        cos_i = dr.maximum(mi.Frame3f.cos_theta(si.wi), 0)
        return self.rd.eval(si, active) * (1 - self.rs.eval(si, active)) * _base(cos_i)

    def to_string(self) -> str:
        values = "".join(f"\n  {name} = {value}," for name, value in self._values().items())
        how = f"importance_sampling = {self.importance_sampling}, normalization = {self.normalization!r}"
        return f"AnisoPhong[{values}\n  {how}\n]"

    # -- the model -----------------------------------------------------------------------------------------------

    def _at(self, ctx: Any, si: Any, active: Any) -> _Surface:
        """What is the same for all wo: parameters, enabled lobes and the probability of the glossy one."""
        at = _Surface()
        at.diffuse = ctx.is_enabled(mi.BSDFFlags.DiffuseReflection, DIFFUSE)
        at.glossy = ctx.is_enabled(mi.BSDFFlags.GlossyReflection, GLOSSY)
        at.rs = self.rs.eval(si, active)
        at.nu, at.nv = self._exponents(si, active)
        at.base = self.rd.eval(si, active) * (1 - at.rs) * _base(mi.Frame3f.cos_theta(si.wi))
        if not (self.importance_sampling and at.glossy):
            at.p = mi.Float(0)
        elif not at.diffuse:
            at.p = mi.Float(1)
        else:
            mirror, base = dr.max(_schlick(at.rs, mi.Frame3f.cos_theta(si.wi))), dr.max(at.base)
            at.p = dr.clip(mirror / dr.maximum(mirror + base, TINY), P_MIN, P_MAX)
        return at

    def _eval_pdf(self, at: _Surface, si: Any, wo: Any) -> tuple[Any, Any]:
        """f cos(wo) and the density of ``sample``; both 0 where a direction is below the horizon."""
        cos_i, cos_o = mi.Frame3f.cos_theta(si.wi), mi.Frame3f.cos_theta(wo)
        if not (at.diffuse or at.glossy):
            return mi.Spectrum(0), mi.Float(0)
        value, pdf = mi.Spectrum(0), (1 - at.p) * dr.inv_pi * cos_o
        if at.glossy:
            m = si.wi + wo
            squared = dr.maximum(dr.squared_norm(m), TINY)
            inverse = dr.rcp(squared)
            k_h = 0.5 * dr.sqrt(squared)  # dot(k, h) has an error of 3e-2 at 89.9 degrees
            q = dr.fma(at.nu * m.x, m.x, at.nv * m.y * m.y) * inverse
            u = dr.maximum(dr.square(m.z) * inverse, TINY)
            scale = dr.sqrt((at.nu + 1) * (at.nv + 1)) / (8 * dr.pi)
            # (n·h)^e = exp(q log(u) / (2 (1 − u))), u = (n·h)²
            density = scale * dr.exp(0.5 * q * log_ratio(u)) / k_h
            pdf = dr.fma(at.p, density, pdf)
            if self.normalization == "pbrt":
                density *= dr.sqrt((at.nu + 2) * (at.nv + 2) / ((at.nu + 1) * (at.nv + 1)))
            value = density * (cos_o / dr.maximum(cos_i, cos_o)) * _schlick(at.rs, k_h)
        if at.diffuse:
            value += (28 / (23 * dr.pi)) * cos_o * _base(cos_o) * at.base
        up = (cos_i > 0) & (cos_o > 0)
        return dr.select(up, value, 0), dr.select(up, pdf, 0)

    def _reflected(self, at: _Surface, wi: Any, sample: Any) -> Any:
        """
        wi mirrored in a half vector drawn from its density; below the horizon where it is to be rejected.

        The paper's four quadrants (eqs. 6 to 8) without branches or arctangents: cos φ and sin φ of the stretched
        angle come from cos 2πu and sin 2πu by one normalisation.
        """
        s, c = dr.sincos(2 * dr.pi * sample.x)
        a, b = at.nv + 1, at.nu + 1
        d = a * dr.square(c) + b * dr.square(s)
        log_cos = log_ratio(1 - sample.y) * sample.y * d / (a * b)
        cos_theta = dr.exp(log_cos)
        radius = dr.sqrt(one_minus_exp(2 * log_cos, dr.square(cos_theta)) / d)
        h = mi.Vector3f(dr.sqrt(a) * radius * c, dr.sqrt(b) * radius * s, cos_theta)
        return 2 * dr.dot(wi, h) * h - wi


class _Surface:
    """
    The material at the points of a wavefront.

    diffuse, glossy  whether the context asks for the lobe
    rs, nu, nv       parameters there
    base             Rd (1 − Rs) A(n·k1): the base's albedo for light from wi
    p                probability of sampling the glossy lobe
    """

    diffuse: bool
    glossy: bool
    rs: Any
    nu: Any
    nv: Any
    base: Any
    p: Any


def _base(c: Any) -> Any:
    """A(c) = 1 − (1 − c/2)^5 as c/2 · (1 + y + y² + y³ + y⁴), y = 1 − c/2: nothing cancels at grazing angles."""
    y = dr.fma(c, -0.5, 1)
    return 0.5 * c * dr.fma(y, dr.fma(y, dr.fma(y, 1 + y, 1), 1), 1)


def _schlick(rs: Any, c: Any) -> Any:
    """Fresnel reflectance F = Rs + (1 − Rs)(1 − c)^5."""
    x = 1 - c
    return dr.fma(1 - rs, dr.square(dr.square(x)) * x, rs)


def _reflectance(props: mi.Properties, name: str) -> Any:
    value = props.get(name, 0.5)
    if isinstance(value, (int, float)):
        if not (math.isfinite(value) and value >= 0) or (name == "rs" and value > 1):
            raise RuntimeError(f"anisophong: {name} = {value} is no reflectance; give a number from 0 to 1")
        if value > 1:
            warnings.warn(f"anisophong: rd = {value} is above 1: more energy may leave than arrives", stacklevel=2)
    return props.get_texture(name, 0.5)


def _exponent(props: mi.Properties, name: str) -> Any:
    value = props.get(name, 100.0)
    if isinstance(value, mi.Texture):
        return value
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        raise RuntimeError(f"anisophong: {name} = {value!r} is no exponent; give a number of at least 0, or a texture")
    _check_exponent(name, value)
    return mi.Float(value)


def _check_exponent(name: str, value: float) -> None:
    if not (math.isfinite(value) and value >= 0):
        raise RuntimeError(f"anisophong: {name} = {value} is no exponent; give a finite number of at least 0")
