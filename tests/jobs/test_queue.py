"""The life of a cell: allowed moves, attempts, what experiments want, and the order in which cells run."""

from __future__ import annotations

import itertools
import tempfile
from pathlib import Path

import pytest
from hypothesis import settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, initialize, invariant, precondition, rule

from jobs import experiments, queue, sql, trash
from jobs.artifacts import Artifacts
from jobs.queue import FATAL, MAX_ATTEMPTS, MOVES, RETRIED, MoveRefused
from jobs.store import Store
from tests.jobs.conftest import assert_sound, claim, dump, planned, record, select, submit, work_off

STATES = ("queued", "running", "done", "failed", "cancelled")
NAMES = sorted({name for _, name in MOVES})


def state(store, cell: int) -> str:
    return select(store, "select state from cell where id = ?", cell)[0][0]


@pytest.mark.parametrize("before", STATES)
@pytest.mark.parametrize("name", NAMES)
def test_only_the_moves_of_the_table_happen(store, before, name):
    """Every (state, move): a move of the table leads where it says and leaves an event; any other changes nothing."""
    submit(store, reference=False)
    store.connection.execute("update cell set state = ? where id = 1", (before,))
    whole, revision = dump(store), store.revision()
    if (before, name) not in MOVES:
        with pytest.raises(MoveRefused, match=f"cell 1 is {before}"):
            queue.move(store, 1, name)
        assert dump(store) == whole
        return
    assert queue.move(store, 1, name) == MOVES[before, name] == state(store, 1)
    assert select(store, "select what, cell_id from event where revision > ?", revision) == [(name, 1)]
    assert select(store, "select revision from cell where id = 1") == [(store.revision(),)]
    assert state(store, 2) == "queued"


def test_a_cell_that_does_not_exist_is_not_moved(store):
    with pytest.raises(MoveRefused, match="cell 7 is absent"):
        queue.move(store, 7, "claim")


def test_cells_run_in_the_order_of_the_plan(store):
    plan = planned(samplers=["independent", "stratified"], spp=[1, 2, 3, 10])
    experiments.submit(store, plan, store.path.parent / "scenes")
    order = list(dict.fromkeys(cell.spec.digest for cell in plan.cells))
    assert [work.digest for work in work_off(store)] == order


def test_an_experiment_with_priority_runs_first_and_else_the_older_one(store):
    old, new = submit(store, name="old", spp=[1, 2]), submit(store, name="new", spp=[3, 4], reference=False)
    first = claim(store)
    assert first.spec.spp == 1
    store.connection.execute("update experiment_cell set priority = 1 where experiment_id = ?", (new.id,))
    assert [work.spec.spp for work in work_off(store)][:2] == [3, 4]
    assert experiments.standing(store, old.id).count("running") == 1


def test_claiming_for_one_experiment_takes_only_what_it_wants(store):
    submit(store, name="old", spp=[1, 2], replicates=4)
    new = submit(store, name="new", spp=[2, 3], replicates=1, reference=False)
    assert [(work.spec.spp, work.missing) for work in work_off(store, experiment=new.id)] == [
        (2, (("cell", 0),)),
        (3, (("cell", 0),)),
    ]
    assert claim(store).spec.spp == 1
    assert claim(store).missing == (("reference", 0), ("reference", 1))
    assert claim(store).missing == (("cell", 1), ("cell", 2), ("cell", 3))


def test_claiming_reads_the_first_rows_of_an_index(store):
    """No sort and no scan: a grid of 100 000 cells is claimed as fast as one of ten."""
    for name in ("next_cell", "next_cell_of_experiment"):
        explained = store.connection.execute("explain query plan " + sql.query(name), {"experiment_id": 1})
        steps = [row[3] for row in explained]
        assert "USING INDEX open_in_" in steps[0], steps
        assert "INTEGER PRIMARY KEY" in steps[1], steps
        assert len(steps) == 2, steps


def test_a_cell_that_two_experiments_want_is_rendered_once(store):
    submit(store, name="one")
    other = submit(store, name="two")
    assert len(work_off(store)) == 3
    assert experiments.standing(store, other.id).state == "done"
    assert select(store, "select count(*) from replicate") == [(6,)]


def test_more_replicates_are_added_to_those_that_are_there(store):
    submit(store, replicates=2)
    work_off(store)
    submit(store, replicates=3)
    assert [work.missing for work in work_off(store)] == [(("cell", 2),), (("cell", 2),)]


