"""What a conversion replaced or ignored: each thing once, by line; and what it could not do without."""

from __future__ import annotations

from renderer.errors import SceneError
from renderer.scenes.pbrt.lexer import Place
from renderer.scenes.pbrt.parameters import Parameters

NOTES_MAX = 200  # a hostile file has millions
ERRORS_SHOWN = 3


class Report:
    """
    notes    sentences "FILE, line N: …" about what is not as in the file: a material replaced, a parameter ignored
    missing  the same about what cannot be left out: geometry, lights, cameras
    """

    def __init__(self) -> None:
        self.notes: list[str] = []
        self.missing: list[str] = []
        self._said: set[str] = set()
        self._more = 0

    def note(self, place: Place, text: str, *, once: str = "") -> None:
        """A warning. Where ``once`` is given, only the first of that key is kept: the rest repeats it."""
        key = once or f"{place}: {text}"
        if key in self._said:
            return
        self._said.add(key)
        if len(self.notes) < NOTES_MAX:
            self.notes.append(f"{place}: {text}")
        else:
            self._more += 1

    def unknown(self, given: Parameters) -> None:
        """One warning for each parameter that nobody took."""
        for item in given.leftovers():
            self.note(item.place, f'"{item.kind} {item.name}" is no parameter of {given.owner} here; it is ignored')

    def lacks(self, place: Place, text: str) -> None:
        """An error; all are told together at the end (``check``)."""
        self.missing.append(f"{place}: {text}")

    def check(self) -> None:
        """Raises ``SceneError`` if anything is missing; closes the notes otherwise."""
        if self.missing:
            more = len(self.missing) - ERRORS_SHOWN
            rest = f"; and {more} more" if more > 0 else ""
            raise SceneError("; ".join(self.missing[:ERRORS_SHOWN]) + rest)
        if self._more:
            self.notes.append(f"and {self._more} more")
            self._more = 0
