"""
The store: one SQLite database in the data directory, reached through named queries.

The owner has the only connection that writes; readers open their own, read-only, and never wait for it. SQL
lives in ``sql/``: ``schema.sql`` is what a fresh database holds, ``migrations/`` bring older ones there, and
``queries.sql`` names every statement. SQLite comes with ``apsw`` and not with Python, see docs/storage.md.
"""

from __future__ import annotations

import contextlib
import datetime
from collections.abc import Iterable, Iterator, Mapping
from functools import cache
from pathlib import Path
from typing import Any

import apsw

from jobs.errors import DataDirectoryProblem

FILE = "dartboard.sqlite"
SQL = Path(__file__).parent / "sql"
BUSY_MILLISECONDS = 10_000  # a checkpoint or a copy tool may hold the file for a moment
WAL_RESET_BUG = ((3, 7, 0), (3, 51, 2))  # SQLite versions that can corrupt a WAL database with two connections

Row = dict[str, Any]


class Store:
    """
    A connection to a data directory's database. Use ``open`` in the owner and ``read`` everywhere else.

    Not thread-safe: one thread, one store.
    """

    def __init__(self, connection: apsw.Connection, path: Path):
        self.connection, self.path = connection, path
        connection.set_busy_timeout(BUSY_MILLISECONDS)
        connection.execute("PRAGMA foreign_keys=ON")

    @classmethod
    def open(cls, data: Path) -> Store:
        """
        The owner's connection: creates what is missing and migrates what is old.

        Raises ``DataDirectoryProblem`` if the directory is read-only or full, or the database is damaged or was
        written by a newer version.
        """
        _refuse_old_sqlite()
        path = data / FILE
        with told(path):
            data.mkdir(parents=True, exist_ok=True)
            store = cls(apsw.Connection(str(path)), path)
            store.connection.execute("PRAGMA journal_mode=WAL")
            store.connection.execute("PRAGMA synchronous=NORMAL")
            store._migrate()
        return store

    @classmethod
    def read(cls, data: Path) -> Store:
        """
        A read-only connection, beside an owner or without one; it also reads from a medium that cannot be written.

        Raises ``DataDirectoryProblem`` if there is no database, or it is of another version.
        """
        path = data / FILE
        if not path.is_file():
            raise DataDirectoryProblem(
                f"no experiments in {data}: it has no {FILE}; give --data DIR, or make one with `dartboard run GRID`"
            )
        with told(path):
            store = cls(_open_readonly(path), path)
            version = store._version()
        if version != len(migrations()):
            raise DataDirectoryProblem(_other_version(path, version))
        return store

    def close(self) -> None:
        self.connection.close()

    @contextlib.contextmanager
    def transaction(self) -> Iterator[None]:
        """All or nothing; inside another transaction it joins that one. Commits survive a killed process."""
        if self.connection.in_transaction:
            yield
            return
        with told(self.path):
            self.connection.execute("BEGIN IMMEDIATE")
            try:
                yield
                self.connection.execute("COMMIT")
            except BaseException:
                with contextlib.suppress(apsw.Error):  # a full disk has already rolled it back
                    self.connection.execute("ROLLBACK")
                raise

    def run(self, name: str, /, **parameters: Any) -> int:
        """Execute a named statement; how many rows it changed."""
        with told(self.path):
            self.connection.execute(query(name), parameters)
        return int(self.connection.changes())

    def run_many(self, name: str, rows: Iterable[Mapping[str, Any]]) -> None:
        """Execute a named statement once per row."""
        with told(self.path):
            self.connection.executemany(query(name), rows)

    def insert(self, name: str, /, **parameters: Any) -> int:
        """Execute a named insert; the id of the new row."""
        self.run(name, **parameters)
        return int(self.connection.last_insert_rowid())

    def rows(self, name: str, /, **parameters: Any) -> Iterator[Row]:
        """The rows of a named query, one dict each, as they are read."""
        with told(self.path):
            cursor = self.connection.execute(query(name), parameters)
            columns: list[str] = []
            for values in cursor:
                columns = columns or [column[0] for column in cursor.get_description()]
                yield dict(zip(columns, values, strict=True))

    def one(self, name: str, /, **parameters: Any) -> Row | None:
        """The first row of a named query, or None."""
        return next(self.rows(name, **parameters), None)

    def value(self, name: str, /, **parameters: Any) -> Any:
        """The first column of the first row, or None."""
        row = self.one(name, **parameters)
        return next(iter(row.values())) if row else None

    def revision(self) -> int:
        """Grows with everything that happens; 0 for a fresh database."""
        return int(self.value("revision") or 0)

    def _version(self) -> int:
        return int(next(iter(self.connection.execute("PRAGMA user_version")))[0])

    def _migrate(self) -> None:
        steps = migrations()
        with self.transaction():
            version = self._version()
            if version > len(steps):
                raise DataDirectoryProblem(_other_version(self.path, version))
            for step in steps[version:]:
                self.connection.execute(step.read_text())
            self.connection.execute(f"PRAGMA user_version={len(steps)}")


