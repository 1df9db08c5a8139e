"""
How live the dashboard is, and what watching it costs a render.

    python -m benchmarks.live [--only latency|pages] [--runs 5] [--pages 50]

latency  One browser shows an experiment of small cells that render. From the commit of a replicate to the event in a
         plain client, and, for the first picture of a cell, to the frame of the page that shows it. All clocks are
         this machine's; the browser shares its cores with the render, which real ones do not.
pages    The same grid in a new data directory each time, without and with fifty pages (benchmarks/followers.py),
         interleaved: seconds from the end of a warm-up grid to the last picture, and CPU seconds of the server itself.
         The pages have a core of their own, since real ones are on other machines: the server and its render process
         have the rest. A page that waited long for a picture would have cost less than it should: that is printed too.
"""

from __future__ import annotations

import argparse
import datetime
import json
import os
import statistics
import subprocess
import sys
import tempfile
import threading
import time
import urllib.request
from pathlib import Path
from typing import Any

from benchmarks import browser
from benchmarks.browser import Server
from jobs.store import Store
from service.eventstream import events_in

LATENCY_AIM_SECONDS, PAGES_AIM = 1.0, 1.05
LIMIT_SECONDS = 1200.0  # for one grid
POLL_SECONDS = 0.05
LOADING_MILLISECONDS = 2000  # of a page whose first tile is there: its plots come last
UNFINISHED = (
    "select 1 from experiment_cell join cell on cell.id = cell_id"
    " where experiment_id = ? and (had < replicates or state = 'running') limit 1"
)
LAST_END = "select max(ended_at) from attempt join experiment_cell using (cell_id) where experiment_id = ?"

SMALL = {  # all of its cells are visible at once
    "name": "latency", "scenes": ["cornell_box"], "samplers": ["independent", "stratified", "multijitter"],
    "spp": [64, 100, 144, 196, 256, 324], "replicates": 2, "resolution": [64, 64], "reference": {"spp": 512},
}  # fmt: skip
CURVES = {
    "scenes": ["cornell_box"], "samplers": ["independent", "stratified", "multijitter"],
    "integrators": ["path", "direct"], "resolution": [128, 128],
}  # fmt: skip
WARM_UP = {**CURVES, "name": "warm-up", "spp": [36], "replicates": 4, "reference": False}
GRID = {**CURVES, "name": "watched", "spp": [4, 16, 64, 144], "replicates": 2, "reference": {"spp": 1024}}

# Notes when a tile shows another picture: the frame after the one in which it was put there has it on screen.
WATCH = """
window.shown = [];
new MutationObserver((changes) => {
  for (const change of changes) for (const node of change.addedNodes) {
    if (node.nodeName !== "IMG") continue;
    const cell = Number(node.closest(".tile")?.dataset.cell);
    const note = () => window.shown.push([cell, node.src, Date.now() / 1000]);
    requestAnimationFrame(() => requestAnimationFrame(note));
  }
}).observe(document, {subtree: true, childList: true});
"""


def main() -> int:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.live", description=(__doc__ or "").split("\n\n")[0])
    parser.add_argument("--only", choices=["latency", "pages"])
    parser.add_argument("--runs", type=int, default=5, help="of the grid, each without and with pages (default 5)")
    parser.add_argument("--pages", type=int, default=50, help="open at once (default 50)")
    asked = parser.parse_args()
    if asked.only != "pages":
        latency()
    if asked.only != "latency":
        pages(asked.runs, asked.pages)
    return 0


# -- from a finished picture to an open page --------------------------------------------------------------------------


def latency() -> None:
    with tempfile.TemporaryDirectory() as name, browser.chromium() as chromium, browser.serving(Path(name)) as server:
        server.submit(WARM_UP)  # until the page is there
        experiment = server.submit(SMALL)
        heard: dict[tuple[int, str, int], float] = {}
        threading.Thread(target=listen, args=(server, experiment, heard), daemon=True).start()
        with browser.opened(chromium, WATCH) as page:
            page.goto(f"{server.url}/experiments/{experiment}?rows=sampler&cols=spp&size=96")
            page.wait_for_selector(".image-grid .tile")
            page.wait_for_timeout(LOADING_MILLISECONDS)
            opened = time.time()
            wait_until_done(server, experiment)
            page.wait_for_timeout(2000)
            shown = {cell: at for cell, source, at in reversed(page.evaluate("window.shown")) if "v=done" in source}
        events, pictures = [], []
        for cell, role, k, at in replicates(server, experiment):
            if at < opened:
                continue  # it was there when the page came
            if (cell, role, k) in heard:
                events.append(heard[cell, role, k] - at)
            if role == "cell" and k == 0 and cell in shown:
                pictures.append(shown[cell] - at)
    print(f"{'from the commit of a picture to':36}{'n':>5}{'median s':>10}{'max s':>8}{'aim':>8}")
    aim = f"< {LATENCY_AIM_SECONDS:g}"
    for title, found in (("its event in a plain client", events), ("its frame on an open page", pictures)):
        print(f"{title:36}{len(found):>5}{statistics.median(found):>10.2f}{max(found):>8.2f}{aim:>8}")


