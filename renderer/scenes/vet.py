"""
Is this scene file safe to hand to Mitsuba?

A Mitsuba scene is executable code: ``type="../../x"`` loads a shared library, ``<path>`` says where from, any file name
reads any file. So a scene may name only the plugins of ``allowed`` and only files of its own folder, and whatever is
not plainly allowed is refused. ``examine`` reads the file as Mitsuba does (``<default>`` and ``$name`` replaced,
``<include>`` followed) and gives the reasons to refuse it, the files that are part of it, and the tree.

The same is asked again of Mitsuba's own reading when the scene is loaded (``load.check_nodes``), and the render process
is confined besides. No Mitsuba here.
"""

from __future__ import annotations

import hashlib
import os
import re
import stat
from dataclasses import dataclass, field
from pathlib import Path, PurePosixPath

from renderer.errors import shown
from renderer.scenes.allowed import (
    ATTRIBUTES,
    EXTENSIONS,
    OBJECTS,
    PLUGINS,
    PYTHON_PLUGINS,
    file_fault,
    string_fault,
    unknown_plugin,
)
from renderer.scenes.xmlfile import Element, Unreadable, parse

XML_BYTES_MAX = 16 * 2**20  # of all scene files together, an included one counted each time
FILES_MAX = 10_000  # in one scene
SCENE_BYTES_MAX = 8 * 2**30  # of all its files
INCLUDE_DEPTH_MAX = 15  # Mitsuba's own limit
VALUE_MAX = 2**16  # characters of a value after its "$" names are replaced; defaults made of defaults grow as 2^n
REASONS_MAX = 20  # enough to repair a file by; a hostile one has millions


@dataclass(frozen=True)
class SceneFile:
    """One file of a scene: its path relative to the scene's folder (POSIX), SHA-256 of its content, size in bytes."""

    path: str
    sha256: str
    size: int


@dataclass
class Examination:
    """What a scene file is: why to refuse it (nothing: it is safe), what belongs to it, and what it says."""

    reasons: list[str] = field(default_factory=list)
    files: dict[str, SceneFile] = field(default_factory=dict)
    root: Element | None = None


def vet(folder: Path, main: str) -> list[str]:
    """Reasons to refuse the scene ``folder/main``, one sentence each; empty when it is safe."""
    return examine(folder, main).reasons


def examine(folder: Path, main: str) -> Examination:
    """Reads ``folder/main`` and all it refers to. Raises nothing for a bad scene: that is in ``reasons``."""
    reader = _Reader(folder)
    try:
        reader.result.root = reader.read_main(main)
    except OSError as error:  # no right to read, or removed meanwhile
        reader.refuse(f"{Path(str(error.filename)).name!r} cannot be read: {error.strerror}")
    return reader.result


