"""
What the catalog is made of: an ``Entry`` is one value of an axis, a ``Parameter`` one of its settings.

Parameters read what people type, as TOML, as JSON or as text after ``=``; whatever is not allowed is told with what is.
The entries themselves stand in ``catalog_samplers.py`` and ``catalog.py``. No Mitsuba here.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass

from renderer.errors import BadParameter, shown
from renderer.spec import Scalar

Values = Mapping[str, Scalar]  # the parameters of a choice by name


@dataclass(frozen=True)
class Parameter:
    """
    One parameter of a plugin. ``default`` None means: not set; ``unset`` says what that comes to.

    banned    values inside the range that make no experiment
    estimand  True if the parameter changes the expected picture; it then belongs to the cell's estimand
    options   of a text: the values that it may have; empty for any text
    meanings  a line for each option
    replays   options that show a published mistake: with one of them a sampler is a *replay*, and never recommended
    required  True if nothing can be done without it
    reader    for values of a form of their own: the text they come to, None for what is not allowed
    form      what a reader allows, in words
    unset     what a default of None comes to, in a few words
    late      its default is left out of a choice: it came later, and what was drawn before keeps its digest
    """

    name: str
    kind: type[bool] | type[int] | type[float] | type[str]
    default: Scalar | None
    line: str
    unit: str = ""
    minimum: float | None = None
    maximum: float | None = None
    banned: tuple[Scalar, ...] = ()
    estimand: bool = False
    options: tuple[str, ...] = ()
    meanings: tuple[str, ...] = ()
    replays: tuple[str, ...] = ()
    required: bool = False
    unset: str = "as the scene"
    reader: Callable[[object], str | None] | None = None
    form: str = ""
    late: bool = False

    def read(self, value: object, where: str) -> Scalar:
        """``value`` (as TOML, JSON or text after ``=``) as this parameter's type; ``BadParameter`` otherwise."""
        read: Scalar | None = None
        if isinstance(value, str) and self.kind is not str:
            value = _from_text(value)
        if self.reader:
            read = self.reader(value)
        elif self.kind is bool:
            read = value if isinstance(value, bool) else None
        elif self.kind is int and not isinstance(value, bool):
            read = int(value) if isinstance(value, (int, float)) and value == value // 1 else None
        elif self.kind is float and not isinstance(value, bool):
            read = _finite(value) if isinstance(value, (int, float)) else None
        elif self.kind is str and isinstance(value, str):
            read = value if value in self.options or not self.options else None
        number = isinstance(read, (int, float)) and not isinstance(read, bool)
        low = number and self.minimum is not None and read < self.minimum  # type: ignore[operator]
        high = number and self.maximum is not None and read > self.maximum  # type: ignore[operator]
        if read is None or low or high or read in self.banned:
            raise BadParameter(f"{self.name} = {shown(value)} of {where} is not allowed; it is {self.allowed}")
        return read

    @property
    def allowed(self) -> str:
        """The range in words: ``an integer from 1 to 64``."""
        if self.form:
            return self.form
        if self.options:
            return f"one of {', '.join(filter(None, self.options))}{', or left out' * ('' in self.options)}"
        words = {bool: "true or false", int: "an integer", float: "a number", str: "a text"}[self.kind]
        if self.minimum is not None:
            words += f" {'of at least' if self.maximum is None else 'from'} {to_text(self.minimum)}"
        if self.maximum is not None:
            words += f" to {to_text(self.maximum)}"
        return words + "".join(f", not {value}" for value in self.banned)

    def meaning(self, option: Scalar | None) -> str:
        """The line of an option; empty where there is none."""
        return dict(zip(self.options, self.meanings, strict=False)).get(str(option), "")


def _anything(values: Values, where: str) -> None:
    """Of entries whose parameters always go together."""


def _any_spp(values: Values, spp: int, where: str) -> None:
    """Of samplers that take any spp with any parameters."""


@dataclass(frozen=True)
class Entry:
    """
    One value of an axis.

    plugin     Mitsuba's name for it
    version    raised when its pictures change: part of every digest
    rounds     samplers only: asked spp → rendered spp
    limit      samplers only: the most samples per pixel that it has; None for no limit of its own
    check      raises ``BadParameter`` for parameters that do not go together; told them and their place
    check_spp  samplers only: the same for parameters and the spp that is rendered
    depth      integrators only: the max_depth it always renders, None where it takes any
    deepest    integrators only: the largest max_depth that it takes, None where it takes any and none
    cost       integrators only: time of a sample, in those of path; for estimates before anything was timed
    """

    axis: str
    name: str
    line: str
    source: str
    plugin: str
    version: int = 1
    parameters: tuple[Parameter, ...] = ()
    aliases: tuple[str, ...] = ()
    rounds: Callable[[int], int] = lambda spp: spp
    rounding: str = "every spp"
    limit: int | None = None
    check: Callable[[Values, str], None] = _anything
    check_spp: Callable[[Values, int, str], None] = _any_spp
    depth: int | None = None
    deepest: int | None = None
    cost: float = 1.0


def _finite(value: float) -> float | None:
    """``value`` as a float, None where it is not finite or too large for one."""
    try:
        return float(value) if math.isfinite(value) else None
    except OverflowError:
        return None


def _from_text(text: str) -> Scalar:
    """The number or truth value that ``key=text`` means; the text itself where it is neither."""
    words: dict[str, Scalar] = {"true": True, "false": False}
    if text.lower() in words:
        return words[text.lower()]
    for read in (int, float):
        try:
            return read(text)
        except ValueError:
            continue
    return text


def to_text(value: Scalar) -> str:
    """The spelling that ``read`` reads back: true, 10, 0.5."""
    if isinstance(value, bool):
        return "true" if value else "false"
    return f"{int(value)}" if isinstance(value, float) and value.is_integer() else f"{value}"
