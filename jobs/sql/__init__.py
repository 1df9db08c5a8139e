"""
All SQL of the program: named statements, the schema, and the way of a database through its versions.

``queries.sql`` names every statement; ``migrations/`` lead from an empty database to today's, one file per
version, and ``schema.sql`` shows where they end. Only ``jobs/store.py`` executes what is here.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache
from pathlib import Path

import apsw

HERE = Path(__file__).parent
BUSY_MILLISECONDS = 10_000  # a checkpoint or a copy tool may hold the file for a moment
CACHE_KIB = 65_536  # holds the indexes of a grid of 100 000 cells while it is inserted


@cache
def query(name: str) -> str:
    """The statement after ``-- name: NAME`` in queries.sql."""
    return _queries()[name]


@cache
def migrations() -> list[str]:
    """The steps from an empty database to today's, in order; their number is today's version."""
    return [file.read_text(encoding="utf-8") for file in sorted((HERE / "migrations").glob("*.sql"))]


def version(connection: apsw.Connection) -> int:
    """Which migration the database has reached; 0 for an empty one."""
    return int(connection.pragma("user_version"))


def settle(connection: apsw.Connection) -> None:
    """
    What every connection needs: foreign keys, patience, and commits that survive a killed process.

    NORMAL syncs at checkpoints only: a power cut may take back the last commits, and never tears one apart.
    """
    connection.set_busy_timeout(BUSY_MILLISECONDS)
    connection.pragma("foreign_keys", True)
    connection.pragma("synchronous", "NORMAL")
    connection.pragma("cache_size", -CACHE_KIB)


def use_wal(connection: apsw.Connection) -> bool:
    """Let readers see the last commit while the next one is written; False on file systems that cannot."""
    return bool(connection.pragma("journal_mode", "WAL") == "wal")


def migrate(connection: apsw.Connection, steps: Sequence[str]) -> None:
    """
    Bring a database to the version ``len(steps)``: all steps that it lacks, or none.

    The caller has refused newer versions and holds a transaction.
    """
    for step in steps[version(connection) :]:
        connection.execute(step)
    connection.pragma("user_version", len(steps))


@cache
def _queries() -> dict[str, str]:
    blocks = (HERE / "queries.sql").read_text(encoding="utf-8").split("-- name: ")[1:]
    return {name.strip(): text for name, _, text in (block.partition("\n") for block in blocks)}
