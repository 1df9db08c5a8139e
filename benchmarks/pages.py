"""
The dashboard with 10 000 cells: how soon the service answers, and how smooth the page is.

    python -m benchmarks.pages [--cells 10000] [--only service|browser] [--data DIR]

service  What the page asks for, one request after the other, none asked twice: seconds until the last byte.
browser  A first visit: from the start of the navigation to thumbnails and toolbar on screen, and bytes over the wire
         until nothing more comes. Thumbnails are counted apart: noise cannot be compressed. Then the longest tasks of
         the page's main thread while the grid and the table are scrolled with the wheel from end to end, and while
         axes, metric and order are switched. "CPU" counts only what the thread itself used: what is longer than that
         was another process's turn.
The experiment is made up (benchmarks/gridfiller.py); with --data it is kept there for the next time.
"""

from __future__ import annotations

import argparse
import asyncio
import json
import random
import statistics
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from playwright.sync_api import Browser, Page

from benchmarks import browser, gridfiller
from benchmarks.browser import Server
from benchmarks.followers import Connection
from renderer.metrics import METRICS

ANSWER_AIM_MS, PAINT_AIM_SECONDS, BYTES_AIM_MB, TASK_AIM_MS = 100.0, 2.0, 2.0, 200.0
REQUESTS = 60  # of each kind
VISITS = 5
LOAD_SECONDS = 120.0  # longest wait for a page
QUIET_SECONDS = 2.0  # without a byte: the page has loaded
WHEEL_PIXELS, WHEEL_SECONDS = 600, 0.03  # a fast hand
EXPERIMENT = "/experiments/{id}"
TALL = "?rows=spp&cols=integrator"  # the longest grid: 100 rows

# Says when the page is usable: a thumbnail, the toolbar and the axes are there, in the frame after that.
USABLE = """
new PerformanceObserver((list) => {
  for (const task of list.getEntries()) (window.tasks ??= []).push(task.duration);
}).observe({type: "longtask", buffered: true});
new MutationObserver((_, observer) => {
  if (!document.querySelector(".image-grid .tile img") || !document.querySelector(".part-head select")) return;
  observer.disconnect();
  requestAnimationFrame(() => requestAnimationFrame(() => window.usable = performance.now()));
}).observe(document, {subtree: true, childList: true});
"""


def main() -> int:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.pages", description=(__doc__ or "").split("\n\n")[0])
    parser.add_argument("--cells", type=int, default=10_000)
    parser.add_argument("--only", choices=["service", "browser"])
    parser.add_argument("--data", type=Path, help="where the experiment is, or is to be made")
    asked = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        data = asked.data or Path(name)
        experiment = 1 if (data / "originals").exists() else gridfiller.fill(data, asked.cells)
        with browser.serving(data) as server:
            detail = json.loads(server.fetch(f"/api/experiments/{experiment}"))
            print(f"{sum(detail['cells'].values())} cells, {detail['had']} pictures")
            if asked.only != "browser":
                asyncio.run(answers(server, experiment, detail))
            if asked.only != "service":
                with browser.chromium() as chromium:
                    visits(server, experiment, chromium)
                    smoothness(server, experiment, chromium)
    return 0


# -- the service ------------------------------------------------------------------------------------------------------


async def answers(server: Server, experiment: int, detail: dict[str, Any]) -> None:
    """Milliseconds of every kind of request."""
    connection, tally = Connection(server.url), Counter[str]()
    first = await connection.json(f"/api/experiments/{experiment}/cells?start=0&limit=2000", tally)
    print(f"{'GET':36}{'n':>5}{'p50 ms':>9}{'p95 ms':>9}{'max ms':>9}{'kB':>9}{'aim p95':>10}")
    for title, paths in requests(experiment, detail, first).items():
        spent, sizes = [], []
        for path in paths:
            start = time.perf_counter()
            sizes.append(len(await connection.fetch(path, tally)))
            spent.append(1000 * (time.perf_counter() - start))
        assert not tally["refused"], title
        spent.sort()
        p95 = spent[max(0, round(0.95 * len(spent)) - 1)]
        row = f"{title:36}{len(spent):>5}{statistics.median(spent):>9.1f}{p95:>9.1f}{spent[-1]:>9.1f}"
        print(f"{row}{max(sizes) / 1000:>9.1f}{f'< {ANSWER_AIM_MS:.0f}':>10}", flush=True)


