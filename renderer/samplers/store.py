"""
The tables of samplers: point sets that are made once and kept on disk.

A file's name is the digest of what was asked: kind, number of points and sets, seed, parameters, and the version of the
generator, which is raised when its numbers change. Files appear whole or not at all, and carry a checksum: one that is
damaged is made again. Any number of threads and processes may ask at once; one makes the table and the others wait.

The folder is ``DARTBOARD_TABLES``, else ``dartboard/tables`` in ``XDG_CACHE_HOME`` or ``~/.cache``. It may be emptied
at any time, and one that cannot be written only means that nothing is kept.
"""

from __future__ import annotations

import fcntl
import hashlib
import io
import json
import os
import tempfile
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from renderer.errors import BadParameter, UnknownName, shown
from renderer.samplers import point_sets, replays
from renderer.samplers.packing import MAX_POINTS
from renderer.samplers.pmj import pmj02bn
from renderer.samplers.point_sets import PointSets
from renderer.samplers.torus import min_distance

MAX_TABLE_POINTS = 65536  # of all sets together, where there are more than MIN_SETS: half a megabyte on the device
MAX_SETS, MIN_SETS = 64, 4
CHECKSUM = hashlib.sha256().digest_size  # bytes, at the beginning of a file

Scalar = bool | int | float | str | None
Points = NDArray[np.float64]


@dataclass(frozen=True)
class Generator:
    """
    What makes the sets of one kind.

    version  raised when ``make`` gives other points for the same arguments
    make     (n, sets, seed, **parameters) → the sets
    """

    version: int
    make: Callable[..., PointSets]


def _basic(n: int, sets: int, seed: int, fill: replays.Fill, min_dist: None = None) -> PointSets:
    return _measured(replays.basic(n, sets, seed, fill))


def _relaxed(n: int, sets: int, seed: int, fill: str = "", min_dist: float | None = None) -> PointSets:
    """The relaxed version always finds n points: there is nothing to fill."""
    return _measured(replays.relaxed(n, sets, seed, min_dist))


def _pmj02bn(n: int, sets: int, seed: int) -> PointSets:
    return _measured(pmj02bn(n, sets, seed) / 2.0**32)  # exact: 32 bits fit into 53


def _measured(points: Points) -> PointSets:
    return PointSets(points, min_distance(points), maximal=False)


GENERATORS = {
    "poissondisk": Generator(1, point_sets.poissondisk),
    "relaxedpoissondisk": Generator(1, point_sets.relaxedpoissondisk),
    "eliminated": Generator(1, point_sets.eliminated),
    "replay_basic": Generator(1, _basic),
    "replay_relaxed": Generator(1, _relaxed),
    "pmj02bn": Generator(1, _pmj02bn),
}


def sets_for(n: int) -> int:
    """
    How many sets of n points a Poisson-disk sampler keeps, a power of two: 64 up to 1024 points, then as many as have
    no more than MAX_TABLE_POINTS in all, but at least 4. ``BadParameter`` above MAX_POINTS.
    """
    _check(n, 1)
    return max(MIN_SETS, min(MAX_SETS, MAX_TABLE_POINTS >> (n - 1).bit_length()))


def load(kind: str, n: int, sets: int, seed: int = 0, **parameters: Scalar) -> PointSets:
    """
    The sets that ``GENERATORS[kind]`` makes of these arguments, from the folder or made now. Parameters that are None
    count as not given. Raises ``UnknownName`` for a kind that there is not, ``BadParameter`` as the generator does.
    """
    if kind not in GENERATORS:
        raise UnknownName("kind of point sets", kind, "the tables of samplers", GENERATORS)
    _check(n, sets)
    given = {name: value for name, value in parameters.items() if value is not None}
    key = _key(kind, n, sets, seed, given)
    path = folder() / f"{kind}-{n}-{key.hex()[:32]}.points"
    if (kept := _read(path, key)) is not None:
        return kept
    with _alone(path):
        if (kept := _read(path, key)) is not None:  # made by another while we waited
            return kept
        made = GENERATORS[kind].make(n, sets, seed, **given)
        _write(path, key, made)
    return made


def folder() -> Path:
    """Where tables are kept."""
    if asked := os.environ.get("DARTBOARD_TABLES"):
        return Path(asked)
    return Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "dartboard" / "tables"


def _check(n: int, sets: int) -> None:
    if not 1 <= n <= MAX_POINTS or sets < 1:
        raise BadParameter(
            f"{shown(sets)} sets of {shown(n)} points are not kept as a table; ask for 1 to {MAX_POINTS} samples per "
            "pixel, or take the sampler sobol, which has no table"
        )


def _key(kind: str, n: int, sets: int, seed: int, given: Mapping[str, Scalar]) -> bytes:
    """SHA-256 of what was asked, in canonical JSON: 1 and 1.0 are the same distance."""
    values = {k: float(v) if isinstance(v, int) and not isinstance(v, bool) else v for k, v in given.items()}
    asked = {
        "kind": kind,
        "n": n,
        "sets": sets,
        "seed": seed,
        "parameters": values,
        "version": GENERATORS[kind].version,
    }
    return hashlib.sha256(json.dumps(asked, sort_keys=True, separators=(",", ":")).encode()).digest()


def _read(path: Path, key: bytes) -> PointSets | None:
    """The sets in a file; None if there is none, or it is not what was written for this key."""
    try:
        whole = path.read_bytes()
    except OSError:
        return None
    checksum, content = whole[:CHECKSUM], whole[CHECKSUM:]
    if checksum != hashlib.sha256(key + content).digest():
        return None
    with np.load(io.BytesIO(content), allow_pickle=False) as arrays:
        return PointSets(arrays["points"], arrays["radius"], bool(arrays["maximal"]))


def _write(path: Path, key: bytes, sets: PointSets) -> None:
    """Keeps the sets, whole or not at all."""
    content = io.BytesIO()
    np.savez(content, points=sets.points, radius=sets.radius, maximal=np.array(sets.maximal))
    whole = hashlib.sha256(key + content.getvalue()).digest() + content.getvalue()
    beside = ""
    try:
        with tempfile.NamedTemporaryFile(dir=path.parent, suffix=".part", delete=False) as file:
            beside = file.name
            file.write(whole)
        os.replace(beside, path)
    except OSError:
        if beside:
            Path(beside).unlink(missing_ok=True)


@contextmanager
def _alone(path: Path) -> Iterator[None]:
    """
    While one thread or process is inside, others wait for the same path. Where no lock can be had, nobody waits.

    The lock's file goes with its owner; who waited for a file that is gone finds the table, or makes it once more.
    """
    lock = path.with_suffix(".lock")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        file = open(lock, "wb")  # noqa: SIM115 - closed below
    except OSError:
        yield
        return
    with file:
        with suppress(OSError):  # a file system without locks
            fcntl.flock(file, fcntl.LOCK_EX)
        try:
            yield
        finally:
            lock.unlink(missing_ok=True)
