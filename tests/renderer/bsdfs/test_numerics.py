"""log(u) / (1 − u) and 1 − exp(x) in float32, where the plain forms cancel."""

from __future__ import annotations

import numpy as np
import pytest

pytestmark = pytest.mark.usefixtures("variant")

RELATIVE = 3e-7


def test_log_ratio_is_good_up_to_one() -> None:
    import mitsuba as mi

    from renderer.bsdfs.numerics import log_ratio

    u = np.concatenate([1 - np.geomspace(2**-24, 0.5, 5000), np.geomspace(1e-30, 1, 5000), [1.0]]).astype(np.float32)
    exact = np.where(u == 1, -1, np.log(u, dtype=float) / np.where(u == 1, 1, 1 - u.astype(float)))
    assert np.allclose(np.array(log_ratio(mi.Float(u))), exact, rtol=RELATIVE, atol=0)


def test_one_minus_exp_is_good_down_to_zero() -> None:
    import drjit as dr
    import mitsuba as mi

    from renderer.bsdfs.numerics import one_minus_exp

    x = np.append(-np.geomspace(1e-30, 80, 10_000), 0.0).astype(np.float32)
    found = np.array(one_minus_exp(mi.Float(x), dr.exp(mi.Float(x))))
    assert np.allclose(found, -np.expm1(x, dtype=float), rtol=RELATIVE, atol=0)
