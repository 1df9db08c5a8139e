"""
The parameters of a directive: ``"float radius" [2]``, typed values by name.

Whoever reads a parameter takes it; what nobody took is unknown to us and reported (``leftovers``), as pbrt does.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from renderer.errors import SceneError, shown
from renderer.scenes.pbrt.lexer import Place, Values

Floats = NDArray[np.float64]

NUMBERS = {"integer": 1, "float": 1, "point2": 2, "vector2": 2, "point3": 3, "vector3": 3, "normal": 3, "rgb": 3,
           "xyz": 3, "blackbody": 2}  # numbers that make one value  # fmt: skip
STRINGS = frozenset({"string", "texture", "bool"})
ALIASES = {"point": "point3", "vector": "vector3", "normal3": "normal", "color": "rgb", "point4": "float"}
SPECTRA = frozenset({"rgb", "xyz", "blackbody", "spectrum"})
TYPES = frozenset(NUMBERS) | STRINGS | {"spectrum"}


@dataclass(slots=True)
class Parameter:
    """One parameter as written, its type without aliases."""

    kind: str
    name: str
    values: Values
    place: Place

    @property
    def numbers(self) -> Floats:
        """Its values as numbers. Raises ``SceneError`` for strings."""
        if isinstance(self.values, list):
            raise SceneError(f"{self.place}: the parameter {self.name!r} wants numbers, not strings")
        return self.values

    @property
    def strings(self) -> list[str]:
        """Its values as strings. Raises ``SceneError`` for numbers."""
        if not isinstance(self.values, list):
            raise SceneError(f"{self.place}: the parameter {self.name!r} wants strings, not numbers")
        return self.values


def make(kind: str, name: str, values: Values, place: Place) -> Parameter:
    """A parameter whose values fit its type. Raises ``SceneError``."""
    kind = ALIASES.get(kind, kind)
    made = Parameter(kind, name, values, place)
    size = NUMBERS.get(kind)
    if kind in STRINGS:
        made.strings  # noqa: B018 - raises
    elif size and len(made.numbers) % size:
        raise SceneError(f"{place}: {name!r} of type {kind} has {len(values)} numbers; each value takes {size}")
    if not len(values) and kind != "texture" and name not in ("P", "N", "indices", "uv", "st", "S"):
        raise SceneError(f"{place}: the parameter {name!r} has no value")
    return made


@dataclass
class Parameters:
    """
    The parameters of one directive.

    owner  how sentences call the directive: 'Shape "sphere"'
    """

    owner: str
    place: Place
    items: dict[str, Parameter] = field(default_factory=dict)
    fallback: Parameters | None = None  # a material's own, below the shape's that override them
    _taken: set[str] = field(default_factory=set)

    def get(self, name: str, *kinds: str) -> Parameter | None:
        """The parameter of that name and one of these types; taken from now on. None if it is not there."""
        found = self.items.get(name)
        below = self.fallback.get(name, *kinds) if self.fallback else None
        if found is not None and (not kinds or found.kind in kinds):
            self._taken.add(name)
            return found
        return below

    def __contains__(self, name: str) -> bool:
        return name in self.items or (self.fallback is not None and name in self.fallback)

    def number(self, name: str, default: float, *, positive: bool = False) -> float:
        """One float (or integer). Raises ``SceneError`` for what is not > 0 where it has to be."""
        found = self.get(name, "float", "integer")
        value = default if found is None else float(found.numbers[0])
        if positive and value <= 0:
            raise SceneError(
                f"{found.place if found else self.place}: {name} = {value:g} of {self.owner}; give more than 0"
            )
        return value

    def integer(self, name: str, default: int) -> int:
        return int(self.number(name, default))

    def text(self, name: str, default: str = "") -> str:
        found = self.get(name, "string")
        return default if found is None else found.strings[0]

    def flag(self, name: str, default: bool) -> bool:
        """A bool. Raises ``SceneError`` for anything but true and false."""
        found = self.get(name, "bool")
        if found is None:
            return default
        value = found.strings[0].strip().lower()
        if value not in ("true", "false"):
            raise SceneError(f"{found.place}: {name} = {shown(value)} of {self.owner}; write true or false")
        return value == "true"

    def array(self, name: str, size: int, *kinds: str) -> Floats | None:
        """All values of a parameter as (n, size); None if it is not there. Raises ``SceneError`` for a rest."""
        found = self.get(name, *kinds)
        if found is None:
            return None
        if len(found.numbers) % size:
            raise SceneError(f"{found.place}: {name!r} has {len(found.numbers)} numbers; they come in groups of {size}")
        return found.numbers.reshape(-1, size)

    def vector(self, name: str, default: tuple[float, float, float]) -> Floats:
        """One point or vector, (3,)."""
        found = self.array(name, 3, "point3", "vector3", "normal")
        return np.array(default, float) if found is None else found[0]

    def ignore(self, *names: str) -> None:
        """Take parameters that change no picture."""
        self._taken.update(names)

    def leftovers(self) -> Iterator[Parameter]:
        """What nobody has taken."""
        return (item for name, item in self.items.items() if name not in self._taken)
