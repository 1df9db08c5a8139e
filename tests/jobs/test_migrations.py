"""The way of a database through its versions."""

from __future__ import annotations

import re
from pathlib import Path

import apsw
import pytest

from jobs import queue, sql, trash
from jobs.errors import DataDirectoryProblem
from jobs.store import FILE, Store
from tests.jobs.conftest import assert_sound, select, submit

VERSION_1 = """
insert into scene values (1, 's', 'box', 'scene.xml', 1);
insert into cell (id, digest, state, revision, scene_id, spp, pixels, estimand, spec)
values (5, 'c', 'cancelled', 1, 1, 4, 9, 'e', '{}');
insert into experiment values (3, 'a', 'old', 'then', null, '{}'), (7, 'b', 'stopped', 'then', 'later', '{}');
insert into experiment_cell (experiment_id, position, cell_id, role, replicates, spp_asked, scene, integrator, sampler)
values (7, 0, 5, 'cell', 2, 4, 'box', 'path', 'independent');
insert into event (at, what, experiment_id) values ('then', 'submit', 7);
"""


def shape(connection: apsw.Connection) -> dict[str, object]:
    """Tables with their columns, keys and indexes; the text of views and triggers, without comments and blanks."""
    found: dict[str, object] = {}
    for kind, name, table, text in connection.execute("select type, name, tbl_name, sql from sqlite_schema"):
        plain = re.sub(r"\s+", " ", re.sub(r"--.*", "", text or ""))
        if kind == "table":
            found[name] = [
                list(connection.execute(f"pragma {what}({name})"))
                for what in ("table_xinfo", "foreign_key_list", "index_list")
            ] + [
                "strict" in plain,
                "without rowid" in plain,
                "autoincrement" in plain,
                sorted(re.findall(r"check \(.*?\)\)?", plain)),
            ]
        elif kind == "index":
            found[name] = [table, list(connection.execute(f"pragma index_xinfo({name})")), plain]
        else:
            found[name] = plain
    return found


def test_the_schema_is_where_all_migrations_end():
    """A change of one without the other fails here."""
    described, migrated = apsw.Connection(":memory:"), apsw.Connection(":memory:")
    described.execute((sql.HERE / "schema.sql").read_text())
    sql.migrate(migrated, sql.migrations())
    assert shape(described) == shape(migrated)
    assert sql.version(migrated) == len(sql.migrations())


def test_every_table_is_strict():
    assert all(row[0] for row in _fresh().execute("select strict from pragma_table_list where schema = 'main' "
                                                  "and type = 'table' and name not like 'sqlite_%'"))  # fmt: skip


def test_migrations_are_numbered_without_gaps_and_open_with_their_intent():
    files = sorted((sql.HERE / "migrations").iterdir())
    for number, file in enumerate(files, start=1):
        assert re.fullmatch(rf"{number:04}_[a-z_]+\.sql", file.name)
        first, second, *_ = file.read_text().splitlines()
        assert first == f"-- {file.name}"
        assert second.startswith("-- ") and len(second) > 20


def test_a_database_of_any_older_version_is_brought_up_to_date(data):
    """From nothing, and from every version in between, without touching what is there."""
    for version in range(len(sql.migrations())):
        folder = data / str(version)
        folder.mkdir(parents=True)
        old = apsw.Connection(str(folder / FILE))
        sql.migrate(old, sql.migrations()[:version])
        old.close()
        store = Store.open(folder)
        assert shape(store.connection) == shape(_fresh())
        store.close()


def test_version_1_keeps_its_rows_and_its_references(data):
    """A table that is made anew has every row under its id, and what refers to it still does."""
    data.mkdir()
    old = apsw.Connection(str(data / FILE))
    sql.migrate(old, sql.migrations()[:1])
    old.execute(VERSION_1)
    old.close()
    store = Store.open(data)
    assert_sound(store)
    columns = "id, digest, name, created_at, cancelled_at, grid, paused_at, deleted_at"
    assert select(store, f"select {columns} from experiment order by id") == [
        (3, "a", "old", "then", None, "{}", None, None),
        (7, "b", "stopped", "then", "later", "{}", None, None),
    ]
    assert select(store, "select state from standing") == [("cancelled",)]
    assert select(store, "select id, digest, state, revision, spec from cell") == [(5, "c", "cancelled", 1, "{}")]
    with pytest.raises(apsw.ConstraintError, match="FOREIGN KEY"):
        store.connection.execute("insert into event (at, what, experiment_id) values ('now', 'submit', 4)")
    store.close()


def test_an_id_that_is_gone_is_never_given_again(store, artifacts):
    """Else the address of a deleted experiment would show another, and the one of its pictures other pictures."""
    submit(store, name="first")
    second = submit(store, name="second", spp=[9])
    cells = {row[0] for row in select(store, "select id from cell")}
    queue.delete(store, second.id)
    assert trash.empty(store, artifacts, seconds=-1) == 1
    assert submit(store, name="third", spp=[16]).id > second.id
    (new,) = select(store, "select id from cell where spp = 16")
    assert new[0] > max(cells)


def test_a_step_that_breaks_leaves_the_old_version_whole():
    connection = _fresh()
    before = shape(connection)
    steps = [*sql.migrations(), "create table more (a) strict; insert into nowhere values (1);"]
    with pytest.raises(apsw.SQLError), connection:
        sql.migrate(connection, steps)
    assert (shape(connection), sql.version(connection)) == (before, len(sql.migrations()))


def test_later_steps_see_what_earlier_ones_left():
    connection = _fresh()
    steps = [*sql.migrations(), "create table more (a integer) strict;", "alter table more add column b text;"]
    with connection:
        sql.migrate(connection, steps)
    assert sql.version(connection) == len(steps)
    assert [row[1] for row in connection.execute("pragma table_info(more)")] == ["a", "b"]


@pytest.mark.parametrize("open_store", [Store.open, Store.read])
def test_a_database_of_a_newer_version_is_refused_and_left_alone(data, open_store):
    Store.open(data).close()
    connection = apsw.Connection(str(data / FILE))
    connection.pragma("user_version", 99)
    connection.close()
    content = (data / FILE).read_bytes()
    with pytest.raises(DataDirectoryProblem, match=r"newer Dartboard \(its version is 99.*update Dartboard or choose"):
        open_store(data)
    assert (data / FILE).read_bytes() == content


def test_a_reader_does_not_migrate_and_says_who_does(data, monkeypatch):
    Store.open(data).close()
    steps = [*sql.migrations(), "create table more (a integer) strict;"]
    monkeypatch.setattr(sql, "migrations", lambda: steps)
    told = rf"older Dartboard \(its version is {len(steps) - 1}, this one reads {len(steps)}\).*dartboard run"
    with pytest.raises(DataDirectoryProblem, match=told):
        Store.read(data)
    store = Store.open(data)
    assert select(store, "select count(*) from more") == [(0,)]
    store.close()


def test_every_statement_is_valid_and_used(store):
    """Names and columns of queries.sql exist, and no statement is left over from something that is gone."""
    root = Path(sql.HERE).parent.parent
    source = "\n".join(file.read_text() for folder in ("jobs", "service") for file in (root / folder).rglob("*.py"))
    for name in sql._queries():
        text = sql.query(name)
        parameters = dict.fromkeys(re.findall(r":([a-z_]+)", text), None)
        store.connection.execute("explain " + text, parameters)
        assert f'"{name}"' in source, f"{name} is never used"


def _fresh() -> apsw.Connection:
    connection = apsw.Connection(":memory:")
    sql.migrate(connection, sql.migrations())
    return connection
