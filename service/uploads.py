"""
Scenes that come over the wire: a zip of a scene's folder, unpacked with suspicion, vetted, and kept by digest.

Only regular files with an extension that a scene may have are unpacked, under names that stay inside the folder, and
no more bytes than allowed are ever written, whatever the archive claims. Then the scene is read like any other
(renderer/scenes/vet.py); what it does not refer to is not kept.
"""

from __future__ import annotations

import contextlib
import stat
import tempfile
import zipfile
from collections.abc import Callable
from dataclasses import replace
from functools import lru_cache
from pathlib import Path, PurePosixPath
from typing import IO, TypeVar

from jobs import disk
from jobs.artifacts import Artifacts
from jobs.store import Store
from renderer.errors import SceneError, UnknownName, shown
from renderer.scenes import sources
from renderer.scenes.allowed import EXTENSIONS, file_fault
from renderer.scenes.builtin import BUILTIN
from renderer.scenes.sources import SceneSource
from renderer.zips import MAX_DIRECTORY, directory_bytes
from service.engine import Engine
from service.problems import TooLarge

T = TypeVar("T")

MAIN_KINDS = (".xml", sources.PBRT)  # of scene files
MAX_FILES = 2000  # in an archive
MAX_BYTES = 2**29  # unpacked
MAX_NAME = 200  # characters
MAX_PART = 255  # bytes of the name of a file or folder, on any usual file system
MAX_PATH = 1000  # bytes of a path in an archive


def receive(engine: Engine, archive: IO[bytes], name: str, main: str | None) -> SceneSource:
    """
    Vet the scene in a zip file and keep a snapshot of it.

    name  what people call it; main  its scene file, where the folder holds several
    Raises ``SceneError`` with the reasons, ``TooLarge`` over a limit.
    """
    _check_name(name)
    with disk.explained(engine.artifacts.data):
        folder = tempfile.TemporaryDirectory(prefix="upload-", dir=engine.artifacts.work)
    with folder:
        root = Path(folder.name)
        with disk.explained(engine.artifacts.data):
            _unpack(archive, root, name)
        inside = _without_wrapper(root)
        try:
            source = replace(sources.find(_main(inside, main, name), inside), name=name)
        except SceneError as error:
            raise SceneError(str(error).replace(str(root), "the archive").replace("'.'", shown(name))) from None
        sources.snapshot(source, engine.artifacts.scenes)
    engine.do(lambda store, _: remember(store, source))
    return source


def remember(store: Store, source: SceneSource) -> None:
    """Note a scene whose snapshot is kept. In the engine's thread."""
    store.run("add_scene", digest=source.digest, name=source.name, main=source.main, builtin=source.builtin)


def find(store: Store, artifacts: Artifacts, uploaded: dict[str, str], name: str) -> SceneSource:
    """
    The scene that a grid from outside names: built in, or uploaded. Never a path of this machine.

    Raises ``UnknownName`` or ``SceneError``.
    """
    if name in uploaded:
        row = store.one("scene_by_digest", digest=uploaded[name])
        if row is None or not artifacts.scene_folder(row["digest"]).is_dir():
            raise SceneError(
                f"scene {shown(name)}: there is no uploaded scene {shown(uploaded[name])}; upload it again"
            )
        return replace(_kept(artifacts.scene_folder(row["digest"]), row["main"]), name=name)
    if name in BUILTIN:
        return sources.find(name, Path())
    raise UnknownName("scene", name, "", [*BUILTIN, *uploaded])


def everything(store: Store, artifacts: Artifacts) -> list[SceneSource]:
    """The scenes that clients have brought, newest first, under the names that they came with."""
    found = []
    for row in store.rows("uploaded_scenes"):
        folder = artifacts.scene_folder(row["digest"])
        with contextlib.suppress(SceneError):  # a snapshot that somebody has damaged hides no other
            if folder.is_dir():
                found.append(replace(_kept(folder, row["main"]), name=row["name"]))
    return found


@lru_cache(maxsize=256)
def _kept(folder: Path, main: str) -> SceneSource:
    """A snapshot, read once: it is never changed, and reading it takes a hash of every file."""
    return sources.kept(main, folder, main)


