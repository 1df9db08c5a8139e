"""
Scene XML as a tree, read so strictly that Mitsuba cannot see another one.

Mitsuba reads with pugixml, which forgives: it skips a document type, takes the first of several roots, guesses the
encoding. We read with expat and refuse whatever the two could take differently: anything but UTF-8, a DOCTYPE (and with
it every entity), text that is not well-formed. Names are kept raw, without namespaces, as Mitsuba compares them.

Which elements and values are *allowed* is the business of ``vet``. No Mitsuba here.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from xml.parsers import expat

DEPTH_MAX = 32  # nested elements; real scenes need about 8
ELEMENTS_MAX = 500_000  # of one file, about 200 MB as a tree; 100 000 instances need 400 000


@dataclass(slots=True)
class Element:
    """One element: its tag and attributes as written, the line (from 1) where it starts, and its children."""

    tag: str
    attributes: dict[str, str]
    line: int
    children: list[Element] = field(default_factory=list)


class Unreadable(Exception):
    """Why a file is not XML that we read; ``str()`` is the end of a sentence, such as "is not UTF-8"."""


def parse(data: bytes) -> Element:
    """The root element of a scene file. Raises ``Unreadable``."""
    try:
        text = data.decode("utf-8")
    except UnicodeDecodeError as error:
        raise Unreadable(f"is not UTF-8 (byte {error.start}); save it as UTF-8") from None
    if "\0" in text:  # UTF-16 of plain letters is also UTF-8, and both readers would guess
        raise Unreadable("is not UTF-8 text (it holds zero bytes); save it as UTF-8")
    if not text.strip("\ufeff \t\r\n"):
        raise Unreadable("is empty")
    builder = _Builder()
    try:
        builder.expat.Parse(data, True)
    except expat.ExpatError as error:
        raise Unreadable(f"is not well-formed XML: {expat.ErrorString(error.code)} in line {error.lineno}") from None
    assert builder.root is not None  # expat reports "no element found" itself
    return builder.root


class _Builder:
    """Expat's events, made into a tree; the limits hold while the file is read, not after."""

    def __init__(self) -> None:
        self.root: Element | None = None
        self.open: list[Element] = []
        self.count = 0
        self.expat = expat.ParserCreate("utf-8")
        self.expat.StartElementHandler = self.start
        self.expat.EndElementHandler = self.end
        self.expat.XmlDeclHandler = self.declaration
        self.expat.StartDoctypeDeclHandler = self.doctype

    def start(self, tag: str, attributes: dict[str, str]) -> None:
        element = Element(tag, attributes, self.expat.CurrentLineNumber)
        self.count += 1
        if self.count > ELEMENTS_MAX:
            raise Unreadable(f"has more than {ELEMENTS_MAX} elements (line {element.line})")
        if len(self.open) >= DEPTH_MAX:
            raise Unreadable(f"nests elements deeper than {DEPTH_MAX} (line {element.line})")
        if self.open:
            self.open[-1].children.append(element)
        else:
            self.root = element
        self.open.append(element)

    def end(self, tag: str) -> None:
        self.open.pop()

    def declaration(self, version: str, encoding: str | None, standalone: int) -> None:
        # Mitsuba obeys a declared encoding: read as Latin-1, the same bytes are other names.
        if encoding is not None and encoding.lower() not in ("utf-8", "us-ascii", "ascii"):
            raise Unreadable(f"declares the encoding {encoding!r}; only utf-8 is read")

    def doctype(self, name: str, system: str | None, public: str | None, internal: bool) -> None:
        raise Unreadable(f"has a document type (<!DOCTYPE {name}>, line {self.expat.CurrentLineNumber}); remove it")
