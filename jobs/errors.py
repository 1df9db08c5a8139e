"""The sentences that explain what went wrong with a grid, a data directory or a queue."""

from __future__ import annotations

from collections.abc import Sequence

from renderer.errors import DartboardError, EnvironmentProblem


class GridError(DartboardError):
    """
    A grid that cannot be run; every problem found is listed, not only the first.

    problems  one sentence each, with the value, the place, what is allowed and the way out
    """

    def __init__(self, problems: Sequence[str]):
        self.problems = tuple(problems)
        super().__init__("\n".join(self.problems))


class NotFound(DartboardError):
    """An experiment that the data directory does not know."""


class DataDirectoryProblem(EnvironmentProblem):
    """A data directory that is read-only, full, damaged, in use by another process, or written by a newer version."""
