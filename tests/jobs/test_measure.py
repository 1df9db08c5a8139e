"""Every pair of a picture and its reference gets its numbers, in whatever order they come."""

from __future__ import annotations

import logging
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from jobs import convergence, experiments, measure, queue
from jobs.artifacts import Artifacts
from jobs.measure import Measurer
from jobs.plan import Plan
from jobs.store import Store
from renderer.metrics import METRICS, Reference, floors
from renderer.metrics import measure as measure_pictures
from tests.jobs.conftest import SIZE, claim, draw, picture, planned, select, submit


def finish_all(measurer: Measurer) -> None:
    while measurer.step(60):
        pass


def draw_all(store, artifacts, measurer=None) -> None:
    while work := claim(store):
        for role, k in work.missing:
            row = draw(store, artifacts, work, role, k)
            if measurer:
                measurer.add(row)
        queue.finish(store, work)


def numbers(store) -> dict[tuple, tuple]:
    """What is measured, without ids that depend on the order of finishing."""
    found = select(
        store,
        "select cell.digest, k, reference.digest, reference_replicates, name, version, value, reason from metric "
        "join replicate on replicate.id = replicate_id join cell on cell.id = cell_id "
        "join cell as reference on reference.id = reference_id",
    )
    return {row[:6]: row[6:] for row in found}


def test_numbers_are_those_of_the_metrics_against_the_means_of_even_and_odd_replicates(store, artifacts):
    submit(store, replicates=3, reference={"spp": 64, "replicates": 4})
    measurer = Measurer(store, artifacts)
    draw_all(store, artifacts, measurer)
    finish_all(measurer)
    found = numbers(store)
    assert len(found) == 2 * 3 * len(METRICS)
    for (digest, k, other, n, name, version), (value, reason) in found.items():
        halves = [
            np.mean([picture(other, "reference", i) for i in half], axis=0, dtype=float) for half in ((0, 2), (1, 3))
        ]
        assert (n, version, reason) == (4, METRICS[name].version, None)
        assert value == pytest.approx(measure_pictures(picture(digest, "cell", k), Reference(*halves))[name], rel=1e-12)


def test_what_was_measured_touches_its_cells(store, artifacts):
    """A page that asks for news sees the numbers."""
    submit(store, spp=[1])
    draw_all(store, artifacts)
    seen = store.revision()
    measurer = Measurer(store, artifacts)
    measurer.look_for_gaps()
    finish_all(measurer)
    assert select(store, "select spp from cell where revision > ?", seen) == [(1,)]
    assert set(select(store, "select what from event where revision > ?", seen)) == {("measure",)}


PLANS = [
    planned(name="a", spp=[1, 2], replicates=2, reference={"spp": 8, "replicates": 2}),
    planned(name="b", spp=[2], replicates=3, reference={"spp": 16, "replicates": 4}),
]


@given(order=st.randoms(use_true_random=False), restart=st.integers(0, 12))
@settings(max_examples=15, deadline=None, derandomize=True)
def test_the_order_of_finishing_does_not_matter(tmp_path_factory, order, restart):
    """Replicates before their reference or after, with a new owner in between."""
    data = tmp_path_factory.mktemp("data")
    artifacts, store = Artifacts(data), Store.open(data)
    artifacts.prepare()
    for asked in PLANS:
        experiments.submit(store, asked, artifacts.scenes)
    works = []
    while work := claim(store):
        works.append(work)
    todo = [(work, role, k) for work in works for role, k in work.missing]
    order.shuffle(todo)
    measurer = Measurer(store, artifacts)
    for done, (work, role, k) in enumerate(todo):
        if done == restart:
            measurer = Measurer(store, artifacts)
            measurer.look_for_gaps()
        measurer.add(draw(store, artifacts, work, role, k))
        if order.random() < 0.5:
            measurer.step(0)
    finish_all(measurer)
    found = numbers(store)
    expected = {
        (cell.spec.digest, k, cell.reference, reference.replicates, name, metric.version)
        for asked in PLANS
        for cell in asked.cells if cell.role == "cell"
        for reference in asked.cells if reference.role == "reference"
        for k in range(cell.replicates)
        for name, metric in METRICS.items()
    }  # fmt: skip
    assert set(found) == expected
    assert None not in {value for value, _ in found.values()}
    store.close()


def test_a_new_version_of_a_formula_fills_itself_in_beside_the_old_one(store, artifacts, monkeypatch):
    submit(store)
    draw_all(store, artifacts)
    measurer = Measurer(store, artifacts)
    measurer.look_for_gaps()
    finish_all(measurer)
    before = numbers(store)
    newer = {**METRICS, "mse": replace(METRICS["mse"], version=2, error_map=lambda picture, reference: picture * 0 + 7)}
    monkeypatch.setattr(measure, "METRICS", newer)
    monkeypatch.setattr("renderer.metrics.METRICS", newer)
    monkeypatch.setattr(measure, "VERSIONS", measure.VERSIONS.replace('"mse": 1', '"mse": 2'))
    measurer = Measurer(store, artifacts)
    measurer.look_for_gaps()
    finish_all(measurer)
    after = numbers(store)
    assert before.items() <= after.items()
    assert {(key[4:], value) for key, value in after.items() if key not in before} == {(("mse", 2), (7.0, None))}


def test_when_nothing_is_missing_nothing_is_written(store, artifacts):
    submit(store)
    measurer = Measurer(store, artifacts)
    draw_all(store, artifacts, measurer)
    finish_all(measurer)
    revision = store.revision()
    again = Measurer(store, artifacts)
    again.look_for_gaps()
    finish_all(again)
    assert store.revision() == revision


