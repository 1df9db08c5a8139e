"""What pages are told: one reading of the database, counted anew exactly when something has happened."""

from __future__ import annotations

import json
from types import SimpleNamespace

import pytest
from hypothesis import given, settings
from hypothesis.stateful import invariant

from jobs import cells, experiments, plan, queue
from jobs.store import Store
from renderer.metrics import METRICS
from service import schemas, views
from service.engine import Drawing, Moment, seconds_left
from service.standings import Standings
from tests.jobs.conftest import claim, record, submit, work_off
from tests.jobs.grids import parse, tables
from tests.jobs.guesser import by_name, guess
from tests.jobs.test_points import draw_all
from tests.jobs.test_queue import Queue


@pytest.fixture
def data(tmp_path):
    return tmp_path / "data"


@pytest.fixture
def store(data):
    store = Store.open(data)
    yield store
    store.close()


def engine(rate: float | None = None) -> SimpleNamespace:
    """As much of an engine as a view reads."""
    return SimpleNamespace(standings=Standings(), moment=Moment(rate=rate), device=SimpleNamespace(description="paint"))


class Counted(Queue):
    """Everything that may happen to a queue, and somebody who remembers how far experiments are."""

    def __init__(self):
        super().__init__()
        self.standings = Standings()

    @invariant()
    def what_is_remembered_is_what_is_counted(self):
        for experiment in self.plans:
            assert self.standings.of(self.store, experiment) == experiments.standing(self.store, experiment)


TestCounted = Counted.TestCase
TestCounted.settings = settings(max_examples=30, stateful_step_count=40, deadline=None, derandomize=True)


def test_a_retry_elsewhere_is_seen(store):
    """The cell failed for both; that one of them tries again opens it for the other too."""
    one, two = submit(store, name="one", spp=[1]), submit(store, name="two", spp=[1])
    standings = Standings()
    queue.fail(store, claim(store), "nan_output", "no")
    assert [standings.of(store, found.id).state for found in (one, two)] == ["queued", "queued"]
    assert [standings.of(store, found.id).failed for found in (one, two)] == [1, 1]
    queue.retry(store, one.id)
    assert [standings.of(store, found.id).failed for found in (one, two)] == [0, 0]


def test_nothing_is_counted_again_while_nothing_happens(store, monkeypatch):
    mine, other = submit(store, name="mine"), submit(store, name="other", spp=[9], reference=False)
    standings = Standings()
    counted = []
    original = experiments.standing
    monkeypatch.setattr(experiments, "standing", lambda *args: (counted.append(args[1]), original(*args))[1])
    for _ in range(3):
        standings.of(store, mine.id)
        work = claim(store, experiment=other.id)
        queue.release(store, work)
        standings.of(store, other.id)
    assert counted.count(mine.id) == 1
    assert counted.count(other.id) == 3


def test_an_older_connection_never_takes_back_what_a_newer_one_knows(store, data):
    """Two threads, one of which began to read earlier: what is remembered is never newer than it says."""
    found = submit(store, reference=False, spp=[1], replicates=1)
    standings, early = Standings(), Store.read(data)
    with early.moment():
        assert standings.of(early, found.id).state == "queued"
        work_off(store)
        assert standings.of(store, found.id).state == "done"
        standings.of(early, found.id)
    assert standings.of(store, found.id).state == "done"


@given(table=tables())
@settings(max_examples=60, deadline=None, derandomize=True)
def test_the_detail_of_any_grid_fits_the_wire_and_is_that_grid(tmp_path_factory, table):
    """Axes in the order of the grid, sizes of what is rendered, and TOML that makes the same grid again."""
    store = Store.open(tmp_path_factory.mktemp("data"))
    spec = parse(table)
    found, _ = experiments.submit(store, plan.expand(spec), store.path.parent / "scenes")
    told = views.detail(store, found, engine())
    assert told.scenes == [
        schemas.SceneInfo(
            name=scene.source.name, width=scene.size[0], height=scene.size[1],
            reference=info.reference if scene.reference else None,
        )
        for scene, info in zip(spec.scenes, told.scenes, strict=True)
    ]  # fmt: skip
    assert all((scene.reference is None) == (info.reference is None)
               for scene, info in zip(spec.scenes, told.scenes, strict=True))  # fmt: skip
    assert told.spp == list(spec.spp) and told.replicates == spec.replicates
    rows = cells.page(store, found.id, limit=10**6).cells
    assert {row["sampler"] for row in rows if row["role"] == "cell"} == set(told.samplers)
    assert {row["integrator"] for row in rows if row["role"] == "cell"} == set(told.integrators)
    assert {row["spp"] for row in rows if row["role"] == "cell"} == set(told.spp)
    for row in rows:
        schemas.Cell.model_validate_json(views.to_json(row))
    assert told.paths == {}
    store.close()