def requests(experiment: int, detail: dict[str, Any], first: dict[str, Any]) -> dict[str, list[str]]:
    """Paths by kind. ``n`` is a parameter that no route knows: it keeps two answers from being one."""
    rng = random.Random(1)
    base = f"/api/experiments/{experiment}"
    count, revision = sum(detail["cells"].values()), first["revision"]
    done = [cell for cell in first["cells"] if cell["role"] == "cell" and cell["state"] == "done"]
    chosen = [rng.choice(done) for _ in range(REQUESTS)]
    curves = [(metric, scene["name"]) for metric in METRICS for scene in detail["scenes"]]
    sizes = [rng.choice((64, 128, 256)) for _ in chosen]
    pictures = list(zip(chosen, sizes, strict=True))
    return {
        "an experiment": [f"{base}?n={n}" for n in range(REQUESTS)],
        "all experiments": [f"/api/experiments?n={n}" for n in range(REQUESTS)],
        "200 cells": [f"{base}/cells?start={rng.randrange(count)}&limit=200" for _ in range(REQUESTS)],
        "2000 cells": [f"{base}/cells?start={rng.randrange(count - 2000)}&limit=2000" for _ in range(REQUESTS)],
        "cells that changed": [f"{base}/cells?after={revision - rng.randrange(1, 500)}" for _ in range(REQUESTS)],
        "curves of a metric and a scene": [
            f"{base}/convergence?metric={metric}&scene={scene}&n={n}" for n in range(8) for metric, scene in curves
        ],
        "a preview": [
            f"/api/cells/{cell['cell']}/preview.png?role=cell&k=0&size={size}&ev={rng.randrange(-9, 9)}&v=done"
            for cell, size in pictures
        ],
        "an error map": [
            f"/api/cells/{cell['cell']}/error/relmse.png?reference={cell['reference']}&k=0&size={size}&max=0.5"
            for cell, size in pictures
        ],
        "pixels for the viewer": [f"/api/cells/{cell['cell']}/pixels?role=cell&k=1" for cell in chosen],
        "attempts of a cell": [f"/api/cells/{cell['cell']}/attempts" for cell in chosen],
    }  # fmt: skip


# -- a visit ----------------------------------------------------------------------------------------------------------


def visits(server: Server, experiment: int, chromium: Browser) -> None:
    """First visits with empty caches; the server has seen none before the first one."""
    paints, loads = [], []
    for _ in range(VISITS):
        with browser.opened(chromium, USABLE) as page, listening(page) as loaded:
            page.goto(server.url + EXPERIMENT.format(id=experiment))
            paints.append(usable(page))
            wait_for_quiet(page, loaded)
            loads.append(loaded)
    median, worst = statistics.median(paints), max(paints)
    print(f"{'a first visit':36}{'median':>10}{'max':>10}{'aim':>10}")
    print(f"{'thumbnails and toolbar on screen, s':36}{median:>10.2f}{worst:>10.2f}{f'< {PAINT_AIM_SECONDS:g}':>10}")
    data = [(sum(load.values()) - load["image"]) / 1e6 for load in loads]
    print(f"{'over the wire, MB':36}{statistics.median(data):>10.2f}{max(data):>10.2f}{f'≤ {BYTES_AIM_MB:g}':>10}")
    for kind in sorted({kind for load in loads for kind in load}, key=lambda kind: -loads[0][kind]):
        sizes = [load[kind] / 1e6 for load in loads]
        title = "  and thumbnails" if kind == "image" else f"  of these {kind}"
        print(f"{title:36}{statistics.median(sizes):>10.2f}{max(sizes):>10.2f}")


def usable(page: Page) -> float:
    """Waits until the page is usable; seconds since its navigation began."""
    end = time.monotonic() + LOAD_SECONDS
    while (found := page.evaluate("window.usable")) is None:
        if time.monotonic() > end:
            raise SystemExit(f"{page.url} showed no thumbnail in {LOAD_SECONDS:.0f} s")
        page.wait_for_timeout(50)
    return float(found) / 1000


