"""The one reading of an experiment that every table, file and plot shares."""

from __future__ import annotations

import csv
import io
import json
import statistics
from dataclasses import replace

import numpy as np
import pytest

from jobs import experiments, queue, results
from jobs.measure import Measurer
from jobs.plan import Plan
from renderer.metrics import METRICS
from tests.jobs.conftest import claim, draw, planned, record, select, submit, work_off

COLUMNS = [
    "experiment", "scene", "integrator", "sampler", "spp", "spp_actual", "replicate", "mse", "mse_cross", "relmse",
    "mean_ratio", "render_seconds", "compile_seconds", "state",
]  # fmt: skip


def rows(store, experiment) -> list[dict]:
    return list(results.rows(store, experiment.id))


def finish_all(store, artifacts) -> None:
    measurer = Measurer(store, artifacts)
    while work := claim(store):
        for role, k in work.missing:
            measurer.add(draw(store, artifacts, work, role, k))
        queue.finish(store, work)
    while measurer.step(60):
        pass


def test_there_is_a_row_per_wanted_replicate_in_the_order_of_the_plan(store):
    experiment = submit(store, samplers=["stratified", "independent"], spp=[3, 4], replicates=2, name="grid")
    found = rows(store, experiment)
    assert [list(row) for row in found] == [COLUMNS] * 8 == [results.columns(store, experiment.id)] * 8
    keys = ("experiment", "scene", "integrator", "sampler", "spp", "spp_actual", "replicate", "state")
    assert [tuple(row[key] for key in keys) for row in found] == [
        ("grid", "cornell_box", "path", sampler, spp, actual, k, "queued")
        for sampler, spp, actual in (
            ("stratified", 3, 4), ("independent", 3, 3), ("stratified", 4, 4), ("independent", 4, 4),
        )
        for k in range(2)
    ]  # fmt: skip
    assert {row[name] for row in found for name in (*METRICS, "render_seconds", "compile_seconds")} == {None}


def test_a_finished_replicate_is_done_while_its_cell_goes_on(store):
    experiment = submit(store, spp=[1, 2], replicates=2, reference=False)
    record(store, claim(store), "cell", 0)
    queue.fail(store, claim(store), "nan_output", "")
    assert [row["state"] for row in rows(store, experiment)] == ["done", "running", "failed", "failed"]
    assert [row["render_seconds"] for row in rows(store, experiment)] == [0.25, None, None, None]
    queue.cancel(store, experiment.id)
    assert [row["state"] for row in rows(store, experiment)] == ["done", "cancelled", "failed", "failed"]


def test_another_experiments_larger_wish_changes_no_number(store, artifacts):
    """Its own first replicates, against the first replicates of its own reference."""
    experiment = submit(store, name="small", replicates=2, reference={"spp": 8, "replicates": 2})
    finish_all(store, artifacts)
    before = rows(store, experiment)
    assert all(row["mse_cross"] is not None for row in before)
    larger = submit(store, name="large", replicates=3, reference={"spp": 16, "replicates": 4})
    finish_all(store, artifacts)
    assert rows(store, experiment) == before
    other = rows(store, larger)
    assert len(other) == 6 and all(row["mse"] is not None for row in other)
    assert {row["mse"] for row in other}.isdisjoint(row["mse"] for row in before)


def test_without_a_reference_there_are_pictures_and_no_errors(store):
    experiment = submit(store, reference=False)
    work_off(store)
    assert {row["mse"] for row in rows(store, experiment)} == {None}
    assert results.summary(store, experiment.id) == []


def test_a_number_of_another_formula_is_not_shown(store, artifacts):
    experiment = submit(store)
    finish_all(store, artifacts)
    store.connection.execute("update metric set version = 99 where name = 'mse'")
    assert {row["mse"] for row in rows(store, experiment)} == {None}
    assert None not in {row["relmse"] for row in rows(store, experiment)}


