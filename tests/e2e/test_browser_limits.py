"""
The dashboard when things go wrong, and for everybody: bad input, lost things, a keyboard, a phone, either theme.
"""

from __future__ import annotations

import re
import zipfile
from pathlib import Path

import httpx
import pytest
from playwright.sync_api import Locator, Page, expect

from tests.e2e.browser import SMALL, Server, Watch, facts, shown, state, tiles, until, viewer, words

# -- accidents and bad input --


def test_a_deletion_can_be_undone(watch: Watch, empty: Server) -> None:
    """From the list, and from the page of the experiment, which says what became of it. Every number comes back."""
    number = empty.run(SMALL)
    page = watch.open(empty)
    other = watch.open(empty, f"/experiments/{number}")
    watch.allow(rf"404 GET /api/experiments/{number}/(cells|convergence)\?")  # asked for just before it heard
    row = page.get_by_role("row").filter(has=page.get_by_role("link", name="small"))
    before = row.inner_text()
    row.get_by_role("button", name="Actions").click()
    page.get_by_role("menuitem", name="Delete").click()
    dialog = page.get_by_role("dialog", name="Delete this experiment?")
    expect(dialog).to_contain_text(re.compile(r"40.pictures in 14.cells"))
    dialog.get_by_role("button", name="Delete").click()
    expect(row).to_have_count(0)
    expect(other.get_by_role("heading", name="This experiment was deleted")).to_be_visible()
    page.get_by_role("status").get_by_role("button", name="Undo").click()
    expect(row).to_have_text(before, use_inner_text=True)

    empty.post(f"/api/experiments/{number}/restore").raise_for_status()
    httpx.delete(f"{empty.url}/api/experiments/{number}", trust_env=False).raise_for_status()
    watch.allow(rf"4\d\d GET /api/experiments/{number}$")
    late = watch.open(empty, f"/experiments/{number}")
    expect(late.get_by_role("heading", name="This experiment was deleted")).to_be_visible()
    late.get_by_role("button", name="Undo the deletion").click()
    expect(state(late)).to_have_text("done")
    expect(facts(late)).to_have_text(re.compile("^40.of.40.pictures$"))


@pytest.mark.parametrize(
    ("path", "heading"), [("/experiments/4711", "There is no such thing"), ("/nowhere/at/all", "There is no such page")]
)
def test_addresses_that_lead_nowhere_say_so(watch: Watch, finished: Server, path: str, heading: str) -> None:
    watch.allow("404 GET /api/experiments/4711$", "404 GET /nowhere/at/all$")
    page = watch.open(finished, path)
    expect(page.get_by_role("heading", level=1)).to_have_text(heading)
    expect(page.get_by_role("main")).to_contain_text(path.removeprefix("/experiments/"))
    page.get_by_role("link", name="All experiments", exact=True).click()
    expect(page.get_by_role("link", name="small")).to_be_visible()


def test_no_page_can_ask_another_host(watch: Watch, finished: Server) -> None:
    """The browser refuses on our behalf, and ``Watch`` hears of it."""
    page = watch.open(finished)
    assert page.evaluate("fetch('http://127.0.0.1:9/').then(() => 'sent', () => 'refused')") == "refused"
    until(page, lambda: any("Content Security Policy" in fault for fault in watch.faults()), "it is heard")
    watch.allow("^console: .*Content Security Policy", "^csp GET ")


SCRIPT = "<script>document.title = 'broken into'</script><img src=x onerror=\"document.title = 'broken into'\">"


def test_a_name_is_text_everywhere(watch: Watch, finished: Server) -> None:
    """The form and the route refuse a name that is too long with the same sentence; one that fits is shown as it is."""
    watch.allow(r"422 POST /api/experiments\?dry_run=true$")
    page = watch.open(finished, "/new")
    field = page.get_by_label("Name", exact=True)
    field.fill(SCRIPT.ljust(500, "x"))
    fault = page.locator("#fault-name")
    expect(fault).to_contain_text("200")
    expect(page.get_by_role("button", name=re.compile("^Queue"))).to_have_count(0)
    grid = {"name": SCRIPT.ljust(500, "x"), "scenes": ["cornell_box"]}
    refused = finished.post("/api/experiments", json={"grid": grid, "origin": "the form"})
    assert refused.status_code == 422
    assert fault.inner_text() in [one["detail"] for one in refused.json()["problems"]]

    name = SCRIPT.ljust(200, "x")
    field.fill(name)
    page.get_by_label("Replicates").fill("1")
    page.get_by_role("region", name="Reference").get_by_role("button", name="none").click()
    page.get_by_role("button", name=re.compile("^Queue")).click()
    expect(page.get_by_role("heading", level=1)).to_have_text(name)
    expect(page).to_have_title(f"{name} · Dartboard")
    page.get_by_role("button", name="Cancel").click()
    expect(state(page)).to_have_text(re.compile("cancelled|done"))
    with page.expect_popup() as report:
        page.get_by_role("link", name="Report").click()
    expect(report.value.get_by_role("heading", level=1)).to_have_text(name)
    expect(report.value).to_have_title(f"{name} · Dartboard report")
    page.get_by_role("link", name="Experiments", exact=True).click()
    expect(page.get_by_role("link", name=name)).to_be_visible()
    page.get_by_role("row").filter(has_text=name).get_by_role("button", name="Actions").click()
    page.get_by_role("menuitem", name="Delete").click()
    expect(page.get_by_role("dialog")).to_contain_text(name)
    page.get_by_role("dialog").get_by_role("button", name="Delete").click()
    expect(page.get_by_role("status").get_by_text(name)).to_be_visible()
    expect(page).to_have_title("Experiments · Dartboard")


