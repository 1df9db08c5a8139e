"""
The store: one SQLite database in the data directory, reached through named queries.

The owner has the only connection that writes; readers open their own, read-only, and never wait for it. The
statements are in ``sql/``; what the disk or SQLite refuses becomes one sentence here. SQLite comes with
``apsw`` and not with Python, see docs/storage.md.
"""

from __future__ import annotations

import contextlib
import datetime
import shutil
import tempfile
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any

import apsw

from jobs import disk, sql
from jobs.errors import DataDirectoryProblem

FILE = "dartboard.sqlite"
WAL_RESET_BUG = ((3, 7, 0), (3, 51, 2))  # SQLite versions that can corrupt a WAL database with two connections

Row = dict[str, Any]


class Store:
    """
    A connection to a data directory's database. Use ``open`` in the owner and ``read`` everywhere else.

    Not thread-safe: one thread, one store.
    """

    def __init__(self, connection: apsw.Connection, path: Path):
        self.connection, self.path = connection, path
        sql.settle(connection)

    @classmethod
    def open(cls, data: Path) -> Store:
        """
        The owner's connection: creates what is missing and migrates what is old.

        Raises ``DataDirectoryProblem`` if the directory is read-only or full, or the database is damaged or was
        written by a newer version.
        """
        refuse_unsound(apsw.sqlite_lib_version())
        path = data / FILE
        with told(path):
            data.mkdir(parents=True, exist_ok=True)
            store = cls(apsw.Connection(str(path)), path)
            try:
                store._prepare()
            except BaseException:
                store.close()
                raise
        return store

    @classmethod
    def read(cls, data: Path) -> Store:
        """
        A read-only connection, beside an owner or without one; it also reads from a medium that cannot be written.

        Raises ``DataDirectoryProblem`` if there is no database, or it is of another version.
        """
        path = data / FILE
        with told(path):
            if not path.is_file():
                raise DataDirectoryProblem(_nothing_in(path))
            connection = _open_readonly(path)
            version = sql.version(connection)
            if version != len(sql.migrations()):
                connection.close()
                raise DataDirectoryProblem(_other_version(path, version) if version else _nothing_in(path))
            return cls(connection, path)

    def close(self) -> None:
        self.connection.close()

    @contextlib.contextmanager
    def transaction(self) -> Iterator[None]:
        """All or nothing; inside another transaction it joins that one. Commits survive a killed process."""
        if self.connection.in_transaction:
            yield
            return
        with told(self.path):
            self.connection.execute("begin immediate")
            try:
                yield
                self.connection.execute("commit")
            except BaseException:
                with contextlib.suppress(apsw.Error):  # a full disk has already rolled it back
                    self.connection.execute("rollback")
                raise

    @contextlib.contextmanager
    def moment(self) -> Iterator[None]:
        """Every query inside sees the same commit, whatever an owner writes meanwhile."""
        if self.connection.in_transaction:
            yield
            return
        with told(self.path):
            self.connection.execute("begin")
            try:
                yield
            finally:
                with contextlib.suppress(apsw.Error):  # the error that ended the block is the one to tell
                    self.connection.execute("rollback")

    @contextlib.contextmanager
    def without_foreign_keys(self) -> Iterator[None]:
        """Rows may be deleted in any order; the caller leaves none that points nowhere. Not inside a transaction."""
        self.connection.pragma("foreign_keys", False)
        try:
            yield
        finally:
            self.connection.pragma("foreign_keys", True)

    def run(self, name: str, /, **parameters: Any) -> int:
        """Execute a named statement; how many rows it changed."""
        with told(self.path):
            self.connection.execute(sql.query(name), parameters)
        return int(self.connection.changes())

    def run_many(self, name: str, /, rows: Iterable[Mapping[str, Any]]) -> None:
        """Execute a named statement once per row."""
        with told(self.path):
            self.connection.executemany(sql.query(name), rows)

    def insert(self, name: str, /, **parameters: Any) -> int:
        """Execute a named insert; the id of the new row."""
        self.run(name, **parameters)
        return int(self.connection.last_insert_rowid())

    def rows(self, name: str, /, **parameters: Any) -> list[Row]:
        """The rows of a named query, one dict each."""
        return list(self.stream(name, **parameters))

    def stream(self, name: str, /, **parameters: Any) -> Iterator[Row]:
        """Like ``rows``, read as they are used: one consistent moment, however long that takes."""
        with told(self.path):
            cursor = self.connection.execute(sql.query(name), parameters)
            columns: list[str] | None = None
            for values in cursor:
                columns = columns or [column[0] for column in cursor.get_description()]
                yield dict(zip(columns, values, strict=True))

    def one(self, name: str, /, **parameters: Any) -> Row | None:
        """The first row of a named query, or None."""
        return next(self.stream(name, **parameters), None)

    def value(self, name: str, /, **parameters: Any) -> Any:
        """The first column of the first row, or None."""
        with told(self.path):
            row = next(self.connection.execute(sql.query(name), parameters), None)
        return row[0] if row else None

    def revision(self) -> int:
        """Grows with everything that happens; 0 for a fresh database."""
        return int(self.value("revision") or 0)

    def _prepare(self) -> None:
        known, version = len(sql.migrations()), sql.version(self.connection)
        if version > known:
            raise DataDirectoryProblem(_other_version(self.path, version))
        if not sql.use_wal(self.connection):
            raise DataDirectoryProblem(
                f"the file system of {self.path.parent} cannot hold a database that is read while it is written; "
                f"choose a --data DIR on a local disk"
            )
        with self.without_foreign_keys(), self.transaction():  # a step may make a table anew that others refer to
            sql.migrate(self.connection, sql.migrations())


