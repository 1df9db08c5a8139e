"""
Numbers: the JSON in a report. Its plots are drawn from it, and other programs may read it.

``convergence`` holds what ``GET /api/experiments/{id}/convergence`` answers, metric by metric; ``replicates`` holds the
rows of ``dartboard results``, null where they are too many.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import asdict
from typing import Any

from renderer import __version__
from service.report.findings import Finding
from service.report.panels import Panel, label
from service.report.reading import Reading

FORMAT = 1  # grows when a key changes its meaning
CELL_KEYS = (
    "cell", "digest", "role", "scene", "integrator", "sampler", "spp", "spp_actual", "replay", "sweep", "state", "had",
    "wanted", "reference", "seconds", "error_class", "error",
)  # fmt: skip


def numbers(reading: Reading, panels: Iterable[Panel], found: Iterable[Finding]) -> dict[str, Any]:
    """Plain values, and no numbers that JSON cannot say."""
    experiment, standing, grid = reading.experiment, reading.standing, reading.grid
    return {
        "format": FORMAT,
        "dartboard": __version__,
        "at": reading.at,
        "revision": reading.revision,
        "experiment": {
            "id": experiment.id, "name": experiment.name, "digest": experiment.digest,
            "created_at": experiment.created_at, "state": standing.state, "had": standing.had,
            "wanted": standing.wanted,
        },
        "grid": grid,
        "toml": reading.toml,
        "axes": {
            "scenes": [scene["name"] for scene in grid["scenes"]],
            "integrators": [label("integrator", item) for item in grid["integrators"]],
            "samplers": [label("sampler", item) for item in grid["samplers"]],
            "spp": grid["spp"],
        },
        "metric": reading.metric,
        "convergence": reading.curves,
        "panels": {
            panel.id: {"scene": panel.scene, "integrators": panel.integrators, "sweep": panel.sweep}
            for panel in panels
        },
        "findings": [asdict(finding) for finding in found],
        "cells": _table(reading.cells, CELL_KEYS),
        "replicates": reading.replicates and _table(reading.replicates, tuple(reading.replicates[0])),
        "made_on": reading.made_on,
        "versions": reading.versions,
    }  # fmt: skip


def _table(rows: list[dict[str, Any]], columns: tuple[str, ...]) -> dict[str, Any]:
    """Names once, then values: a third of the size of one object per row."""
    return {"columns": columns, "rows": [[row[name] for name in columns] for row in rows]}
