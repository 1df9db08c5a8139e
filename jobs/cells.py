"""
Cells as one experiment sees them: what a page lists, and what changed on it since it last looked.

Rows have the names of ``Cell`` on the wire. A cell that two experiments share stands in both, each with its own state
and its own numbers.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import Any

from jobs.points import SECONDS
from jobs.store import Row, Store
from renderer import catalog
from renderer.metrics import METRICS

PAGE = 1000  # cells, when nobody says how many
CURRENT = {name: metric.version for name, metric in METRICS.items()}


@dataclass(frozen=True)
class Page:
    """
    cells  in the order of the plan
    next   position of the following page, None at the end
    """

    cells: list[Row]
    next: int | None


def page(store: Store, experiment: int, *, after: int = 0, start: int = 0, limit: int = PAGE) -> Page:
    """
    Up to ``limit`` cells from position ``start`` on; with ``after``, only those that changed since that revision.

    A change of the whole experiment (cancelled, paused, retried) changes every cell of it.
    """
    asked: dict[str, Any] = {"experiment_id": experiment, "start": start, "limit": limit + 1}
    if after and not touched(store, experiment, after):
        rows = store.rows("cells_changed", after=after, **asked)
    else:
        rows = store.rows("cells_page", **asked)
    more = rows[limit]["position"] if len(rows) > limit else None
    return Page(list(_cells(rows[:limit])), more)


def touched(store: Store, experiment: int, after: int) -> bool:
    """
    Whether all of an experiment may have changed since that revision: something happened to the experiment itself, or
    the revision is of another, older database that was here before.
    """
    return after > store.revision() or bool(store.value("experiment_touched", experiment_id=experiment, after=after))


def _cells(rows: Iterable[Row]) -> Iterator[Row]:
    for row in rows:
        metrics, seconds = {}, None
        for name, version, mean, error, n in json.loads(row.pop("points")):
            if name == SECONDS:
                seconds = mean
            elif CURRENT.get(name) == version:
                metrics[name] = (mean, error, n)
        row["sweep"] = json.loads(row["sweep"]) if row["sweep"] else {}
        if row["state"] != "failed":
            row["error_class"] = row["error"] = None
        row["replay"] = catalog.is_replay(row["sampler"])
        yield row | {"seconds": seconds, "metrics": {name: metrics[name] for name in METRICS if name in metrics}}