ROOM = """<scene version="3.0.0">
  <integrator type="path"><integer name="max_depth" value="3"/></integrator>
  <sensor type="perspective"><film type="hdrfilm"/></sensor>
  <emitter type="constant"/>
  <shape type="ply"><string name="filename" value="wall.ply"/></shape>
</scene>"""


def test_a_scene_is_sent_and_its_failure_explained(watch: Watch, empty: Server, tmp_path: Path) -> None:
    """What no scene may hold is refused in the form; a mesh that cannot be read fails its cells, with log and retry."""
    watch.allow(r"422 POST /api/")
    page = watch.open(empty, "/new")
    packed(tmp_path / "escaping.zip", {"../room.xml": ROOM})
    packed(tmp_path / "room.zip", {"room.xml": ROOM, "wall.ply": "no mesh"})
    scenes = page.get_by_role("region", name="Scenes")
    scenes.get_by_role("checkbox", name="Cornell box cornell_box").uncheck()
    chooser = scenes.locator("input[type=file][accept*=zip]")
    chooser.set_input_files(tmp_path / "escaping.zip")
    expect(scenes.get_by_role("alert")).to_contain_text("../room.xml")
    chooser.set_input_files(tmp_path / "room.zip")
    expect(scenes.get_by_role("checkbox", name="room")).to_be_checked()
    expect(scenes.get_by_role("alert")).to_have_count(0)
    page.get_by_role("region", name="Reference").get_by_role("button", name="none").click()
    page.get_by_label("Width in pixels").fill("16")
    page.get_by_label("Height in pixels").fill("16")
    page.get_by_role("button", name="Queue 9 cells").click()
    expect(state(page)).to_have_text("failed")

    expect(tiles(page).first).to_contain_text("scene error")
    tiles(page).first.get_by_role("button", name="log").click()
    dialog = page.get_by_role("dialog", name="Log of a cell")
    expect(dialog).to_contain_text("wall.ply")
    expect(dialog.locator("details").first).to_contain_text("scene error")
    attempts = dialog.locator("details").count()
    dialog.get_by_role("button", name="Retry what is missing").click()
    expect(dialog).to_be_hidden()
    expect(state(page)).to_have_text("failed")
    tiles(page).first.get_by_role("button", name="log").click()
    expect(dialog.locator("details")).to_have_count(attempts + 1)


def packed(file: Path, content: dict[str, str]) -> None:
    with zipfile.ZipFile(file, "w") as archive:
        for name, text in content.items():
            archive.writestr(name, text)


# -- everybody --


def test_the_keyboard_is_enough(watch: Watch, finished: Server) -> None:
    """From the list into an experiment, its grid and its viewer, and back, without a mouse."""
    page = watch.open(finished)
    expect(page.get_by_role("link", name="small")).to_be_visible()
    press_until(page, "Tab", page.get_by_role("link", name="small"))
    page.keyboard.press("Enter")
    expect(state(page)).to_have_text("done")
    grid = page.get_by_role("grid")
    press_until(page, "Tab", grid)
    page.keyboard.press("ArrowDown")
    page.keyboard.press("ArrowDown")
    page.keyboard.press("ArrowRight")
    selected = tiles(page).and_(page.locator("[aria-selected=true]"))
    expect(selected).to_have_accessible_name(re.compile("direct · stratified"))
    page.keyboard.press("Enter")
    expect(shown(page)).to_have_accessible_name("direct")
    page.keyboard.press("1")
    expect(shown(page)).to_have_accessible_name("path")
    page.keyboard.press("ArrowUp")
    expect(shown(page)).to_have_text(words("path", "independent"), use_inner_text=True)
    page.keyboard.press("Escape")
    expect(viewer(page)).to_be_hidden()
    expect(grid).to_be_focused()
    expect(selected).to_have_accessible_name(re.compile("path · independent"))
    page.keyboard.press("?")
    expect(page.get_by_role("dialog", name="Keyboard shortcuts")).to_contain_text("picture n of the row")
    page.keyboard.press("Escape")
    expect(grid).to_be_focused()


