"""
The catalog: every value an axis can take, with its parameters, defaults, units and rounding rules.

The command line, the grid file, the REST interface and the docs all read this one list, and it turns what
people type (``stratified:jitter=false``, ``random``) into a fully resolved ``Choice``. It names Mitsuba's
plugins but never imports them, so checking a grid takes no renderer. Samplers and integrators have files of their own.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache, lru_cache
from typing import Any

from renderer.catalog_integrators import INTEGRATORS, MAX_DEPTH
from renderer.catalog_samplers import IGNORE_SPP, IGNORED_SPP, MITSUBA, SAMPLERS
from renderer.catalog_types import Entry, Parameter, to_text
from renderer.errors import BadParameter, DartboardError, UnknownName, shown
from renderer.spec import Choice

__all__ = ["MAX_DEPTH", "Entry", "Parameter"]

MAX_SPP = 10**7  # more is refused: a typo, not an experiment
COLOURS = ("rgb", "spectral")
POINTS = "points"  # a parameter that nobody writes: the digest of a point file, put into a choice when the file is read


_ENTRIES = (
    *SAMPLERS,
    *INTEGRATORS,
    Entry("rfilter", "box", "a pixel is the mean of its own area: pixels stay independent", MITSUBA, "box"),
    Entry("rfilter", "tent", "linear falloff", MITSUBA, "tent",
          parameters=(Parameter("radius", float, 1.0, "support", "pixels", 0.5, 16),)),
    Entry("rfilter", "gaussian", "truncated Gaussian, Mitsuba's own default", MITSUBA, "gaussian",
          parameters=(Parameter("stddev", float, 0.5, "standard deviation", "pixels", 0.1, 4),)),
    Entry("rfilter", "mitchell", "Mitchell and Netravali's cubic", MITSUBA, "mitchell",
          parameters=(Parameter("B", float, 1 / 3, "parameter B of the paper", "", 0, 1),
                      Parameter("C", float, 1 / 3, "parameter C of the paper", "", 0, 1))),
    Entry("rfilter", "catmullrom", "Catmull-Rom cubic", MITSUBA, "catmullrom"),
    Entry("rfilter", "lanczos", "windowed sinc", MITSUBA, "lanczos",
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
    for key, parameter in known.items():
        if parameter.required and key not in given:
            raise BadParameter(f"{place} needs {key}, {parameter.line}; write {entry.name}:{key}=…")
    resolved = {
        key: item for key, item in values.items()
        if item is not None and not (known[key].late and item == known[key].default)
    }  # fmt: skip
    entry.check(resolved, place)
    return Choice(entry.name, entry.version, tuple(sorted(resolved.items())))


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
    told = [
        f"{key}={to_text(value)}" for key, value in choice.parameters if key != POINTS and value != defaults.get(key)
    ]
    return choice.name + (":" + ",".join(told) if told else "")


@lru_cache(maxsize=4096)
def mistake(sampler: Choice | str) -> str | None:
    """
    What a *replay* gets wrong on purpose, in words; None for a sampler that means to be right.

    ``sampler`` is a choice or its label; of a label that this version does not know nothing is said.
    """
    try:
        choice = resolve("sampler", sampler) if isinstance(sampler, str) else sampler
        parameters = find("sampler", choice.name).parameters
    except DartboardError:
        return None
    values = dict(choice.parameters)
    shown_by = (item for item in parameters if values.get(item.name) in item.replays)
    return next((item.meaning(values[item.name]) for item in shown_by), None)


def is_replay(sampler: Choice | str) -> bool:
    """Whether a sampler (a choice or its label) shows a published mistake: labelled, plotted at the spp asked."""
    return mistake(sampler) is not None


def rendered_spp(sampler: Choice, asked: int, where: str = "spp") -> int:
    """
    What the sampler makes of a request, by its rounding rule. Raises ``BadParameter`` outside 1 … MAX_SPP, and for
    more points than the sampler has, or has room for.
    """
    if isinstance(asked, bool) or not isinstance(asked, int) or not 1 <= asked <= MAX_SPP:
        raise BadParameter(f"{where}: {shown(asked)} samples per pixel; give an integer from 1 to {MAX_SPP}")
    entry, values = find("sampler", sampler.name), dict(sampler.parameters)
    rendered = IGNORED_SPP if values.get("replay") == IGNORE_SPP else entry.rounds(asked)
    if entry.limit is not None and rendered > entry.limit:
        raise BadParameter(
            f"{where}: {entry.name} has at most {entry.limit} points for a pixel, and {asked} were asked; ask for "
            "fewer, or take sobol, which has as many as you like"
        )
    if rendered > MAX_SPP:
        raise BadParameter(
            f"{where}: {sampler.name} rounds {asked} samples per pixel up to {rendered}, more than {MAX_SPP}; "
            "ask for less"
        )
    entry.check_spp(values, rendered, where)
    return rendered


def check_depth(integrator: Choice, max_depth: int, where: str) -> None:
    """Raises ``BadParameter`` for a max_depth that this integrator does not take."""
    deepest = find("integrator", integrator.name).deepest
    if deepest is not None and not 1 <= max_depth <= deepest:
        raise BadParameter(
            f"{integrator.name} takes a max_depth from 1 to {deepest}, and {where} has {max_depth}; "
            "set max_depth there, or take path, which goes as deep as you like"
        )


def strategy(integrator: Choice) -> str:
    """``Estimand.strategy`` of an integrator that draws one strategy alone; empty for all others."""
    values = dict(integrator.parameters)
    pair = str(values.get("debug_strategy", ""))
    return pair + " alone" * (pair != "" and not values["debug_weighted"])


def as_json() -> dict[str, list[dict[str, Any]]]:
    """The catalog, with scenes and metrics, as plain values for ``catalog --json``, the REST interface and the docs."""
    from renderer.metrics import METRICS
    from renderer.scenes.builtin import BUILTIN

    def parameter(item: Parameter) -> dict[str, Any]:
        return {
            "name": item.name, "type": item.kind.__name__, "default": item.default, "unit": item.unit,
            "minimum": item.minimum, "maximum": item.maximum, "line": item.line, "options": list(item.options),
            "meanings": list(item.meanings), "replays": list(item.replays), "required": item.required,
            "unset": item.unset if item.default is None else "",
        }  # fmt: skip

    out: dict[str, list[dict[str, Any]]] = {}
    for entry in _ENTRIES:
        row: dict[str, Any] = {
            "name": entry.name, "line": entry.line, "source": entry.source, "version": entry.version,
            "aliases": list(entry.aliases), "parameters": [parameter(item) for item in entry.parameters],
        }  # fmt: skip
        if entry.axis == "sampler":
            row |= {"rounding": entry.rounding, "limit": entry.limit}
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
            "reference": dict(scene.reference),
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
