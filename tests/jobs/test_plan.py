"""The cells of a grid: which, in which order, and measured against what."""

from __future__ import annotations

from dataclasses import replace
from itertools import groupby

import pytest
from hypothesis import given, settings

from jobs import gridsweeps
from jobs.plan import expand
from renderer import catalog
from renderer.spec import CellSpec
from tests.jobs.grids import parse, tables

grids = tables().map(parse)
relaxed = settings(max_examples=60, deadline=None)


def planned(table=None, **keys):
    return expand(parse(table, **keys)).cells


def curve(cell):
    return cell.scene, cell.spec.estimand.sweep, cell.integrator, cell.sampler


def digests(cells):
    return {(cell.spec.digest, cell.role, cell.spp_asked) for cell in cells}


@given(grids)
@relaxed
def test_every_combination_is_planned_once(grid):
    """As many cells as the product of the axes, less what two spellings share; nothing twice."""
    cells = expand(grid).cells
    assert len(digests(cells)) == len(cells)
    in_scenes = sum(gridsweeps.count(grid.sweeps, scene.source.name) for scene in grid.scenes)
    product = in_scenes * len(grid.integrators) * len(grid.samplers) * len(grid.spp)
    wanted = [cell for cell in cells if cell.role == "cell"]
    curves = {curve(cell) for cell in wanted}
    assert len(wanted) == len(curves) * len(grid.spp) <= product
    assert {cell.spp_asked for cell in wanted} == set(grid.spp)
    assert {cell.replicates for cell in wanted} == {grid.replicates}


@given(grids)
@relaxed
def test_scenes_follow_each_other(grid):
    """A loaded scene slows every kernel, so each is finished before the next."""
    order = [scene for scene, _ in groupby(cell.scene for cell in expand(grid).cells)]
    assert order == [scene.source.name for scene in grid.scenes]


@given(grids)
@relaxed
def test_in_a_scene_all_curves_start_then_references_then_breadth_first(grid):
    for _, group in groupby(expand(grid).cells, key=lambda cell: cell.scene):
        steps = [(cell.spp_asked if cell.role == "cell" else "reference") for cell in group]
        order = [step for step, _ in groupby(steps)]
        references = ["reference"] if "reference" in steps else []
        assert order == [grid.spp[0], *references, *grid.spp[1:]]


@given(grids)
@relaxed
def test_every_cell_has_a_reference_of_its_own_estimand_or_none_is_wanted(grid):
    """Else ``direct`` against a longer path would show a bias that is none."""
    cells = expand(grid).cells
    references = {cell.spec.digest: cell for cell in cells if cell.role == "reference"}
    wanted = {scene.source.name: scene.reference for scene in grid.scenes}
    for cell in cells:
        if cell.role == "reference" or wanted[cell.scene] is None:
            assert cell.reference is None
        else:
            reference = references[cell.reference]
            assert reference.spec.estimand == cell.spec.estimand
            assert reference.spec.estimand.digest == cell.spec.estimand.digest
            request = wanted[cell.scene]
            assert (reference.replicates, reference.spp_asked) == (request.replicates, request.asked)
            assert reference.replicates % 2 == 0
            assert reference.replicates * reference.spp_asked >= request.asked_total
    assert set(references) == {cell.reference for cell in cells} - {None}, "a reference that serves nobody"


@given(grids)
@relaxed
def test_a_spec_holds_the_rendered_spp_and_reads_back(grid):
    for cell in expand(grid).cells:
        assert cell.spec.spp == catalog.rendered_spp(cell.spec.sampler, cell.spp_asked)
        assert CellSpec.parse(cell.spec.text) == cell.spec


@given(grids)
@relaxed
def test_the_estimand_takes_what_changes_the_expected_picture(grid):
    """No integrator of a spec keeps max_depth or hide_emitters; the label that people read does."""
    for cell in expand(grid).cells:
        kept = dict(cell.spec.integrator.parameters)
        assert not {"max_depth", "hide_emitters"} & set(kept)
        read = dict(catalog.resolve("integrator", cell.integrator).parameters)
        assert read.get("hide_emitters", False) == cell.spec.estimand.hide_emitters
        if "max_depth" in read:
            assert read["max_depth"] == cell.spec.estimand.max_depth
        fixed = catalog.find("integrator", cell.spec.integrator.name).depth
        assert fixed in (None, cell.spec.estimand.max_depth)


@given(grids)
@relaxed
def test_a_curve_is_named_by_labels_that_can_be_typed_again(grid):
    for cell in expand(grid).cells:
        for axis, label in (("integrator", cell.integrator), ("sampler", cell.sampler)):
            assert catalog.label(axis, catalog.resolve(axis, label)) == label


