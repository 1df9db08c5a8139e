"""The sentences that explain what went wrong with a grid, a data directory or a queue."""

from __future__ import annotations

from collections.abc import Sequence

from renderer.errors import DartboardError, EnvironmentProblem, shown


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


class WasDeleted(NotFound):
    """An experiment in the trash: it can be restored for some minutes."""

    def __init__(self, experiment: int, name: str):
        self.experiment = experiment
        short = name if len(name) <= 60 else name[:57] + "…"
        super().__init__(
            f"experiment {experiment} ({short}) was deleted; restore it within ten minutes to see it again"
        )


class Conflict(DartboardError):
    """A request that does not fit the state of things."""


class KeyReused(Conflict):
    """An Idempotency-Key that came with another grid before."""

    def __init__(self, key: str):
        super().__init__(
            f"the Idempotency-Key {shown(key)} came with another grid before; send a new key for a new grid"
        )


class DataDirectoryProblem(EnvironmentProblem):
    """A data directory that is read-only, full, damaged, in use by another process, or written by a newer version."""
