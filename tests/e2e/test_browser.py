"""
The dashboard as people use it: a real server, a real browser, small grids.

Every test also holds what ``Watch`` holds: no page asks another host for anything, none writes an error to its console.
"""

from __future__ import annotations

import csv
import io
import re
import signal
from pathlib import Path

import httpx
import numpy as np
import pytest
from playwright.sync_api import Page, expect

from tests.e2e.browser import (
    SMALL,
    Server,
    Watch,
    bar,
    dartboard,
    drawn,
    facts,
    picture,
    shown,
    state,
    tiles,
    until,
    viewer,
    words,
)

ENDLESS = SMALL.replace("small", "endless").replace("replicates = 3", "replicates = 1000")  # it outlasts every test
SLOW = """
name = "slow"
scenes = ["cornell_box"]
integrators = ["direct"]
spp = [65536]
replicates = 1
resolution = [32, 24]
reference = false
"""


# -- live --


def test_the_demo_grid_fills_on_an_open_page(watch: Watch, demo: Server) -> None:
    """``up`` on an empty directory: pictures come while one looks, and the page can stop it."""
    page = watch.open(demo)
    page.get_by_role("link", name="Demo: which sampler converges fastest?").click()
    expect(state(page)).to_have_text("running")
    before = bar(page).get_attribute("aria-label")
    for integrator in ("path", "direct"):
        expect(picture(page, f"cornell_box · {integrator} · independent · 4 spp")).to_be_visible()
    assert before is not None
    expect(bar(page)).not_to_have_accessible_name(before)
    page.get_by_role("button", name="Cancel").click()
    expect(state(page)).to_have_text("cancelled")
    expect(page.get_by_role("banner").get_by_text("idle")).to_be_visible()
    assert demo.stop() == 0


def test_a_picture_is_seen_while_it_is_drawn(watch: Watch, empty: Server) -> None:
    """Its previews get better, and give way to the finished picture, without the page being loaded again."""
    page = watch.open(empty)
    page.evaluate(RECORD)
    number = empty.submit(SLOW)
    page.get_by_role("link", name="slow").click()
    expect(state(page)).to_have_text("done", timeout=300_000)
    cell = next(cell for cell in empty.get(f"/api/experiments/{number}/cells")["cells"] if cell["role"] == "cell")
    until(page, lambda: "done" in versions(page, cell["cell"]), "the finished picture is shown")
    *previews, last = versions(page, cell["cell"])
    assert last == "done"
    assert all(re.fullmatch(r"p\d+", version) for version in previews)
    assert previews or cell["seconds"] < 2, "a picture that takes longer shows how far it is"


RECORD = """
window.recorded = [];
new MutationObserver((changes) => {
  const added = changes.flatMap((change) => [...change.addedNodes]);
  recorded.push(...added.filter((node) => node.nodeName === "IMG").map((node) => node.src));
}).observe(document, { childList: true, subtree: true });
"""


def versions(page: Page, cell: int) -> list[str]:
    """What of a cell the page has shown so far: ``p1``, ``p2`` … are previews."""
    sources: list[str] = page.evaluate("recorded")
    return [re.sub(".*[?&]v=", "", source) for source in sources if f"/cells/{cell}/preview.png?role=cell" in source]


def test_two_pages_show_the_same(watch: Watch, empty: Server) -> None:
    """What one page does, the other shows; when all is still they agree in every number."""
    number = empty.submit(ENDLESS)
    pages = [watch.open(empty, f"/experiments/{number}") for _ in range(2)]
    for page in pages:
        expect(picture(page, "cornell_box · path · independent · 4 spp")).to_be_visible()
    pages[0].get_by_role("button", name="Pause").click()
    for page in pages:
        expect(state(page)).to_have_text("paused")
    pages[1].get_by_role("button", name="Resume").click()
    for page in pages:
        expect(state(page)).to_have_text("running")
    pages[1].get_by_role("link", name="Experiments", exact=True).click()
    pages[1].get_by_role("button", name="Actions").click()
    pages[1].get_by_role("menuitem", name="Cancel").click()
    expect(pages[0].get_by_role("banner").get_by_text("idle")).to_be_visible()
    pages[1].get_by_role("link", name="endless").click()
    for page in pages:
        expect(state(page)).to_have_text("cancelled")
        server_says = empty.get(f"/api/experiments/{number}")
        expect(facts(page)).to_have_text(re.compile(rf"^{server_says['had']}\b"))
    assert bar(pages[0]).get_attribute("aria-label") == bar(pages[1]).get_attribute("aria-label")


# -- comparing --


