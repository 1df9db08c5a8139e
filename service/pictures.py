"""
Pictures of cells for browsers: previews, error maps, float16 rows. Made when asked for, the last ones kept in memory.

A finished replicate never changes, and its file has the digest of its cell for a name: so whatever is made of it has a
tag that tells it from anything else, in any data directory. A picture that is still being drawn is read from the small
file that its render process writes, and has none.
"""

from __future__ import annotations

import contextlib
import hashlib
import logging
import threading
from collections import OrderedDict
from collections.abc import Callable, Sequence
from concurrent.futures import Future
from dataclasses import dataclass
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from jobs.artifacts import Artifacts
from jobs.errors import NotFound
from jobs.store import Row, Store
from renderer import __version__
from renderer.errors import BadParameter, DartboardError, UnknownName
from renderer.images import read_picture
from renderer.metrics import METRICS, Reference
from renderer.previews import error_png, preview_png, shrink, to_half

log = logging.getLogger("dartboard")
T = TypeVar("T", bytes, NDArray[np.float32])
Floats = NDArray[np.float32]

SIZES = (64, 128, 256, 512)  # pixels of a preview's longer side: few, so that pages share them
KEPT_PNG_BYTES = 2**23  # what asks for the same again finds it in service/kept.py
KEPT_PICTURE_BYTES = 3 * 2**24  # a reference in halves and a picture of it, of 1024 × 1024 pixels
MEAN = "mean"  # in place of a replicate's number: the mean of all of them


class Cache:
    """Values by key, the least used dropped when all of them have more than ``limit`` bytes. For any thread."""

    def __init__(self, limit: int):
        self.limit, self.bytes = limit, 0
        self.held: OrderedDict[object, bytes | Floats] = OrderedDict()
        self.making: dict[object, Future[Any]] = {}
        self.lock = threading.Lock()

    def get(self, key: object, make: Callable[[], T]) -> T:
        """The value of ``key``, made once: fifty pages ask for a new picture in the same moment."""
        with self.lock:
            if key in self.held:
                self.held.move_to_end(key)
                return self.held[key]  # type: ignore[return-value]
            known = self.making.get(key)
            if known is None:
                made = self.making[key] = Future[Any]()
        if known is not None:
            return known.result()  # type: ignore[no-any-return]
        try:
            value = make()
        except BaseException as error:
            with self.lock:
                del self.making[key]
            made.set_exception(error)
            raise
        with self.lock:
            del self.making[key]
            self.held[key] = value
            self.bytes += _size(value)
            while self.bytes > self.limit and len(self.held) > 1:
                self.bytes -= _size(self.held.popitem(last=False)[1])
        made.set_result(value)
        return value


@dataclass(frozen=True)
class Made:
    """
    A picture in the form that was asked for.

    tag      of what it is made of: equal tags, equal pictures. None: it changes any moment
    fixed    its address never shows anything else; False for means, which grow, and for what is compared with one
    make     its bytes
    """

    tag: str | None
    fixed: bool
    make: Callable[[], bytes]