def test_the_cell_that_is_also_a_reference_is_claimed_once_for_both(store):
    submit(store, spp=[4], replicates=1, reference={"spp": 8, "replicates": 2})
    (work,) = work_off(store)
    assert work.missing == (("cell", 0), ("reference", 0), ("reference", 1))


def test_more_that_is_wanted_meanwhile_queues_the_cell_again(store):
    submit(store, replicates=1, spp=[1], reference=False)
    work = claim(store)
    submit(store, replicates=2, spp=[1], reference=False)
    record(store, work, "cell", 0)
    assert queue.finish(store, work) == "queued"
    assert claim(store).missing == (("cell", 1),)


@pytest.mark.parametrize("error_class", sorted(RETRIED))
def test_three_crashes_without_a_picture_in_between_fail_a_cell_and_the_rest_goes_on(store, error_class):
    experiment = submit(store, spp=[1, 2], reference=False)
    for expected in ("queued", "queued", "failed"):
        work = claim(store)
        assert work.spec.spp == 1
        assert queue.fail(store, work, error_class, "it went away", "logs/attempt-1.log") == expected
    assert [work.spec.spp for work in work_off(store)] == [2]
    (failure,) = store.rows("failures", experiment_id=experiment.id)
    assert (failure["error_class"], failure["error"]) == (error_class, "it went away")
    assert failure["log"] == "logs/attempt-1.log"
    assert select(store, "select count(*), min(outcome) from attempt where cell_id = 1") == [(3, error_class)]


def test_a_picture_forgives_earlier_crashes(store):
    submit(store, spp=[1], replicates=2, reference=False)
    for crashes in range(MAX_ATTEMPTS - 1):
        assert queue.fail(store, claim(store), "crash", "") == "queued", crashes
    work = claim(store)
    record(store, work, "cell", 0)
    for crashes in range(MAX_ATTEMPTS - 1):
        assert queue.fail(store, work, "crash", "") == "queued", crashes
        work = claim(store)
    assert queue.fail(store, work, "crash", "") == "failed"


@pytest.mark.parametrize("error_class", sorted(FATAL))
def test_what_cannot_get_better_fails_at_once(store, error_class):
    submit(store, spp=[1], reference=False)
    assert queue.fail(store, claim(store), error_class, "no") == "failed"
    assert claim(store) is None


def test_an_unknown_error_class_is_refused_and_changes_nothing(store):
    submit(store)
    work = claim(store)
    whole = dump(store)
    with pytest.raises(ValueError, match="unknown error class 'cosmic ray'; known: bad_parameter, crash"):
        queue.fail(store, work, "cosmic ray", "")
    assert dump(store) == whole


def test_a_crash_after_the_last_picture_is_no_failure(store):
    submit(store, spp=[1], replicates=1, reference=False)
    work = claim(store)
    record(store, work, "cell", 0)
    assert queue.fail(store, work, "crash", "") == "done"


def test_a_cell_of_a_version_that_rendered_otherwise_is_not_rendered_under_its_name(store, monkeypatch):
    """Its digest promises the old pictures."""
    old = submit(store, name="old", spp=[1, 2], reference=False)
    monkeypatch.setattr("renderer.spec.PASS_LOOP", 99)
    new = submit(store, name="new", spp=[2], reference=False)
    (work,) = work_off(store)
    assert work.spec.digest == work.digest
    assert experiments.standing(store, new.id).state == "done"
    assert experiments.standing(store, old.id).cells == {"failed": 2}
    assert "submit its grid again" in store.rows("failures", experiment_id=old.id)[0]["error"]


def test_release_and_recover_blame_nobody(store):
    submit(store, spp=[1, 2], reference=False)
    for _ in range(MAX_ATTEMPTS + 1):
        assert queue.release(store, claim(store)) == "queued"
    for _ in range(MAX_ATTEMPTS + 1):
        claim(store), claim(store)
        assert queue.recover(store) == 2
    assert select(store, "select distinct state, crashes from cell") == [("queued", 0)]
    assert dict(select(store, "select outcome, count(*) from attempt group by outcome")) == {
        "released": MAX_ATTEMPTS + 1,
        "owner_lost": 2 * (MAX_ATTEMPTS + 1),
    }
    assert queue.recover(store) == 0


