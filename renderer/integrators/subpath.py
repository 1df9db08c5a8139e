"""
The vertices of a light subpath, kept in local memory until the camera's subpath of the same lane comes by.

``LightVertex`` is what is kept: enough to evaluate the BSDF there once more. The store is a little array of each lane,
on the stack of a CPU thread and in local memory of a GPU: it does not grow with the picture.

This module names the variant's types: import it when a variant has been set.
"""

from __future__ import annotations

from typing import Any

import drjit as dr
import mitsuba as mi

# Vertices. Two sizes, so that nearly all depths share a kernel; and CUDA's compiler makes registers of smaller arrays,
# which takes twice the time.
CAPACITIES = (32, 64)


class LightVertex:
    """
    p, n          point and geometric normal
    sn, ss        shading normal and tangent
    uv            texture coordinates
    dp_du, dp_dv  derivatives of p by them, which bump maps use
    wi            where the light came from, in the shading frame
    prim          number of the primitive, which mesh attributes use
    shape, bsdf   what was hit
    beta          light that arrives, per density of the subpath; 0 where nothing can be connected
    vcm, vc       of ``mis``
    """

    DRJIT_STRUCT = {  # noqa: RUF012 - not a default: Dr.Jit reads the fields of its structures here
        "p": mi.Point3f, "n": mi.Normal3f, "sn": mi.Normal3f, "ss": mi.Vector3f, "uv": mi.Point2f,
        "dp_du": mi.Vector3f, "dp_dv": mi.Vector3f, "wi": mi.Vector3f, "prim": mi.UInt32, "shape": mi.ShapePtr,
        "bsdf": mi.BSDFPtr, "beta": mi.Spectrum, "vcm": mi.Float, "vc": mi.Float,
    }  # fmt: skip

    p: Any
    n: Any
    sn: Any
    ss: Any
    uv: Any
    dp_du: Any
    dp_dv: Any
    wi: Any
    prim: Any
    shape: Any
    bsdf: Any
    beta: Any
    vcm: Any
    vc: Any

    def __init__(self) -> None:
        for name, kind in self.DRJIT_STRUCT.items():
            setattr(self, name, dr.zeros(kind))

    @classmethod
    def of(cls, si: Any, bsdf: Any, beta: Any, vcm: Any, vc: Any) -> LightVertex:
        """What to keep of a vertex."""
        made = cls()
        made.p, made.n, made.sn, made.ss, made.uv = si.p, si.n, si.sh_frame.n, si.sh_frame.s, si.uv
        made.dp_du, made.dp_dv, made.wi, made.prim, made.shape = si.dp_du, si.dp_dv, si.wi, si.prim_index, si.shape
        made.bsdf, made.beta, made.vcm, made.vc = bsdf, beta, vcm, vc
        return made

    def interaction(self, time: Any, wavelengths: Any) -> Any:
        """The vertex as BSDFs want it."""
        si = dr.zeros(mi.SurfaceInteraction3f)
        si.t = mi.Float(1)  # valid
        si.p, si.n, si.uv, si.wi, si.prim_index, si.shape = self.p, self.n, self.uv, self.wi, self.prim, self.shape
        si.sh_frame = mi.Frame3f(self.ss, dr.cross(self.sn, self.ss), self.sn)
        si.dp_du, si.dp_dv, si.time, si.wavelengths = self.dp_du, self.dp_dv, time, wavelengths
        return si


def capacity(max_depth: int) -> int:
    """
    How many vertices of a light subpath are kept: all that camera subpaths of paths of ``max_depth`` edges connect to.

    Two faults of Dr.Jit 1.5 (LLVM) are to be kept away from the store. It loses masked writes that go to different
    places in different lanes: so vertex number i is written by all lanes at once, whether it can be connected or not.
    And kernels that differ in nothing but the size of a local array are one kernel to it, which then reads beyond the
    smaller one: so the size is to stand in the code, as a bound.
    """
    needed = max(max_depth - 2, 1)
    return next(size for size in CAPACITIES if size >= needed)


def store(size: int) -> Any:
    """Room for ``size`` vertices."""
    return dr.alloc_local(LightVertex, size)
