"""
The catalog: every value an axis can take, with its parameters, defaults, units and rounding rules.

The command line, the grid file, the REST interface and the docs all read this one list, and it turns what
people type (``stratified:jitter=false``, ``random``) into a fully resolved ``Choice``. It names Mitsuba's
plugins but never imports them, so checking a grid takes no renderer.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cache
from typing import Any

from renderer.errors import BadParameter, DartboardError, UnknownName, shown
from renderer.spec import Choice, Scalar

MAX_SPP = 10**7  # more is refused: a typo, not an experiment
MAX_DEPTH = 10**6  # edges; fits Mitsuba's 32-bit integers, and no light survives as many
COLOURS = ("rgb", "spectral")


@dataclass(frozen=True)
class Parameter:
    """
    One parameter of a plugin. ``default`` None means: taken from the grid or the scene, not from here.

    banned    values inside the range that make no experiment
    estimand  True if the parameter changes the expected picture; it then belongs to the cell's estimand
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

    def read(self, value: object, where: str) -> Scalar:
        """``value`` (as TOML, JSON or text after ``=``) as this parameter's type; ``BadParameter`` otherwise."""
        read: Scalar | None = None
        if isinstance(value, str) and self.kind is not str:
            value = _from_text(value)
        if self.kind is bool:
            read = value if isinstance(value, bool) else None
        elif self.kind is int and not isinstance(value, bool):
            read = int(value) if isinstance(value, (int, float)) and value == value // 1 else None
        elif self.kind is float and not isinstance(value, bool):
            read = _finite(value) if isinstance(value, (int, float)) else None
        elif self.kind is str and isinstance(value, str):
            read = value
        number = isinstance(read, (int, float)) and not isinstance(read, bool)
        low = number and self.minimum is not None and read < self.minimum  # type: ignore[operator]
        high = number and self.maximum is not None and read > self.maximum  # type: ignore[operator]
        if read is None or low or high or read in self.banned:
            raise BadParameter(f"{self.name} = {shown(value)} of {where} is not allowed; it is {self.allowed}")
        return read

    @property
    def allowed(self) -> str:
        """The range in words: ``an integer from 1 to 64``."""
        words = {bool: "true or false", int: "an integer", float: "a number", str: "a text"}[self.kind]
        if self.minimum is not None:
            words += f" {'of at least' if self.maximum is None else 'from'} {_to_text(self.minimum)}"
        if self.maximum is not None:
            words += f" to {_to_text(self.maximum)}"
        return words + "".join(f", not {value}" for value in self.banned)


