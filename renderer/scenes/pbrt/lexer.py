"""
The text of a pbrt file as tokens: words, quoted strings, numbers and bracketed lists, each with its line.

A list is one token, and its numbers go straight into an array: a mesh of ten million lines costs no objects. At most
``TEXT_MAX`` bytes are read, by all files of a scene together, so memory is bounded whatever is in them.

Source: the pbrt-v3 input file format, https://pbrt.org/fileformat-v3.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from renderer.errors import SceneError, shown

TEXT_MAX = 2**28  # bytes of pbrt text, of a file and all that it includes
LIST_MAX = 6 * 10**7  # numbers in one list: as many as 2·10⁷ vertices have
BLOCK = 2**24  # bytes of a list whose numbers are read at once

Values = NDArray[np.float64] | list[str]  # numbers, or strings; true and false are strings, as in pbrt-v3


class Place(NamedTuple):
    """Where something stands in a scene; ``str()`` is how sentences name it."""

    file: str
    line: int

    def __str__(self) -> str:
        return f"{self.file}, line {self.line}"


@dataclass(slots=True)
class Token:
    """
    kind   "word" (a directive, true or false), "string", "number" or "list"
    value  the text of a word or string, a number, or the values of a list
    """

    kind: str
    value: str | float | Values
    place: Place


_NUMBER = rb"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?"
_STRING = rb'"((?:[^"\\\r\n]|\\[^\r\n])*+)"'
_BLANK = re.compile(rb"(?:\s++|#[^\r\n]*+)*+")
_LIST = re.compile(rb'\[((?:[^"#\[\]]++|#[^\r\n]*+|"(?:[^"\\\r\n]|\\[^\r\n])*+")*+)\]')
_TOKEN = re.compile(_STRING + rb"|(" + _NUMBER + rb")(?![\w.])|([A-Za-z_]\w*+)")
_ITEM = re.compile(_BLANK.pattern + rb"(?:" + _STRING + rb"|(true|false)\b)")
_ESCAPES = {"n": "\n", "t": "\t", "r": "\r", "b": "\b", "f": "\f"}


def tokens(data: bytes, file: str) -> Iterator[Token]:
    """The tokens of a file's bytes. Raises ``SceneError`` with file and line for what is none."""
    _check_text(data, file)
    position = 3 if data.startswith(b"\xef\xbb\xbf") else 0
    line, counted = 1, 0
    while True:
        blank = _BLANK.match(data, position)
        position = blank.end() if blank else position
        if position >= len(data):
            return
        line += _lines(data, counted, position)
        counted, place = position, Place(file, line)
        if data[position] == ord("["):
            found = _LIST.match(data, position)
            if not found:
                raise SceneError(f"{place}: the list that starts here has no ']', or a stray '[' or '\"' in it")
            yield Token("list", _values(data, found.start(1), found.end(1), place), place)
        else:
            found = _TOKEN.match(data, position)
            if not found:
                raise SceneError(f"{place}: {_stray(data, position)}")
            yield _token(found, place)
        position = found.end()


def _token(found: re.Match[bytes], place: Place) -> Token:
    string, number, word = found.groups()
    if string is not None:
        return Token("string", _unescape(string.decode("utf-8")), place)
    if number is not None:
        value = float(number)
        if not math.isfinite(value):
            raise SceneError(f"{place}: a number is infinite or NaN; every number of a scene is finite")
        return Token("number", value, place)
    return Token("word", word.decode("ascii"), place)


def _values(data: bytes, start: int, end: int, place: Place) -> Values:
    """The content of a list: all numbers, or all strings."""
    if data.find(b'"', start, end) < 0 and not re.compile(rb"\s*+(?:true|false)\b").match(data, start, end):
        return _finite(_numbers(data, start, end, place), place)
    strings: list[str] = []
    while start < end:
        found = _ITEM.match(data, start, end)
        if not found:
            blank = _BLANK.match(data, start, end)
            if blank and blank.end() == end:
                break
            raise SceneError(f"{place}: a list holds numbers or strings, not both; {_stray(data, start)}")
        strings.append(_unescape((found[1] if found[1] is not None else found[2]).decode("utf-8")))
        start = found.end()
    return strings


def _numbers(data: bytes, start: int, end: int, place: Place) -> NDArray[np.float64]:
    """The numbers of a list, a block at a time. numpy's reader takes 10 million a second."""
    parts, count = [], 0
    while start < end:
        stop = min(end, start + BLOCK)
        if stop < end:
            gap = re.compile(rb"\s").search(data, stop, end)
            stop = gap.start() if gap else end
        block = re.sub(rb"#[^\r\n]*", b" ", data[start:stop]).strip() if b"#" in data[start:stop] else data[start:stop]
        start = stop
        if not block.strip():
            continue  # numpy makes a number of nothing
        try:
            parts.append(np.fromstring(block, sep=" "))
        except (ValueError, DeprecationWarning):
            raise SceneError(f"{place}: {_not_a_number(block)} in a list of numbers") from None
        count += len(parts[-1])
        if count > LIST_MAX:
            raise SceneError(f"{place}: a list of more than {LIST_MAX} numbers; put meshes in .ply files")
    return np.concatenate(parts) if parts else np.empty(0)


def _not_a_number(block: bytes) -> str:
    for word in block.split():
        if not re.fullmatch(_NUMBER, word):
            return f"{shown(word.decode('utf-8', 'replace'))} is no number"
    return "something is no number"


def _finite(numbers: NDArray[np.float64], place: Place) -> NDArray[np.float64]:
    if not np.isfinite(numbers).all():
        raise SceneError(f"{place}: a number is infinite or NaN; every number of a scene is finite")
    return numbers


def _check_text(data: bytes, file: str) -> None:
    """UTF-8 without zero bytes. Raises ``SceneError``."""
    if data.isascii() and b"\0" not in data:
        return
    try:
        data.decode("utf-8")
        where, what = data.find(b"\0"), "holds zero bytes: it is no text"
    except UnicodeDecodeError as error:
        where, what = error.start, "is not UTF-8"
    if where >= 0:
        raise SceneError(f"{Place(file, 1 + _lines(data, 0, where))}: the file {what}; save it as UTF-8")


def _lines(data: bytes, start: int, end: int) -> int:
    """Line ends between two positions: \\n, \\r\\n, or the \\r of old Macs."""
    feeds = data.count(b"\n", start, end)
    returns = data.count(b"\r", start, end)
    return feeds + returns - data.count(b"\r\n", start, min(end + 1, len(data))) if returns else feeds


def _stray(data: bytes, position: int) -> str:
    if data[position : position + 1] == b'"':
        return "a string that is not closed in its line"
    if data[position : position + 1] == b"]":
        return "a ']' without its '['"
    text = data[position : position + 40].split(maxsplit=1)[:1] or [b""]
    return f"cannot read {shown(text[0].decode('utf-8', 'replace'))}"


def _unescape(text: str) -> str:
    """pbrt's escapes; a backslash before another letter stays: file names of Windows have them."""
    if "\\" not in text:
        return text
    return re.sub(r"\\(.)", lambda m: _ESCAPES.get(m[1], m[1] if m[1] in "\\\"'" else m[0]), text)