@given(grids)
@relaxed
def test_adding_an_spp_adds_only_its_cells(grid):
    more = replace(grid, spp=(*grid.spp, 10_000))
    before, after = expand(grid).cells, expand(more).cells
    added = digests(after) - digests(before)
    assert digests(before) <= digests(after)
    assert {asked for _, _, asked in added} == {10_000} and {role for _, role, _ in added} == {"cell"}


def test_more_replicates_are_the_same_cells():
    assert digests(planned(replicates=3)) == digests(planned(replicates=30))


def test_a_shared_cell_of_two_grids_has_one_digest():
    """However the rest of the two grids differs."""
    one = planned(spp=[4, 16], samplers=["stratified", "random"], replicates=2, reference=False, name="a")
    two = planned(spp=[16, 64], samplers=["stratified:jitter=true", "ldsampler"], scenes=["defocus", "cornell_box"])
    assert len({cell.spec.digest for cell in one} & {cell.spec.digest for cell in two}) == 1


@pytest.mark.parametrize(
    ("own", "scene", "whole", "depth"),
    [(4, 5, 6, 4), (None, 5, 6, 5), (None, None, 7, 7), (None, None, None, 6), (4, None, None, 4), (-1, 5, 6, -1)],
)
def test_max_depth_is_the_integrators_then_the_scenes_then_the_grids_then_the_files(own, scene, whole, depth):
    table = {"integrators": [{"type": "path"} | ({} if own is None else {"max_depth": own})], "spp": 4}
    table |= {} if whole is None else {"max_depth": whole}
    table |= {} if scene is None else {"scene": {"cornell_box": {"max_depth": scene}}}
    assert {cell.spec.estimand.max_depth for cell in planned(table)} == {depth}


def test_direct_light_has_its_own_estimand_and_a_path_reference_of_two_edges():
    cells = planned(integrators=["path", "direct"], max_depth=6, spp=4)
    depths = {(cell.role, cell.integrator): cell.spec.estimand.max_depth for cell in cells}
    assert depths == {
        ("cell", "path"): 6, ("reference", "path"): 6, ("cell", "direct"): 2, ("reference", "path:max_depth=2"): 2,
    }  # fmt: skip


def test_cells_of_one_estimand_share_a_reference():
    cells = planned(integrators=["direct", "path:max_depth=2", "path:rr_depth=1,max_depth=2"], spp=4)
    assert sum(cell.role == "reference" for cell in cells) == 1


def test_hidden_lamps_are_hidden_in_the_reference_too():
    cells = planned(integrators=["path", "path:hide_emitters=true"], spp=4)
    labels = [cell.integrator for cell in cells if cell.role == "reference"]
    assert labels == ["path", "path:hide_emitters=true"]


def test_a_cell_may_be_a_reference_as_well():
    """The same spec in two roles: its replicates have different seeds."""
    cells = planned(spp=[2048])
    assert [cell.role for cell in cells] == ["cell", "reference"]
    assert cells[0].spec == cells[1].spec and cells[0].reference == cells[1].spec.digest


def test_two_requests_that_are_rounded_alike_stay_two_points_of_one_spec():
    cells = planned(samplers="stratified", spp=[10, 16], reference=False)
    assert [(cell.spp_asked, cell.spec.spp) for cell in cells] == [(10, 16), (16, 16)]
    assert cells[0].spec is cells[1].spec


def test_two_spellings_of_the_same_cells_are_planned_once():
    cells = planned(integrators=["path", "path:max_depth=6"], max_depth=6, spp=[4, 16], reference=False)
    assert [cell.integrator for cell in cells] == ["path", "path"]


def test_a_reference_is_asked_for_in_total_and_rendered_in_equal_parts():
    (reference,) = (
        cell
        for cell in planned(spp=4, reference={"spp": 1000, "replicates": 6, "sampler": "stratified"})
        if cell.role == "reference"
    )
    assert (reference.replicates, reference.spp_asked, reference.spec.spp) == (6, 167, 169)


def test_the_largest_grid_has_as_many_different_cells():
    """100 000, none rounded onto another; benchmarks/scale.py measures how long it takes."""
    cells = planned(
        scenes=["cornell_box", "defocus"],
        samplers=["independent", "stratified", "stratified:jitter=false", "multijitter", "multijitter:jitter=false"],
        integrators=[f"path:rr_depth={depth}" for depth in range(1, 101)],
        spp=[side**2 for side in range(1, 101)],
        reference=False,
    )
    assert len({cell.spec.digest for cell in cells}) == len(cells) == 100_000
