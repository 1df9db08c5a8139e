"""
What a server costs that has nothing to do: memory and CPU of its process tree.

    python -m benchmarks.idle [--seconds 30]

One data directory with a finished experiment of 1000 cells. The server is looked at when it has just been started, and
again when it has rendered a small grid and ended its render process; each time without and with a page of the
experiment open; and last with caches that are full.
"""

from __future__ import annotations

import argparse
import json
import sys
import tempfile
import time
from pathlib import Path

from playwright.sync_api import Browser

from benchmarks import browser, gridfiller
from benchmarks.browser import Server
from jobs.dispatcher import REST_SECONDS

AIM_MB, AIM_PERCENT = 250.0, 1.0
CELLS = 1000
SETTLE_SECONDS = 5.0  # after a start, and after a page has loaded
WORK = {
    "name": "some work", "scenes": ["cornell_box"], "samplers": ["independent"], "spp": [4, 16], "replicates": 2,
    "resolution": [64, 64], "reference": {"spp": 64},
}  # fmt: skip


def main() -> int:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.idle", description=(__doc__ or "").split("\n\n")[0])
    parser.add_argument("--seconds", type=float, default=30.0, help="of each measurement (default 30)")
    seconds = parser.parse_args().seconds
    with tempfile.TemporaryDirectory() as name, browser.chromium() as chromium:
        data = Path(name)
        experiment = gridfiller.fill(data, CELLS)
        with browser.serving(data) as server:
            print(f"{'':34}{'processes':>10}{'RSS MB':>9}{'PSS MB':>9}{'CPU %':>8}")
            look("before any work", server, seconds)
            look_with_page("before any work, one page", server, seconds, chromium, experiment)
            work(server)
            look("render process kept ready", server, min(seconds, REST_SECONDS / 4))
            wait_for_rest(server)
            look("after work", server, seconds)
            look_with_page("after work, one page", server, seconds, chromium, experiment)
            see_all(server, experiment)
            look("after every picture was seen", server, seconds)
    print(f"aims: RSS < {AIM_MB:g} MB, CPU < {AIM_PERCENT:g} %, where the render process has ended")
    return 0


def look(title: str, server: Server, seconds: float) -> None:
    """One row: memory at the end, CPU over the whole time."""
    time.sleep(SETTLE_SECONDS)
    before, started = browser.cpu_seconds(server.tree()), time.monotonic()
    time.sleep(seconds)
    pids = server.tree()
    percent = 100 * (browser.cpu_seconds(pids) - before) / (time.monotonic() - started)
    rss, pss = browser.memory_mb(pids)
    print(f"{title:34}{len(pids):>10}{rss:>9.0f}{pss:>9.0f}{percent:>8.2f}", flush=True)


def look_with_page(title: str, server: Server, seconds: float, chromium: Browser, experiment: int) -> None:
    with browser.opened(chromium) as page:
        page.goto(f"{server.url}/experiments/{experiment}")
        page.wait_for_selector(browser.PICTURE)
        look(title, server, seconds)


def work(server: Server) -> None:
    """Have a small grid rendered to its end."""
    path = f"/api/experiments/{server.submit(WORK)}"
    while (state := json.loads(server.fetch(path))["state"]) in ("queued", "running"):
        time.sleep(0.5)
    assert state == "done", state


def see_all(server: Server, experiment: int) -> None:
    """Fill the caches of the server: every picture, and its error."""
    for cell in json.loads(server.fetch(f"/api/experiments/{experiment}/cells?limit=2000"))["cells"]:
        if cell["role"] == "cell" and cell["state"] == "done":
            server.fetch(f"/api/cells/{cell['cell']}/preview.png?k=0&size=128&v=done")
            server.fetch(f"/api/cells/{cell['cell']}/error/relmse.png?reference={cell['reference']}&k=0&size=128")


def wait_for_rest(server: Server) -> None:
    """Until the render process has ended."""
    end = time.monotonic() + 2 * REST_SECONDS
    while len(server.tree()) > 1:
        if time.monotonic() > end:
            print(f"the render process did not end in {2 * REST_SECONDS:.0f} s", file=sys.stderr)
            return
        time.sleep(1.0)


if __name__ == "__main__":
    sys.exit(main())