@dataclass(frozen=True)
class Entry:
    """
    One value of an axis.

    plugin   Mitsuba's name for it
    version  raised when its pictures change: part of every digest
    rounds   samplers only: asked spp → rendered spp
    depth    integrators only: the max_depth it always renders, None where it takes any
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
    depth: int | None = None


def _square(spp: int) -> int:
    """Stratified: strata on an n×n grid, so the next square."""
    return (math.isqrt(spp - 1) + 1) ** 2


def _near_square(spp: int) -> int:
    """Multijitter: a grid of ⌊√spp⌋ columns and as many rows as it takes."""
    columns = math.isqrt(spp)
    return columns * -(-spp // columns)


def _prime_square(spp: int) -> int:
    """Orthogonal (Bose's arrays): the square of a prime, at least 4."""
    side = max(2, math.isqrt(spp - 1) + 1)
    while any(side % divisor == 0 for divisor in range(2, math.isqrt(side) + 1)):
        side += 1
    return side * side


def _power_of_four(spp: int) -> int:
    """(0,2)-nets of Kollig and Keller: a power of four, at least 4."""
    power = 4
    while power < spp:
        power *= 4
    return power


_JITTER = Parameter("jitter", bool, True, "random position in a stratum; false takes its centre, which is biased")
_DEPTH = Parameter("max_depth", int, None, "edges of the longest path; -1 is unlimited", "edges", -1, MAX_DEPTH,
                   banned=(0,), estimand=True)  # fmt: skip
_HIDE = Parameter("hide_emitters", bool, False, "lamps are not seen directly", estimand=True)
_MITSUBA = "Mitsuba 3.9"

_ENTRIES = (
    Entry("sampler", "independent", "plain random numbers (PCG32): the baseline", _MITSUBA, "independent",
          aliases=("random",)),
    Entry("sampler", "stratified", "one jittered point per cell of a square grid", _MITSUBA, "stratified",
          parameters=(_JITTER,), rounds=_square, rounding="up to a square"),
    Entry("sampler", "multijitter", "correlated multi-jittered points (Kensler 2013)", _MITSUBA, "multijitter",
          parameters=(_JITTER,), rounds=_near_square, rounding="up to a near-square grid"),
    Entry("sampler", "orthogonal", "orthogonal arrays of strength 2 (Jarosz et al. 2019)", _MITSUBA, "orthogonal",
          parameters=(_JITTER,), rounds=_prime_square, rounding="up to the square of a prime"),
    Entry("sampler", "ldsampler", "one (0,2)-net per pixel, permuted per dimension (Kollig and Keller 2002)", _MITSUBA,
          "ldsampler", rounds=_power_of_four, rounding="up to a power of four"),
    Entry("integrator", "path", "path tracing with next-event estimation and multiple importance sampling", _MITSUBA,
          "path", parameters=(_DEPTH, _HIDE,
                              Parameter("rr_depth", int, 5, "edges before Russian roulette", "edges", 1, MAX_DEPTH))),
    Entry("integrator", "direct", "direct light only: paths of at most two edges", _MITSUBA, "direct", depth=2,
          parameters=(_HIDE, Parameter("emitter_samples", int, 1, "light samples per camera ray", "", 1, 1024),
                      Parameter("bsdf_samples", int, 1, "BSDF samples per camera ray", "", 1, 1024))),
    Entry("rfilter", "box", "a pixel is the mean of its own area: pixels stay independent", _MITSUBA, "box"),
    Entry("rfilter", "tent", "linear falloff", _MITSUBA, "tent",
          parameters=(Parameter("radius", float, 1.0, "support", "pixels", 0.5, 16),)),
    Entry("rfilter", "gaussian", "truncated Gaussian, Mitsuba's own default", _MITSUBA, "gaussian",
          parameters=(Parameter("stddev", float, 0.5, "standard deviation", "pixels", 0.1, 4),)),
    Entry("rfilter", "mitchell", "Mitchell and Netravali's cubic", _MITSUBA, "mitchell",
          parameters=(Parameter("B", float, 1 / 3, "parameter B of the paper", "", 0, 1),
                      Parameter("C", float, 1 / 3, "parameter C of the paper", "", 0, 1))),
    Entry("rfilter", "catmullrom", "Catmull-Rom cubic", _MITSUBA, "catmullrom"),
    Entry("rfilter", "lanczos", "windowed sinc", _MITSUBA, "lanczos",
          parameters=(Parameter("lobes", int, 3, "lobes of the sinc", "", 1, 16),)),
)  # fmt: skip


@cache
def entries(axis: str) -> Mapping[str, Entry]:
    """Every entry of an axis ("sampler", "integrator" or "rfilter") by name, aliases left out."""
    return {entry.name: entry for entry in _ENTRIES if entry.axis == axis}


def resolve(axis: str, value: str | Mapping[str, Any], where: str = "") -> Choice:
    """
    An axis value as people write it → a ``Choice`` with every parameter resolved.

    ``value`` is ``"NAME"``, ``"NAME:key=value,key=value"`` or a table ``{type = "NAME", key = value}``;
    ``where`` is put into errors. Raises ``UnknownName`` for a name or key the catalog does not know and
    ``BadParameter`` for a value out of range.
    """
    name, given = _split(axis, value, where)
    entry = find(axis, name, where)
    known = {parameter.name: parameter for parameter in entry.parameters}
    for key in given:
        if key not in known:
            raise UnknownName(f"parameter of {axis} {entry.name!r}:", key, where, known)
    place = f"{axis} {entry.name!r}" + (f" in {where}" if where else "")
    values = {
        key: parameter.read(given[key], place) if key in given else parameter.default
        for key, parameter in known.items()
    }
    pairs = tuple(sorted((key, item) for key, item in values.items() if item is not None))
    return Choice(entry.name, entry.version, pairs)


def find(axis: str, name: str, where: str = "") -> Entry:
    """The entry of that name or alias; raises ``UnknownName`` with what is known."""
    table = entries(axis)
    for entry in table.values():
        if name == entry.name or name in entry.aliases:
            return entry
    raise UnknownName(axis, name, where or f"axis {axis!r}", table)


def label(axis: str, choice: Choice) -> str:
    """The canonical short form, ``NAME:key=value``, with only the parameters that are not the default."""
    defaults = {parameter.name: parameter.default for parameter in find(axis, choice.name).parameters}
    told = [f"{key}={_to_text(value)}" for key, value in choice.parameters if value != defaults.get(key)]
    return choice.name + (":" + ",".join(told) if told else "")


def rendered_spp(sampler: Choice, asked: int, where: str = "spp") -> int:
    """What the sampler makes of a request, by its rounding rule. Raises ``BadParameter`` outside 1 … MAX_SPP."""
    if isinstance(asked, bool) or not isinstance(asked, int) or not 1 <= asked <= MAX_SPP:
        raise BadParameter(f"{where}: {shown(asked)} samples per pixel; give an integer from 1 to {MAX_SPP}")
    rendered = find("sampler", sampler.name).rounds(asked)
    if rendered > MAX_SPP:
        raise BadParameter(
            f"{where}: {sampler.name} rounds {asked} samples per pixel up to {rendered}, more than {MAX_SPP}; "
            "ask for less"
        )
    return rendered


def as_json() -> dict[str, list[dict[str, Any]]]:
    """The catalog, with scenes and metrics, as plain values for ``catalog --json``, the REST interface and the docs."""
    from renderer.metrics import METRICS
    from renderer.scenes.builtin import BUILTIN

    def parameter(item: Parameter) -> dict[str, Any]:
        return {
            "name": item.name, "type": item.kind.__name__, "default": item.default, "unit": item.unit,
            "minimum": item.minimum, "maximum": item.maximum, "line": item.line,
        }  # fmt: skip

    out: dict[str, list[dict[str, Any]]] = {}
    for entry in _ENTRIES:
        row: dict[str, Any] = {
            "name": entry.name, "line": entry.line, "source": entry.source, "version": entry.version,
            "aliases": list(entry.aliases), "parameters": [parameter(item) for item in entry.parameters],
        }  # fmt: skip
        if entry.axis == "sampler":
            row["rounding"] = entry.rounding
        out.setdefault(entry.axis + "s", []).append(row)
    out["scenes"] = [
        {
            "name": scene.name,
            "line": scene.summary,
            "source": scene.source,
            "title": scene.title,
            "good_for": scene.good_for,
            "hard_part": scene.hard_part,
            "bad_for": scene.bad_for,
            "lamp_in_frame": scene.lamp_in_frame,
        }
        for scene in BUILTIN.values()
    ]
    out["metrics"] = [
        {
            "name": metric.name,
            "line": metric.line,
            "formula": metric.formula,
            "epsilon": metric.epsilon,
            "version": metric.version,
            "lower_is_better": metric.lower_is_better,
            "needs_halves": metric.needs_halves,
        }
        for metric in METRICS.values()
    ]
    return out


def _split(axis: str, value: object, where: str) -> tuple[str, dict[str, Any]]:
    """Name and given parameters of an axis value in any of its spellings."""
    place = where or f"axis {axis!r}"
    if isinstance(value, str):
        name, _, rest = value.partition(":")
        pairs = [part.partition("=") for part in rest.split(",")] if rest else []
        for key, sign, _ in pairs:
            if not key or not sign:
                raise DartboardError(f"cannot read {shown(value)} in {place}; write NAME or NAME:key=value,key=value")
        return name.strip(), {key.strip(): text.strip() for key, _, text in pairs}
    if isinstance(value, Mapping) and isinstance(value.get("type"), str):
        return value["type"], {str(key): item for key, item in value.items() if key != "type"}
    raise DartboardError(f"cannot read {shown(value)} in {place}; write NAME or a table {{ type = NAME, key = value }}")


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


def _to_text(value: Scalar) -> str:
    """The spelling that ``_from_text`` reads back: true, 10, 0.5."""
    if isinstance(value, bool):
        return "true" if value else "false"
    return f"{int(value)}" if isinstance(value, float) and value.is_integer() else f"{value}"
