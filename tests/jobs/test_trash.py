"""Deleting an experiment: what goes, what stays, what comes back, and that the database is sound after all of it."""

from __future__ import annotations

import datetime

import numpy as np
import pytest

from jobs import experiments, queue, results, trash
from jobs.errors import NotFound, WasDeleted
from jobs.measure import Measurer
from tests.jobs.conftest import (
    SIZE,
    assert_sound,
    claim,
    draw,
    dump,
    planned,
    record,
    select,
    submit,
    work_off,
)

SINCE = -1  # seconds: whatever was deleted, was deleted long enough ago


def finish_all(store, artifacts, measurer=None, picture=lambda role: None) -> Measurer:
    """Every picture as a file, and measured."""
    measurer = measurer or Measurer(store, artifacts)
    while work := claim(store):
        for role, k in work.missing:
            measurer.add(draw(store, artifacts, work, role, k, picture(role)))
        queue.finish(store, work)
    while measurer.step(60):
        pass
    return measurer


def files(artifacts) -> set[str]:
    folders = ("images", "logs")
    return {str(path.relative_to(artifacts.data)) for name in folders for path in (artifacts.data / name).rglob("*.*")}


def test_what_would_go_is_what_goes(store, artifacts):
    """The cells that nobody else has, their pictures and their bytes."""
    one = submit(store, name="one", spp=[1, 2], replicates=2)
    two = submit(store, name="two", spp=[2, 3], replicates=3)
    finish_all(store, artifacts)
    loss = trash.loss(store, artifacts, one.id)
    assert (loss.cells, loss.pictures) == (1, 2), "2 spp and the reference are the other's too"
    before = files(artifacts)
    kept = list(results.rows(store, two.id))
    queue.delete(store, one.id)
    assert files(artifacts) == before
    assert trash.empty(store, artifacts, seconds=SINCE) == 1
    gone = before - files(artifacts)
    assert len(gone) == loss.pictures
    assert not any((artifacts.data / name).parent.exists() for name in gone)
    assert list(results.rows(store, two.id)) == kept
    assert_sound(store)
    whole = trash.loss(store, artifacts, two.id)
    assert (whole.cells, whole.pictures) == (3, 8)
    assert whole.disk_bytes == sum((artifacts.data / name).stat().st_size for name in files(artifacts))


def test_after_the_last_one_nothing_is_left(store, artifacts):
    """Two that share everything: the first takes nothing, the second all, logs included."""
    one, two = submit(store, name="one", spp=[1, 2]), submit(store, name="two", spp=[1, 2])
    work = claim(store)
    log = artifacts.write_log(work.attempt_id, "last words")
    queue.fail(store, work, "nan_output", "3 pixels are NaN", log)
    finish_all(store, artifacts)
    experiments.submit(store, planned(name="two", spp=[1, 2]), artifacts.scenes, "a key")
    for experiment, left in ((one, len(files(artifacts))), (two, 0)):
        queue.delete(store, experiment.id)
        trash.empty(store, artifacts, seconds=SINCE)
        assert len(files(artifacts)) == left
        assert_sound(store)
    rows = dump(store)
    for table in ("cell", "experiment", "experiment_cell", "attempt", "replicate", "metric", "submission", "point"):
        assert rows[table] == [], table
    assert {row[2:] for row in rows["event"]} == {("measure", None, None), ("purge", None, None)}


def test_it_vanishes_at_once_and_undo_brings_everything_back(store, artifacts):
    experiment = submit(store, spp=[1, 2])
    finish_all(store, artifacts)
    submit(store, name="other")
    before, pictures = list(results.rows(store, experiment.id)), files(artifacts)
    rows = dump(store)
    queue.delete(store, experiment.id)
    for look in (lambda: experiments.get(store, experiment.id), lambda: experiments.find(store, str(experiment.id))):
        with pytest.raises(WasDeleted, match=rf"experiment {experiment.id} \(.*\) was deleted; restore it within ten"):
            look()
    with pytest.raises(NotFound, match="there are: 2 \\(other\\)"):
        experiments.find(store, experiment.name)
    assert [found.name for found in experiments.everything(store)] == ["other"]
    assert trash.empty(store, artifacts) == 0
    queue.restore(store, experiment.id)
    assert experiments.get(store, experiment.id) == experiment
    assert list(results.rows(store, experiment.id)) == before
    assert files(artifacts) == pictures
    after = dump(store)
    for table in ("experiment", "experiment_cell", "replicate", "metric", "point", "attempt", "scene"):
        assert after[table] == rows[table], table
    assert trash.empty(store, artifacts, seconds=SINCE) == 0


