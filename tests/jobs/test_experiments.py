"""Submitting a plan, and finding it again."""

from __future__ import annotations

import pytest
from hypothesis import given, settings

from jobs import experiments, plan, queue, trash
from jobs.errors import DataDirectoryProblem, KeyReused, NotFound, WasDeleted
from jobs.store import Store
from tests.jobs.conftest import claim, dump, planned, record, select, submit, work_off
from tests.jobs.grids import parse, tables


def test_submitting_twice_changes_nothing(store, data):
    asked = planned(samplers=["independent", "stratified"])
    first = experiments.submit(store, asked, data / "scenes")
    before = dump(store)
    assert experiments.submit(store, asked, data / "scenes") == (first[0], 0)
    assert dump(store) == before
    work_off(store)
    before = dump(store)
    assert experiments.submit(store, asked, data / "scenes") == (first[0], 0)
    assert dump(store) == before


@given(tables())
@settings(max_examples=25, deadline=None, derandomize=True)
def test_every_grid_is_stored_as_planned(tmp_path_factory, table):
    """Cells by digest, once; what is wanted of them in the order of the plan, with its reference."""
    data = tmp_path_factory.mktemp("data")
    asked = plan.expand(parse(table))
    store = Store.open(data)
    experiment, created = experiments.submit(store, asked, data / "scenes")
    digests = {cell.spec.digest for cell in asked.cells}
    assert created == len(digests)
    assert {row[0] for row in select(store, "select digest from cell")} == digests
    stored = select(
        store,
        "select cell.digest, cell.spec, role, replicates, spp_asked, scene, integrator, sampler, reference.digest, "
        "cell.spp, cell.pixels, cell.estimand from experiment_cell join cell on cell.id = cell_id "
        "left join cell as reference on reference.id = reference_id order by position",
    )
    assert stored == [
        (
            cell.spec.digest, cell.spec.text, cell.role, cell.replicates, cell.spp_asked, cell.scene, cell.integrator,
            cell.sampler, cell.reference, cell.spec.spp, cell.spec.estimand.size[0] * cell.spec.estimand.size[1],
            cell.spec.estimand.digest,
        )
        for cell in asked.cells
    ]  # fmt: skip
    assert experiments.standing(store, experiment.id).count("queued") == len(
        {(c.spec.digest, c.role) for c in asked.cells}
    )
    store.close()


def test_one_more_spp_creates_only_that(store, data):
    submit(store, spp=[1, 2])
    work_off(store)
    experiment, created = experiments.submit(store, planned(spp=[1, 2, 3]), data / "scenes")
    assert created == 1
    assert experiments.standing(store, experiment.id).cells == {"done": 2, "queued": 1}
    assert [work.spec.spp for work in work_off(store)] == [3]


def test_the_scene_is_copied_before_anything_refers_to_it(store, data, tmp_path):
    folder = tmp_path / "room"
    folder.mkdir()
    (folder / "scene.xml").write_text('<scene version="3.0.0"><shape type="sphere"/></scene>')
    asked = plan.expand(parse(scenes=["room"], resolution=[9, 9], reference=False, base=tmp_path))
    experiments.submit(store, asked, data / "scenes")
    (scene,) = store.connection.execute("select digest, name, main, builtin from scene")
    assert scene[1:] == ("room", "scene.xml", 0)
    (folder / "scene.xml").write_text("<scene/>")
    assert "sphere" in (data / "scenes" / scene[0] / "scene.xml").read_text()


def test_a_scene_that_changed_since_it_was_read_is_no_experiment(store, data, tmp_path):
    (tmp_path / "a.xml").write_text('<scene version="3.0.0"/>')
    asked = plan.expand(parse(scenes=["a.xml"], resolution=[9, 9], reference=False, base=tmp_path))
    (tmp_path / "a.xml").write_text('<scene version="3.0.0"><shape type="sphere"/></scene>')
    before = dump(store)
    with pytest.raises(Exception, match="chang"):
        experiments.submit(store, asked, data / "scenes")
    assert dump(store) == before


def test_a_cancelled_experiment_is_wanted_again_when_it_is_submitted_again(store):
    experiment = submit(store)
    record(store, claim(store), "cell", 0)
    queue.cancel(store, experiment.id)
    assert experiments.find(store, "1").cancelled
    assert submit(store).id == experiment.id
    assert not experiments.find(store, "1").cancelled
    assert work_off(store)[0].missing == (("cell", 1),)


def test_the_same_key_is_the_same_request(store, data):
    """Whatever happened since the first time: the second one changes nothing at all."""
    asked, other = planned(), planned(spp=[9])
    first, new = experiments.submit(store, asked, data / "scenes", "key")
    assert new == 3
    queue.cancel(store, first.id)
    before = dump(store)
    again, new = experiments.submit(store, asked, data / "scenes", "key")
    assert (again.id, again.cancelled, new) == (first.id, True, 0)
    with pytest.raises(KeyReused, match="the Idempotency-Key 'key' came with another grid before; send a new key"):
        experiments.submit(store, other, data / "scenes", "key")
    assert dump(store) == before
    assert not experiments.submit(store, asked, data / "scenes", "another key")[0].cancelled