def now() -> str:
    """This moment as stored: UTC, ISO 8601 with milliseconds."""
    return datetime.datetime.now(datetime.UTC).isoformat(timespec="milliseconds")


def refuse_unsound(version: str) -> None:
    """apsw's wheels bring a sound SQLite; one that was built against the system's may not."""
    if WAL_RESET_BUG[0] <= tuple(int(part) for part in version.split(".")) <= WAL_RESET_BUG[1]:
        raise DataDirectoryProblem(
            f"apsw was built with SQLite {version}, which can corrupt a database that is read while it is written; "
            f"install apsw's own wheel: pip install --force-reinstall --only-binary apsw apsw"
        )


@contextlib.contextmanager
def told(path: Path) -> Iterator[None]:
    """SQLite's and the system's errors about ``path`` as one sentence each."""
    try:
        yield
    except apsw.FullError as error:
        raise disk.full(path.parent) from error
    except apsw.ReadOnlyError as error:
        raise DataDirectoryProblem(
            f"the data directory {path.parent} cannot be written; make it writable or choose another --data DIR"
        ) from error
    except (apsw.CantOpenError, apsw.PermissionsError) as error:
        raise DataDirectoryProblem(
            f"{path} cannot be opened; make it and its folder readable and writable, or choose another --data DIR"
        ) from error
    except (apsw.NotADBError, apsw.CorruptError) as error:
        raise DataDirectoryProblem(
            f"{path} is damaged or no database of ours ({error}); restore it from a copy or choose another --data DIR"
        ) from error
    except apsw.BusyError as error:
        raise DataDirectoryProblem(
            f"another program has held {path} for {sql.BUSY_MILLISECONDS // 1000} s; close it and run again"
        ) from error
    except apsw.IOError as error:
        raise DataDirectoryProblem(
            f"{path} cannot be read or written ({error}); check the disk, then run again: what was finished is there"
        ) from error
    except OSError as error:
        raise disk.problem(error, path.parent) from error


def _open_readonly(path: Path) -> apsw.Connection:
    connection = apsw.Connection(str(path), flags=apsw.SQLITE_OPEN_READONLY)
    connection.set_busy_timeout(sql.BUSY_MILLISECONDS)
    try:
        sql.version(connection)
        return connection
    except (apsw.CantOpenError, apsw.ReadOnlyError):
        # A WAL database wants an index beside the file, even for reading. Where nobody can write one, nobody
        # writes the database either, and it can be read as it lies there.
        connection.close()
    log = path.with_name(path.name + "-wal")
    if log.exists() and log.stat().st_size:
        return _open_copy(path, log)  # commits of an owner that was killed: only SQLite can put them together
    flags = apsw.SQLITE_OPEN_READONLY | apsw.SQLITE_OPEN_URI
    return apsw.Connection(f"{path.resolve().as_uri()}?immutable=1", flags=flags)


def _open_copy(*files: Path) -> apsw.Connection:
    with tempfile.TemporaryDirectory(prefix="dartboard-") as folder:
        for file in files:
            shutil.copyfile(file, Path(folder) / file.name)
        connection = apsw.Connection(str(Path(folder) / files[0].name))
        sql.version(connection)  # opens every file that it needs: they live on without names
        return connection


def _nothing_in(path: Path) -> str:
    return f"no experiments in {path.parent}: it has no {FILE}; give --data DIR, or make one with `dartboard run GRID`"


def _other_version(path: Path, version: int) -> str:
    known = len(sql.migrations())
    if version > known:
        return (
            f"{path} was written by a newer Dartboard (its version is {version}, this one knows {known}); "
            f"update Dartboard or choose another --data DIR"
        )
    return (
        f"{path} was written by an older Dartboard (its version is {version}, this one reads {known}); "
        f"any command that writes, such as `dartboard run GRID`, brings it up to date"
    )