@contextmanager
def listening(page: Page) -> Iterator[Counter[str]]:
    """Counts the bytes of a page's answers, headers included, as they came over the wire, by kind."""
    loaded, kinds = Counter[str](), dict[str, str]()
    session = page.context.new_cdp_session(page)
    session.on("Network.responseReceived", lambda event: kinds.update({event["requestId"]: event["type"]}))

    def finished(event: dict[str, Any]) -> None:
        loaded[kinds.get(event["requestId"], "Other").lower()] += int(event["encodedDataLength"])

    session.on("Network.loadingFinished", finished)
    session.send("Network.enable")
    yield loaded


def wait_for_quiet(page: Page, loaded: Counter[str]) -> None:
    before, since = 0, time.monotonic()
    while time.monotonic() - since < QUIET_SECONDS:
        page.wait_for_timeout(100)
        if (now := sum(loaded.values())) != before:
            before, since = now, time.monotonic()


# -- scrolling and switching ------------------------------------------------------------------------------------------


def smoothness(server: Server, experiment: int, chromium: Browser) -> None:
    print(f"{'longest task of the main thread':36}{'ms':>10}{'CPU ms':>10}{'aim':>10}")
    with browser.opened(chromium, USABLE) as page, listening(page) as loaded:
        with tasks(chromium, page, "loading"):
            page.goto(server.url + EXPERIMENT.format(id=experiment) + TALL)
            usable(page)
            wait_for_quiet(page, loaded)
        with tasks(chromium, page, "scrolling the grid"):
            scroll(page, ".image-grid")
        with tasks(chromium, page, "scrolling the table"):
            scroll(page, ".table-scroller")
        page.evaluate("scrollTo(0, 0)")
        for title, query in switches():
            with tasks(chromium, page, title):
                page.evaluate(SWITCH, query)
                wait_for_quiet(page, loaded)


SWITCH = """(query) => {
  history.pushState(null, "", query);
  dispatchEvent(new PopStateEvent("popstate"));
}"""


def switches() -> list[tuple[str, str]]:
    return [
        *((f"switching to {metric}", f"{TALL}&metric={metric}") for metric in METRICS),
        ("spp × samplers", "?rows=spp&cols=sampler"),
        ("integrators × spp", "?rows=integrator&cols=spp"),
        ("samplers × integrators", "?"),
        ("error maps", "?show=errors"),
        ("small multiples", "?arrange=multiples"),
        ("another scene", "?scene=defocus"),
        ("sorting the table", "?sort=-relmse"),
        ("filtering the table", "?q=stratified"),
    ]


def scroll(page: Page, selector: str) -> None:
    """With the wheel, from one end to the other."""
    scroller = page.locator(selector)
    scroller.scroll_into_view_if_needed()
    scroller.hover(position={"x": 200, "y": 200})
    place: Callable[[], int] = lambda: int(scroller.evaluate("(box) => box.scrollTop"))  # noqa: E731
    before = -1
    while (now := place()) > before:
        before = now
        for _ in range(8):
            page.mouse.wheel(0, WHEEL_PIXELS)
            time.sleep(WHEEL_SECONDS)
    end = scroller.evaluate("(box) => box.scrollHeight - box.clientHeight")
    assert abs(before - end) < 2, f"{selector} was scrolled to {before} of {end}"


@contextmanager
def tasks(chromium: Browser, page: Page, title: str) -> Iterator[None]:
    """Prints the longest task meanwhile: by the clock, and by the thread's own CPU time."""
    chromium.start_tracing(page=page, categories=["toplevel", "__metadata"])
    yield
    page.wait_for_timeout(300)
    events = json.loads(chromium.stop_tracing())["traceEvents"]
    mains = {
        (event["pid"], event["tid"])
        for event in events
        if event["name"] == "thread_name" and event["args"]["name"] == "CrRendererMain"
    }
    found = [event for event in events if event["ph"] == "X" and (event["pid"], event["tid"]) in mains]
    longest = max((event["dur"] for event in found), default=0) / 1000
    cpu = max((event.get("tdur", 0) for event in found), default=0) / 1000
    print(f"{title:36}{longest:>10.0f}{cpu:>10.0f}{f'≤ {TASK_AIM_MS:.0f}':>10}", flush=True)


if __name__ == "__main__":
    sys.exit(main())
