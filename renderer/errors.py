"""
The sentences that explain what went wrong in the renderer.

Every error a user can cause is a ``DartboardError``: one sentence that names the value, the place, what is
allowed and the way out. ``jobs`` and ``service`` derive their own from it, so a command line or a route
catches one class and prints it, and anything else that escapes is a bug of ours. No Mitsuba here.
"""

from __future__ import annotations

import difflib
import reprlib
from collections.abc import Iterable, Mapping

_SHORT = reprlib.Repr()
_SHORT.maxstring = _SHORT.maxother = _SHORT.maxlong = 60  # characters of a value that a sentence repeats


def shown(value: object) -> str:
    """A value as a sentence repeats it: short, TOML's ``true`` and ``false``, never a failure of its own."""
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, Mapping):
        return "a table"
    try:
        return _SHORT.repr(value)
    except (ValueError, RecursionError):  # Python prints no integer of more than 4300 digits
        return f"a very long {type(value).__name__}"


class DartboardError(Exception):
    """A problem that the user can solve; ``str(error)`` is the whole explanation."""

    exit_code = 2  # bad input, unless a subclass says otherwise (docs/architecture.md, "Exit codes")


class UnknownName(DartboardError):
    """A scene, sampler, integrator or parameter that the catalog does not know."""

    def __init__(self, what: str, value: object, where: str, known: Iterable[str]):
        names = sorted(known)
        close = difflib.get_close_matches(value[:80], names, n=1) if isinstance(value, str) else []
        hint = f"; did you mean {close[0]!r}?" if close else ""
        place = f" in {where}" if where else ""
        super().__init__(f"unknown {what} {shown(value)}{place}; known: {', '.join(names) or 'none'}{hint}")


class BadParameter(DartboardError):
    """A value outside what its parameter allows. Not retried: the same value fails again."""

    error_class = "bad_parameter"


class SceneError(DartboardError):
    """A scene that is missing, unreadable, refused by the vetting, or that Mitsuba cannot load. Not retried."""

    error_class = "scene_error"


class NonFinitePicture(DartboardError):
    """A picture with NaN or infinite pixels: never counted silently into an error."""

    error_class = "nan_output"


class EnvironmentProblem(DartboardError):
    """What the machine lacks: LLVM, a free port, disk space, the data directory's lock."""

    exit_code = 3
