"""The points that are kept ready are what anybody would compute from the rows."""

from __future__ import annotations

import itertools
import math
import statistics

import apsw
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from jobs import cells, convergence, experiments, points, queue, results, sql
from jobs.points import SECONDS
from jobs.store import FILE, Store
from renderer.metrics import METRICS
from tests.jobs.conftest import claim, dump, record, select, submit
from tests.jobs.guesser import by_name, guess
from tests.jobs.painter import noise

numbers = st.none() | st.floats(-1e3, 1e3) | st.floats(1e-30, 1e-20) | st.sampled_from([0.0, 1e30, 0.1])


def draw(store, work, k: int, role: str = "cell") -> None:
    """A picture as the dispatcher records it."""
    with store.transaction():
        record(store, work, role, k)
        points.refresh(store, [work.cell_id])


def draw_all(store, **keys) -> None:
    while work := claim(store, **keys):
        for role, k in work.missing:
            draw(store, work, k, role)
        queue.finish(store, work)


def close(value: float | None, expected: float | None, scale: float, digits: int) -> bool:
    """Equal in as many digits as a point keeps."""
    if value is None or expected is None:
        return value is expected
    return math.isclose(value, expected, rel_tol=0.6 * 10 ** (1 - digits), abs_tol=1e-12 * scale)


def assert_points_are_averages(store, experiment: int) -> None:
    """The table, the summary and the curves against ``results.rows``, averaged here."""
    rows = iter(list(results.rows(store, experiment)))
    summary = {(point.scene, point.integrator, point.sampler, point.spp, point.metric): point
               for point in results.summary(store, experiment)}  # fmt: skip
    curves = {(name, item["cell"], item["spp"]): item
              for name in METRICS for series in convergence.curves(store, experiment, name)
              for item in series.points}  # fmt: skip
    told = 0
    for cell in cells.page(store, experiment, limit=10**6).cells:
        if cell["role"] != "cell":
            continue
        mine = list(itertools.islice(rows, cell["wanted"]))
        axes = tuple(cell[key] for key in ("scene", "integrator", "sampler", "spp"))
        assert {tuple(row[key] for key in ("scene", "integrator", "sampler", "spp")) for row in mine} == {axes}
        seconds = [row["render_seconds"] for row in mine if row["render_seconds"] is not None]
        assert close(cell["seconds"], statistics.fmean(seconds) if seconds else None, 1.0, 4), cell
        for name in METRICS:
            values = [row[name] for row in mine if row[name] is not None]
            if not values:
                assert name not in cell["metrics"]
                assert (name, cell["cell"], cell["spp"]) not in curves and (*axes, name) not in summary
                continue
            told += 1
            mean, error, n = cell["metrics"][name]
            scale = max(map(abs, values))
            spread = statistics.stdev(values) / math.sqrt(len(values)) if len(values) > 1 else None
            assert n == len(values), (cell, values)
            assert close(mean, statistics.fmean(values), scale, 8), (cell, values)
            assert close(error, spread, scale, 4), (cell, values)
            point, curve = summary[(*axes, name)], curves[name, cell["cell"], cell["spp"]]
            assert (point.mean, point.error, point.n) == (curve["mean"], curve["error"], curve["n"]) == (mean, error, n)
    assert next(rows, None) is None
    assert len(summary) == told


@given(data=st.data())
@settings(max_examples=30, deadline=None, derandomize=True)
def test_every_number_is_the_average_of_its_rows(tmp_path_factory, data):
    """
    Two experiments that share cells and a reference, with different numbers of replicates, drawn to any extent:
    each counts its own first replicates, against its own number of pictures of the reference.
    """
    store = Store.open(tmp_path_factory.mktemp("data"))
    wishes = data.draw(st.lists(st.tuples(st.integers(1, 4), st.sampled_from([2, 4])), min_size=1, max_size=3))
    found = [
        submit(store, name=f"grid {index}", samplers=["independent", "stratified"], spp=[1, 2, 3], replicates=wanted,
               reference={"spp": 8 * halves, "replicates": halves})
        for index, (wanted, halves) in enumerate(wishes)
    ]  # fmt: skip
    drawn: dict[tuple[int, int, str], float | None] = {}

    def value(pair, name):
        key = (pair["replicate_id"], pair["reference_replicates"], name)
        if key not in drawn:
            drawn[key] = data.draw(numbers)
        return drawn[key]

    while (work := claim(store)) is not None:
        for role, k in work.missing[: data.draw(st.integers(0, len(work.missing)), label="drawn")]:
            draw(store, work, k, role)
        queue.fail(store, work, "nan_output", "") if data.draw(st.booleans()) else queue.finish(store, work)
        if select(store, "select count(*) from attempt")[0][0] > 40:
            break
        guess(store, value, steps=data.draw(st.integers(0, 3)))
    guess(store, value)
    for experiment in found:
        assert_points_are_averages(store, experiment.id)
    store.close()


