"""Curves of an experiment: their points, their order, and whether their times may be compared."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest

from jobs import convergence, points, queue
from jobs.slopes import slope, student
from renderer.errors import UnknownName
from tests.jobs.conftest import claim, planned, submit
from tests.jobs.guesser import guess
from tests.jobs.painter import Painter, noise
from tests.jobs.test_dispatcher import painted
from tests.jobs.test_points import draw_all


def draw_under(store, conditions) -> None:
    """Every cell drawn under the conditions that ``conditions`` gives for it: machine, threads, neighbours."""
    while work := claim(store):
        machine, threads, neighbours = conditions(work)
        work = queue.Work(**{**vars(work), "machine": machine})
        for role, k in work.missing:
            with store.transaction():
                queue.finish_replicate(
                    store, work, role, k, image="x", seed=k, render_seconds=work.spec.spp / 4, compile_seconds=0.0,
                    threads=threads, neighbours=neighbours,
                )  # fmt: skip
                points.refresh(store, [work.cell_id])
        queue.finish(store, work)
    guess(store, lambda pair, name: 1.0 + pair["replicate_id"] % 2)


def test_there_is_a_curve_per_scene_integrator_and_sampler_in_the_order_of_the_plan(store):
    experiment = submit(
        store, scenes=["defocus", "cornell_box"], samplers=["stratified", "independent"],
        integrators=["path", "path:max_depth=2"], spp=[1, 4, 16],
    )  # fmt: skip
    draw_all(store)
    guess(store, lambda pair, name: 0.5 + pair["replicate_id"] % 3)
    found = convergence.curves(store, experiment.id, "mse")
    expected = itertools.product(
        ["defocus", "cornell_box"], ["path", "path:max_depth=2"], ["stratified", "independent"]
    )
    assert sorted((c.scene, c.integrator, c.sampler) for c in found) == sorted(expected)
    assert [c.scene for c in found] == ["defocus"] * 4 + ["cornell_box"] * 4
    assert all([point["spp"] for point in curve.points] == [1, 4, 16] for curve in found)
    only = convergence.curves(store, experiment.id, "mse", "cornell_box")
    assert [vars(curve) for curve in only] == [vars(curve) for curve in found if curve.scene == "cornell_box"]
    assert convergence.curves(store, experiment.id, "mse", "no such scene") == []


def test_a_replay_is_read_against_the_spp_that_were_asked(store):
    """One cell of 16 spp that is wanted at four: its error does not fall, and that is what its slope says."""
    experiment = submit(
        store, samplers=["poissondisk:replay=ignore_spp", "stratified"], spp=[4, 8, 16, 64], replicates=4
    )
    draw_all(store)
    guess(store, lambda pair, name: 1.0 + pair["replicate_id"] % 4)
    flat, right = convergence.curves(store, experiment.id, "relmse")
    assert (flat.replay, right.replay) == (True, False)
    assert [(point["spp"], point["spp_actual"]) for point in flat.points] == [(4, 16), (8, 16), (16, 16), (64, 16)]
    assert len({point["cell"] for point in flat.points}) == 1
    assert len({(point["mean"], point["error"], point["n"]) for point in flat.points}) == 1
    assert flat.slope is not None and flat.slope.value == pytest.approx(0, abs=1e-12)
    assert flat.slope.low < 0 < flat.slope.high
    assert right.slope == slope(right.points)


def test_a_point_has_the_interval_of_its_mean(store):
    experiment = submit(store, spp=[1, 2, 4], replicates=4)
    draw_all(store)
    guess(store, lambda pair, name: 1.0 + pair["replicate_id"] % 4)
    (curve,) = convergence.curves(store, experiment.id, "relmse")
    for point in curve.points:
        assert point["n"] == 4
        assert point["mean"] == 2.5
        assert point["error"] == pytest.approx(math.sqrt(5 / 3 / 4), rel=1e-3)
        assert point["high"] - point["mean"] == pytest.approx(student(3) * point["error"], rel=1e-5)
        assert point["mean"] - point["low"] == pytest.approx(student(3) * point["error"], rel=1e-5)
        assert point["seconds"] == pytest.approx(0.25 + 1.5)
    assert curve.slope == slope(curve.points)


def test_one_replicate_has_a_mean_and_no_interval(store):
    experiment = submit(store, spp=[1, 2, 4], replicates=1)
    draw_all(store)
    guess(store, lambda pair, name: 2.0)
    (curve,) = convergence.curves(store, experiment.id, "mse")
    assert [(p["mean"], p["error"], p["low"], p["high"]) for p in curve.points] == [(2.0, None, None, None)] * 3
    assert curve.slope is None


def test_pictures_of_known_noise_fall_with_slope_minus_one(store, artifacts):
    """
    From pixels to the exponent: noise of variance 1 / spp about a mean of 1, drawn, measured and fitted. The cross
    metric has no floor from the reference, so its mean is the variance itself.
    """
    asked = planned(spp=[1, 4, 16, 64], replicates=8, resolution=[40, 30], reference={"spp": 2 * 4096, "replicates": 2})
    dispatcher = painted(store, artifacts, Painter())
    found, _ = dispatcher.submit(asked)
    dispatcher.run()
    (curve,) = convergence.curves(store, found.id, "mse_cross")
    assert curve.slope is not None
    assert curve.slope.low < -1 < curve.slope.high
    assert curve.slope.high - curve.slope.low < 0.2
    for point in curve.points:
        assert point["low"] < 1 / point["spp"] < point["high"], point
        assert point["mean"] * point["spp"] == pytest.approx(1, abs=0.15)
    assert noise("0" * 64, "cell", 0, (2, 2), 1).dtype == np.float32


def test_times_are_alike_where_nothing_differs(store):
    experiment = submit(store, samplers=["independent", "stratified"], spp=[1, 4])
    draw_under(store, lambda work: ("here", 2, 0))
    assert [curve.alike for curve in convergence.curves(store, experiment.id, "mse")] == [True, True]


@pytest.mark.parametrize("other", [("there", 2, 0), ("here", 4, 0), ("here", 2, 1)])
def test_a_curve_under_other_conditions_is_not_compared_by_its_seconds(store, other):
    """Another machine, another number of threads, a neighbour: the curve says so, the others do not."""
    experiment = submit(store, samplers=["independent", "stratified", "multijitter"], spp=[1, 4])
    draw_under(store, lambda work: other if work.spec.sampler.name == "multijitter" else ("here", 2, 0))
    alike = {curve.sampler: curve.alike for curve in convergence.curves(store, experiment.id, "mse")}
    assert alike == {"independent": True, "stratified": True, "multijitter": False}


def test_one_point_under_other_conditions_is_enough(store):
    experiment = submit(store, samplers=["independent", "stratified"], spp=[1, 4, 9])
    odd = {("independent", 9)}
    draw_under(store, lambda work: ("there" if (work.spec.sampler.name, work.spec.spp) in odd else "here", 2, 0))
    alike = {curve.sampler: curve.alike for curve in convergence.curves(store, experiment.id, "mse")}
    assert alike == {"independent": False, "stratified": True}


def test_the_noise_of_a_reference_is_news_when_it_is_measured(store, artifacts):
    """Nothing else may change with it: who has read the curves before has to read them again."""
    found, _ = painted(store, artifacts, Painter()).submit(planned(spp=[1, 2, 4]))
    painted(store, artifacts, Painter()).run()
    store.connection.execute("delete from floor")
    assert {curve.floor for curve in convergence.curves(store, found.id, "mse")} == {None}
    seen = store.revision()
    dispatcher = painted(store, artifacts, Painter())
    dispatcher.run()
    assert store.revision() > seen
    assert all(curve.floor for curve in convergence.curves(store, found.id, "mse"))
    seen = store.revision()
    dispatcher.run()
    assert store.revision() == seen


def test_an_unknown_metric_is_told_with_those_that_are_known(store):
    experiment = submit(store)
    with pytest.raises(UnknownName, match="unknown metric 'rmse'; known: .*relmse.*did you mean '.*mse'"):
        convergence.curves(store, experiment.id, "rmse")


def test_nothing_measured_is_no_curve(store):
    assert convergence.curves(store, submit(store).id, "mse") == []
