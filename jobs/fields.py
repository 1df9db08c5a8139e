"""
Reading a request field by field: every problem becomes a sentence, and the reading goes on.

A grid comes from a file that somebody typed, so all that is wrong with it is told at once. A ``Table`` reads one
table of the request; what it cannot use goes to the ``Problems`` that all tables share, and None comes back.
What the fields mean is the caller's business (``grid.py``). Indices in places count from 0.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from typing import Any, TypeVar

from jobs.errors import GridError
from renderer import catalog
from renderer.errors import DartboardError, UnknownName, shown
from renderer.spec import Choice

T = TypeVar("T")

MAX_TOLD = 50  # sentences; a generated file may repeat one mistake 100 000 times


class Problems:
    """The sentences found so far, each once, in the order they were found."""

    def __init__(self) -> None:
        self._told: dict[str, None] = {}

    def add(self, sentence: str) -> None:
        self._told[sentence] = None

    def attempt(self, step: Callable[[], T]) -> T | None:
        """The value of ``step``, or None with its error noted."""
        try:
            return step()
        except GridError as error:
            for sentence in error.problems:
                self.add(sentence)
        except DartboardError as error:
            self.add(str(error))
        return None

    def __bool__(self) -> bool:
        return bool(self._told)

    def raise_any(self) -> None:
        """Raises ``GridError`` with all sentences, if there are any."""
        sentences = list(self._told)
        if len(sentences) > MAX_TOLD:
            sentences[MAX_TOLD:] = [f"… and {len(sentences) - MAX_TOLD} more problems"]
        if sentences:
            raise GridError(sentences)


class Table:
    """
    One table of a request.

    where  its place in sentences: ``grid.toml`` or ``[reference] of grid.toml``
    known  the keys it may have; any other is a problem
    """

    def __init__(self, data: Mapping[str, object], where: str, known: Iterable[str], problems: Problems):
        self.data = data
        self.where = where
        self.problems = problems
        known = tuple(known)
        for key in data:
            if key not in known:
                problems.add(str(UnknownName("key", key, where, known)))

    def __contains__(self, key: str) -> bool:
        return key in self.data

    def place(self, key: str) -> str:
        return f"{key} of {self.where}"

    def wrong(self, place: str, value: object, way_out: str) -> None:
        """Notes ``PLACE is VALUE; WAY OUT``."""
        self.problems.add(f"{place} is {shown(value)}; {way_out}")

    def values(self, key: str, default: object, most: int) -> list[tuple[object, str]]:
        """An axis: its values with their places. One value may stand without a list; an empty list is a problem."""
        value = self.data.get(key, default)
        if not isinstance(value, list):
            return [(value, self.place(key))]
        if not value:
            self.problems.add(
                f"{self.place(key)} is empty; give at least one value" + (default is not None) * ", or leave it out"
            )
        if len(value) > most:
            self.problems.add(f"{self.place(key)} has {len(value)} values, more than {most}; split the grid")
            return []
        return [(item, self.place(f"{key}[{index}]")) for index, item in enumerate(value)]

    def integer(self, key: str, low: int, high: int, *, even: bool = False) -> int | None:
        """The integer at ``key``, None where it is absent or wrong."""
        return self.to_integer(self.data[key], self.place(key), low, high, even=even) if key in self.data else None

    def to_integer(self, value: object, place: str, low: int, high: int, *, even: bool = False) -> int | None:
        """``value`` as an integer from ``low`` to ``high``; 16.0 is one, ``"16"`` and true are not."""
        if isinstance(value, float) and value.is_integer():
            value = int(value)
        if isinstance(value, int) and not isinstance(value, bool) and low <= value <= high and not (even and value % 2):
            return value
        quotes = " without quotes" if isinstance(value, str) and value.strip().isdecimal() else ""
        self.wrong(place, value, f"give an {'even ' * even}integer from {low} to {high}{quotes}")
        return None

    def integers(self, key: str, names: str, low: int, high: int) -> tuple[int, ...] | None:
        """A list of as many integers as ``names`` has words ("width, height"), None where it is absent or wrong."""
        if key not in self.data:
            return None
        value, count = self.data[key], len(names.split(", "))
        if not isinstance(value, list) or len(value) != count:
            self.wrong(self.place(key), value, f"give {count} integers, [{names}]")
            return None
        read = [self.to_integer(item, self.place(f"{key}[{index}]"), low, high) for index, item in enumerate(value)]
        return None if None in read else tuple(item for item in read if item is not None)

    def table(self, key: str, way_out: str) -> Mapping[str, object]:
        """The table at ``key``, empty where it is absent or something else."""
        value = self.data.get(key, {})
        if isinstance(value, Mapping):
            return value
        self.wrong(self.place(key), value, way_out)
        return {}


def choice(table: Table, axis: str, value: Any, place: str) -> Choice | None:
    """An axis value by the catalog, None where it knows no such thing."""
    return table.problems.attempt(lambda: catalog.resolve(axis, value, place))