def test_another_experiments_larger_wish_changes_no_point(store):
    """Its own first replicates: a top-up by somebody else is not for this table."""
    mine = submit(store, name="mine", replicates=2)
    draw_all(store)
    guess(store, by_name)
    before = cells.page(store, mine.id).cells
    assert {cell["metrics"]["mse"][2] for cell in before if cell["role"] == "cell"} == {2}
    other = submit(store, name="other", replicates=5, reference={"spp": 16, "replicates": 4})
    draw_all(store)
    guess(store, by_name)
    assert cells.page(store, mine.id).cells == before
    assert {cell["metrics"]["mse"][2] for cell in cells.page(store, other.id).cells if cell["role"] == "cell"} == {5}
    for experiment in (mine, other):
        assert_points_are_averages(store, experiment.id)


def test_a_new_experiment_has_the_points_of_what_it_shares_at_once(store):
    submit(store, name="one", spp=[1, 2], replicates=3)
    draw_all(store)
    guess(store, by_name)
    two = submit(store, name="two", spp=[2, 5], replicates=2)
    assert_points_are_averages(store, two.id)
    (shared,) = (cell for cell in cells.page(store, two.id).cells if cell["spp"] == 2)
    assert shared["metrics"]["relmse"][2] == 2
    assert shared["seconds"] == 0.25 + 0.5


def test_two_requests_that_are_rounded_to_one_cell_have_a_point_each(store):
    experiment = submit(store, samplers=["stratified"], spp=[3, 4], replicates=2)
    draw_all(store)
    guess(store, by_name)
    assert_points_are_averages(store, experiment.id)
    (series,) = convergence.curves(store, experiment.id, "mse")
    assert [(point["spp"], point["spp_actual"]) for point in series.points] == [(3, 4), (4, 4)]
    assert len({point["mean"] for point in series.points}) == 1


def test_a_formula_that_has_changed_leaves_no_number_of_the_old_one(store, monkeypatch):
    """Neither in the table nor in the curves, until it is measured again."""
    experiment = submit(store)
    draw_all(store)
    guess(store, by_name)
    store.connection.execute("update point set version = 99 where name = 'mse'")
    page = cells.page(store, experiment.id).cells
    assert all("mse" not in cell["metrics"] for cell in page)
    assert all(set(cell["metrics"]) == set(METRICS) - {"mse"} for cell in page if cell["role"] == "cell")
    assert convergence.curves(store, experiment.id, "mse") == []


def test_a_database_without_points_gets_them_from_its_next_owner(store, data):
    """A grid of version 1, with pictures and numbers: after the migration its table is there."""
    experiment = submit(store, samplers=["independent", "stratified"], spp=[1, 2], replicates=3)
    half = submit(store, name="half", spp=[64], replicates=2)
    empty = submit(store, name="empty", spp=[128], reference=False)
    draw_all(store, experiment=experiment.id)
    guess(store, by_name)
    work = claim(store, experiment=half.id)
    draw(store, work, 0)
    queue.recover(store)
    expected = dump(store)["point"]
    store.close()
    downgrade(data)
    store = Store.open(data)
    assert dump(store)["point"] == []
    points.fill_gaps(store)
    assert dump(store)["point"] == expected
    points.fill_gaps(store)
    assert dump(store)["point"] == expected
    for found in (experiment, half, empty):
        assert_points_are_averages(store, found.id)
    store.close()


def downgrade(data) -> None:
    """Make a database what version 1 would have left of it."""
    new = data / "new.sqlite"
    (data / FILE).rename(new)
    old = apsw.Connection(str(data / FILE))
    sql.migrate(old, sql.migrations()[:1])
    ((trigger,),) = old.execute("select sql from sqlite_schema where name = 'replicate_counted'")
    old.execute("drop trigger replicate_counted; attach ? as new", (str(new),))
    for (table,) in list(
        old.execute("select name from sqlite_schema where type = 'table' and name not like 'sqlite_%'")
    ):
        columns = ", ".join(row[1] for row in old.execute(f"pragma table_info({table})"))
        old.execute(f"insert into main.{table} ({columns}) select {columns} from new.{table}")
    old.execute(trigger)
    old.close()
    new.unlink()


def test_the_seconds_are_those_of_the_first_replicates_with_their_conditions(store):
    experiment = submit(store, spp=[1], replicates=2, reference=False)
    submit(store, name="more", spp=[1], replicates=3, reference=False)
    work = claim(store)
    for k in range(3):
        with store.transaction():
            queue.finish_replicate(
                store, work, "cell", k, image="x", seed=k, render_seconds=float(k), compile_seconds=0.0,
                threads=1 + k, neighbours=0,
            )  # fmt: skip
            points.refresh(store, [work.cell_id])
    assert select(
        store, "select n, mean, conditions from point where experiment_id = ? and name = ?", experiment.id, SECONDS
    ) == [(2, 0.5, "here, llvm, 1 threads, 0 beside it,here, llvm, 2 threads, 0 beside it")]
    assert experiments.standing(store, experiment.id).state == "done"


@pytest.mark.parametrize("spp", [1, 4, 64])
def test_the_painters_noise_has_the_variance_that_it_claims(spp):
    """What other tests build on: mean 1, variance 1 / spp."""
    picture = noise("0" * 64, "cell", 0, (200, 100), spp).astype(float)
    n = picture.size
    assert abs(picture.mean() - 1) < 5 * math.sqrt(1 / spp / n)
    assert abs(picture.var() * spp - 1) < 5 * math.sqrt((2 + 6 / spp) / n)