def test_pictures_are_flipped_in_the_viewer(watch: Watch, finished: Server) -> None:
    """``1`` … ``9`` show the pictures of a row, Shift the reference while it is held; numbers are those of the file."""
    page = watch.open(finished, "/experiments/1?rows=sampler&cols=spp&integrator=path")
    picture(page, "cornell_box · path · stratified · 4 spp").click()
    expect(shown(page)).to_have_text(words("path", "stratified", "4 spp"), use_inner_text=True)
    seen = {"1": settled(page)}
    for key, spp in (("2", 16), ("3", 64)):
        page.keyboard.press(key)
        expect(shown(page)).to_have_text(words("path", "stratified", f"{spp} spp"), use_inner_text=True)
        seen[key] = settled(page, *seen.values())
    page.keyboard.down("Shift")
    expect(shown(page)).to_have_accessible_name("reference")
    settled(page, *seen.values())
    page.keyboard.up("Shift")
    expect(shown(page)).to_have_accessible_name("64 spp")
    until(page, lambda: drawn(page) == seen["3"], "the picture is back")

    row = finished.get("/api/experiments/1/cells")["cells"]
    cell = next(c for c in row if (c["integrator"], c["sampler"], c["spp"]) == ("path", "stratified", 64))
    box = shown(page).locator("[data-view]").bounding_box()
    assert box is not None
    middle = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
    page.mouse.move(middle[0] + 2, middle[1] + 2)  # in the pixel whose corner is the middle
    pixel = viewer(page).get_by_label("Pixel under the pointer")
    expect(pixel).to_contain_text("16, 12")
    answer = httpx.get(f"{finished.url}/api/cells/{cell['cell']}/pixels?k=0", trust_env=False)
    rgb = np.frombuffer(answer.content, "<f2").reshape(24, 32, 3)[12, 16].astype(float)
    written = [float(text) for text in pixel.locator("b").all_inner_texts()[:3]]
    assert written == pytest.approx(rgb, rel=1e-3)


def settled(page: Page, *others: bytes) -> bytes:
    """The picture that the viewer has drawn, once it is none of those before."""
    until(page, lambda: drawn(page) not in others, "another picture is drawn")
    return drawn(page)


def test_a_click_on_a_point_opens_its_picture(watch: Watch, finished: Server) -> None:
    page = watch.open(finished, "/experiments/1")
    plot = page.locator("#curves")
    plot.scroll_into_view_if_needed()
    point = plot.locator(".points path").nth(4)
    point.wait_for()
    box = point.bounding_box()
    assert box is not None
    x, y = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
    page.mouse.move(x - 2, y)
    page.mouse.move(x, y)
    lines = plot.locator(".hoverlayer .hovertext .line")
    lines.first.wait_for()
    text = " | ".join(lines.all_text_contents())
    found = re.match(r"(\w+) · (\w+) \|.*\| (\d+) spp", text)
    assert found, text
    sampler, integrator, spp = found.groups()
    page.mouse.down()
    page.mouse.up()
    expect(shown(page)).to_have_text(words(integrator, sampler, f"{spp} spp"), use_inner_text=True)
    page.keyboard.press("Escape")
    expect(viewer(page)).to_be_hidden()
    expect(tiles(page).and_(page.locator("[aria-selected=true]"))).to_have_accessible_name(
        re.compile(f"^cornell_box · {integrator} · {sampler} · {spp} spp"))  # fmt: skip
    expect(plot.get_by_role("button", name=re.compile("share|cloud", re.IGNORECASE))).to_have_count(0)


def test_the_address_is_the_view(watch: Watch, finished: Server) -> None:
    """Axes, metric, exposure, the open viewer: a reload and another browser show what this one shows."""
    page = watch.open(finished, "/experiments/1")
    page.get_by_role("group", name="metric").get_by_text("mse", exact=True).click()
    page.get_by_role("combobox", name="rows", exact=True).select_option("spp")
    page.get_by_role("combobox", name="columns", exact=True).select_option("sampler")
    page.get_by_role("group", name="integrator").get_by_text("direct", exact=True).click()
    page.keyboard.press("e")
    page.keyboard.press("e")
    picture(page, "cornell_box · direct · stratified · 16 spp").click()
    viewer(page).get_by_role("button", name="Side by side").click()
    viewer(page).get_by_role("button", name="Δ²", exact=True).click()
    view = {"metric": "mse", "rows": "spp", "cols": "sampler", "integrator": "direct", "ev": "1", "layout": "side",
            "mode": "squared", "viewer": "open"}  # fmt: skip
    expect(page).to_have_url(re.compile("".join(f"(?=.*[?&]{name}={value}(&|$))" for name, value in view.items())))
    before = page.evaluate(SETTINGS)
    page.reload()
    until(page, lambda: page.evaluate(SETTINGS) == before, "the page is as before")
    other = watch.open(finished, page.url.removeprefix(finished.url))
    until(other, lambda: other.evaluate(SETTINGS) == before, "another browser shows the same")


SETTINGS = """() => [
  ...document.querySelectorAll("input:checked, select, input[type=range], [aria-pressed=true], dialog section"),
].map((one) => `${(one.closest("label") ?? one).innerText}: ${one.value}`)"""


# -- the journey --