def test_a_key_of_what_was_deleted_brings_nothing_back(store, artifacts, data):
    first, _ = experiments.submit(store, planned(), data / "scenes", "key")
    queue.delete(store, first.id)
    before = dump(store)
    with pytest.raises(WasDeleted):
        experiments.submit(store, planned(), data / "scenes", "key")
    assert dump(store) == before
    trash.empty(store, artifacts, seconds=-1)
    assert experiments.submit(store, planned(), data / "scenes", "key")[0].id > first.id


def test_a_request_that_fails_leaves_no_key(store, data, monkeypatch):
    def die(*_):
        raise KeyboardInterrupt

    with monkeypatch.context() as patch:
        patch.setattr(queue, "want", die)
        with pytest.raises(KeyboardInterrupt):
            experiments.submit(store, planned(), data / "scenes", "key")
    assert (
        select(store, "select count(*) from experiment") == select(store, "select count(*) from submission") == [(0,)]
    )
    assert experiments.submit(store, planned(spp=[9]), data / "scenes", "key")[1] == 2


def test_submitting_again_does_not_retry_what_failed(store):
    experiment = submit(store, spp=[1], reference=False)
    queue.fail(store, claim(store), "scene_error", "no such file")
    submit(store, spp=[1], reference=False)
    other = submit(store, spp=[1], reference=False, name="other")
    assert claim(store) is None
    for item in (experiment, other):
        assert experiments.standing(store, item.id).state == "failed"


def test_an_experiment_is_found_by_id_and_by_its_name_the_newest_first(store):
    old, new, other = submit(store, name="a"), submit(store, name="a", spp=[9]), submit(store, name="b")
    assert experiments.find(store, "a") == new
    assert experiments.find(store, "1") == old
    assert experiments.find(store, "3") == experiments.find(store, "b") == other
    assert [item.id for item in experiments.everything(store)] == [1, 2, 3]


@pytest.mark.parametrize("name", ["c", "", "7", "-1", "9" * 30, "²", "٣", "a' or 1=1 --", "\udcff", "1.0"])
def test_an_unknown_experiment_is_told_with_those_that_are_there(store, data, name):
    with pytest.raises(NotFound, match=r"no experiment .* there are: none yet"):
        experiments.find(store, name)
    submit(store, name="first")
    with pytest.raises(NotFound, match=rf"in {data}; there are: 1 \(first\)"):
        experiments.find(store, name)


def test_two_requests_that_are_rounded_to_one_cell_count_once(store):
    experiment = submit(store, samplers=["stratified"], spp=[3, 4], reference=False)
    standing = experiments.standing(store, experiment.id)
    assert (standing.cells, standing.wanted) == ({"queued": 1}, 2)
    work_off(store)
    standing = experiments.standing(store, experiment.id)
    assert (standing.cells, standing.had, standing.finished) == ({"done": 1}, 2, True)


def test_standing_follows_an_experiment_through_its_life(store):
    experiment = submit(store, spp=[1, 2, 3], replicates=1)
    seen = []
    while work := claim(store):
        seen.append(experiments.standing(store, experiment.id).state)
        if work.spec.spp == 2:
            queue.fail(store, work, "nan_output", "")
        else:
            for role, k in work.missing:
                record(store, work, role, k)
            queue.finish(store, work)
    standing = experiments.standing(store, experiment.id)
    assert seen == ["running"] * 4
    assert (standing.state, standing.failed, standing.finished) == ("failed", 1, True)
    assert (standing.had, standing.wanted) == (4, 5)


def test_what_is_left_is_counted_in_samples(store):
    experiment = submit(store, spp=[1, 2], replicates=2, reference={"spp": 8}, resolution=[4, 5])
    assert store.value("samples_left", experiment_id=experiment.id) == (1 * 2 + 2 * 2 + 8) * 20
    record(store, claim(store), "cell", 0)
    assert store.value("samples_left", experiment_id=experiment.id) == (1 + 2 * 2 + 8) * 20


def test_the_estimate_learns_what_is_there_and_how_fast_this_machine_was(store):
    submit(store, spp=[1, 2], replicates=2, reference=False, crop=[1, 1, 4, 5])
    assert experiments.replicates_had(store) == experiments.rates(store, "here") == {}
    work = work_off(store)
    assert experiments.replicates_had(store) == {(item.digest, "cell"): 2 for item in work}
    seconds = 2 * (0.25 + 1.25)
    assert experiments.rates(store, "here") == {("cornell_box", "path"): pytest.approx((1 + 2) * 2 * 20 / seconds)}
    assert experiments.rates(store, "another machine") == {}


def test_submitting_to_a_reader_is_refused_in_a_sentence(store, data):
    with pytest.raises(DataDirectoryProblem, match="cannot be written"):
        submit(Store.read(data))
