"""
Point files: sets of points that somebody brings, as ``dartboard points`` writes them.

A point file is a numpy archive (.npz) with ``points``, float, all in [0, 1): of shape (K, N, 2), K sets of N points, or
(N, 2), one set. It comes from outside, so nothing in it is believed: no pickles, and sizes are read before content. Its
identity is the SHA-256 of its points, however they were stored; cells draw a snapshot that is named by it. No Mitsuba.
"""

from __future__ import annotations

import hashlib
import io
import math
import os
import tempfile
import zipfile
from dataclasses import dataclass
from pathlib import Path
from typing import IO, TYPE_CHECKING, Any

from renderer.errors import BadParameter, EnvironmentProblem, shown
from renderer.zips import MAX_DIRECTORY, directory_bytes

if TYPE_CHECKING:  # most grids name no file, and reading them takes no numpy
    import numpy as np
    from numpy.typing import NDArray

MAX_BYTES = 2**26  # of a file, and of all that it unpacks to
MEMBER = "points.npy"
SUFFIX = ".npz"


@dataclass(frozen=True)
class PointFile:
    """
    points  (K, N, 2) float64 in [0, 1), C order
    digest  SHA-256 of shape and points, 64 hexadecimal digits
    """

    points: NDArray[np.float64]
    digest: str


@dataclass(frozen=True)
class PointSource:
    """
    A point file that was found and read.

    name   as a grid writes it
    path   where it is now
    sets   K, how many sets it holds
    count  N, how many points each of them has
    """

    name: str
    path: Path
    digest: str
    sets: int
    count: int


def read(path: Path) -> PointFile:
    """The points in a file. Raises ``BadParameter`` with one sentence for whatever is wrong with it."""
    name = shown(path.name)
    try:
        with path.open("rb") as file:
            if os.fstat(file.fileno()).st_size > MAX_BYTES:
                raise _too_large(name)
            points = _checked(_array(file, name), name)
    except FileNotFoundError:
        raise BadParameter(f"there is no point file {name} in {path.parent}; `dartboard points` writes one") from None
    except IsADirectoryError:
        raise BadParameter(f"{name} is a folder; name the point file itself, such as {name[1:-1]}/my.npz") from None
    except (OSError, ValueError) as error:  # ValueError: a name that no file system takes
        reason = error.strerror if isinstance(error, OSError) else error
        raise BadParameter(f"cannot read the point file {name}: {reason}; check its name and rights") from None
    return PointFile(points, digest_of(points))


def find(name: str, base: Path) -> PointSource:
    """The point file that a grid in the folder ``base`` names. Raises ``BadParameter``."""
    return source(name, base.absolute() / name)


def source(name: str, path: Path) -> PointSource:
    """The point file at ``path`` under the name that somebody gave it. Raises ``BadParameter``."""
    found = read(path)
    sets, count, _ = found.points.shape
    return PointSource(name, path, found.digest, sets, count)


def write(path: Path, points: NDArray[np.float64], **meta: Any) -> None:
    """
    Write points (K, N, 2), with whatever else is to be known of them as further arrays.

    Written beside and renamed, so that the file is complete or absent.
    """
    import numpy as np

    handle, beside = tempfile.mkstemp(prefix=".points-", suffix=SUFFIX, dir=path.parent)
    try:
        with os.fdopen(handle, "wb") as file:
            np.savez_compressed(file, points=np.asarray(points, np.float64), **meta)
            file.flush()
            os.fsync(file.fileno())
        os.chmod(beside, 0o644)  # mkstemp's 0600 would hide it from a render process of another user
        os.replace(beside, path)
    except BaseException:
        os.unlink(beside)
        raise


def snapshot(of: PointSource, into: Path) -> Path:
    """
    Copy a point file to ``into/<digest>.npz``; nothing happens where it is already there.

    Raises ``BadParameter`` when the file is no longer what it was when it was found, ``EnvironmentProblem`` when
    ``into`` cannot be written.
    """
    target = into / f"{of.digest}{SUFFIX}"
    if target.is_file():
        return target
    found = read(of.path)
    if found.digest != of.digest:
        raise BadParameter(f"the point file {shown(of.name)} was changed while it was copied; submit again")
    try:
        into.mkdir(parents=True, exist_ok=True)
        write(target, found.points)
    except OSError as error:
        reason = f"{error.strerror}; free space there or name another folder"
        raise EnvironmentProblem(f"cannot copy the point file {shown(of.name)} to {into}: {reason}") from error
    return target


def digest_of(points: NDArray[np.float64]) -> str:
    """The identity of points (K, N, 2): SHA-256 of their shape and values, the same on every machine."""
    import numpy as np

    content = np.ascontiguousarray(points, "<f8")
    return hashlib.sha256(f"{content.shape}".encode("ascii") + content.tobytes()).hexdigest()


def _array(file: IO[bytes], name: str) -> NDArray[Any]:
    """What the archive holds as ``points``, of any shape. Nothing is unpacked before it is known to be small."""
    import numpy as np

    if directory_bytes(file) > MAX_DIRECTORY:
        raise _too_large(name)
    try:
        with zipfile.ZipFile(file) as archive:
            if sum(entry.file_size for entry in archive.infolist()) > MAX_BYTES:
                raise _too_large(name)
            if MEMBER not in archive.namelist():
                held = ", ".join(entry.removesuffix(".npy") for entry in archive.namelist()[:5]) or "nothing"
                raise BadParameter(f"the point file {name} holds {held}, and no array named points; add it")
            content = io.BytesIO(archive.read(MEMBER))
        version = np.lib.format.read_magic(content)
        header = np.lib.format.read_array_header_1_0 if version == (1, 0) else np.lib.format.read_array_header_2_0
        shape, columns_first, kind = header(content)
        if kind.kind != "f":
            raise BadParameter(f"points of {name} are of type {kind}; give floating-point numbers in [0, 1)")
        if math.prod(shape) * kind.itemsize > MAX_BYTES:
            raise _too_large(name)
        values = np.frombuffer(content.read(), kind, math.prod(shape))
        return values.reshape(shape, order="F" if columns_first else "C")
    except BadParameter:
        raise
    except Exception as error:  # zipfile and numpy raise a dozen kinds of errors for what is no archive of theirs
        reason = str(error).splitlines()[0][:100] if str(error) else type(error).__name__
        raise BadParameter(
            f"the point file {name} cannot be read ({reason}); write one with numpy.savez, or `dartboard points`"
        ) from None


def _checked(points: NDArray[Any], name: str) -> NDArray[np.float64]:
    """(K, N, 2) float64 in [0, 1); ``BadParameter`` for points that are not."""
    import numpy as np

    if points.ndim not in (2, 3) or points.shape[-1] != 2 or 0 in points.shape:
        raise BadParameter(
            f"points of {name} have the shape {points.shape}; give (K, N, 2) for K sets of N points, or (N, 2) for one"
        )
    sets = points.reshape(-1, *points.shape[-2:])
    values = np.ascontiguousarray(sets, np.float64) + 0.0  # no -0.0: one value, one digest
    wrong = ~((values >= 0) & (values < 1))  # NaN is neither
    if wrong.any():
        first = tuple(int(place) for place in np.argwhere(wrong)[0])
        raise BadParameter(
            f"{int(wrong.sum())} coordinates of the points of {name} are outside [0, 1), the first is "
            f"{float(values[first])!r} at {list(first)}; scale or wrap them"
        )
    return values


def _too_large(name: str) -> BadParameter:
    return BadParameter(
        f"the point file {name} has or unpacks to more than {MAX_BYTES >> 20} MiB; give fewer sets, or fewer points"
    )
