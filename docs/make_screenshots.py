"""
Make the screenshots of README.md: ``python docs/make_screenshots.py [--data DIR]``, in an environment that
``./dartboard test`` has prepared and with ``chromium`` in PATH.

A server of its own renders the demo grid (some minutes) and ends; ``--data`` keeps its data directory, or takes one
where the demo is finished. Each picture is taken when everything in sight has been drawn.
"""

from __future__ import annotations

import argparse
import re
import shutil
import subprocess
import sys
import tempfile
import tomllib
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from playwright.sync_api import Page, ViewportSize, expect, sync_playwright

ROOT = Path(__file__).resolve().parent.parent
DEMO = tomllib.loads((ROOT / "service" / "demo.toml").read_text())["name"]
SIZE: ViewportSize = {"width": 1280, "height": 800}  # CSS pixels
ARGUMENTS = ["--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"]  # WebGL 2 without a GPU
RENDER_MS = 3_600_000  # the longest that the demo may take
STICKY = 144  # CSS pixels at the top that header and bar cover once a page is scrolled
EDGE = "zoom=8&x=0.68&y=0.76"  # of the block and its shadow, in the Cornell box
ALL_SEEN = """() => [...document.querySelectorAll(".tile-box")].every((box) => {
  const { top, bottom } = box.getBoundingClientRect();
  return bottom < 0 || top > innerHeight || box.querySelector("img")?.complete;
})"""


def main() -> None:
    parser = argparse.ArgumentParser(description="Make the screenshots of README.md.")
    parser.add_argument("--data", type=Path, help="a data directory to use or make; default: a temporary one")
    data = parser.parse_args().data
    chromium = shutil.which("chromium")
    if chromium is None:
        sys.exit("there is no chromium in PATH; `apt-get install chromium` gets one")
    with (
        tempfile.TemporaryDirectory() as folder,
        serving(data or Path(folder) / "data") as url,
        sync_playwright() as playwright,
    ):
        browser = playwright.chromium.launch(executable_path=chromium, args=ARGUMENTS)
        page = browser.new_page(viewport=SIZE, color_scheme="dark")
        take_all(page, url)
        browser.close()


@contextmanager
def serving(data: Path) -> Iterator[str]:
    """The address of a server with the demo."""
    command = [sys.executable, "-m", "service.cli", "up", "--port", "0", "--data", str(data)]
    process = subprocess.Popen(command, cwd=ROOT, stderr=subprocess.PIPE, text=True)
    try:
        assert process.stderr is not None
        said = ""
        for line in process.stderr:
            said += line
            if found := re.search(r"(http://\S+) shows", line):
                yield found[1]
                return
        sys.exit(f"the server did not start:\n{said}")
    finally:
        process.terminate()
        process.wait()


def take_all(page: Page, url: str) -> None:
    page.goto(url)
    page.get_by_text(re.compile(r"^1\d\d of \d+$|^(\d+) of \1$")).first.wait_for(timeout=RENDER_MS)  # half-way, or done
    take(page, "list")
    page.get_by_role("link", name=DEMO).click()
    expect(page.get_by_role("main").locator(".state").first).to_have_text("done", timeout=RENDER_MS)
    demo = page.url
    number = demo.rpartition("/")[2]

    page.goto(f"{demo}?spp=16")
    page.locator("#curves .points path").first.wait_for()
    scroll(page, "#pictures")
    page.wait_for_function(ALL_SEEN)
    take(page, "grid")

    page.goto(f"{demo}?cols=spp")  # pictures take the whole width, so the plot does
    page.locator("#curves").scroll_into_view_if_needed()
    page.locator("#curves .points path").first.wait_for()
    scroll(page, "#curves")
    take(page, "plot")

    cells = page.request.get(f"{url}/api/experiments/{number}/cells").json()["cells"]
    noisy = next(cell for cell in cells if cell["integrator"] == "path" and cell["spp"] == 16)
    page.goto(f"{demo}?rows=spp&cols=sampler&cell={noisy['position']}&viewer=open&layout=side&{EDGE}")
    page.get_by_role("dialog").get_by_role("region").nth(3).wait_for()
    expect(page.locator(".viewer-message")).to_have_count(0)
    page.mouse.move(465, 320)
    take(page, "viewer")

    page.goto(f"{url}/new?from={number}")
    page.get_by_role("checkbox", name="orthogonal").check()
    expect(page.get_by_role("button", name=re.compile(r"Queue \d+ cells"))).to_be_enabled()
    page.evaluate("scrollTo(0, 0)")
    take(page, "new")

    page.emulate_media(color_scheme="light")
    page.goto(f"{url}/api/experiments/{number}/report")
    page.locator("[data-plot]").first.scroll_into_view_if_needed()
    page.locator(".points path").first.wait_for()
    page.evaluate("document.querySelector('#results').scrollIntoView()")
    take(page, "report")


def scroll(page: Page, part: str) -> None:
    """Bring a part of the page right below what is always in sight."""
    page.evaluate(f"scrollBy(0, document.querySelector('{part}').getBoundingClientRect().top - {STICKY})")


def take(page: Page, name: str) -> None:
    page.evaluate("new Promise((drawn) => requestAnimationFrame(() => requestAnimationFrame(drawn)))")
    file = ROOT / "docs" / "images" / f"{name}.png"
    page.screenshot(path=file, animations="disabled")
    print(f"{file.relative_to(ROOT)}: {file.stat().st_size / 1000:.0f} kB")


if __name__ == "__main__":
    main()