def press_until(page: Page, key: str, target: Locator) -> None:
    """Press a key until something has the focus, which must be seen to have it."""
    for _ in range(60):
        page.keyboard.press(key)
        if target.evaluate("(one) => one === document.activeElement"):
            seen = page.screenshot()
            target.evaluate("(one) => one.blur()")
            assert page.screenshot() != seen, f"nothing shows that {target} has the focus"
            return target.focus()
    raise AssertionError(f"{target} is out of reach of {key}")


@pytest.mark.parametrize("width", [1280, 390])
@pytest.mark.parametrize("scheme", ["dark", "light"])
def test_every_page_can_be_read(watch: Watch, finished: Server, scheme: str, width: int) -> None:
    """Contrast of text at least 4.5 (WCAG AA), nothing to scroll sideways, in both themes and on a phone."""
    page = watch.open(finished, color_scheme=scheme, viewport={"width": width, "height": 800})
    watch.allow("404 GET /nowhere$")
    faint, wide = {}, []
    for path, there in {
        "/": "small", "/new": "Samples per pixel", "/experiments/1?cell=0&spp=4": "Convergence",
        "/experiments/1?cell=0&spp=4&viewer=open": "Normalise", "/nowhere": "There is no such page",
    }.items():  # fmt: skip
        page.goto(finished.url + path)
        page.get_by_text(there, exact=True).first.wait_for()
        if there == "Convergence":
            page.locator("#curves").scroll_into_view_if_needed()
            page.locator("#curves .points path").first.wait_for()
        for name in STATES:  # each in every place that shows one
            page.evaluate(TURN, name)
            faint.update({f"{path}: {text}": ratio for text, ratio in page.evaluate(CONTRAST) if ratio < 4.5})
        if page.evaluate("document.documentElement.scrollWidth > innerWidth"):
            wide.append(path)
    assert not faint and not wide


STATES = ("queued", "running", "failed", "cancelled", "paused", "done")
TURN = "(name) => document.querySelectorAll('.state').forEach((one) => (one.dataset.state = name))"


# Text with the contrast to what lies under it, by WCAG 2: colours over each other, from the element up to the page.
CONTRAST = """() => {
  const canvas = new OffscreenCanvas(1, 1).getContext("2d", { willReadFrequently: true });
  const rgba = (colour) => {
    canvas.clearRect(0, 0, 1, 1);
    canvas.fillStyle = colour;
    canvas.fillRect(0, 0, 1, 1);
    const [r, g, b, a] = canvas.getImageData(0, 0, 1, 1).data;
    return [r, g, b, a / 255];
  };
  const over = ([r, g, b, a], [R, G, B]) => [r, g, b].map((c, i) => c * a + [R, G, B][i] * (1 - a)).concat(1);
  const under = (one) => {
    const own = one ? rgba(getComputedStyle(one).backgroundColor) : [255, 255, 255, 1];
    return own[3] === 1 ? own : over(own, under(one.matches("dialog") ? null : one.parentElement));
  };
  const light = (rgb) => {
    const [r, g, b] = rgb.map((c) => (c / 255 <= 0.04045 ? c / 255 / 12.92 : ((c / 255 + 0.055) / 1.055) ** 2.4));
    return 0.2126 * r + 0.7152 * g + 0.0722 * b;
  };
  for (const one of document.getAnimations()) if (one.effect?.getComputedTiming().iterations !== Infinity) one.finish();
  const left = "svg, :disabled, [aria-disabled=true], [hidden], option, script, noscript";
  const found = [];
  for (const one of document.querySelectorAll("body *")) {
    const own = [...one.childNodes].filter((node) => node.nodeType === Node.TEXT_NODE);
    const text = own.map((node) => node.data.trim()).join(" ").trim();
    const visible = one.checkVisibility({ opacityProperty: true, visibilityProperty: true });
    if (!text || !visible || one.closest(left)) continue;
    const { color, opacity } = getComputedStyle(one);
    const [r, g, b, a] = rgba(color);
    const back = under(one);
    const [dark, bright] = [light(over([r, g, b, a * opacity], back)), light(back)].sort((x, y) => x - y);
    found.push([`${text.slice(0, 40)} (${one.dataset.state ?? one.className})`, (bright + 0.05) / (dark + 0.05)]);
  }
  return found;
}"""
