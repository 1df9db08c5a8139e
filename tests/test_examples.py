"""Every example grid can be run as it is."""

from __future__ import annotations

from pathlib import Path

import pytest

from jobs import grid, plan

EXAMPLES = Path(__file__).resolve().parent.parent / "examples"


@pytest.mark.parametrize("name", sorted(file.name for file in EXAMPLES.glob("*.toml")))
def test_an_example_is_a_plan(name: str) -> None:
    assert plan.expand(grid.read(EXAMPLES / name)).cells


def test_the_study_has_the_shape_of_a_students_study() -> None:
    """4 scenes × 4 samplers × 3 integrators × 3 spp, of which no two are one cell."""
    cells = plan.expand(grid.read(EXAMPLES / "study.toml")).cells
    assert len(cells) == len({cell.spec.digest for cell in cells}) == 144
