"""
A grid file on its way to a server: its text, and the scenes and point files that lie beside it.

The server reads the grid with its own catalog and never opens a path that a client names, so what must be done here is
only what needs the files: find each scene and each point file, check it, and send exactly what the grid refers to.
"""

from __future__ import annotations

import shutil
import tempfile
import zipfile
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import IO, Any

from jobs import grid
from jobs.errors import GridError
from jobs.gridpoints import file_of
from renderer import catalog
from renderer.errors import DartboardError, UnknownName
from renderer.samplers import pointfile
from renderer.samplers.pointfile import PointSource
from renderer.scenes import sources
from renderer.scenes.sources import SceneSource
from service.client import Client, Refused
from service.outcome import say
from service.schemas import Experiment
from service.tables import size

ORIGIN_MAX = 200  # characters of a file's name that the server takes
IN_MEMORY_BYTES = 2**24  # of a zip; a larger one is written to a temporary file
UNPROCESSABLE = 422  # HTTP: the grid is wrong, or names a scene that the server has not got
EPOCH = (1980, 1, 1, 0, 0, 0)  # of every file in a zip, so that a scene has the same bytes whenever it is sent


@dataclass(frozen=True)
class Parcel:
    """
    A grid's text, what sentences call it, its scenes that are not built in and its point files, by their names in the
    grid.
    """

    text: str
    origin: str
    scenes: Mapping[str, SceneSource]
    points: Mapping[str, PointSource]


def pack(file: Path) -> Parcel:
    """The grid in ``file``. Raises ``GridError`` for what cannot be sent, in the words of ``dartboard check``."""
    try:
        if file.stat().st_size > grid.MAX_BYTES:
            raise GridError([f"{file} is too large"])
        text = file.read_bytes().decode("utf-8-sig")
        data = grid.loads(text, str(file))
        return Parcel(text, file.name[-ORIGIN_MAX:], dict(_scenes(data, file.parent)), dict(_points(data, file.parent)))
    except (OSError, ValueError, DartboardError):
        grid.read(file)  # says everything that is wrong with the grid, not only what was found here
        raise


def _scenes(data: Mapping[str, Any], base: Path) -> Iterator[tuple[str, SceneSource]]:
    for name in _values(data, "scenes"):
        if isinstance(name, str) and name:
            try:
                source = sources.find(name, base)
            except UnknownName:  # the server may know it
                continue
            if not source.builtin:
                yield name, source


def _points(data: Mapping[str, Any], base: Path) -> Iterator[tuple[str, PointSource]]:
    for value in _values(data, "samplers"):
        try:
            name = file_of(catalog.resolve("sampler", value))
        except UnknownName:  # the server may know it
            continue
        if name is not None:
            yield name, pointfile.find(name, base)


def _values(data: Mapping[str, Any], key: str) -> list[Any]:
    """An axis of a grid: one value may stand without a list."""
    values = data.get(key, [])
    return values if isinstance(values, list) else [values]


def send(client: Client, parcel: Parcel) -> tuple[Experiment, bool]:
    """Submit it → (its experiment, whether it is new). Files are sent only to a server that lacks some of them."""
    scenes = {name: source.digest for name, source in parcel.scenes.items()}
    points = {name: source.digest for name, source in parcel.points.items()}
    try:
        return client.submit(parcel.text, parcel.origin, scenes, points)
    except Refused as refusal:
        if not (scenes or points) or refusal.status != UNPROCESSABLE:
            raise
    scenes = {name: _upload(client, name, source) for name, source in parcel.scenes.items()}
    points = {name: _upload_points(client, name, source) for name, source in parcel.points.items()}
    return client.submit(parcel.text, parcel.origin, scenes, points)


def _upload(client: Client, name: str, source: SceneSource) -> str:
    with tempfile.SpooledTemporaryFile(IN_MEMORY_BYTES) as file:
        archive(source, file)
        length = file.tell()
        say(f"sending scene {name}: {len(source.files)} files, {size(length)}")
        return client.upload(name, source.main, file, length).digest


def _upload_points(client: Client, name: str, source: PointSource) -> str:
    say(f"sending point file {name}: {source.sets} sets of {source.count} points")
    with source.path.open("rb") as file:
        return client.upload_points(name, file).digest


def archive(source: SceneSource, into: IO[bytes]) -> None:
    """The files of a scene as a zip: the same bytes for the same files."""
    with zipfile.ZipFile(into, "w", zipfile.ZIP_DEFLATED) as made:
        for file in source.files:
            entry = zipfile.ZipInfo(file.path, EPOCH)
            entry.compress_type = zipfile.ZIP_DEFLATED
            entry.external_attr = 0o644 << 16
            entry.file_size = file.size  # a file of 4 GiB or more has another form, which is chosen first
            with (source.folder / file.path).open("rb") as read, made.open(entry, "w") as write:
                shutil.copyfileobj(read, write, 2**20)