def test_an_owner_with_nothing_to_render_measures_what_its_predecessor_left(store, artifacts):
    submit(store)
    draw_all(store, artifacts)
    measure.catch_up(store, artifacts)
    assert len(numbers(store)) == 4 * len(METRICS)


@pytest.mark.parametrize(
    ("role", "pixels", "reason"),
    [
        (
            "cell",
            np.where(np.arange(SIZE * SIZE * 3).reshape(SIZE, SIZE, 3) < 6, np.nan, 1),
            "2 pixels of the picture are",
        ),
        ("cell", np.full((SIZE, SIZE, 3), np.inf), "81 pixels of the picture are NaN or infinite"),
        ("cell", np.ones((SIZE, SIZE + 1, 3)), "the picture is 10×9, the reference 9×9"),
        ("reference", np.full((SIZE, SIZE, 3), np.nan), "81 pixels of the reference are NaN or infinite"),
    ],
)
def test_a_value_that_does_not_exist_is_missing_for_a_reason(store, artifacts, role, pixels, reason):
    submit(store, spp=[1], replicates=2)
    while work := claim(store):
        for own, k in work.missing:
            draw(store, artifacts, work, own, k, pixels if (own, k) == (role, 0) else None)
        queue.finish(store, work)
    measurer = Measurer(store, artifacts)
    measurer.look_for_gaps()
    finish_all(measurer)
    bad = {key[1] for key, (value, told) in numbers(store).items() if value is None and told.startswith(reason)}
    good = {key[1] for key, (value, told) in numbers(store).items() if value is not None and told is None}
    assert (bad, good) == (({0}, {1}) if role == "cell" else ({0, 1}, set()))


def test_a_reference_of_one_picture_has_no_halves_and_the_other_numbers_remain(store, artifacts, data):
    asked = planned(spp=[1], replicates=1)
    cells = tuple(replace(cell, replicates=1) for cell in asked.cells)
    experiments.submit(store, Plan(asked.grid, cells), data / "scenes")
    measurer = Measurer(store, artifacts)
    draw_all(store, artifacts, measurer)
    finish_all(measurer)
    found = {key[4]: told for key, told in numbers(store).items()}
    assert found.pop("mse_cross") == (None, "the reference has no two halves")
    assert len(found) == 3 and all(value is not None for value, _ in found.values())


@pytest.mark.parametrize("role", ["cell", "reference"])
def test_a_file_that_cannot_be_read_is_logged_and_tried_by_the_next_owner(store, artifacts, role, caplog):
    submit(store, spp=[1, 2], replicates=1)
    draw_all(store, artifacts)
    (name,) = select(store, "select image from replicate where role = ? order by id limit 1", role)[0]
    content = artifacts.path(name).read_bytes()
    artifacts.path(name).write_bytes(content[: len(content) // 2])
    measurer = Measurer(store, artifacts)
    measurer.look_for_gaps()
    with caplog.at_level(logging.WARNING, "dartboard"):
        finish_all(measurer)
    assert name.rsplit("/", 1)[1] in caplog.text and "is not measured" in caplog.text
    assert len(numbers(store)) == (len(METRICS) if role == "cell" else 0)
    artifacts.path(name).write_bytes(content)
    measurer = Measurer(store, artifacts)
    measurer.look_for_gaps()
    finish_all(measurer)
    assert len(numbers(store)) == 2 * len(METRICS)


def test_a_step_is_short_and_says_whether_there_is_more(store, artifacts, monkeypatch):
    submit(store, spp=[1, 2, 3], replicates=2)
    draw_all(store, artifacts)
    monkeypatch.setattr(measure, "PAGE", 2)
    measurer = Measurer(store, artifacts)
    assert measurer.step(60) is False
    measurer.look_for_gaps()
    counts = []
    while True:
        more = measurer.step(1e-9)
        counts.append(len(numbers(store)) // len(METRICS))
        if not more:
            break
    assert counts[-1] == 6
    assert max(np.diff([0, *counts])) == 1, "one pair at a time where there is no time"


def test_few_references_stay_in_memory(store, artifacts, monkeypatch):
    monkeypatch.setattr(measure, "KEPT_BYTES", 3 * 2 * SIZE * SIZE * 3 * 8)
    for depth in range(2, 8):
        submit(store, max_depth=depth, spp=[1], replicates=1)
    measurer = Measurer(store, artifacts)
    draw_all(store, artifacts, measurer)
    finish_all(measurer)
    assert len(numbers(store)) == 6 * len(METRICS)
    assert len(measurer.references) == 3


def test_every_reference_gets_its_noise_floor_whoever_finds_it(store, artifacts):
    """While pictures come, and by the next owner where an older version had measured without floors."""
    experiment = submit(store, reference={"spp": 64, "replicates": 4})
    measurer = Measurer(store, artifacts)
    draw_all(store, artifacts, measurer)
    finish_all(measurer)
    ((digest,),) = select(store, "select digest from cell join floor on reference_id = cell.id group by digest")
    halves = [
        np.mean([picture(digest, "reference", k) for k in half], axis=0, dtype=float) for half in ((0, 2), (1, 3))
    ]
    expected = floors(Reference(*halves))
    for again in (False, True):
        if again:
            store.connection.execute("delete from floor")
            measure.catch_up(store, artifacts)
        for name, value in expected.items():
            assert [one.floor for one in convergence.curves(store, experiment.id, name)] == [pytest.approx(value)]
        assert convergence.curves(store, experiment.id, "mse_cross")[0].floor is None
