"""Cells as a page lists them: page by page without a gap, and what changed since, without losing a change."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import pytest
from hypothesis import settings
from hypothesis import strategies as st
from hypothesis.stateful import invariant, precondition, rule

from jobs import cells, points, queue
from jobs.store import Store
from tests.jobs.conftest import claim, record, submit, work_off
from tests.jobs.guesser import by_name, guess
from tests.jobs.test_queue import Queue


@dataclass
class Client:
    """
    What an open page does: all pages once, then only what changed since the revision of the first.

    start  0, or where the next page begins; first  revision of the first page of the round under way
    """

    experiment: int
    rows: dict[int, dict[str, Any]] = field(default_factory=dict)
    revision: int = 0
    start: int = 0
    first: int = 0

    def read_page(self, store: Store, limit: int) -> bool:
        """One request; True if it was the last of its round."""
        now = store.revision()
        page = cells.page(store, self.experiment, after=self.revision, start=self.start, limit=limit)
        assert len(page.cells) <= limit
        if self.start == 0:
            self.first = now
        self.rows |= {row["position"]: row for row in page.cells}
        self.start = page.next or 0
        if page.next is None:
            self.revision = self.first
        return page.next is None

    def catch_up(self, store: Store, limit: int) -> None:
        """The rest of the round under way, and one more."""
        while self.start and not self.read_page(store, limit):
            pass
        while not self.read_page(store, limit):
            pass


class Pages(Queue):
    """
    Everything that may happen to a queue, with clients that look on: one per experiment after every step, others only
    now and then, also in the middle of their pages.
    """

    def __init__(self):
        super().__init__()
        self.clients: list[Client] = []
        self.eager: dict[int, Client] = {}

    def _record(self, work, role, k):
        with self.store.transaction():
            row = record(self.store, work, role, k)
            points.refresh(self.store, [work.cell_id])
        return row

    @rule()
    def draw_a_whole_cell(self):
        """Else histories seldom get so far that there is something to measure."""
        if work := claim(self.store):
            for role, k in work.missing:
                self._record(work, role, k)
                self.pictures.add((work.digest, role, k))
            self.crashes[work.digest] = 0
            queue.finish(self.store, work)
            self.ended.append((work, []))

    @rule(steps=st.integers(1, 4))
    def measure(self, steps):
        guess(self.store, by_name, steps=steps)

    @precondition(lambda self: self.plans)
    @rule(pick=st.integers(0, 3))
    def open_a_page(self, pick):
        self.clients.append(Client(self._experiment(pick)))

    @precondition(lambda self: self.clients)
    @rule(pick=st.integers(0, 9), limit=st.integers(1, 5))
    def read_a_page(self, pick, limit):
        client = self.clients[pick % len(self.clients)]
        client.read_page(self.store, limit)

    @precondition(lambda self: self.clients)
    @rule(pick=st.integers(0, 9), limit=st.integers(1, 5))
    def catch_up(self, pick, limit):
        self._same_as_fresh(self.clients[pick % len(self.clients)], limit)

    @invariant()
    def nobody_misses_a_change(self):
        for experiment in self.plans:
            self._same_as_fresh(self.eager.setdefault(experiment, Client(experiment)), 1000)

    def teardown(self):
        for client in self.clients:
            self._same_as_fresh(client, 3)
        super().teardown()

    def _same_as_fresh(self, client, limit):
        if client.experiment in self.plans:
            client.catch_up(self.store, limit)
            fresh = cells.page(self.store, client.experiment, limit=10**6)
            assert fresh.next is None
            assert list(client.rows.values()) == sorted(client.rows.values(), key=lambda row: row["position"])
            assert list(client.rows.values()) == fresh.cells


TestPages = Pages.TestCase
TestPages.settings = settings(max_examples=40, stateful_step_count=40, deadline=None, derandomize=True)


@pytest.mark.parametrize("limit", [1, 2, 3, 7, 8, 9, 2000])
def test_pages_give_every_cell_once_in_the_order_of_the_plan(store, limit):
    experiment = submit(store, samplers=["independent", "stratified"], spp=[1, 2, 3], reference={"spp": 8})
    whole = cells.page(store, experiment.id).cells
    assert [row["position"] for row in whole] == list(range(len(whole)))
    assert len(whole) == 7
    found, start = [], 0
    while start is not None:
        page = cells.page(store, experiment.id, start=start, limit=limit)
        found, start = found + page.cells, page.next
        assert page.next is None or len(page.cells) == limit
    assert found == whole


def test_a_row_says_what_the_cell_is_and_whose_reference_it_has(store):
    experiment = submit(store, samplers=["stratified"], spp=[3], replicates=2, reference={"spp": 8})
    cell, reference = cells.page(store, experiment.id).cells
    assert (cell["role"], cell["spp"], cell["spp_actual"], cell["had"], cell["wanted"]) == ("cell", 3, 4, 0, 2)
    assert (cell["scene"], cell["integrator"], cell["sampler"]) == ("cornell_box", "path", "stratified")
    assert cell["reference"] == reference["cell"]
    assert (reference["role"], reference["reference"], reference["sampler"]) == ("reference", None, "independent")
    assert (cell["state"], cell["seconds"], cell["metrics"], cell["error"]) == ("queued", None, {}, None)


def test_nothing_new_is_an_empty_page(store):
    experiment = submit(store)
    work_off(store)
    page = cells.page(store, experiment.id, after=store.revision())
    assert page == cells.Page([], None)


def test_only_what_changed_comes_back(store):
    experiment = submit(store, spp=[1, 2, 3])
    seen = store.revision()
    work = claim(store)
    assert [row["cell"] for row in cells.page(store, experiment.id, after=seen).cells] == [work.cell_id]


def test_a_change_of_the_experiment_is_a_change_of_all_its_cells(store):
    experiment = submit(store, spp=[1, 2, 3])
    work_off(store)
    submit(store, name="other", spp=[9])
    for step in (queue.cancel, queue.retry, queue.delete, queue.restore, queue.pause, queue.resume):
        seen = store.revision()
        step(store, experiment.id)
        assert len(cells.page(store, experiment.id, after=seen).cells) == 4, step


def test_another_experiment_that_comes_and_goes_is_not_news(store):
    experiment = submit(store, name="one", spp=[1, 2])
    work_off(store)
    seen = store.revision()
    other = submit(store, name="other", spp=[9])
    queue.cancel(store, other.id)
    queue.delete(store, other.id)
    assert cells.page(store, experiment.id, after=seen).cells == []
    assert not cells.touched(store, experiment.id, seen)


def test_an_error_is_told_as_long_as_the_cell_has_failed(store):
    experiment = submit(store, spp=[1], reference=False)
    queue.fail(store, claim(store), "nan_output", "3 pixels are NaN")
    (row,) = cells.page(store, experiment.id).cells
    assert (row["state"], row["error_class"], row["error"]) == ("failed", "nan_output", "3 pixels are NaN")
    queue.retry(store, experiment.id)
    (row,) = cells.page(store, experiment.id).cells
    assert (row["state"], row["error_class"], row["error"]) == ("queued", None, None)


def test_a_revision_that_never_was_asks_for_everything(store):
    """A page that was open before the data directory was replaced by another, younger one."""
    experiment = submit(store)
    assert cells.touched(store, experiment.id, store.revision() + 1)
    assert len(cells.page(store, experiment.id, after=10**9).cells) == 3