def listen(server: Server, experiment: int, heard: dict[tuple[int, str, int], float]) -> None:
    """Note when a plain client hears of each replicate: the first update that counts it."""
    known: dict[tuple[int, str], int] = {}
    with urllib.request.urlopen(f"{server.url}/api/experiments/{experiment}/events") as answer:
        for event in events_in(iter(answer.read1, b"")):
            at = time.time()
            for cell in json.loads(event.data)["cells"] if event.name == "update" else ():
                key = (cell["cell"], cell["role"])
                for k in range(known.get(key, 0), cell["had"]):
                    heard[*key, k] = at
                known[key] = cell["had"]


def replicates(server: Server, experiment: int) -> list[tuple[int, str, int, float]]:
    """Cell, role, k and the time of the commit."""
    store = Store.read(server.data)
    rows: Any = store.connection.execute(
        "select distinct replicate.cell_id, replicate.role, k, finished_at from replicate"
        " join experiment_cell using (cell_id, role) where experiment_id = ?", (experiment,),
    ).fetchall()  # fmt: skip
    store.close()
    return [(cell, role, k, seconds_of(at)) for cell, role, k, at in rows]


# -- fifty pages beside a render --------------------------------------------------------------------------------------


def pages(runs: int, count: int) -> None:
    without: list[tuple[float, float]] = []
    watched: list[tuple[float, float]] = []
    fetched: list[dict[str, int]] = []
    print(f"server and render process on {len(cores()[0])} of {os.cpu_count()} cores, pages on another")
    print(f"{'run':>5}{'pages':>7}{'render s':>10}{'server CPU s':>14}")
    for index in range(runs):
        order = (0, count) if index % 2 == 0 else (count, 0)
        for open_pages in order:
            seconds, cpu, tally = render_once(open_pages)
            (watched if open_pages else without).append((seconds, cpu))
            if tally:
                fetched.append(tally)
            print(f"{index + 1:>5}{open_pages:>7}{seconds:>10.2f}{cpu:>14.2f}", flush=True)
    medians = [[statistics.median(column) for column in zip(*side, strict=True)] for side in (without, watched)]
    for title, (seconds, cpu) in zip(("none", str(count)), medians, strict=True):
        print(f"{'median':>5}{title:>6}{seconds:>10.2f}{cpu:>14.2f}")
    (alone, idle), (beside, busy) = medians
    share = (busy - idle) / (alone * len(cores()[0]))
    print(f"ratio of seconds {beside / alone:.3f} (aim < {PAGES_AIM}); the server's CPU alone would be {1 + share:.3f}")
    print(f"the pages fetched {json.dumps(fetched[-1])}")


def render_once(count: int) -> tuple[float, float, dict[str, int] | None]:
    """Seconds of the grid with so many pages open, CPU seconds of the server meanwhile, and what the pages fetched."""
    with tempfile.TemporaryDirectory() as name, browser.serving(Path(name), cores=cores()[0]) as server:
        before, grid = server.submit(WARM_UP), server.submit(GRID)  # in this order: one render process draws both
        client = watch(server, grid, count) if count else None
        warm = wait_until_done(server, before)
        used = browser.cpu_seconds([server.process.pid])
        done = wait_until_done(server, grid)
        used = browser.cpu_seconds([server.process.pid]) - used
        tally = json.loads(client.communicate(timeout=60)[0]) if client else None
    return done - warm, used, tally


def cores() -> tuple[set[int], set[int]]:
    """For the server and its render process, and for the pages."""
    *most, last = sorted(os.sched_getaffinity(0))
    if not most:
        raise SystemExit("this needs two cores: one renders, one holds the pages")
    return set(most), {last}


def watch(server: Server, experiment: int, count: int) -> subprocess.Popen[str]:
    """Pages in a process of their own; returns when all are open."""
    client = subprocess.Popen(
        [sys.executable, "-m", "benchmarks.followers", server.url, str(experiment), str(count)],
        cwd=browser.ROOT, stdout=subprocess.PIPE, text=True, preexec_fn=lambda: os.sched_setaffinity(0, cores()[1]),
    )  # fmt: skip
    assert client.stdout is not None
    assert client.stdout.readline() == "open\n"
    return client


def wait_until_done(server: Server, experiment: int) -> float:
    """When its last attempt ended. Reads the database, which costs the server nothing."""
    store, end = Store.read(server.data), time.monotonic() + LIMIT_SECONDS
    try:
        while store.connection.execute(UNFINISHED, (experiment,)).fetchone():
            if time.monotonic() > end:
                raise SystemExit(f"experiment {experiment} is not done after {LIMIT_SECONDS:.0f} s")
            time.sleep(POLL_SECONDS)
        row: Any = store.connection.execute(LAST_END, (experiment,)).fetchone()
    finally:
        store.close()
    return seconds_of(row[0])


def seconds_of(stamp: str) -> float:
    """Seconds since 1970 of a time in the database."""
    return datetime.datetime.fromisoformat(stamp).timestamp()


if __name__ == "__main__":
    sys.exit(main())
