"""
The directives of a pbrt file, one after the other, with those of the files that it includes in their place.

Nothing is interpreted here but ``Include``: a ``Directive`` is a name, its arguments and its parameters, as written.
Files are read only from inside the scene's folder.
"""

from __future__ import annotations

import difflib
import os
import re
import stat
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path, PurePosixPath

import numpy as np

from renderer.errors import SceneError, shown
from renderer.scenes.pbrt.lexer import TEXT_MAX, Place, Token, tokens
from renderer.scenes.pbrt.parameters import ALIASES, TYPES, Parameters, make

INCLUDE_DEPTH_MAX = 15
INCLUDES_MAX = 10_000
DIRECTIVES_MAX = 10**6  # a Mitsuba scene takes fewer elements

# Name → what follows it: a number of numbers, or a number of strings and whether parameters come after them.
NUMERIC = {"LookAt": 9, "Translate": 3, "Scale": 3, "Rotate": 4, "Transform": 16, "ConcatTransform": 16,
           "TransformTimes": 2}  # fmt: skip
BARE = frozenset({"Identity", "ReverseOrientation", "WorldBegin", "WorldEnd", "AttributeBegin", "AttributeEnd",
                  "TransformBegin", "TransformEnd", "ObjectEnd"})  # fmt: skip
NAMED = frozenset({"CoordinateSystem", "CoordSysTransform", "ObjectBegin", "ObjectInstance", "NamedMaterial",
                   "Include", "MediumInterface", "ActiveTransform"})  # fmt: skip
TYPED = frozenset({"Camera", "Film", "PixelFilter", "Sampler", "Integrator", "Accelerator", "Material",
                   "MakeNamedMaterial", "MakeNamedMedium", "Shape", "AreaLightSource", "LightSource",
                   "Texture"})  # fmt: skip
KNOWN = frozenset(NUMERIC) | BARE | NAMED | TYPED
V2 = {"SurfaceIntegrator": "Integrator", "VolumeIntegrator": "Integrator", "Renderer": "Integrator"}


@dataclass(slots=True)
class Directive:
    """
    name        such as "Shape"
    words       its quoted arguments: the type of a shape, or name, type and class of a texture
    numbers     its numbers: those of a transform
    parameters  what follows
    """

    name: str
    words: list[str]
    numbers: list[float]
    parameters: Parameters
    place: Place


class Folder:
    """
    The folder of a scene: all that it may read, and how much text is left to read.

    Paths in a scene are relative to the main file's folder.
    """

    def __init__(self, home: Path):
        self.home = home.resolve()
        self.room = TEXT_MAX

    def locate(self, written: str, place: Place, what: str) -> Path:
        """The file that a scene names, links followed. Raises ``SceneError`` outside the folder or if it is missing."""
        name = written.strip().replace("\\", "/")
        path = PurePosixPath(name)
        if not name or not name.isprintable():
            raise SceneError(f"{place}: {what} {shown(written)} is not a file name")
        if path.is_absolute() or ".." in path.parts or re.match(r"~|[A-Za-z]:", name):
            raise SceneError(
                f"{place}: {what} {shown(written)} leads out of the scene's folder; copy it there and name that"
            )
        try:
            found = (self.home / name).resolve(strict=True)
            kind = found.stat().st_mode
        except (OSError, ValueError, RuntimeError):
            raise SceneError(f"{place}: {what} {shown(written)} does not exist in the scene's folder") from None
        if not found.is_relative_to(self.home):
            raise SceneError(f"{place}: {what} {shown(written)} is a link that leads out of the scene's folder")
        if not stat.S_ISREG(kind):
            raise SceneError(f"{place}: {what} {shown(written)} is not a file")
        if not os.access(found, os.R_OK):
            raise SceneError(f"{place}: {what} {shown(written)} cannot be read; look at its permissions")
        return found

    def text(self, path: Path, name: str) -> bytes:
        """The content of a text file, within what all of them may have together."""
        with path.open("rb") as file:
            data = file.read(self.room + 1)
        if len(data) > self.room:
            most = TEXT_MAX >> 20
            raise SceneError(f"{name}: the scene has more than {most} MiB of pbrt text; put meshes in .ply files")
        self.room -= len(data)
        return data


