"""The estimate counts each picture once, and only what is still to be rendered."""

from __future__ import annotations

import pytest
from hypothesis import given, settings

from jobs.estimate import EXR_BYTES_PER_PIXEL, ROUGH_RATE, Rounded, estimate
from jobs.plan import expand
from tests.jobs.grids import parse, tables


def planned(**keys):
    return expand(parse(**keys))


def everything(plan):
    """All pictures of a plan, as a store would tell them."""
    return {(cell.spec.digest, cell.role): cell.replicates for cell in plan.cells}


def test_pictures_samples_and_bytes_are_a_product():
    plan = planned(samplers=["independent", "stratified"], spp=[4, 16], replicates=3, resolution=[50, 40])
    told = estimate(plan)
    assert (told.cells, told.references, told.replicates, told.reused) == (4, 1, 4 * 3 + 2, 0)
    assert told.samples == 50 * 40 * (2 * (4 + 16) * 3 + 4096)
    assert told.rough and told.seconds > told.samples / ROUGH_RATE
    assert told.disk_bytes == pytest.approx(14 * 50 * 40 * EXR_BYTES_PER_PIXEL, rel=0.1)


def test_a_crop_costs_what_it_shows():
    whole, crop = (
        estimate(planned(resolution=[100, 100])),
        estimate(planned(resolution=[100, 100], crop=[0, 0, 10, 10])),
    )
    assert crop.samples * 100 == whole.samples


def test_seconds_follow_the_measured_rate():
    plan = planned(spp=[10_000], replicates=1, reference=False, resolution=[100, 100])
    told = estimate(plan, {("cornell_box", "path"): 1e6})
    assert told.seconds == pytest.approx(100, rel=0.01) and not told.rough
    assert estimate(plan, {("defocus", "path"): 1e6}).rough, "a rate of another scene says nothing"


def test_an_integrator_that_was_never_timed_costs_as_much_as_it_usually_does():
    path, bdpt = (
        estimate(planned(spp=[10_000], replicates=1, reference=False, integrators=[name], resolution=[100, 100]))
        for name in ("path", "bdpt")
    )
    assert bdpt.seconds == pytest.approx(3 * path.seconds, rel=0.01) and bdpt.rough


@given(tables().map(parse))
@settings(max_examples=30, deadline=None)
def test_what_is_there_costs_nothing(grid):
    plan = expand(grid)
    told = estimate(plan, had=everything(plan))
    assert (told.samples, told.seconds, told.disk_bytes, told.rough) == (0, 0, 0, False)
    assert told.reused == told.replicates == estimate(plan).replicates


@given(tables().map(parse))
@settings(max_examples=30, deadline=None)
def test_half_of_the_pictures_cost_the_rest(grid):
    """More of another experiment's replicates than this one wants are no credit."""
    plan = expand(grid)
    had = {key: (count + 1000 if number % 2 else 0) for number, (key, count) in enumerate(everything(plan).items())}
    some, all_ = estimate(plan, had=had), estimate(plan)
    assert some.reused == sum(count for key, count in everything(plan).items() if had[key])
    assert 0 <= some.samples <= all_.samples and some.disk_bytes <= all_.disk_bytes


def test_reference_pictures_are_no_replicates_of_the_same_cell():
    plan = planned(spp=[2048], replicates=2)
    (digest,) = {cell.spec.digest for cell in plan.cells}
    assert estimate(plan, had={(digest, "reference"): 2}).reused == 2
    assert estimate(plan).replicates == 4


def test_two_points_of_one_spec_are_rendered_once():
    told = estimate(planned(samplers="stratified", spp=[10, 16], replicates=1, reference=False, resolution=[10, 10]))
    assert (told.cells, told.replicates, told.samples) == (2, 1, 1600)


def test_roundings_are_told_once_with_the_references():
    plan = planned(
        scenes=["cornell_box", "defocus"],
        samplers=["independent", "stratified"],
        spp=[10, 16],
        reference={"sampler": "ldsampler", "spp": 1000},
    )
    assert estimate(plan).rounded == (Rounded("stratified", 10, 16), Rounded("ldsampler", 500, 1024))
