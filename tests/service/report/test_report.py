"""A report says what the data says, and needs nothing but itself."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from jobs import experiments, queue, results
from jobs.errors import NotFound, WasDeleted
from renderer.images import write_picture
from renderer.metrics import METRICS
from service.report import render_report
from service.report.figures import number
from tests.jobs.conftest import claim, picture, record, submit
from tests.service.report.conftest import Page, finished, numbers_of, page_of, work_off

NASTY = "<script>alert(1)</script> <!-- </title> & \"double\" 'single' {{ 7 * 7 }} " + "x" * 110


def table(found: dict) -> list[dict]:
    return [dict(zip(found["columns"], row, strict=True)) for row in found["rows"]]


def test_its_numbers_are_those_of_the_results(store, artifacts):
    """The table, the CSV and the report read one thing."""
    experiment = finished(store, artifacts, integrators=["path", "direct"], spp=[1, 3, 16])
    found = numbers_of(render_report(store, artifacts, experiment.id))
    told = {
        (metric, one["scene"], one["integrator"], one["sampler"], point["spp"]): (
            point["spp_actual"], point["n"], point["mean"], point["error"],
        )
        for metric, convergence in found["convergence"].items()
        for one in convergence["series"]
        for point in one["points"]
    }  # fmt: skip
    expected = {
        (point.metric, point.scene, point.integrator, point.sampler, point.spp): (
            point.spp_actual, point.n, point.mean, point.error,
        )
        for point in results.summary(store, experiment.id)
    }  # fmt: skip
    assert told == expected and len(told) == 12 * len(METRICS)
    assert table(found["replicates"]) == list(results.rows(store, experiment.id))


def test_too_many_replicates_are_left_to_the_csv(store, artifacts, monkeypatch):
    monkeypatch.setattr("service.report.reading.MOST_REPLICATES", 5)
    page, html = page_of(store, artifacts, finished(store, artifacts))
    assert numbers_of(html)["replicates"] is None and "there are too many" in page.text


def test_its_tables_show_these_numbers(store, artifacts):
    experiment = finished(store, artifacts)
    page, _ = page_of(store, artifacts, experiment)
    for point in results.summary(store, experiment.id):
        if point.metric != "mean_ratio":
            assert f"{number(point.mean)} ± {number(point.error, 2)}" in page.text


def test_it_has_all_that_a_reader_needs(store, artifacts):
    experiment = finished(store, artifacts, name="A grid", spp=[1, 3, 16], rfilter="tent")
    page, html = page_of(store, artifacts, experiment)
    for words in (
        "A grid", "Which sampler and which integrator converge fastest", "Complete: 20 pictures",
        'samplers = ["independent", "stratified"]', "plain random numbers (PCG32)", "3 → 4",
        "stratified cannot render every spp", "jitter = true", "tent", "9 × 9", "mean((I − R1)·(I − R2))",
        "dartboard run grid.toml", "dartboard results 'A grid'", "llvm", "here", "relmse at 16 spp",
        "like spp to the power",
    ):  # fmt: skip
        assert words in page.text, words
    found = numbers_of(html)
    digests = {cell["digest"] for cell in table(found["cells"])}
    assert digests == {row[0] for row in store.connection.execute("select digest from cell")}
    assert all(digest in page.text for digest in digests)
    assert found["made_on"][0]["pictures"] == 20


def test_it_loads_nothing(store, artifacts):
    page, html = page_of(store, artifacts, finished(store, artifacts))
    links = page.attributes("src", "href", "srcset", "action", "data", "poster", "background")
    assert links and all(link.startswith(("data:", "#")) for link in links)
    assert not [tag for tag, _ in page.elements if tag in ("iframe", "object", "embed", "base", "form")]
    assert "@import" not in html.partition("</style>")[0] and "url(" not in html.partition("</style>")[0]
    [policy] = [found for tag, found in page.elements if tag == "meta" and found.get("http-equiv")]
    assert policy["content"] == (
        "default-src 'none'; img-src data:; style-src 'unsafe-inline'; script-src 'unsafe-inline'"
    )
    assert all(link[1:] in page.attributes("id") for link in links if link.startswith("#"))


def test_a_name_is_text_wherever_it_stands(store, artifacts):
    plain, _ = page_of(store, artifacts, finished(store, artifacts, name="plain"))
    page, html = page_of(store, artifacts, finished(store, artifacts, name=NASTY))
    assert [tag for tag, _ in page.elements] == [tag for tag, _ in plain.elements]
    assert NASTY in page.text
    assert numbers_of(html)["experiment"]["name"] == NASTY


def test_what_is_missing_is_said_at_the_top(store, artifacts):
    experiment = submit(store, spp=[1, 4, 16], replicates=3)
    page, _ = page_of(store, artifacts, experiment)
    assert "none of 11 pictures is there" in page.text and "Nothing is measured yet" in page.text
    work_off(store, artifacts, cells=2)
    record(store, claim(store), "cell", 0)
    page, html = page_of(store, artifacts, experiment)
    assert "Not finished. As of" in page.text and "9 of 11 pictures are there" in page.text
    assert "1 running" in page.text and numbers_of(html)["experiment"]["state"] == "running"
    queue.cancel(store, experiment.id)
    page, _ = page_of(store, artifacts, experiment)
    assert "Not finished: cancelled." in page.text


def test_failed_cells_are_told_with_their_reason(store, artifacts):
    experiment = submit(store, samplers=["independent", "stratified"], spp=[1, 4, 16], replicates=2)
    work_off(store, artifacts, failing=(3, 5))
    page, _ = page_of(store, artifacts, experiment)
    assert "2 cells failed (2 nan output)" in page.text and "3 pixels are </script><b>NaN</b>" in page.text
    assert "Not complete." in page.text


def test_without_a_reference_it_says_so_and_shows_pictures_and_times(store, artifacts):
    page, html = page_of(store, artifacts, finished(store, artifacts, reference=False))
    assert "No reference was asked for" in page.text
    assert "Render time of a picture" in page.text and "The lowest" not in page.text
    assert sum(tag == "img" for tag, _ in page.elements) == 6
    assert all(not convergence["series"] for convergence in numbers_of(html)["convergence"].values())


def test_with_one_replicate_nothing_is_certain(store, artifacts):
    page, _ = page_of(store, artifacts, finished(store, artifacts, replicates=1))
    assert "One replicate of each cell" in page.text and "nobody can say how sure that is" in page.text
    told = page.text.partition("Metrics I is")[0]
    assert "apart" not in told.partition("Set-up")[0] and "±" not in told


def test_integrators_that_count_the_same_paths_are_compared_and_others_not(store, artifacts):
    experiment = finished(store, artifacts, integrators=["path", "direct", "path:rr_depth=3"])
    page, html = page_of(store, artifacts, experiment)
    panels = [panel["integrators"] for panel in numbers_of(html)["panels"].values()]
    assert panels == [["path", "path:rr_depth=3"], ["direct"]]
    assert "path, path:rr_depth=3 and direct count different paths" in page.text


def test_versions_are_those_in_the_pictures(store, artifacts):
    experiment = submit(store, spp=[1], replicates=1, reference=False)
    work = claim(store)
    name = artifacts.picture(work.digest, "cell", 0)
    header = {"versions": '{"mitsuba": "3.9.7", "drjit": "1.5.3"}', "variant": "llvm_ad_rgb"}
    write_picture(artifacts.work / "x.exr", picture(work.digest, "cell", 0), header)
    artifacts.adopt(artifacts.work / "x.exr", name)
    record(store, work, "cell", 0, name)
    queue.finish(store, work)
    page, html = page_of(store, artifacts, experiment)
    assert "Mitsuba 3.9.7 and Dr.Jit 1.5.3 (llvm_ad_rgb)" in page.text
    assert numbers_of(html)["versions"] == [{"mitsuba": "3.9.7", "drjit": "1.5.3", "variant": "llvm_ad_rgb"}]


def test_a_lost_file_costs_its_picture_only(store, artifacts):
    experiment = finished(store, artifacts)
    [lost, *_] = sorted(artifacts.data.glob("images/*/*/cell-000.exr"))
    lost.unlink()
    page, _ = page_of(store, artifacts, experiment)
    assert "no picture" in page.text
    assert sum(tag == "img" for tag, _ in page.elements) == 6  # five of six, and the reference


def test_an_experiment_that_is_not_there_is_told(store, artifacts):
    with pytest.raises(NotFound, match="no experiment '7'"):
        render_report(store, artifacts, 7)
    experiment = finished(store, artifacts, spp=[1], replicates=1)
    queue.delete(store, experiment.id)
    with pytest.raises(WasDeleted):
        render_report(store, artifacts, experiment.id)
    assert experiments.everything(store) == []


def test_its_elements_are_well_formed(store, artifacts):
    """``Page`` fails on what does not match; this is the page with the most in it."""
    experiment = submit(store, samplers=["independent", "stratified"], integrators=["path", "path:rr_depth=2"],
                        spp=[1, 2, 3, 4, 5, 6, 7, 8, 9, 10], replicates=2)  # fmt: skip
    work_off(store, artifacts, failing=(2,), cells=30)
    assert Page(render_report(store, artifacts, experiment.id)).elements


def test_making_one_loads_no_mitsuba():
    code = "import sys, service.report; assert not {'mitsuba', 'drjit'} & set(sys.modules)"
    done = subprocess.run([sys.executable, "-c", code], cwd=Path(__file__).parents[3], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