def _check_name(name: str) -> None:
    if not name.strip() or len(name) > MAX_NAME or not name.isprintable():
        raise SceneError(f"the name {shown(name)} is not allowed; give 1 to {MAX_NAME} printable characters")


def _main(folder: Path, main: str | None, name: str) -> str:
    """What to look for in the folder: nothing outside of it, whatever a client names."""
    there = sorted(path.relative_to(folder).as_posix() for kind in MAIN_KINDS for path in folder.rglob(f"*{kind}"))
    if main is None:
        return "."
    if main not in there:
        held = ", ".join(there[:5]) or "no .xml or .pbrt file"
        raise SceneError(f"there is no {shown(main)} in the archive of {shown(name)}; it holds {held}")
    return main


def _unpack(archive: IO[bytes], root: Path, name: str) -> None:
    """Raises ``SceneError`` for what is no sound archive, ``TooLarge``, and ``OSError`` for the disk alone."""
    if directory_bytes(archive) > MAX_DIRECTORY:
        raise TooLarge(f"the archive of {shown(name)} has a list of files of more than {MAX_DIRECTORY >> 20} MiB")
    with _read(name, lambda: zipfile.ZipFile(archive)) as opened:
        entries = [entry for entry in opened.infolist() if not entry.filename.endswith("/")]
        if len(entries) > MAX_FILES:
            raise TooLarge(f"the archive of {shown(name)} has {len(entries)} files, more than {MAX_FILES}")
        left = MAX_BYTES
        for entry in entries:
            fault = _fault(entry)
            if fault:
                raise SceneError(f"the archive of {shown(name)} is refused: {shown(entry.filename)} {fault}")
            left = _write(opened, entry, root, left, name)


def _read(name: str, step: Callable[[], T]) -> T:
    """What a step of reading the archive gives. zipfile raises a dozen kinds of errors for what is no archive."""
    try:
        return step()
    except Exception as error:
        reason = str(error)[:100] or type(error).__name__
        raise SceneError(f"the archive of {shown(name)} cannot be read ({reason}); send a zip of the folder") from None


def _fault(entry: zipfile.ZipInfo) -> str | None:
    """Why a file of an archive is refused, or None."""
    kind = stat.S_IFMT(entry.external_attr >> 16)
    if kind not in (0, stat.S_IFREG):
        return "is no regular file (a link or a device); put the file itself there"
    if entry.flag_bits & 0x1:
        return "is encrypted; send it without a password"
    if entry.compress_type not in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED):
        return "is packed in an unusual way; pack it with deflate, as zip does"
    path = PurePosixPath(entry.filename)
    if len(str(path).encode()) > MAX_PATH or any(len(part.encode()) > MAX_PART for part in path.parts):
        return f"has too long a name; give at most {MAX_PART} bytes to a file or folder, and {MAX_PATH} to a path"
    if fault := file_fault(entry.filename):
        return fault
    suffix = path.suffix.lower()
    if suffix not in MAIN_KINDS and suffix not in EXTENSIONS:
        return f"has an extension that no scene needs; allowed: {' '.join([*MAIN_KINDS, *sorted(EXTENSIONS)])}"
    return None


def _write(opened: zipfile.ZipFile, entry: zipfile.ZipInfo, root: Path, left: int, name: str) -> int:
    """Unpack one file, no more than ``left`` bytes; how many are left after it."""
    to = root / entry.filename
    if to.exists() or any(folder.is_file() for folder in to.parents):
        raise SceneError(f"the archive of {shown(name)} holds {shown(entry.filename)} twice; pack it anew")
    to.parent.mkdir(parents=True, exist_ok=True)
    with _read(name, lambda: opened.open(entry)) as packed, to.open("xb") as file:
        while block := _read(name, lambda: packed.read(2**16)):
            left -= len(block)
            if left < 0:
                raise TooLarge(f"the archive of {shown(name)} unpacks to more than {MAX_BYTES >> 20} MiB")
            file.write(block)
    return left


def _without_wrapper(root: Path) -> Path:
    """A zip made of a folder holds that folder: what counts is what is in it."""
    inside = list(root.iterdir())
    return inside[0] if len(inside) == 1 and inside[0].is_dir() else root
