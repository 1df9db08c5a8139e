"""A caveat is counted, or chance would hardly produce it."""

from __future__ import annotations

import math

import pytest

from jobs.measure import Measurer
from service.report.findings import findings
from service.report.panels import sections
from service.report.reading import read
from service.report.student import tail
from tests.service.report.conftest import finished, numbers_of, page_of


def told(store, artifacts, experiment) -> list[tuple[str, str]]:
    reading = read(store, artifacts, experiment.id)
    return [(found.kind, found.text) for found in findings(reading, sections(reading))]


@pytest.mark.parametrize(
    ("t", "degrees", "expected"),
    [
        (12.7062, 1, 0.05), (4.3027, 2, 0.05), (3.1824, 3, 0.05), (2.0423, 30, 0.05),
        (3.0, 3, 0.057669), (1.0, 1, 0.5), (0.0, 7, 1.0), (9.2189, 3, 0.0027),
    ],
)  # fmt: skip
def test_the_tail_is_that_of_students_table(t, degrees, expected):
    assert tail(t, degrees) == pytest.approx(expected, rel=1e-3)


def test_the_tail_approaches_the_normal_one():
    assert tail(1.96, 100_000) == pytest.approx(math.erfc(1.96 / math.sqrt(2)), rel=1e-4)


def test_a_plain_experiment_has_no_caveats(store, artifacts):
    assert told(store, artifacts, finished(store, artifacts)) == []


def test_a_brightness_that_chance_does_not_explain_is_a_warning(store, artifacts):
    experiment = finished(store, artifacts, replicates=8)
    change = "update point set mean = ?, error = 0.001 where name = 'mean_ratio' and position = 0"
    store.connection.execute(change, (1.0035,))
    assert told(store, artifacts, experiment) == []  # 3.5 standard errors: once in a hundred, and there are 6 cells
    store.connection.execute(change, (0.98,))
    [(kind, text)] = told(store, artifacts, experiment)
    assert kind == "warn"
    assert "independent · 1 spp: mean_ratio 0.9800 ± 0.0010 is 20.0 standard errors from 1 (n = 8)" in text


def test_times_of_another_machine_are_a_warning(store, artifacts):
    experiment = finished(store, artifacts)
    store.connection.execute("update point set conditions = 'elsewhere' where position = 0 and name = 'render_seconds'")
    [(kind, text)] = told(store, artifacts, experiment)
    assert kind == "warn" and "cannot be compared: independent · path" in text


def test_a_replay_is_told_with_its_mistake_and_blamed_for_nothing_else(store, artifacts):
    """Not for its bias, nor for its rounding: both are what it shows."""
    samplers = ["independent", "poissondisk:replay=ignore_spp", "poissondisk:replay=zeros"]
    experiment = finished(store, artifacts, samplers=samplers, spp=[4, 16, 64])
    change = "update point set mean = 0.5, error = 0.001 where name = 'mean_ratio' and position in (1, 2)"
    store.connection.execute(change)
    found = told(store, artifacts, experiment)
    assert [kind for kind, _ in found] == ["note", "note"]
    assert found[0][1].startswith(
        "poissondisk:replay=ignore_spp is a replay: it shows a published mistake (renders 16 samples per pixel, "
    )
    assert "poissondisk:replay=zeros is a replay" in found[1][1] and "(0, 0)" in found[1][1]


def test_the_report_marks_replays_wherever_they_stand(store, artifacts):
    samplers = ["independent", "poissondisk:replay=ignore_spp"]
    page, html = page_of(store, artifacts, finished(store, artifacts, samplers=samplers, spp=[4, 16, 64]))
    marks = [found for tag, found in page.elements if tag == "span" and found.get("class") == "replay"]
    assert len(marks) >= 4 and all("published mistake" in (found["title"] or "") for found in marks)
    data = numbers_of(html)
    flat = [one for one in data["convergence"]["relmse"]["series"] if one["replay"]]
    assert [one["sampler"] for one in flat] == ["poissondisk:replay=ignore_spp"]
    assert [(point["spp"], point["spp_actual"]) for point in flat[0]["points"]] == [(4, 16), (16, 16), (64, 16)]
    assert "replay" in data["cells"]["columns"]


def test_samplers_that_round_are_a_note(store, artifacts):
    experiment = finished(store, artifacts, samplers=["independent", "stratified", "orthogonal"], spp=[3, 16])
    notes = [text for kind, text in told(store, artifacts, experiment) if kind == "note"]
    assert any("stratified cannot render every spp; asked → rendered: 3 → 4." in text for text in notes)
    assert any("orthogonal cannot render every spp; asked → rendered: 3 → 4, 16 → 25." in text for text in notes)


def test_an_error_below_zero_is_a_note(store, artifacts):
    experiment = finished(store, artifacts)
    store.connection.execute("update point set mean = -1e-9 where name = 'mse_cross' and position = 0")
    [(kind, text)] = told(store, artifacts, experiment)
    assert kind == "note" and "mse_cross of 1 cell is not above zero" in text


def test_finished_cells_without_an_error_are_told(store, artifacts, monkeypatch):
    monkeypatch.setattr(Measurer, "step", lambda self, seconds: False)
    [(kind, text)] = told(store, artifacts, finished(store, artifacts))
    assert kind == "bad" and "6 finished cells have no error yet" in text