def test_it_is_final_after_a_while_and_not_before(store, artifacts):
    experiment = submit(store)
    queue.delete(store, experiment.id)
    (deleted_at,) = select(store, "select deleted_at from experiment")[0]
    final = datetime.datetime.fromisoformat(trash.final_at(deleted_at))
    assert (final - datetime.datetime.fromisoformat(deleted_at)).total_seconds() == trash.UNDO_SECONDS
    assert trash.empty(store, artifacts) == 0
    earlier = (final - datetime.timedelta(seconds=2 * trash.UNDO_SECONDS + 1)).isoformat(timespec="milliseconds")
    store.connection.execute("update experiment set deleted_at = ?", (earlier,))
    assert trash.empty(store, artifacts) == 1
    with pytest.raises(NotFound, match="there are: none yet"):
        experiments.get(store, experiment.id)
    queue.restore(store, experiment.id)  # too late
    assert select(store, "select count(*) from experiment") == [(0,)]


def test_deleting_again_or_what_is_not_there_changes_nothing(store):
    experiment = submit(store)
    queue.delete(store, experiment.id)
    before = dump(store)
    assert queue.delete(store, experiment.id) == queue.delete(store, 99) == []
    assert dump(store) == before


def test_submitting_a_deleted_grid_takes_it_out_of_the_trash(store, artifacts):
    """Before it is final it is the same experiment with all its pictures, afterwards a new one."""
    experiment = submit(store)
    finish_all(store, artifacts)
    queue.delete(store, experiment.id)
    assert submit(store) == experiment
    assert experiments.standing(store, experiment.id).state == "done"
    queue.delete(store, experiment.id)
    trash.empty(store, artifacts, seconds=SINCE)
    again = submit(store)
    assert again.id != experiment.id
    assert experiments.standing(store, again.id).state == "queued"
    finish_all(store, artifacts)
    assert all(row["mse"] is not None for row in results.rows(store, again.id))
    assert_sound(store)


def test_what_is_drawn_for_a_deleted_experiment_alone_is_to_be_killed(store):
    one, two = (
        submit(store, name="one", spp=[1, 2], reference=False),
        submit(store, name="two", spp=[2], reference=False),
    )
    works = [claim(store), claim(store)]
    assert queue.delete(store, one.id) == [works[0].cell_id]
    record(store, works[1], "cell", 0)
    record(store, works[1], "cell", 1)
    assert queue.finish(store, works[1]) == "done"
    assert experiments.standing(store, two.id).state == "done"


def test_a_new_reference_is_not_mistaken_for_one_that_is_gone(store, artifacts):
    """The measurer remembers references by cell: an old one must never measure new pictures."""
    grey = np.full((SIZE, SIZE, 3), 0.5, np.float32)
    old = submit(store, name="old", spp=[1], max_depth=2)
    measurer = finish_all(store, artifacts, picture=lambda role: grey * (4 if role == "reference" else 1))
    assert {row["mse"] for row in results.rows(store, old.id)} == {1.5**2}
    queue.delete(store, old.id)
    trash.empty(store, artifacts, seconds=SINCE)
    new = submit(store, name="new", spp=[1], max_depth=3)
    finish_all(store, artifacts, measurer, picture=lambda role: grey)
    assert {row["mse"] for row in results.rows(store, new.id)} == {0.0}


def test_keys_of_submissions_are_forgotten_after_a_day(store, artifacts, data):
    experiments.submit(store, planned(), data / "scenes", "key")
    trash.empty(store, artifacts)
    assert select(store, "select key from submission") == [("key",)]
    store.connection.execute("update submission set at = '2020-01-01T00:00:00.000+00:00'")
    trash.empty(store, artifacts)
    assert select(store, "select key from submission") == []


def test_a_file_that_is_gone_already_stops_nothing(store, artifacts):
    experiment = submit(store)
    finish_all(store, artifacts)
    for name in sorted(files(artifacts))[:2]:
        (artifacts.data / name).unlink()
    queue.delete(store, experiment.id)
    assert trash.empty(store, artifacts, seconds=SINCE) == 1
    assert files(artifacts) == set()
    assert_sound(store)


def test_scenes_stay(store, artifacts):
    """Snapshots are small, and another grid may name them."""
    experiment = submit(store)
    work_off(store)
    queue.delete(store, experiment.id)
    trash.empty(store, artifacts, seconds=SINCE)
    assert len(select(store, "select * from scene")) == 1
    assert len(list(artifacts.scenes.iterdir())) == 1