def directives(folder: Folder, main: str) -> Iterator[Directive]:
    """Every directive of ``main`` and its includes, in order. Raises ``SceneError`` with file and line."""
    path = folder.locate(main, Place(main, 1), "the scene file")
    chain = [path]
    stack = [_Cursor(tokens(folder.text(path, main), main))]
    count = includes = 0
    while stack:
        found = _next(stack[-1])
        if found is None:
            stack.pop()
            chain.pop()
            continue
        count += 1
        if count > DIRECTIVES_MAX:
            raise SceneError(f"{found.place}: the scene has more than {DIRECTIVES_MAX} directives")
        if found.name != "Include":
            yield found
            continue
        path = folder.locate(found.words[0], found.place, "the included file")
        includes += 1
        if path in chain:
            raise SceneError(f"{found.place}: {shown(found.words[0])} includes itself")
        if len(chain) > INCLUDE_DEPTH_MAX:
            raise SceneError(f"{found.place}: includes nest deeper than {INCLUDE_DEPTH_MAX}")
        if includes > INCLUDES_MAX:
            raise SceneError(f"{found.place}: the scene has more than {INCLUDES_MAX} includes")
        name = path.relative_to(folder.home).as_posix()
        chain.append(path)
        stack.append(_Cursor(tokens(folder.text(path, name), name)))


class _Cursor:
    """Tokens with a look at the next one."""

    def __init__(self, source: Iterator[Token]):
        self.source = source
        self.ahead: Token | None = next(source, None)

    def take(self) -> Token | None:
        token = self.ahead
        self.ahead = next(self.source, None)
        return token

    def is_next(self, *kinds: str) -> bool:
        return self.ahead is not None and self.ahead.kind in kinds


def _next(cursor: _Cursor) -> Directive | None:
    token = cursor.take()
    if token is None:
        return None
    if token.kind != "word":
        what = {"string": "a string", "number": "a number"}.get(token.kind, "a list")
        raise SceneError(f"{token.place}: {what} where a directive is expected, such as Shape or Translate")
    name, place = str(token.value), token.place
    if name not in KNOWN:
        if name in V2:
            raise SceneError(f"{place}: {name} is of pbrt-v2; pbrt-v3 files are read, which have {V2[name]}")
        close = difflib.get_close_matches(name, KNOWN, n=1)
        hint = f"did you mean {close[0]}?" if close else "known are those of pbrt-v3"
        raise SceneError(f"{place}: unknown directive {shown(name)}; {hint}")
    made = Directive(name, [], [], Parameters(name, place), place)
    if name in NUMERIC:
        made.numbers = _numbers(cursor, made, NUMERIC[name])
    elif name in NAMED or name in TYPED:
        made.words = _words(cursor, made)
    if name in TYPED:
        made.parameters = _parameters(cursor, made)
    return made


def _numbers(cursor: _Cursor, directive: Directive, count: int) -> list[float]:
    """``count`` numbers, with brackets or without."""
    numbers: list[float] = []
    while len(numbers) < count and cursor.is_next("number", "list"):
        token = cursor.take()
        assert token is not None
        numbers += [token.value] if isinstance(token.value, float) else _listed(token)
    if len(numbers) != count:
        raise SceneError(f"{directive.place}: {directive.name} takes {count} numbers, and here are {len(numbers)}")
    return numbers


def _listed(token: Token) -> list[float]:
    """The numbers of a list; none where it holds strings."""
    return token.value.tolist() if isinstance(token.value, np.ndarray) else []


def _words(cursor: _Cursor, directive: Directive) -> list[str]:
    name, place = directive.name, directive.place
    least, most = (3, 3) if name == "Texture" else (1, 2) if name == "MediumInterface" else (1, 1)
    words: list[str] = []
    while len(words) < most and cursor.is_next("string", *(["word"] if name == "ActiveTransform" else [])):
        token = cursor.take()
        assert token is not None
        words.append(str(token.value).strip())
    if len(words) < least:
        what = "name, type and class" if least == 3 else "a name"
        raise SceneError(f"{place}: {name} is followed by {what} in quotes")
    return words


def _parameters(cursor: _Cursor, directive: Directive) -> Parameters:
    """``"type name" value …``: values in brackets, or one without; spaces inside the quotes do not matter."""
    owner = f"{directive.name} {shown(directive.words[-1])}".replace("'", '"')
    found = Parameters(owner, directive.place)
    while cursor.is_next("string"):
        token = cursor.take()
        assert token is not None
        kind, _, name = str(token.value).strip().partition(" ")
        kind, name = "".join(kind.split()), name.strip()
        if not name or ALIASES.get(kind, kind) not in TYPES:
            raise SceneError(
                f'{token.place}: {shown(token.value)} of {owner} is no parameter; write "TYPE NAME", with a type of '
                f"{', '.join(sorted(TYPES))}"
            )
        value = cursor.take() if cursor.is_next("string", "number", "list") or _is_truth(cursor) else None
        if value is None:
            raise SceneError(f"{token.place}: the parameter {name!r} of {owner} has no value")
        if isinstance(value.value, float):
            values: np.ndarray | list[str] = np.array([value.value])
        elif isinstance(value.value, str):
            values = [value.value]
        else:
            values = value.value
        found.items[name] = make(kind, name, values, token.place)
    return found


def _is_truth(cursor: _Cursor) -> bool:
    return cursor.is_next("word") and cursor.ahead is not None and cursor.ahead.value in ("true", "false")
