"""
The points of plots, kept ready: mean and standard error of every metric, and the mean time, per cell of an experiment.

A table of a grid of 10 000 cells would take a second to add up; it is added up when a picture is measured instead.
Every row can be computed again from ``metric`` and ``replicate``: nothing is known here alone. ``cells.py``,
``convergence.py`` and ``results.py`` read the same rows, so a plot and a table cannot disagree. A mean has eight
digits, its error and a time have four: more than replicates can tell, and half as much to send.
"""

from __future__ import annotations

import json
from collections.abc import Iterable

from jobs.store import Store
from renderer.metrics import METRICS

SECONDS = "render_seconds"  # beside the metrics, with the conditions under which it was timed
VERSIONS = json.dumps({name: metric.version for name, metric in METRICS.items()})


def refresh(store: Store, cells: Iterable[int]) -> None:
    """The points of these cells, in every experiment that has them: after they were drawn or measured."""
    listed = json.dumps(sorted(cells))
    with store.transaction():
        store.run("refresh_errors", cells=listed, versions=VERSIONS)
        store.run("refresh_seconds", cells=listed)


def refresh_experiment(store: Store, experiment: int) -> None:
    """The points of an experiment that was just submitted and shares finished cells with others."""
    refresh(store, (row["cell_id"] for row in store.rows("cells_of_experiment", experiment_id=experiment)))


def fill_gaps(store: Store) -> None:
    """For a new owner: experiments of a version that kept no points."""
    for row in store.rows("without_points"):
        refresh_experiment(store, row["id"])
