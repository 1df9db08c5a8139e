"""
Where a scene comes from, and its snapshot.

``find`` turns the name a user typed into a ``SceneSource``: the main XML file and every file that it refers to, vetted,
and one digest over their contents. ``snapshot`` copies exactly these files into a folder named by the digest; cells
render that copy, so a scene that is edited later is another scene and never a wrong picture. What else lies in the
folder (a README, old renderings) is no part of the scene.

A pbrt-v3 file is converted first, into a folder of its own that lives as long as its ``SceneSource``; from there on it
is an XML scene like any other.

What may be in a scene is the business of ``vet``; loading it, of ``load``. No Mitsuba here.
"""

from __future__ import annotations

import hashlib
import json
import logging
import os
import shutil
import tempfile
import time
import weakref
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from renderer.errors import EnvironmentProblem, SceneError, UnknownName, shown
from renderer.scenes.builtin import BUILTIN
from renderer.scenes.defaults import SceneDefaults, defaults_of
from renderer.scenes.vet import SceneFile, examine

__all__ = ["SceneDefaults", "SceneFile", "SceneSource", "find", "snapshot"]

MAIN = "scene.xml"  # the main file of a folder that holds several
REASONS_SHOWN = 3  # in one error; ``vet`` gives all
PBRT = ".pbrt"
ABANDONED_S = 3600  # a half-made copy that is older belongs to a process that was killed

log = logging.getLogger(__name__)


@dataclass(frozen=True)
class SceneSource:
    """
    A scene that was found and vetted.

    name      as the user typed it, or the built-in's
    folder    where its files are now
    main      the XML file to load, relative to ``folder``
    files     the main file and all that it refers to, sorted by path
    digest    SHA-256 of main and files: the same on every machine, whatever else the folder holds
    builtin   True: shipped with Dartboard
    defaults  what the file itself says about size, integrator and sampler
    reference of a built-in: what it is measured against where a grid says nothing, as a grid says it
    notes     of a pbrt file: what was replaced or ignored, a sentence each; logged as warnings, too
    """

    name: str
    folder: Path
    main: str
    files: tuple[SceneFile, ...]
    digest: str
    builtin: bool
    defaults: SceneDefaults
    notes: tuple[str, ...] = ()
    reference: Mapping[str, Any] = field(default_factory=dict, repr=False, compare=False)
    lent: TemporaryFolder | None = field(default=None, repr=False, compare=False)  # ``folder``, if it was made for this


class TemporaryFolder:
    """A folder that is removed when nobody holds this any more, or when the process ends."""

    def __init__(self) -> None:
        self.path = Path(tempfile.mkdtemp(prefix="dartboard-scene-"))
        weakref.finalize(self, shutil.rmtree, self.path, ignore_errors=True)


def find(name: str, base: Path) -> SceneSource:
    """
    The scene that ``name`` means: a built-in, or a path relative to ``base`` of a Mitsuba XML file, of a pbrt-v3 file,
    or of a folder that holds ``scene.xml``, just one XML file, or no XML and just one pbrt file.

    Raises ``UnknownName`` or ``SceneError``.
    """
    if name in BUILTIN:
        scene = BUILTIN[name]
        return replace(_read(name, scene.folder, MAIN, builtin=True), reference=scene.reference)
    path = base.absolute() / name
    try:
        is_folder, is_file = path.is_dir(), path.is_file()
    except (OSError, ValueError):  # a name that no file system takes
        is_folder = is_file = False
    if is_folder:
        path = path / _main_of(path, name)
    if path.suffix.lower() == PBRT and (is_file or is_folder):
        return _converted(name, path)
    if is_folder or (is_file and path.suffix.lower() == ".xml"):
        return _read(name, path.parent, path.name, builtin=False)
    if is_file:
        raise SceneError(
            f"scene {shown(name)} is neither an .xml nor a .pbrt file; name a Mitsuba or pbrt-v3 file, or a folder "
            "that holds one"
        )
    if "/" not in name and "." not in name:
        raise UnknownName("scene", name, "", BUILTIN)
    raise SceneError(f"scene {shown(name)} is not in {base}; a scene is a path from there, or one of {_builtins()}")


def kept(name: str, folder: Path, main: str) -> SceneSource:
    """The scene in a snapshot, under the name that somebody gave it. Raises ``SceneError``."""
    return _read(name, folder, main, builtin=False)


