"""
Two functions that float32 gets wrong near their zero: log(u) / (1 − u) at 1, and 1 − exp(x) at 0.

Dr.Jit has neither ``log1p`` nor ``expm1``, and on a GPU its ``log`` is only absolutely accurate near 1. Both are series
where the plain form would cancel; relative errors are below 3e-7 everywhere (science.md B.3).
"""

from __future__ import annotations

from typing import Any

import drjit as dr


def log_ratio(u: Any) -> Any:
    """
    log(u) / (1 − u) for u in (0, 1], which tends to −1 as u tends to 1.

    Above 3/4 by log u = 2 artanh((u − 1) / (u + 1)); its next term would be 2e-8.
    """
    near = u > 0.75
    inverse = dr.rcp(dr.select(near, 1 + u, 1 - u))
    z2 = dr.square((u - 1) * inverse)
    series = dr.fma(z2, dr.fma(z2, dr.fma(z2, 1 / 7, 1 / 5), 1 / 3), 1)
    return dr.select(near, -2 * series, dr.log(u)) * inverse


def one_minus_exp(x: Any, exp_x: Any) -> Any:
    """1 − exp(x) for x ≤ 0, where exp(x) is known already. Above −1/4 by the Taylor series up to x^7."""
    series = 1 + x / 7
    for n in range(6, 1, -1):
        series = dr.fma(x / n, series, 1)
    return dr.select(x > -0.25, -x * series, 1 - exp_x)
