"""
Samples against the density that ``pdf`` tells: Pearson's χ² on the sphere by Mitsuba's own test (science.md B.5).

Sharper lobes are tested by their half vectors (test_anisophong.py): no grid resolves them.
"""

from __future__ import annotations

import itertools
from typing import Any

import numpy as np
import pytest

from tests.renderer.bsdfs.cases import direction

pytestmark = pytest.mark.usefixtures("variant")

ANGLES = (0, 30, 60, 85)
EXPONENTS = ((0, 0), (1, 1), (10, 10), (100, 100), (100, 10), (0, 100))
CASES = list(itertools.product(ANGLES, EXPONENTS))


def agree(degrees: float, exponents: tuple[int, int], **more: Any) -> bool:
    """Whether a million samples look like the density, at the level 0.01 by Šidák over all cases."""
    import mitsuba as mi

    core: Any = mi
    described = {"type": "anisophong", "rd": 0.5, "rs": 0.2, "nu": exponents[0], "nv": exponents[1], **more}
    component = described.pop("component", None)
    ctx = mi.BSDFContext()
    if component is not None:
        ctx.component = component
    wi = direction(np.radians(degrees), 0.3)
    sample, pdf = core.chi2.BSDFAdapter("anisophong", described, wi=wi.tolist(), ctx=ctx)
    test = core.chi2.ChiSquareTest(core.chi2.SphericalDomain(), sample, pdf, sample_dim=3, res=140, ires=32)
    return bool(test.run(significance_level=0.01, test_count=len(CASES), quiet=True))


@pytest.mark.parametrize(("degrees", "exponents"), CASES)
def test_samples_follow_their_density(degrees: float, exponents: tuple[int, int]) -> None:
    assert agree(degrees, exponents)


def test_the_test_can_fail() -> None:
    """A lobe that is sampled by other exponents than its density has is found out."""
    import mitsuba as mi

    core: Any = mi
    sample, _ = core.chi2.BSDFAdapter("anisophong", {"type": "anisophong", "nu": 10, "nv": 12}, wi=[0, 0.6, 0.8])
    _, pdf = core.chi2.BSDFAdapter("anisophong", {"type": "anisophong", "nu": 10, "nv": 10}, wi=[0, 0.6, 0.8])
    test = core.chi2.ChiSquareTest(core.chi2.SphericalDomain(), sample, pdf, sample_dim=3)
    assert not test.run(test_count=len(CASES), quiet=True)


@pytest.mark.slow
@pytest.mark.parametrize("more", [{"component": 0}, {"component": 1}, {"importance_sampling": False}])
@pytest.mark.parametrize(("degrees", "exponents"), CASES)
def test_samples_of_each_lobe_follow_its_density(
    degrees: float, exponents: tuple[int, int], more: dict[str, Any]
) -> None:
    assert agree(degrees, exponents, **more)