def snapshot(source: SceneSource, into: Path) -> Path:
    """
    Copies the scene to ``into/<digest>/`` and returns that folder; does nothing where it is already there.

    Written beside, flushed, then renamed: the folder is complete or absent, also when several processes copy at once
    or one is killed. Raises ``SceneError`` when a file is no longer the one that was vetted, ``EnvironmentProblem``
    when ``into`` cannot be written.
    """
    target = into / source.digest
    if target.is_dir():
        return target
    try:
        into.mkdir(parents=True, exist_ok=True)
        _sweep(into)
        return _make(source, target)
    except OSError as error:
        reason = f"{error.strerror}; free space there or name another folder"
        raise EnvironmentProblem(f"cannot copy scene {source.name!r} to {into}: {reason}") from error


def _converted(name: str, path: Path) -> SceneSource:
    """A pbrt file as the Mitsuba scene that is made of it."""
    from renderer.scenes.pbrt import convert  # which needs numpy: not before somebody has such a file

    lent = TemporaryFolder()
    try:
        notes = convert.convert(path, lent.path)
    except OSError as error:
        reason = f"{error.strerror}; free space in {lent.path.parent}, or name another folder with TMPDIR"
        raise EnvironmentProblem(f"cannot convert scene {name!r}: {reason}") from error
    for note in notes:
        log.warning("%s", note)
    return replace(_read(name, lent.path, MAIN, builtin=False), notes=tuple(notes), lent=lent)


def _make(source: SceneSource, target: Path) -> Path:
    work = Path(tempfile.mkdtemp(prefix=".scene-", dir=target.parent))
    try:
        for file in source.files:
            _copy(source, file, work)
        for folder in [*(path for path in work.rglob("*") if path.is_dir()), work]:
            _flush(folder)
        work.chmod(0o755)  # mkdtemp's 0700 would hide it from a render process of another user
        try:
            work.rename(target)
        except OSError:
            if not target.is_dir():  # else another process was first; its copy is the same by digest
                raise
        _flush(target.parent)
        return target
    finally:
        shutil.rmtree(work, ignore_errors=True)


def digest_of(main: str, files: Iterable[SceneFile]) -> str:
    """The identity of a scene: SHA-256 of a canonical list of its main file and the content of every file."""
    listing = [main, sorted((file.path, file.sha256) for file in files)]
    return hashlib.sha256(json.dumps(listing, separators=(",", ":")).encode("ascii")).hexdigest()


def _read(name: str, folder: Path, main: str, builtin: bool) -> SceneSource:
    found = examine(folder, main)
    if found.reasons or found.root is None:
        first, more = found.reasons[:REASONS_SHOWN], len(found.reasons) - REASONS_SHOWN
        rest = f"; and {more} more" if more > 0 else ""
        raise SceneError(f"scene {shown(name)} is refused: {'; '.join(first)}{rest}")
    files = tuple(sorted(found.files.values(), key=lambda file: file.path))
    return SceneSource(name, folder, main, files, digest_of(main, files), builtin, defaults_of(found.root))


def _main_of(folder: Path, name: str) -> str:
    if (folder / MAIN).is_file():
        return MAIN
    found = sorted(path.name for path in folder.glob("*.xml")) or sorted(path.name for path in folder.glob("*.pbrt"))
    if len(found) == 1:
        return found[0]
    held = f"the {len(found)} files {', '.join(found[:5])}" if found else "no .xml file, and no .pbrt file"
    raise SceneError(f"the folder {shown(name)} holds {held}; name the file, or call the main one {MAIN}")


def _builtins() -> str:
    return ", ".join(sorted(BUILTIN))


def _copy(source: SceneSource, file: SceneFile, work: Path) -> None:
    to = work / file.path
    to.parent.mkdir(parents=True, exist_ok=True)
    digest = hashlib.sha256()
    try:
        with (source.folder / file.path).open("rb") as read, to.open("xb") as write:
            while block := read.read(2**20):
                digest.update(block)
                write.write(block)
            write.flush()
            os.fsync(write.fileno())
    except FileNotFoundError:
        raise SceneError(f"scene {source.name!r}: {file.path} was removed while it was copied; submit again") from None
    if digest.hexdigest() != file.sha256:
        raise SceneError(f"scene {source.name!r}: {file.path} was changed while it was copied; submit again")
    to.chmod(0o444)  # a snapshot is never edited: its name is its content


def _flush(folder: Path) -> None:
    """Makes the entries of a folder durable."""
    handle = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)


def _sweep(into: Path) -> None:
    for left in into.glob(".scene-*"):
        try:
            if time.time() - left.stat().st_mtime > ABANDONED_S:
                shutil.rmtree(left, ignore_errors=True)
        except OSError:
            continue  # another process swept it
