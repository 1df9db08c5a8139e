"""What cells and pictures are called in sentences."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

from renderer.parameters import told

Sweep = Mapping[str, Any] | Iterable[tuple[str, Any]]  # what a cell sets in its scene


def cell_name(scene: str, integrator: str, sampler: str, spp: int, sweep: Sweep = ()) -> str:
    """``cornell_box · lamp.radiance = 10 · path · stratified · 16 spp``."""
    return " · ".join([scene, *told(sweep), integrator, sampler, f"{spp} spp"])


def replicate_name(role: str, k: int) -> str:
    """A picture of a cell, counted from 1: ``replicate 3``, ``reference 1``."""
    return f"reference {k + 1}" if role == "reference" else f"replicate {k + 1}"
