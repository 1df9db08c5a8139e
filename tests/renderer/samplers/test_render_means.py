"""In a render every sampler has the mean of ``independent``: law 7 of science.md A.8, by the tests of E.4."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from renderer.spec import seed
from tests.renderer.conftest import make_cell
from tests.renderer.means import check_means
from tests.renderer.samplers.conftest import CORRECT, COUNTS

SIZE = (24, 24)
DRAWN: dict[tuple[str, int], NDArray[np.float64]] = {}
COMPARISONS = len(CORRECT) * (1 + 2 * len(COUNTS))  # in this file


def pictures(load_for: Callable[..., Any], scene: str, sampler: str, spp: int, count: int) -> NDArray[np.float64]:
    """(count, H, W, 3) replicates; those of a cell are drawn once."""
    from renderer.render import render

    spec = make_cell(scene, sampler, spp, size=SIZE)
    if (spec.digest, count) not in DRAWN:
        seeds = [seed(spec.digest, k) for k in range(count)]
        drawn = [one.picture for one in render(spec, load_for(spec, scene), seeds)]
        DRAWN[spec.digest, count] = np.array(drawn, np.float64)
    return DRAWN[spec.digest, count]


@pytest.mark.parametrize("name", CORRECT)
def test_pictures_have_the_mean_of_independent(load_for: Callable[..., Any], name: str, tmp_path: Path) -> None:
    count = 48
    check_means(
        pictures(load_for, "cornell_box", name, 16, count), pictures(load_for, "cornell_box", "independent", 16, count),
        tmp_path, COMPARISONS,
    )  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize("scene", ["cornell_box", "defocus"])
@pytest.mark.parametrize("spp", COUNTS)
@pytest.mark.parametrize("name", CORRECT)
def test_pictures_have_the_mean_of_independent_at_every_count(
    load_for: Callable[..., Any], name: str, spp: int, scene: str, tmp_path: Path
) -> None:
    count = 64
    check_means(
        pictures(load_for, scene, name, spp, count),
        pictures(load_for, scene, "independent", spp, count),
        tmp_path,
        COMPARISONS,
    )


def test_a_wrong_mean_is_found(load_for: Callable[..., Any], tmp_path: Path) -> None:
    """Stratified points without jitter are biased: the test has to see that, or it could not fail."""
    with pytest.raises(pytest.fail.Exception, match="means differ"):
        check_means(
            pictures(load_for, "cornell_box", "stratified:jitter=false", 16, 48),
            pictures(load_for, "cornell_box", "independent", 16, 48), tmp_path, COMPARISONS,
        )  # fmt: skip
