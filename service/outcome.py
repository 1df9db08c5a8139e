"""
What became of an experiment, as ``run`` and ``submit --wait`` tell it: counts, the table of errors, the exit code.

The same words and the same JSON whether the numbers come from a data directory or from a server.
"""

from __future__ import annotations

import json
from dataclasses import dataclass
from typing import Any

from rich.markup import escape

from jobs.results import Point
from service.progress import console
from service.tables import show_errors, show_failures


@dataclass(frozen=True)
class Outcome:
    """
    An experiment at the end of a command that rendered it or watched it.

    cells, references  how many by state
    had, wanted        pictures, references included; ``had_before`` when the command began
    points             mean errors, in the order of the plan
    failures           scene, integrator, sampler, spp, error and log (where it is, or None) of each failed cell
    left               None, or the sentence for somebody who interrupted it: what goes on, and the way back
    """

    experiment: int
    name: str
    state: str
    cells: dict[str, int]
    references: dict[str, int]
    had: int
    wanted: int
    had_before: int
    points: list[Point]
    failures: list[dict[str, Any]]
    left: str | None = None

    @property
    def exit_code(self) -> int:
        """0 done, 1 some cells failed or were cancelled, 130 interrupted."""
        return 130 if self.left else 0 if self.state == "done" else 1


def tell(outcome: Outcome, *, where: str, go_on: str, as_json: bool) -> None:
    """
    Print it.

    where  the last line: where the pictures and all numbers are
    go_on  the command that goes on with an experiment that was cancelled or paused
    """
    had = f"{outcome.had} of {outcome.wanted} pictures are there"
    if as_json:
        print(json.dumps(_as_json(outcome), indent=2, ensure_ascii=False))
        return
    if outcome.left:
        say(f"{outcome.left} ({had})")
        return
    if outcome.state in ("cancelled", "paused"):
        say(f"{outcome.state}: {had}; `{go_on}` goes on")
    elif outcome.had == outcome.had_before and outcome.state == "done":
        say(f"nothing to do: all {outcome.had} pictures of {outcome.name!r} are there")
    show_errors(outcome.points)
    show_failures(outcome.failures)
    say(where)


def _as_json(outcome: Outcome) -> dict[str, Any]:
    return {
        "experiment": outcome.experiment, "name": outcome.name, "state": outcome.state,
        "cells": outcome.cells, "references": outcome.references, "pictures": outcome.had, "wanted": outcome.wanted,
        "interrupted": outcome.left is not None, "points": [point.__dict__ for point in outcome.points],
    }  # fmt: skip


def say(line: str) -> None:
    """A line on stderr; nothing in it is markup."""
    console.print(escape(line), soft_wrap=True)