class Pictures:
    """The pictures of one data directory."""

    def __init__(self, artifacts: Artifacts):
        self.artifacts = artifacts
        self.png, self.decoded = Cache(KEPT_PNG_BYTES), Cache(KEPT_PICTURE_BYTES)

    def preview(
        self, store: Store, cell: int, role: str, k: str, *, size: int, ev: float, tone: str, maximum: float
    ) -> Made:
        """
        A tone-mapped PNG. Of a replicate that is not finished, what is drawn so far.

        Raises ``NotFound`` while there is nothing to see.
        """
        _check_size(size)
        try:
            names = self._names(store, cell, role, k)
        except NotFound:
            partial = self._partial(store, cell)
            if partial is None:
                raise
            shown = shrink(partial, size)
            return Made(None, False, lambda: preview_png(shown, ev=ev, tone=tone, maximum=maximum))
        key = (names, size, ev, tone, maximum)

        def make() -> bytes:
            return preview_png(self._shrunk(names, size), ev=ev, tone=tone, maximum=maximum)

        return Made(_tag(key), k != MEAN, lambda: self.png.get(key, make))

    def error(self, store: Store, cell: int, metric: str, reference: int, k: str, *, size: int, maximum: float) -> Made:
        """The map of a metric as a PNG, from 0 to ``maximum``. Raises ``NotFound`` while nothing can be compared."""
        if metric not in METRICS:
            raise UnknownName("metric", metric, "", METRICS)
        _check_size(size)
        names = self._names(store, cell, "cell", k)
        halves = [tuple(row["image"] for row in self._rows(store, reference, "reference")[part::2]) for part in (0, 1)]
        if not all(halves):
            raise NotFound(f"reference {reference} is not finished yet; there is nothing to compare with")
        key = (names, metric, METRICS[metric].version, *halves, size, maximum)

        def make() -> bytes:
            against = Reference(self._mean(halves[0]), self._mean(halves[1]))
            picture = self._mean(names)
            if picture.shape != against.first.shape:
                raise BadParameter(f"cell {cell} and reference {reference} differ in size: nothing can be compared")
            return error_png(shrink(METRICS[metric].error_map(picture, against), size), maximum)

        return Made(_tag(key), False, lambda: self.png.get(key, make))

    def pixels(self, store: Store, cell: int, role: str, k: str, size: int | None) -> tuple[int, int, Made]:
        """Width, height and float16 RGB rows from the top."""
        names = self._names(store, cell, role, k)
        picture = self._mean(names) if size is None else self._shrunk(names, size)
        made = Made(_tag((names, size)), k != MEAN, lambda: to_half(picture).tobytes())
        return picture.shape[1], picture.shape[0], made

    def file(self, store: Store, cell: int, role: str, k: int) -> str:
        """The EXR file of a replicate, relative to the data directory."""
        return self._names(store, cell, role, str(k))[0]

    def _names(self, store: Store, cell: int, role: str, k: str) -> tuple[str, ...]:
        """The files of one replicate, or of all of them."""
        rows = self._rows(store, cell, role)
        if k != MEAN and not k.isdecimal():
            raise BadParameter(f"k = {k[:20]!r} is not allowed; give the number of a replicate, or {MEAN}")
        names = tuple(row["image"] for row in rows if k == MEAN or row["k"] == int(k))
        if not names:
            known = store.one("cell_by_id", id=cell)
            if known is None:
                raise NotFound(f"there is no cell {cell}")
            which = "no picture" if k == MEAN else f"no picture {k}"
            raise NotFound(f"cell {cell} has {which} of role {role!r} yet; it is {known['state']}")
        return names

    def _rows(self, store: Store, cell: int, role: str) -> list[Row]:
        return store.rows("images", cell_id=cell, role=role)

    def _shrunk(self, names: tuple[str, ...], size: int) -> Floats:
        return self.decoded.get((names, size), lambda: np.asarray(shrink(self._mean(names), size), np.float32))

    def _mean(self, names: Sequence[str]) -> Floats:
        """The mean of pictures, float32."""

        def make() -> Floats:
            total = self._read(names[0])
            if len(names) == 1:
                return total
            whole = total.astype(np.float64)
            for name in names[1:]:
                whole += self._read(name)
            return np.asarray(whole / len(names), np.float32)

        return self.decoded.get(tuple(names), make)

    def _read(self, name: str) -> Floats:
        try:
            return read_picture(self.artifacts.path(name))
        except DartboardError as error:
            log.warning("a picture cannot be shown: %s", error)
            raise NotFound(f"the picture {name} cannot be shown: its file is gone or damaged") from None

    def _partial(self, store: Store, cell: int) -> Floats | None:
        """What a render process has drawn so far of a cell, None where it shows nothing yet."""
        known = store.one("cell_by_id", id=cell)
        with contextlib.suppress(OSError, ValueError, EOFError):
            if known is not None:
                loaded = np.load(self.artifacts.preview(known["digest"]), allow_pickle=False)
                return np.asarray(loaded, np.float32)
        return None


def _tag(key: object) -> str:
    """A short name of what a picture is made of, and by which Dartboard."""
    return hashlib.sha256(repr((__version__, key)).encode()).hexdigest()[:32]


def _check_size(size: int) -> None:
    if size not in SIZES:
        raise BadParameter(f"size = {size} is not allowed; give one of {', '.join(map(str, SIZES))}")


def _size(value: bytes | Floats) -> int:
    return len(value) if isinstance(value, bytes) else value.nbytes