def test_recover_finishes_what_only_lacked_the_last_word(store):
    submit(store, spp=[1], replicates=1, reference=False)
    record(store, claim(store), "cell", 0)
    queue.recover(store)
    assert state(store, 1) == "done"


def test_the_same_picture_counts_once(store):
    submit(store, spp=[1], replicates=2, reference=False)
    work = claim(store)
    first = record(store, work, "cell", 0)
    whole = dump(store)
    assert record(store, work, "cell", 0) == first
    assert dump(store) == whole


def test_what_an_ended_attempt_still_says_changes_no_state(store):
    experiment = submit(store, spp=[1], replicates=2, reference=False)
    work = claim(store)
    assert queue.cancel(store, experiment.id) == [work.cell_id]
    whole = dump(store)
    for told in (queue.finish(store, work), queue.release(store, work), queue.fail(store, work, "crash", "")):
        assert told == "cancelled"
    assert dump(store) == whole


def test_a_late_picture_is_kept_and_may_complete_its_cell(store):
    submit(store, spp=[1], replicates=1, reference=False)
    work = claim(store)
    queue.release(store, work)
    record(store, work, "cell", 0)
    assert state(store, 1) == "done"
    assert claim(store) is None


def test_cancelling_stops_what_nobody_else_wants(store):
    one, two = submit(store, name="one", spp=[1, 2, 3]), submit(store, name="two", spp=[2, 3, 5])
    running = [claim(store) for _ in range(2)]  # 1 spp of one alone, and the reference of both
    assert queue.cancel(store, one.id) == [running[0].cell_id]
    counts = experiments.standing(store, one.id)
    assert (counts.cells, counts.references, counts.state) == ({"cancelled": 3}, {"cancelled": 1}, "cancelled")
    assert [work.spec.spp for work in work_off(store)] == [2, 3, 5]
    assert experiments.standing(store, two.id).cells == {"done": 3}
    assert experiments.standing(store, one.id).cells == {"cancelled": 1, "done": 2}


def test_cancelling_twice_or_what_is_not_there_changes_nothing(store):
    experiment = submit(store)
    queue.cancel(store, experiment.id)
    whole = dump(store)
    assert queue.cancel(store, experiment.id) == queue.cancel(store, 99) == []
    assert dump(store) == whole


def test_a_finished_experiment_stays_done_when_it_is_cancelled(store):
    experiment = submit(store)
    work_off(store)
    assert queue.cancel(store, experiment.id) == []
    assert experiments.standing(store, experiment.id).state == "done"


def test_retry_queues_failed_and_cancelled_cells_for_everyone_who_misses_them(store):
    one, two = submit(store, name="one", spp=[1, 2]), submit(store, name="two", spp=[1, 5])
    queue.fail(store, claim(store), "nan_output", "3 pixels are NaN")
    queue.cancel(store, one.id)
    assert experiments.standing(store, two.id).count("failed") == 1
    assert queue.retry(store, one.id) == 3
    assert {*select(store, "select state, crashes, error_class, error from cell")} == {("queued", 0, None, None)}
    assert [work.spec.spp for work in work_off(store)] == [1, 4, 2, 5]
    assert experiments.standing(store, one.id).state == experiments.standing(store, two.id).state == "done"


def test_retry_of_a_sound_experiment_starts_nothing(store):
    experiment = submit(store)
    work_off(store)
    assert queue.retry(store, experiment.id) == 0
    assert claim(store) is None


def test_a_pause_waits_and_going_on_needs_no_retry(store):
    experiment = submit(store, spp=[1, 2])
    work = claim(store)
    assert queue.pause(store, experiment.id) == [work.cell_id]
    standing = experiments.standing(store, experiment.id)
    assert (standing.state, standing.finished, standing.count("paused")) == ("paused", True, 3)
    assert claim(store) is None
    assert queue.resume(store, experiment.id) == 3
    assert len(work_off(store)) == 3
    assert queue.resume(store, experiment.id) == 0


def test_what_is_cancelled_during_a_pause_is_cancelled(store):
    """Else its page would offer to go on, and nothing would."""
    experiment = submit(store)
    queue.pause(store, experiment.id)
    queue.cancel(store, experiment.id)
    assert experiments.standing(store, experiment.id).state == "cancelled"
    assert queue.resume(store, experiment.id) == 0
    assert claim(store) is None
    assert queue.retry(store, experiment.id) == 3
    assert experiments.standing(store, experiment.id).state == "queued"