def test_the_summary_is_mean_and_standard_error_of_the_rows(store, artifacts):
    experiment = submit(store, samplers=["independent", "stratified"], spp=[1, 3], replicates=3)
    finish_all(store, artifacts)
    points = results.summary(store, experiment.id)
    assert len(points) == 4 * len(METRICS)
    for point in points:
        values = [
            row[point.metric]
            for row in rows(store, experiment)
            if (row["sampler"], row["spp"], row["spp_actual"]) == (point.sampler, point.spp, point.spp_actual)
        ]
        assert point.n == 3
        assert point.mean == pytest.approx(statistics.fmean(values), rel=1e-7)
        assert point.error == pytest.approx(statistics.stdev(values) / np.sqrt(3), rel=1e-3)
    assert [(point.sampler, point.spp) for point in points[:: len(METRICS)]] == [
        ("independent", 1), ("stratified", 1), ("independent", 3), ("stratified", 3),
    ]  # fmt: skip


def test_one_replicate_has_no_standard_error(store, artifacts):
    experiment = submit(store, spp=[1], replicates=1)
    finish_all(store, artifacts)
    assert {(point.n, point.error) for point in results.summary(store, experiment.id)} == {(1, None)}


def test_csv_and_json_say_the_same_and_numbers_read_back_exactly(store, artifacts):
    experiment = submit(store, name='a "name", with commas', spp=[1, 2], replicates=2)
    record(store, claim(store), "cell", 0)
    queue.recover(store)
    found = rows(store, experiment)
    as_csv, as_json = io.StringIO(newline=""), io.StringIO()
    results.write_csv(found, as_csv)
    results.write_json(iter(found), as_json)
    assert json.loads(as_json.getvalue()) == found
    read = list(csv.DictReader(io.StringIO(as_csv.getvalue(), newline="")))
    assert [list(row) for row in read] == [COLUMNS] * 4
    for row, expected in zip(read, found, strict=True):
        for name, value in expected.items():
            assert row[name] == ("" if value is None else str(value))
            assert not isinstance(value, float) or float(row[name]) == value


def test_nothing_is_still_a_table():
    as_csv, as_json = io.StringIO(), io.StringIO()
    results.write_csv([], as_csv)
    results.write_json([], as_json)
    assert as_csv.getvalue().strip().split(",") == COLUMNS
    assert json.loads(as_json.getvalue()) == []


def test_a_sweep_is_a_column_and_keeps_curves_apart(store, artifacts, data):
    """Cells that differ in a material only have the same labels."""
    asked = planned(spp=[1], replicates=1, reference=False)

    def variant(cell, sweep):
        estimand = replace(cell.spec.estimand, sweep=sweep)
        return replace(cell, spec=replace(cell.spec, estimand=estimand))

    cells = [variant(asked.cells[0], sweep) for sweep in ((), (("box.bsdf.nu", 10),), (("box.bsdf.nu", 2.5),))]
    experiment, created = experiments.submit(store, Plan(asked.grid, tuple(cells)), data / "scenes")
    assert created == 3
    assert results.columns(store, experiment.id) == [*COLUMNS[:7], "box.bsdf.nu", *COLUMNS[7:]]
    assert [list(row) for row in rows(store, experiment)] == [results.columns(store, experiment.id)] * 3
    assert [row["box.bsdf.nu"] for row in rows(store, experiment)] == [None, 10, 2.5]


def test_rows_are_one_moment_also_while_the_owner_writes(store, data):
    from jobs.store import Store

    experiment = submit(store, spp=[1, 2, 3], replicates=2, reference=False)
    reader = Store.read(data)
    reading = results.rows(reader, experiment.id)
    first = next(reading)
    work_off(store)
    assert {row["state"] for row in [first, *reading]} == {"queued"}
    assert {row["state"] for row in results.rows(reader, experiment.id)} == {"done"}
    assert select(store, "pragma integrity_check") == [("ok",)]
