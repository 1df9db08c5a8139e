"""
The parameters of a scene that a sweep may set, and what a name for one means.

Mitsuba names everything in a loaded scene by the way to it: ``sphere.bsdf.brdf_0.nu.value``. People write what they
mean, ``sphere.bsdf.nu``: the object, then the parameter, with what lies between left out where one parameter fits.
The owner of a data directory knows the names of a scene from a child process (``renderer.sweep``). No Mitsuba here.
"""

from __future__ import annotations

import difflib
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any, Literal

from renderer.errors import BadParameter, shown

Value = float | tuple[float, float, float]  # a number, or a linear RGB colour
Kind = Literal["number", "colour", "other"]

MAX_TOLD = 12  # names in one sentence; a scene may have thousands
MAX_MAGNITUDE = 1e30  # far from the end of float32: a number beyond it is a slip


@dataclass(frozen=True)
class Parameter:
    """
    One parameter of a loaded scene.

    key   Mitsuba's name of it, as ``mi.traverse`` gives it
    kind  "number"; "colour", linear RGB; "other" is what a sweep cannot set (a transform, a mesh, a bitmap)
    now   what the scene file says; None where that is no number and no colour
    """

    key: str
    kind: Kind
    now: Value | None = None

    @property
    def short(self) -> str:
        """The key without Mitsuba's last word for the number inside a texture."""
        return self.key.removesuffix(".value")

    @property
    def bounded(self) -> bool:
        """Whether it is a reflectance, which Mitsuba accepts from 0 to 1 only when it reads a file."""
        return "reflectance" in self.short.rpartition(".")[2]


def as_value(data: Any) -> Value | None:
    """
    A swept value from TOML or JSON: a finite number or a list of three; None for anything else.

    10.0 becomes 10 and -0.0 becomes 0: one value has one spelling.
    """
    if isinstance(data, (list, tuple)):
        numbers = [_number(item) for item in data]
        red, green, blue = numbers if len(numbers) == 3 else (None, None, None)
        return None if red is None or green is None or blue is None else (red, green, blue)
    return _number(data)


def find(name: str, known: Mapping[str, Parameter]) -> Parameter:
    """
    The parameter that ``name`` means among those of a scene, by key: its key, the key without ``.value``, or the only
    number or colour whose key begins and ends with the words of the name and has them all in order.

    Raises ``BadParameter`` for a name that means none, several, or what a sweep cannot set.
    """
    exact = known.get(name) or known.get(f"{name}.value")
    if exact is not None and exact.kind != "other":
        return exact
    if exact is not None:
        raise BadParameter(
            f"{shown(name)} is neither a number nor a colour, so it cannot be swept; {_offer(name, known)}"
        )
    fitting = [parameter for parameter in known.values() if parameter.kind != "other" and _fits(name, parameter)]
    if len(fitting) == 1:
        return fitting[0]
    if fitting:
        told = ", ".join(parameter.short for parameter in fitting[:MAX_TOLD])
        raise BadParameter(f"the parameter {shown(name)} may mean {told}; write one of these names")
    raise BadParameter(f"there is no parameter {shown(name)}{_hint(name, known)}; {_offer(name, known)}")


def check_value(parameter: Parameter, value: Value) -> None:
    """Raises ``BadParameter`` for a value that the parameter cannot have."""
    if parameter.kind == "number" and isinstance(value, tuple):
        raise BadParameter(f"{list(value)} is a colour, but {parameter.short} is one number; give a number")
    if parameter.kind == "colour":
        channels = value if isinstance(value, tuple) else (value,)
        if min(channels) < 0 or (parameter.bounded and max(channels) > 1):
            allowed = "0 to 1" if parameter.bounded else "0 or more"
            shown_value = list(value) if isinstance(value, tuple) else value
            raise BadParameter(f"{shown_value} is outside what {parameter.short} allows; give {allowed}")


def assign(sweep: Iterable[tuple[str, Value]], known: Mapping[str, Parameter]) -> dict[str, tuple[Parameter, Value]]:
    """
    What a sweep sets in a scene: key → (parameter, value).

    Raises ``BadParameter`` as ``find`` and ``check_value`` do, and for two names of one parameter.
    """
    found: dict[str, tuple[Parameter, Value]] = {}
    names: dict[str, str] = {}
    for name, value in sweep:
        parameter = find(name, known)
        if (other := names.setdefault(parameter.key, name)) != name:
            raise BadParameter(f"{shown(other)} and {shown(name)} are one parameter, {parameter.key}; leave one out")
        check_value(parameter, value)
        found[parameter.key] = (parameter, value)
    return found


def told(sweep: Mapping[str, Any] | Iterable[tuple[str, Any]]) -> list[str]:
    """``["sphere.bsdf.nu = 10", …]``: what is set, as people read it, also where a value came back from JSON."""
    pairs = sweep.items() if isinstance(sweep, Mapping) else sweep
    return [f"{name} = {list(value) if isinstance(value, tuple) else value}" for name, value in pairs]


def _fits(name: str, parameter: Parameter) -> bool:
    words, key = name.split("."), parameter.short.split(".")
    if len(words) < 2 or words[0] != key[0] or words[-1] != key[-1]:
        return False
    left = iter(key)
    return all(word in left for word in words)  # in order: each search goes on where the last one ended


def _hint(name: str, known: Mapping[str, Parameter]) -> str:
    names = [parameter.short for parameter in known.values() if parameter.kind != "other"]
    close = difflib.get_close_matches(name[:200], names, n=1, cutoff=0.75)
    return f" (did you mean {close[0]!r}?)" if close else ""


def _offer(name: str, known: Mapping[str, Parameter]) -> str:
    """What could have been meant: the parameters of the same object, else the closest names, else the first ones."""
    names = [parameter.short for parameter in known.values() if parameter.kind != "other"]
    beginning = name.split(".")[0] + "."
    same = [item for item in names if item.startswith(beginning)]
    offered = same or difflib.get_close_matches(name[:200], names, n=MAX_TOLD, cutoff=0.5) or names
    if not offered:
        return "the scene has no number or colour with a name"
    more = f", … ({len(offered) - MAX_TOLD} more)" if len(offered) > MAX_TOLD else ""
    return f"{'its object has' if same else 'the scene has'} {', '.join(offered[:MAX_TOLD])}{more}"


def _number(value: Any) -> float | None:
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        return None
    if not abs(value) <= MAX_MAGNITUDE:  # NaN neither
        return None
    return int(value) if float(value).is_integer() else value