def test_a_deleted_experiment_comes_back_as_it_was(store):
    """Live, paused or cancelled: ``restore`` changes nothing else."""
    live, paused, cancelled = (submit(store, name=name, spp=[n]) for name, n in (("a", 1), ("b", 2), ("c", 3)))
    queue.pause(store, paused.id)
    queue.cancel(store, cancelled.id)
    for experiment in (live, paused, cancelled):
        queue.delete(store, experiment.id)
    assert experiments.everything(store) == []
    assert claim(store) is None
    for experiment in (live, paused, cancelled):
        queue.restore(store, experiment.id)
    states = [experiments.standing(store, experiment.id).state for experiment in (live, paused, cancelled)]
    assert states == ["queued", "paused", "cancelled"]
    assert queue.resume(store, paused.id) == 2
    assert {work.spec.spp for work in work_off(store)} == {1, 2, 4}


PLANS = [
    planned(name="a", spp=[1, 2], replicates=2, reference={"spp": 8, "replicates": 2}),
    planned(name="b", spp=[2, 4], replicates=3, reference={"spp": 16, "replicates": 4}),  # its 4 spp are a's reference
    planned(name="c", spp=[1, 2, 3], samplers=["independent", "stratified"], replicates=1, reference=False),
    planned(name="d", spp=[3, 4], samplers=["stratified"], replicates=2, reference=False),  # both are 4 spp
]


