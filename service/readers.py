"""Read-only connections of a server: kept open between requests, each lent to one thread at a time."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from pathlib import Path
from queue import Empty, Full, LifoQueue

from jobs.store import Store
from renderer.errors import DartboardError

KEPT = 40  # as many as there are threads that read; opening one costs a millisecond
CACHE_KIB = 2048


class Readers:
    """Read-only connections, lent to one thread at a time."""

    def __init__(self, data: Path):
        self.data = data
        self.free: LifoQueue[Store] = LifoQueue(KEPT)

    @contextlib.contextmanager
    def lend(self) -> Iterator[Store]:
        try:
            store = self.free.get_nowait()
        except Empty:
            store = Store.read(self.data)
            store.connection.pragma("cache_size", -CACHE_KIB)
        try:
            yield store
        except DartboardError:
            self._give_back(store)
            raise
        except BaseException:
            store.close()
            raise
        self._give_back(store)

    def _give_back(self, store: Store) -> None:
        try:
            self.free.put_nowait(store)
        except Full:
            store.close()

    def close(self) -> None:
        while not self.free.empty():
            self.free.get_nowait().close()