def test_every_number_of_a_measured_experiment_fits_the_wire(store):
    found = submit(store, samplers=["independent", "stratified"], spp=[1, 2, 4], replicates=3)
    draw_all(store)
    guess(store, by_name)
    for name in METRICS:
        told = schemas.Convergence.model_validate_json(views.to_json(views.curves(store, found.id, name)))
        assert [len(series.points) for series in told.series] == [3, 3]
        assert told.metric == views.metric_info(name)
    assert views.detail(store, found, engine()).default_metric == "relmse"


def test_what_is_shown_first_is_what_has_values(store):
    found = submit(store)
    assert views.default_metric(store, found.id) == "relmse"
    draw_all(store)
    guess(store, lambda pair, name: 1.0 if name == "mse" else None)
    assert views.default_metric(store, found.id) == "mse"


def test_an_update_holds_what_changed_or_says_to_load_again(store, monkeypatch):
    """A few cells come along, more than a page of them do not, and neither do those of a changed experiment."""
    found = submit(store, spp=[1, 2, 3], replicates=1, reference=False)
    seen = store.revision()

    def update(after):
        told = views.update(store, found, after, engine(), Moment())
        return schemas.Update.model_validate_json(views.to_json(told))

    assert (update(seen).reload, update(seen).cells, update(seen).revision) == (False, [], seen)
    record(store, claim(store), "cell", 0)
    assert [cell.spp for cell in update(seen).cells] == [1]
    work_off(store)
    assert [cell.state for cell in update(seen).cells] == ["done", "done", "done"]
    monkeypatch.setattr(cells, "PAGE", 2)
    assert (update(seen).reload, update(seen).cells) == (True, [])
    monkeypatch.setattr(cells, "PAGE", 1000)
    queue.recover(store)
    queue.cancel(store, found.id)
    assert (update(seen).reload, update(seen).cells) == (True, [])
    assert update(store.revision()).reload is False


@pytest.mark.parametrize("rate", [None, 1000.0])
def test_the_time_that_is_left_is_what_is_left_at_the_rate_that_is_known(store, rate):
    found = submit(store, spp=[1, 2], replicates=2, reference=False, resolution=[10, 10])
    told = views.experiment(store, found, engine(rate))
    assert told["seconds_left"] == (None if rate is None else pytest.approx((1 + 2) * 2 * 100 / rate))
    schemas.Experiment(**told)
    work_off(store)
    assert views.experiment(store, found, engine(rate))["seconds_left"] is None
    assert seconds_left(store, found.id, 1000.0) is None


def test_the_worker_is_told_with_what_it_draws():
    drawing = Drawing(7, "cell", 0, "box · path · independent · 4 spp", (3, 5))
    told = schemas.Worker(**views.worker(engine(), Moment(state="rendering", drawing=drawing, queued=2)))
    assert (told.state, told.experiment, told.cell, told.queued) == ("rendering", 3, 7, 2)
    idle = schemas.Worker(**views.worker(engine(), Moment(state="stalled", trouble="the disk is full")))
    assert (idle.experiment, idle.cell, idle.trouble) == (None, None, "the disk is full")


def test_what_is_sent_is_json_and_nothing_that_only_looks_like_it():
    """No NaN, no letters that end a line of a stream."""
    for value in ({"x": float("nan")}, [float("-inf")], [1.0, float("inf")]):
        with pytest.raises(ValueError, match="JSON compliant"):
            views.to_json(value)
    assert json.loads(views.to_json({"NaN": ":NaN"})) == {"NaN": ":NaN"}
    text = views.to_json({"name": "a\nb\r\u2028é"})
    assert "\n" not in text and "\r" not in text
    assert json.loads(text) == {"name": "a\nb\r\u2028é"}


def test_experiments_are_listed_newest_first(store):
    first, second = submit(store, name="first"), submit(store, name="second", spp=[9])
    listed = views.all_experiments(store, engine())
    assert [item["id"] for item in listed] == [second.id, first.id]