class Queue(RuleBasedStateMachine):
    """
    Any sequence of what owners, processes and people do, beside a model of what must be so.

    pictures  (digest, role, k) that were finished; claimed: attempts under way with what they still have to draw;
    ended: works whose attempt is over; crashes and failed, by digest; marks, by experiment: why it wants nothing now
    """

    def __init__(self):
        super().__init__()
        self.folder = tempfile.TemporaryDirectory()
        self.store = Store.open(Path(self.folder.name) / "data")
        self.pictures, self.claimed, self.ended = set(), {}, []
        self.crashes, self.failed, self.marks, self.plans = {}, set(), {}, {}
        self.artifacts = Artifacts(self.store.path.parent)

    def teardown(self):
        self.store.close()
        self.folder.cleanup()

    @initialize(index=st.sampled_from(range(len(PLANS))))
    def submit_one(self, index):
        self.submit_another(index)

    @rule(index=st.sampled_from(range(len(PLANS))))
    def submit_another(self, index):
        experiment, _ = experiments.submit(self.store, PLANS[index], self.store.path.parent / "scenes")
        self.marks[experiment.id] = set()
        self.plans[experiment.id] = PLANS[index]

    @precondition(lambda self: self.plans)
    @rule(pick=st.none() | st.integers(0, 3))
    def claim(self, pick):
        chosen = None if pick is None else sorted(self.plans)[pick % len(self.plans)]
        queued = [item for item in self._wanted(chosen) if self._state(item[1].spec.digest) == "queued"]
        work = claim(self.store, experiment=chosen)
        if work is None:
            assert not queued
            return
        digest = queued[0][1].spec.digest
        assert work.digest == digest, "not the next one in order"
        cells = [cell for _, cell in self._wanted(chosen) if cell.spec.digest == digest]
        wanted = {(cell.role, k) for cell in cells for k in range(cell.replicates)}
        had = {(role, k) for other, role, k in self.pictures if other == digest}
        assert work.missing == tuple(sorted(wanted - had)), "cells before references, and nothing twice"
        self.claimed[work.attempt_id] = (work, list(work.missing))

    @precondition(lambda self: self.claimed)
    @rule(pick=st.integers(0, 9), again=st.booleans())
    def draw(self, pick, again):
        work, left = self._pick(pick)
        if left:
            role, k = left.pop(0)
            row = self._record(work, role, k)
            assert not again or self._record(work, role, k) == row
            self.pictures.add((work.digest, role, k))
            self.crashes[work.digest] = 0

    @precondition(lambda self: any(not left for _, left in self.claimed.values()))
    @rule()
    def finish(self):
        attempt = next(attempt for attempt, (_, left) in self.claimed.items() if not left)
        work, _ = self._end(attempt)
        assert queue.finish(self.store, work) == ("queued" if self._is_wanted(work.digest) else "done")

    @precondition(lambda self: self.claimed)
    @rule(pick=st.integers(0, 9), error_class=st.sampled_from([*sorted(RETRIED), "crash", "crash", *sorted(FATAL)]))
    def fail(self, pick, error_class):
        work, _ = self._end(self._pick(pick)[0].attempt_id)
        expected = "done"
        if self._is_wanted(work.digest):
            self.crashes[work.digest] = self.crashes.get(work.digest, 0) + 1
            expected = "queued"
            if error_class in FATAL or self.crashes[work.digest] == MAX_ATTEMPTS:
                expected = "failed"
                self.failed.add(work.digest)
        assert queue.fail(self.store, work, error_class, "for some reason") == expected

    @precondition(lambda self: self.claimed)
    @rule(pick=st.integers(0, 9))
    def release(self, pick):
        work, _ = self._end(self._pick(pick)[0].attempt_id)
        queue.release(self.store, work)

    @rule()
    def recover(self):
        assert queue.recover(self.store) == len(self.claimed)
        for attempt in list(self.claimed):
            self._end(attempt)

    @precondition(lambda self: self.plans)
    @rule(pick=st.integers(0, 3))
    def cancel(self, pick):
        experiment = self._experiment(pick)
        self._stop(experiment, queue.cancel, {*self.marks[experiment], "cancelled"} - {"paused"})

    @precondition(lambda self: self.plans)
    @rule(pick=st.integers(0, 3))
    def pause(self, pick):
        experiment = self._experiment(pick)
        self._stop(experiment, queue.pause, self.marks[experiment] or {"paused"})

    @precondition(lambda self: self.plans)
    @rule(pick=st.integers(0, 3))
    def delete(self, pick):
        experiment = self._experiment(pick)
        self._stop(experiment, queue.delete, {*self.marks[experiment], "deleted"})

    @precondition(lambda self: self.plans)
    @rule(pick=st.integers(0, 3), move=st.sampled_from([("paused", queue.resume), ("deleted", queue.restore)]))
    def take_back(self, pick, move):
        experiment, (mark, take) = self._experiment(pick), move
        before = dump(self.store)
        take(self.store, experiment)
        if mark in self.marks[experiment]:
            self.marks[experiment].discard(mark)
        else:
            assert dump(self.store) == before

    @precondition(lambda self: self.plans)
    @rule(pick=st.integers(0, 3))
    def retry(self, pick):
        experiment = self._experiment(pick)
        self.marks[experiment] = set()
        for cell in self.plans[experiment].cells:
            if cell.spec.digest in self.failed and self._misses(cell):
                self.failed.discard(cell.spec.digest)
                self.crashes[cell.spec.digest] = 0
        queue.retry(self.store, experiment)

    @rule()
    def purge(self):
        gone = [experiment for experiment, marks in self.marks.items() if "deleted" in marks]
        doomed = {cell.spec.digest for experiment in gone for cell in self.plans.pop(experiment).cells}
        doomed -= {cell.spec.digest for plan in self.plans.values() for cell in plan.cells}
        for experiment in gone:
            del self.marks[experiment]
        self.pictures = {picture for picture in self.pictures if picture[0] not in doomed}
        self.crashes = {digest: count for digest, count in self.crashes.items() if digest not in doomed}
        self.failed -= doomed
        self.ended = [ended for ended in self.ended if ended[0].digest not in doomed]
        assert trash.empty(self.store, self.artifacts, seconds=-1) == len(gone)
        assert_sound(self.store)

    @precondition(lambda self: self.ended)
    @rule(pick=st.integers(0, 9), what=st.sampled_from(["finish", "fail", "release"]))
    def hear_from_an_ended_attempt(self, pick, what):
        work, left = self.ended[pick % len(self.ended)]
        before = dump(self.store)
        told = {
            "finish": lambda: queue.finish(self.store, work),
            "fail": lambda: queue.fail(self.store, work, "lost", ""),
            "release": lambda: queue.release(self.store, work),
        }[what]()
        assert told == self._state(work.digest)
        assert dump(self.store) == before
        if left:
            role, k = left.pop(0)
            self._record(work, role, k)
            self.pictures.add((work.digest, role, k))
            self.crashes[work.digest] = 0

    @invariant()
    def pictures_are_there_once(self):
        rows = select(self.store, "select digest, role, k from replicate join cell on cell.id = cell_id")
        assert len(rows) == len(set(rows))
        assert set(rows) == self.pictures

    @invariant()
    def running_cells_are_open_attempts(self):
        running = {row[0] for row in select(self.store, "select id from cell where state = 'running'")}
        attempts = select(self.store, "select cell_id, id from attempt where ended_at is null")
        assert running == {cell for cell, _ in attempts}
        assert {attempt for _, attempt in attempts} == set(self.claimed)

    @invariant()
    def experiments_want_what_they_miss(self):
        rows = select(
            self.store,
            "select experiment_id, position, digest, role, replicates, had, open from experiment_cell "
            "join cell on cell.id = cell_id",
        )
        for experiment, position, digest, role, replicates, had, is_open in rows:
            cell = self.plans[experiment].cells[position]
            assert (digest, role, replicates) == (cell.spec.digest, cell.role, cell.replicates)
            assert had == sum((digest, role, k) in self.pictures for k in range(replicates))
            assert is_open == (not self.marks[experiment] and had < replicates and digest not in self.failed)

    @invariant()
    def everybody_sees_a_cell_by_what_is_theirs(self):
        rows = select(
            self.store,
            "select experiment_id, digest, had = replicates, cell.state, standing.state from standing "
            "join cell on cell.id = cell_id",
        )
        for experiment, digest, complete, state, shown in rows:
            marks = self.marks[experiment]
            why = "paused" if "paused" in marks else "cancelled"
            live = "failed" if digest in self.failed else state if not marks else why
            assert shown == ("done" if complete else live), (experiment, digest, marks)

    @invariant()
    def queued_means_wanted_and_idle_means_not(self):
        for digest, state in select(self.store, "select digest, state from cell"):
            if state != "running":
                assert (state == "queued") == self._is_wanted(digest), (digest, state)
            assert (state == "failed") == (digest in self.failed)

    @invariant()
    def counts_add_up(self):
        for experiment, plan in self.plans.items():
            standing = experiments.standing(self.store, experiment)
            for role, counts in (("cell", standing.cells), ("reference", standing.references)):
                cells = {(cell.spec.digest, cell.replicates) for cell in plan.cells if cell.role == role}
                assert sum(counts.values()) == len(cells)
            distinct = {(cell.spec.digest, cell.role, k) for cell in plan.cells for k in range(cell.replicates)}
            assert (standing.had, standing.wanted) == (len(distinct & self.pictures), len(distinct))

    def _wanted(self, experiment):
        """(experiment, planned cell) of what live experiments miss, in the order of claiming."""
        for live, plan in sorted(self.plans.items()):
            if not self.marks[live] and experiment in (None, live):
                yield from ((live, cell) for cell in plan.cells if self._open(cell))

    def _open(self, cell):
        return self._misses(cell) and cell.spec.digest not in self.failed

    def _misses(self, cell):
        return any((cell.spec.digest, cell.role, k) not in self.pictures for k in range(cell.replicates))

    def _is_wanted(self, digest):
        return any(cell.spec.digest == digest for _, cell in self._wanted(None))

    def _state(self, digest):
        return select(self.store, "select state from cell where digest = ?", digest)[0][0]

    def _record(self, work, role, k):
        return record(self.store, work, role, k)

    def _experiment(self, pick):
        return sorted(self.plans)[pick % len(self.plans)]

    def _stop(self, experiment, stop, marks):
        """Under new marks nothing of it is wanted; what was drawn for it alone is to be killed."""
        wanted = {cell.spec.digest for _, cell in self._wanted(experiment)}
        self.marks[experiment] = marks
        killed = set(stop(self.store, experiment))
        alone = {
            attempt: work
            for attempt, (work, _) in self.claimed.items()
            if work.digest in wanted and not self._is_wanted(work.digest)
        }
        assert killed == {work.cell_id for work in alone.values()}
        for attempt in alone:
            self._end(attempt)

    def _pick(self, pick):
        return next(itertools.islice(self.claimed.values(), pick % len(self.claimed), None))

    def _end(self, attempt):
        ended = self.claimed.pop(attempt)
        self.ended.append(ended)
        return ended


TestQueue = Queue.TestCase
TestQueue.settings = settings(max_examples=60, stateful_step_count=40, deadline=None, derandomize=True)