def test_from_the_form_to_the_export(watch: Watch, empty: Server) -> None:
    """
    A new grid is built in the form, queued, cancelled, retried; the server goes and is killed meanwhile. The page says
    so and goes on by itself, nothing finished is lost, and what is exported is what the command line has.
    """
    watch.allow("net::ERR_(CONNECTION_REFUSED|CONNECTION_RESET|EMPTY_RESPONSE|INCOMPLETE_CHUNKED_ENCODING) GET ")
    page = watch.open(empty)
    page.get_by_role("main").get_by_role("link", name="New experiment").click()
    fill_form(page)
    panel = page.get_by_role("complementary", name="What this will do")
    expect(panel).to_contain_text(re.compile(r"20.cells\s*= 2.scenes × 1.integrator × 2.samplers × 5.spp"))
    expect(panel).to_contain_text("20\u202f004")
    panel.get_by_text("The grid as TOML").click()
    text = panel.locator("pre").inner_text()
    told = empty.post("/api/experiments?dry_run=true", json={"toml": text}).raise_for_status().json()
    assert (told["cells"], told["references"], told["replicates"]) == (20, 2, 20 * 1000 + 2 * 2)
    panel.get_by_role("button", name="Queue 20 cells").click()

    expect(page.get_by_role("heading", name="A journey", exact=True)).to_be_visible()
    expect(state(page)).to_have_text("running")
    expect(picture(page, "cornell_box · path · independent · 4 spp")).to_be_visible()
    page.get_by_role("button", name="Cancel").click()
    expect(state(page)).to_have_text("cancelled")
    page.get_by_role("button", name="Retry what is missing").click()
    expect(state(page)).to_have_text("running")

    for number in (signal.SIGTERM, signal.SIGKILL):
        grows(page)
        before = rows(empty.data)
        ended = empty.stop(number)
        assert ended == (0 if number == signal.SIGTERM else -signal.SIGKILL)
        expect(page.get_by_text("The server is gone")).to_be_visible()
        empty.start()
        expect(page.get_by_text("The server is gone")).to_be_hidden()
        grows(page)
        after = rows(empty.data)
        assert all(after[key] == row for key, row in before.items()), "what was finished is still there, and the same"

    page.get_by_role("button", name="Cancel").click()
    expect(state(page)).to_have_text("cancelled")
    expect(page.get_by_role("banner").get_by_text("idle")).to_be_visible()
    with page.expect_download() as download:
        page.locator("#table").get_by_role("link", name="CSV", exact=True).click()
    exported = Path(download.value.path()).read_bytes().decode()
    assert exported == dartboard("results", "A journey", "--data", empty.data, "--format", "csv")


def fill_form(page: Page) -> None:
    """Twenty cells: two scenes, two samplers, five spp; so many replicates that it outlasts the test."""
    page.get_by_label("Name").fill("A journey")
    page.get_by_role("region", name="Scenes").get_by_role("checkbox", name="Defocus").check()
    page.get_by_role("region", name="Samplers", exact=True).get_by_role("checkbox", name="multijitter").uncheck()
    spp = page.get_by_role("region", name="Samples per pixel")
    spp.get_by_role("button", name="32", exact=True).click()
    spp.get_by_label("Other samples per pixel").fill("9")
    spp.get_by_role("button", name="Add").click()
    page.get_by_label("Replicates").fill("1000")
    page.get_by_label("Width in pixels").fill("32")
    page.get_by_label("Height in pixels").fill("24")
    page.get_by_role("region", name="Reference").get_by_label("Samples per pixel").fill("256")


def grows(page: Page) -> None:
    """Wait for another picture."""
    expect(facts(page)).not_to_have_text(facts(page).inner_text())


def rows(data: Path) -> dict[tuple[str, ...], tuple[str, ...]]:
    """Every finished picture with what can be said of it as soon as it is finished."""
    table = csv.DictReader(io.StringIO(dartboard("results", "A journey", "--data", data, "--format", "csv")))
    there = [row for row in table if row["render_seconds"]]
    named = ("scene", "integrator", "sampler", "spp", "replicate")
    said = ("spp_actual", "render_seconds", "compile_seconds")
    return {tuple(row[name] for name in named): tuple(row[name] for name in said) for row in there}


def test_a_report_needs_nothing_but_itself(watch: Watch, finished: Server, tmp_path: Path) -> None:
    """The page opens it in a tab of its own; saved, it shows the same with its plots, and asks nobody for anything."""
    page = watch.open(finished, "/experiments/1")
    with page.expect_popup() as opened:
        page.get_by_role("link", name="Report").click()
    file = tmp_path / "report.html"
    file.write_text(httpx.get(opened.value.url, trust_env=False, timeout=60).text)
    for report in (opened.value, watch.open_file(file)):
        expect(report.get_by_role("heading", level=1)).to_have_text("small")
        report.locator("[data-plot]").first.scroll_into_view_if_needed()
        report.locator(".points path").first.wait_for()
        expect(report.get_by_role("main")).to_contain_text(re.compile("14.cells"))
        assert report.evaluate("document.documentElement.scrollWidth <= innerWidth")
