"""What tests of samplers share: tables in a folder of their own, and what is said of every sampler of ours."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

CORRECT = ("poissondisk", "relaxedpoissondisk", "eliminated", "sobol", "zsobol", "pmj02bn", "halton")
POISSON = ("poissondisk", "relaxedpoissondisk", "eliminated")
NETS = ("sobol", "zsobol", "pmj02bn")
COUNTS = (16, 64, 200, 256)


@pytest.fixture(scope="session", autouse=True)
def tables(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """Point sets are made in, and read from, a folder of this test run."""
    folder = tmp_path_factory.mktemp("tables")
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("DARTBOARD_TABLES", str(folder))
        yield folder