class _Reader:
    """One examination: Mitsuba's reading of the main file and its includes, in Mitsuba's order."""

    def __init__(self, folder: Path):
        self.folder = folder
        self.home = folder.resolve()
        self.result = Examination()
        self.parameters: list[tuple[str, str]] = []  # ("$name", value), longest name first, as Mitsuba keeps them
        self.xml_bytes = self.xml_files = 0
        self.size = 0
        self.including: list[str] = []  # the chain of files that is being read, main first

    def refuse(self, reason: str) -> None:
        if len(self.result.reasons) < REASONS_MAX and reason not in self.result.reasons:
            self.result.reasons.append(reason)

    def read_main(self, main: str) -> Element | None:
        fault = file_fault(main)
        if fault:
            self.refuse(f"the scene file {main!r} {fault}")
            return None
        root = self.read_xml(main, "the scene file")
        if root is not None and root.tag != "scene":
            self.refuse(f"{main} starts with <{root.tag}>, not with <scene version=...>: it is no Mitsuba scene")
            return None
        return root

    def read_xml(self, path: str, what: str) -> Element | None:
        """Reads, records and checks one scene file; None when it is unreadable."""
        found = self.locate(path, what)
        if found is None:
            return None
        self.xml_bytes += found.stat().st_size
        self.xml_files += 1
        if self.xml_bytes > XML_BYTES_MAX or self.xml_files > FILES_MAX:
            most = f"{XML_BYTES_MAX >> 20} MiB or {FILES_MAX} includes"
            self.refuse(f"{path}: the scene has more than {most} of XML; put meshes in .ply files")
            return None
        data = found.read_bytes()  # what is examined is what is hashed, whatever becomes of the file meanwhile
        self.record(path, hashlib.sha256(data).hexdigest(), len(data))
        try:
            root = parse(data)
        except Unreadable as error:
            self.refuse(f"{path} {error}")
            return None
        for parent in {self.folder, found.parent}:
            if (parent / "plugins").exists():
                self.refuse(f"beside {path} is a folder named 'plugins', where Mitsuba looks for code; rename it")
        if not re.fullmatch(r"\d{1,4}\.\d{1,4}\.\d{1,4}", root.attributes.get("version", "")):
            self.refuse(f'{path} has no version; start it with <{root.tag} version="3.0.0">')
        self.including.append(path)
        self.check(root, path, top=True)
        self.including.pop()
        return root

    def record(self, path: str, sha256: str, size: int) -> None:
        if path not in self.result.files:
            self.result.files[path] = SceneFile(path, sha256, size)
            self.size += size
            if len(self.result.files) > FILES_MAX:
                self.refuse(f"the scene has more than {FILES_MAX} files")
            if self.size > SCENE_BYTES_MAX:
                self.refuse(f"the scene's files are larger than {SCENE_BYTES_MAX >> 30} GiB")

    def check(self, element: Element, path: str, top: bool = False) -> None:
        """Checks an element and all below it; replaces its ``$`` names and puts included elements in place."""
        place = f"{path}, line {element.line}"
        tag, allowed = element.tag, ATTRIBUTES.get(element.tag)
        if tag == "path":
            return self.refuse(f"{place}: <path> is not allowed; file names are relative to the scene's folder")
        if allowed is None or (tag == "scene" and not top):
            return self.refuse(f"{place}: unknown element <{tag}>")
        if top:
            allowed |= {"version", "id", "name"}
        written = dict(element.attributes)
        for name, value in written.items():
            if name not in allowed:
                self.refuse(f"{place}: unknown attribute {name!r} of <{tag}>")
            if name != "filename":  # never put together: file_fault refuses its "$"
                element.attributes[name] = self.substitute(value, place)
        self.check_value(element, written, path, place)
        children: list[Element] = []
        for child in element.children:
            self.check(child, path)
            children += self.included(child, path) if child.tag == "include" else [child]
        element.children = children

    def check_value(self, element: Element, written: dict[str, str], path: str, place: str) -> None:
        tag, value = element.tag, element.attributes.get("value", "")
        kind = element.attributes.get("type")
        if tag in OBJECTS and (kind is not None or tag != "spectrum") and kind not in PLUGINS | PYTHON_PLUGINS:
            self.refuse(f"{place}: {unknown_plugin(kind)}")
        if tag == "default":
            self.define("$" + element.attributes.get("name", ""), value, place)
        if tag == "spectrum" and "filename" in written:
            self.refer(written["filename"], place)
        if tag == "string" and element.attributes.get("name") == "filename":
            self.refer(written.get("value", ""), place)
        elif tag == "string" and (fault := string_fault(value)):
            self.refuse(f"{place}: the value {shown(value)} {fault}")

    def define(self, key: str, value: str, place: str) -> None:
        if "\\" in key + value:
            self.refuse(f"{place}: a backslash in a <default>")
        if all(key != known for known, _ in self.parameters):
            self.parameters.append((key, value))
            self.parameters.sort(key=lambda item: -len(item[0]))  # stable, as Mitsuba's insertion

    def substitute(self, value: str, place: str) -> str:
        """``$name`` replaced as Mitsuba does, longest name first. Its escape, a backslash, is refused."""
        if "$" not in value:
            return value
        if "\\" in value:
            self.refuse(f"{place}: the value {shown(value)} mixes '$' and a backslash")
        for key, replacement in self.parameters:
            value = value.replace(key, replacement)
            if len(value) > VALUE_MAX:
                self.refuse(f"{place}: a value grows beyond {VALUE_MAX} characters by its '$' names")
                return ""
        if "$" in value:
            unknown = re.search(r"\$\w*", value)
            name = unknown[0] if unknown else "$"
            self.refuse(f"{place}: unknown parameter {name!r}; define it before with <default name=... value=...>")
        return value

    def included(self, element: Element, path: str) -> list[Element]:
        """The elements that an ``<include>`` stands for."""
        place = f"{path}, line {element.line}"
        written = element.attributes.get("filename", "")
        target = self.resolve(written, place, frozenset({".xml"}))
        if target is None:
            return []
        # Mitsuba looks in the including file's folder first, then outwards along the chain, last in the main one.
        around = [(PurePosixPath(file).parent / target).as_posix() for file in reversed(self.including)]
        target = next((name for name in around if os.path.lexists(self.folder / name)), target)
        if target in self.including:
            self.refuse(f"{place}: {target} includes itself")
            return []
        if len(self.including) >= INCLUDE_DEPTH_MAX:
            self.refuse(f"{place}: includes nest deeper than {INCLUDE_DEPTH_MAX}")
            return []
        root = self.read_xml(target, f"{place}: the included file")
        if root is None or (root.tag not in OBJECTS and root.tag != "scene"):
            self.refuse(f"{place}: {target} holds neither a <scene> nor one object")
            return []
        return root.children if root.tag == "scene" else [root]

    def refer(self, written: str, place: str) -> None:
        """Checks and records a file that a plugin will read."""
        target = self.resolve(written, place, EXTENSIONS)
        if target is None or target in self.result.files:
            return
        found = self.locate(target, f"{place}: the file")
        if found is None:
            return
        if self.size + found.stat().st_size > SCENE_BYTES_MAX:
            return self.refuse(f"the scene's files are larger than {SCENE_BYTES_MAX >> 30} GiB")
        with found.open("rb") as stream:
            digest = hashlib.file_digest(stream, "sha256").hexdigest()
            self.record(target, digest, stream.tell())

    def resolve(self, written: str, place: str, kinds: frozenset[str]) -> str | None:
        """
        A file name as written, made canonical, or None (and a reason) when its spelling is refused.

        Names of what plugins read are relative to the main file's folder, in included files too, as in Mitsuba 3.9.
        """
        path = PurePosixPath(written)
        if fault := file_fault(written):
            self.refuse(f"{place}: the file {shown(written)} {fault}")
        elif path.suffix.lower() not in kinds:
            known = " ".join(sorted(kinds))
            self.refuse(f"{place}: the file {shown(written)} is of a kind that is not read there; allowed: {known}")
        else:
            return path.as_posix()
        return None

    def locate(self, path: str, what: str) -> Path | None:
        """The regular file behind a relative path, links followed, if it lies inside the scene's folder."""
        try:
            found = (self.folder / path).resolve(strict=True)
            kind = found.stat().st_mode
        except (OSError, ValueError, RuntimeError):
            self.refuse(f"{what} {shown(path)} does not exist in the scene's folder")
            return None
        if not found.is_relative_to(self.home):
            self.refuse(f"{what} {shown(path)} is a link that leads out of the scene's folder; copy it there")
        elif not stat.S_ISREG(kind):
            self.refuse(f"{what} {shown(path)} is not a file")
        else:
            return found
        return None
