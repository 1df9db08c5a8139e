"""A report in a real browser, from a file, with nobody to ask."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest
from playwright.sync_api import Browser, Page

from service.report import render_report
from tests.service.report.conftest import finished

NASTY = "</script><script>window.wrong = 1</script><img src=x onerror='window.wrong = 2'>"


@pytest.fixture
def file(store, artifacts, tmp_path) -> Path:
    experiment = finished(store, artifacts, name=NASTY, integrators=["path", "direct"], replicates=3)
    path = tmp_path / "report.html"
    path.write_text(render_report(store, artifacts, experiment.id), encoding="utf-8")
    return path


@pytest.fixture
def page(chromium: Browser, file: Path) -> Iterator[Page]:
    """The report, opened from its file; nothing may be asked for and nothing may go wrong."""
    context = chromium.new_context(viewport={"width": 1280, "height": 900})
    page = context.new_page()
    asked, faults = [], []
    page.on("request", lambda request: asked.append(request.url))
    page.on("console", lambda message: faults.append(message.text))
    page.on("pageerror", lambda error: faults.append(str(error)))
    page.goto(file.as_uri())
    yield page
    context.close()
    assert [url for url in asked if not url.startswith("data:")] == [file.as_uri()]
    assert faults == []


def test_it_opens_from_a_file_and_draws_its_plots(page):
    plot = page.locator("[data-plot]").first
    plot.scroll_into_view_if_needed()
    plot.locator(".scatterlayer .js-line").first.wait_for(state="attached")
    assert plot.locator(".scatterlayer .trace.scatter").count() >= 2
    assert page.evaluate("window.wrong") is None
    assert page.evaluate("document.documentElement.scrollWidth <= innerWidth")


def test_metric_axis_and_arrangement_can_be_chosen(page):
    plot = page.locator("[data-plot]").first
    plot.scroll_into_view_if_needed()
    plot.locator(".ytitle", has_text="relmse").wait_for()
    plot.get_by_role("button", name="mse_cross").click()
    plot.locator(".ytitle", has_text="mse_cross").wait_for()
    plot.get_by_role("button", name="seconds").click()
    plot.locator(".xtitle", has_text="seconds").wait_for()
    plot.get_by_role("button", name="one each").click()
    plot.locator(".annotation-text", has_text="stratified").wait_for()
    assert plot.locator('button[aria-pressed="true"]').all_inner_texts() == ["mse_cross", "seconds", "one each"]


def test_its_numbers_and_its_plots_can_be_saved(page, tmp_path):
    with page.expect_download() as numbers:
        page.get_by_role("button", name="save numbers").click()
    assert numbers.value.suggested_filename == "numbers.json"
    plot = page.locator("[data-plot]").first
    plot.locator(".drawing").hover()
    with page.expect_download() as drawing:
        plot.locator(".modebar-btn").first.click()
    drawing.value.save_as(tmp_path / "plot.svg")
    assert (tmp_path / "plot.svg").read_text().startswith("<svg")


def test_on_paper_every_plot_is_there_and_white(page):
    """Also those that nobody has scrolled to, and whatever the screen's theme is."""
    page.emulate_media(color_scheme="dark")
    titles = "[...document.querySelectorAll('.drawing .xtitle')].map((text) => text.style.fill)"
    page.evaluate("dispatchEvent(new Event('beforeprint'))")
    assert page.evaluate(titles) == ["rgb(28, 35, 48)"] * 2
    page.evaluate("dispatchEvent(new Event('afterprint'))")
    assert page.evaluate(titles) == ["rgb(216, 220, 228)"] * 2
    assert page.pdf(prefer_css_page_size=True).startswith(b"%PDF")


def test_a_small_window_needs_no_sideways_scrolling(page):
    page.set_viewport_size({"width": 390, "height": 800})
    assert page.evaluate("document.documentElement.scrollWidth <= innerWidth")