def now() -> str:
    """This moment as stored: UTC, ISO 8601 with milliseconds."""
    return datetime.datetime.now(datetime.UTC).isoformat(timespec="milliseconds")


@cache
def migrations() -> list[Path]:
    """The steps from an empty database to today's, in order."""
    return sorted((SQL / "migrations").glob("*.sql"))


def query(name: str) -> str:
    """The statement after ``-- name: NAME`` in queries.sql."""
    return _queries()[name]


@cache
def _queries() -> dict[str, str]:
    blocks = (SQL / "queries.sql").read_text().split("-- name: ")[1:]
    return {name.strip(): text for name, _, text in (block.partition("\n") for block in blocks)}


@contextlib.contextmanager
def told(path: Path) -> Iterator[None]:
    """SQLite's and the system's errors about ``path`` as one sentence each."""
    try:
        yield
    except apsw.FullError as error:
        raise DataDirectoryProblem(
            f"the disk of {path.parent} is full; free some space and run again: nothing that was finished is lost"
        ) from error
    except (apsw.ReadOnlyError, apsw.CantOpenError, apsw.PermissionsError) as error:
        raise DataDirectoryProblem(
            f"{path.parent} cannot be written ({error}); make it writable or choose another --data DIR"
        ) from error
    except (apsw.NotADBError, apsw.CorruptError) as error:
        raise DataDirectoryProblem(
            f"{path} is no database of ours, or damaged ({error}); restore it from a copy or choose another --data DIR"
        ) from error
    except apsw.BusyError as error:
        raise DataDirectoryProblem(
            f"another program has held {path} for {BUSY_MILLISECONDS // 1000} s; close it and run again"
        ) from error
    except apsw.IOError as error:
        raise DataDirectoryProblem(
            f"{path} cannot be read or written ({error}); check the disk, then run again: what was finished is there"
        ) from error
    except OSError as error:
        raise DataDirectoryProblem(
            f"{path.parent} cannot be used: {error.strerror}; choose another --data DIR"
        ) from error


def _open_readonly(path: Path) -> apsw.Connection:
    connection = apsw.Connection(str(path), flags=apsw.SQLITE_OPEN_READONLY)
    try:
        connection.execute("PRAGMA user_version").fetchall()
        return connection
    except (apsw.CantOpenError, apsw.ReadOnlyError):
        # A WAL database wants to write its index beside the file. Where it cannot, nobody else can write either.
        connection.close()
        flags = apsw.SQLITE_OPEN_READONLY | apsw.SQLITE_OPEN_URI
        return apsw.Connection(f"{path.resolve().as_uri()}?immutable=1", flags=flags)


def _refuse_old_sqlite() -> None:
    """apsw's wheels bring a sound SQLite; one built against the system's may not."""
    version = tuple(int(part) for part in apsw.sqlite_lib_version().split("."))
    if WAL_RESET_BUG[0] <= version <= WAL_RESET_BUG[1]:
        raise DataDirectoryProblem(
            f"apsw was built with SQLite {apsw.sqlite_lib_version()}, which can corrupt a database in WAL mode; "
            f"install apsw's own wheel: pip install --force-reinstall --only-binary apsw apsw"
        )


def _other_version(path: Path, version: int) -> str:
    known = len(migrations())
    if version > known:
        return (
            f"{path} was written by a newer Dartboard (its version is {version}, this one knows {known}); "
            f"update Dartboard or choose another --data DIR"
        )
    return (
        f"{path} was written by an older Dartboard (its version is {version}, this one reads {known}); "
        f"any command that writes, such as `dartboard run GRID`, brings it up to date"
    )
