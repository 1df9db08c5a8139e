"""
Setting parameters of a loaded scene: what a sweep does between two cells.

A scene is loaded once and serves every cell of a sweep. Before a cell, *every* parameter that was ever set in it gets
its value again, or what the file says where the cell has none: no cell's setting leaks into the next. Values are
memory, not code, so that all cells of a sweep run the same kernels.

``python -m renderer.sweep VARIANT FOLDER MAIN`` loads a scene and prints its parameters as JSON, or why there are none:
the owner of a data directory never loads a scene itself.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import drjit as dr
import mitsuba as mi

from renderer.errors import BadParameter, DartboardError
from renderer.parameters import Kind, Parameter, Value, assign, told

LIST_SIZE = 16  # pixels: nothing is rendered to list parameters
DIGITS = 6  # of a float32
NO_PICTURE = ("silhouette_sampling_weight",)  # what is there for derivatives alone


class Settings:
    """The parameters of one loaded scene, and what was set in it. Raises nothing by itself."""

    def __init__(self, scene: Any):
        self.scene = scene
        self.traversed: Any = None  # mi.SceneParameters, once something is swept: it visits the whole scene
        self.known: dict[str, Parameter] = {}
        self.original: dict[str, Any] = {}  # key → what the file says, of all that was ever set
        self.current: tuple[tuple[str, Value], ...] = ()

    def parameters(self) -> dict[str, Parameter]:
        """Every parameter of the scene by its key."""
        if self.traversed is None:
            self.traversed = mi.traverse(self.scene)
            self.known = {key: _parameter(key, self.traversed[key]) for key in self.traversed.keys()}  # noqa: SIM118
        return self.known

    def apply(self, sweep: Sequence[tuple[str, Value]]) -> None:
        """
        Make the scene that of a cell whose estimand has this ``sweep``.

        Raises ``BadParameter`` for a name or value that the scene does not take; it is then as its file says.
        """
        sweep = tuple(sweep)
        if sweep == self.current:
            return
        wanted = {
            key: self._typed(parameter, value) for key, (parameter, value) in assign(sweep, self.parameters()).items()
        }
        for key in wanted:
            if key not in self.original:
                now = self.traversed[key]
                self.original[key] = type(now)(now)  # setting writes into the object that is there
        self.current = ()
        try:
            self._write({**self.original, **wanted})
        except Exception as error:  # whatever a plugin says to a value
            self._write(self.original)
            if isinstance(error, DartboardError):
                raise
            reason = str(error).strip() or type(error).__name__
            raise BadParameter(f"the scene does not take {', '.join(told(sweep))}: {reason}") from None
        self.current = sweep

    def _write(self, values: dict[str, Any]) -> None:
        for key, value in values.items():
            self.traversed[key] = value
        self.traversed.update()

    def _typed(self, parameter: Parameter, value: Value) -> Any:
        """A value as Mitsuba holds it; opaque, so that it becomes no constant of a kernel."""
        if type(self.traversed[parameter.key]) is float:
            return value
        if parameter.kind == "number":
            return dr.opaque(mi.Float, value)
        channels = value if isinstance(value, tuple) else (value,) * 3
        colour = mi.Color3f(self._coefficients(parameter, channels) if mi.is_spectral else channels)
        dr.make_opaque(colour)
        return colour

    def _coefficients(self, parameter: Parameter, channels: tuple[float, float, float]) -> Any:
        """The spectrum of a reflectance as the loader would make it of an rgb value, by its three coefficients."""
        owner = self.traversed.properties[parameter.key][2].class_name()
        if owner != "SRGBReflectanceSpectrum":
            raise BadParameter(
                f'{parameter.short} is no reflectance: in colour = "spectral" a lamp\'s colour cannot be swept; '
                'sweep it in colour = "rgb", or write one scene file for each colour'
            )
        return mi.srgb_model_fetch(mi.ScalarColor3f(channels))


def _parameter(key: str, now: Any) -> Parameter:
    kind: Kind = "other"
    value: Value | None = None
    if key.endswith(NO_PICTURE):
        return Parameter(key, kind)
    if type(now) is float or (isinstance(now, mi.Float) and len(now) == 1):
        kind, value = "number", _rounded(now if isinstance(now, float) else now[0])
    elif isinstance(now, mi.Color3f) and len(now[0]) == 1:
        kind = "colour"
        if not mi.is_spectral:  # there it is the coefficients of a spectrum
            value = (_rounded(now[0][0]), _rounded(now[1][0]), _rounded(now[2][0]))
    return Parameter(key, kind, value)


def _rounded(value: Any) -> float:
    return float(f"{float(value):.{DIGITS}g}")


def main(variant: str, folder: str, file: str) -> int:
    """Print ``{"parameters": [[key, kind, now], …]}`` or ``{"error": …}``."""
    from renderer.scenes.load import load
    from renderer.variant import use

    use(variant, 1)
    answer: dict[str, Any]
    try:
        loaded = load(Path(folder), file, width=LIST_SIZE, height=LIST_SIZE)
        found = Settings(loaded.scene).parameters().values()
        answer = {"parameters": [[parameter.key, parameter.kind, parameter.now] for parameter in found]}
    except DartboardError as error:
        answer = {"error": str(error)}
    print(json.dumps(answer))
    return 0


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
