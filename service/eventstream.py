"""
Reading server-sent events: bytes in, events out (WHATWG HTML, "Server-sent events").

By hand, because an HTTP library's idea of a line (U+2028 ends one, for Python) is not the standard's, and the names of
experiments may hold any character.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass


@dataclass(frozen=True)
class Event:
    """``id`` is None where the event has none of its own."""

    name: str
    data: str
    id: str | None


def events_in(blocks: Iterable[bytes]) -> Iterator[Event]:
    """The events of a stream that arrives in blocks, cut anywhere; without comments, and what is cut off at the end."""
    name, data, identity = "message", list[str](), None
    for line in _lines(blocks):
        if not line:
            if data:
                yield Event(name, "\n".join(data), identity)
            name, data, identity = "message", [], None
            continue
        field, _, value = line.partition(":")
        value = value.removeprefix(" ")
        if field == "event":
            name = value
        elif field == "data":
            data.append(value)
        elif field == "id" and "\0" not in value:
            identity = value


def _lines(blocks: Iterable[bytes]) -> Iterator[str]:
    """Whole lines; they end with LF or CR LF."""
    rest = b""
    for block in blocks:
        *whole, rest = (rest + block).replace(b"\r\n", b"\n").split(b"\n")
        for line in whole:
            yield line.decode(errors="replace")
