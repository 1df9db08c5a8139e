"""In a render every sampler has the mean of ``independent``: law 7 of science.md A.8, by the tests of E.4."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from renderer.images import write_picture
from renderer.spec import seed
from tests.renderer.conftest import make_cell
from tests.renderer.samplers.conftest import CORRECT, COUNTS

SIZE = (24, 24)
BLOCK = 4  # pixels a side
DRAWN: dict[tuple[str, int], NDArray[np.float64]] = {}
COMPARISONS = len(CORRECT) * (1 + 2 * len(COUNTS))  # in this file
FAMILY = 0.01  # chance that anything fails here although all means are equal


def pictures(load_for: Callable[..., Any], scene: str, sampler: str, spp: int, count: int) -> NDArray[np.float64]:
    """(count, H, W, 3) replicates; those of a cell are drawn once."""
    from renderer.render import render

    spec = make_cell(scene, sampler, spp, size=SIZE)
    if (spec.digest, count) not in DRAWN:
        seeds = [seed(spec.digest, k) for k in range(count)]
        drawn = [one.picture for one in render(spec, load_for(spec, scene), seeds)]
        DRAWN[spec.digest, count] = np.array(drawn, np.float64)
    return DRAWN[spec.digest, count]


def check_means(ours: NDArray[np.float64], others: NDArray[np.float64], evidence: Path) -> None:
    """
    Equal expectations (E.4): |z| of the mean picture < 3.3 in each channel, and Welch's t of each block of pixels
    within the Šidák level of all blocks of all comparisons.
    """
    from scipy.stats import ttest_ind

    z = difference(ours.mean((1, 2)), others.mean((1, 2)))
    height, width = ours.shape[1:3]

    def blocks(pictures: NDArray[np.float64]) -> NDArray[np.float64]:
        cut = pictures.reshape(len(pictures), height // BLOCK, BLOCK, width // BLOCK, BLOCK, 3)
        return cut.mean((2, 4, 5)).reshape(len(pictures), -1)

    a, b = blocks(ours), blocks(others)
    varies = (a.std(0) + b.std(0)) > 1e-6 * (a.mean(0) + b.mean(0) + 1e-6)
    p = ttest_ind(a[:, varies], b[:, varies], equal_var=False).pvalue
    level = 1 - (1 - FAMILY) ** (1 / (COMPARISONS * max(varies.sum(), 1)))
    if np.abs(z).max() >= 3.3 or p.min() <= level:
        write_picture(evidence / "difference.exr", (ours.mean(0) - others.mean(0)).astype(np.float32), {})
        pytest.fail(
            f"means differ: z {np.round(z, 2)}, least p of a block {p.min():.2g} (level {level:.2g}): {evidence}"
        )


def difference(a: NDArray[np.float64], b: NDArray[np.float64]) -> NDArray[np.float64]:
    """z of the difference of two means, per channel."""
    return (a.mean(0) - b.mean(0)) / np.sqrt(a.var(0, ddof=1) / len(a) + b.var(0, ddof=1) / len(b))


@pytest.mark.parametrize("name", CORRECT)
def test_pictures_have_the_mean_of_independent(load_for: Callable[..., Any], name: str, tmp_path: Path) -> None:
    count = 48
    check_means(
        pictures(load_for, "cornell_box", name, 16, count), pictures(load_for, "cornell_box", "independent", 16, count),
        tmp_path,
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
        pictures(load_for, scene, name, spp, count), pictures(load_for, scene, "independent", spp, count), tmp_path
    )


def test_a_wrong_mean_is_found(load_for: Callable[..., Any], tmp_path: Path) -> None:
    """Stratified points without jitter are biased: the test has to see that, or it could not fail."""
    with pytest.raises(pytest.fail.Exception, match="means differ"):
        check_means(
            pictures(load_for, "cornell_box", "stratified:jitter=false", 16, 48),
            pictures(load_for, "cornell_box", "independent", 16, 48), tmp_path,
        )  # fmt: skip
