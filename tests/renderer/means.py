"""Have two estimators the same expected picture? The tests of science.md E.4 on replicates of both."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from renderer.images import write_picture

BLOCK = 4  # pixels a side
FAMILY = 0.01  # chance that any comparison of a file fails although all means are equal
Z_MAX = 3.3


def check_means(ours: NDArray[np.float64], others: NDArray[np.float64], evidence: Path, comparisons: int) -> None:
    """
    Equal expectations of two sets of replicates, (K, H, W, 3) each: |z| of the mean picture < 3.3 in each channel, and
    Welch's t of each block of pixels within the Šidák level of all blocks of all ``comparisons`` of a file.

    z is the normal deviate that is as unlikely as Welch's t: of few replicates t itself is above 3.3 more often.
    """
    from scipy.stats import norm, ttest_ind

    assert np.isfinite(ours).all(), "pictures have pixels that are no numbers"
    z = norm.isf(ttest_ind(ours.mean((1, 2)), others.mean((1, 2)), equal_var=False).pvalue / 2)
    height, width = ours.shape[1:3]

    def blocks(pictures: NDArray[np.float64]) -> NDArray[np.float64]:
        cut = pictures.reshape(len(pictures), height // BLOCK, BLOCK, width // BLOCK, BLOCK, 3)
        return cut.mean((2, 4, 5)).reshape(len(pictures), -1)

    a, b = blocks(ours), blocks(others)
    varies = (a.std(0) + b.std(0)) > 1e-6 * (a.mean(0) + b.mean(0) + 1e-6)
    p = ttest_ind(a[:, varies], b[:, varies], equal_var=False).pvalue
    level = 1 - (1 - FAMILY) ** (1 / (comparisons * max(varies.sum(), 1)))
    if np.nanmax(z) >= Z_MAX or p.min() <= level:
        write_picture(evidence / "difference.exr", (ours.mean(0) - others.mean(0)).astype(np.float32), {})
        pytest.fail(
            f"means differ: z {np.round(z, 2)}, least p of a block {p.min():.2g} (level {level:.2g}): {evidence}"
        )
