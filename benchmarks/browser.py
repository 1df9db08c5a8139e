"""
What the benchmarks of the dashboard share: a real server process, Debian's Chromium, and what /proc tells of either.

Chromium comes from the system (``/usr/bin/chromium``, or the path in CHROMIUM); Playwright drives it and downloads
nothing. A page is measured with the clock of the page, a server with the kernel's.
"""

from __future__ import annotations

import json
import os
import signal
import socket
import subprocess
import sys
import time
import urllib.request
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import IO, Any

from playwright.sync_api import Browser, Page, sync_playwright

ROOT = Path(__file__).resolve().parent.parent
CHROMIUM = os.environ.get("CHROMIUM", "/usr/bin/chromium")
WINDOW = {"width": 1280, "height": 900}  # px
TICKS = os.sysconf("SC_CLK_TCK")  # of a second of CPU time in /proc/PID/stat
START_SECONDS, STOP_SECONDS = 60.0, 20.0  # longest waits for a server
PICTURE = ".image-grid .tile img"  # a thumbnail of the experiment's page


@contextmanager
def chromium() -> Iterator[Browser]:
    """A browser without a window, WebGL in software: what a machine without a screen has."""
    with sync_playwright() as playwright:
        options = ["--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"]
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=options)
        try:
            yield browser
        finally:
            browser.close()


@contextmanager
def opened(browser: Browser, script: str = "") -> Iterator[Page]:
    """A page with empty caches; ``script`` runs in it before anything else does."""
    context = browser.new_context(viewport=WINDOW)  # type: ignore[arg-type]
    try:
        if script:
            context.add_init_script(script)
        yield context.new_page()
    finally:
        context.close()


def free_port() -> int:
    with socket.socket() as found:
        found.bind(("127.0.0.1", 0))
        return int(found.getsockname()[1])


@dataclass(frozen=True)
class Server:
    """A ``dartboard serve`` that answers."""

    url: str
    port: int
    data: Path
    process: subprocess.Popen[bytes]

    def fetch(self, path: str) -> bytes:
        with urllib.request.urlopen(self.url + path, timeout=60) as answer:
            return bytes(answer.read())

    def submit(self, grid: dict[str, Any]) -> int:
        """The id of the experiment that a grid becomes."""
        body, headers = json.dumps({"grid": grid}).encode(), {"content-type": "application/json"}
        request = urllib.request.Request(self.url + "/api/experiments", body, headers)
        with urllib.request.urlopen(request, timeout=60) as answer:
            return int(json.load(answer)["id"])

    def tree(self) -> list[int]:
        """Its process and all below it, such as the render process."""
        return tree(self.process.pid)


@contextmanager
def serving(data: Path, log: Path | None = None, cores: set[int] | None = None) -> Iterator[Server]:
    """Start a server on a data directory in a process of its own; ended as a user does, by SIGTERM."""
    allowed = os.sched_getaffinity(0) if cores is None else cores
    port = free_port()
    out: IO[bytes] | int = log.open("wb") if log else subprocess.DEVNULL
    process = subprocess.Popen(
        [sys.executable, "-m", "service.cli", "serve", "--data", str(data), "--port", str(port)],
        cwd=ROOT, stdout=out, stderr=out, start_new_session=True,
        preexec_fn=lambda: os.sched_setaffinity(0, allowed),
    )  # fmt: skip
    url = f"http://127.0.0.1:{port}"
    try:
        wait_until_it_answers(url, process)
        yield Server(url, port, data, process)
    finally:
        stop(process)
        if not isinstance(out, int):
            out.close()


def wait_until_it_answers(url: str, process: subprocess.Popen[bytes], seconds: float = START_SECONDS) -> None:
    end = time.monotonic() + seconds
    while time.monotonic() < end and process.poll() is None:
        try:
            urllib.request.urlopen(url + "/api/health", timeout=5).close()
            return
        except OSError:
            time.sleep(0.02)
    raise SystemExit(f"the server did not answer at {url}; its exit code is {process.poll()}")


def stop(process: subprocess.Popen[bytes]) -> float:
    """End a server and what it started; seconds that it took."""
    started = time.monotonic()
    process.send_signal(signal.SIGTERM)
    try:
        process.wait(STOP_SECONDS)
    except subprocess.TimeoutExpired:
        os.killpg(process.pid, signal.SIGKILL)
        process.wait()
    return time.monotonic() - started


# -- what /proc tells ------------------------------------------------------------------------------------------------


def tree(pid: int) -> list[int]:
    """A process and all its descendants."""
    parents: dict[int, list[int]] = {}
    for folder in Path("/proc").glob("[0-9]*"):
        try:
            fields = (folder / "stat").read_text().rpartition(")")[2].split()
        except OSError:
            continue  # it has just ended
        parents.setdefault(int(fields[1]), []).append(int(folder.name))
    found = [pid]
    for known in found:
        found.extend(parents.get(known, []))
    return found


def cpu_seconds(pids: list[int]) -> float:
    """CPU time that these processes have used, in user and kernel mode."""
    ticks = 0
    for pid in pids:
        fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
        ticks += int(fields[11]) + int(fields[12])
    return ticks / TICKS


def memory_mb(pids: list[int]) -> tuple[float, float]:
    """(RSS, PSS) in MB (10⁶ bytes); PSS counts a page that n processes share as 1/n in each."""
    sizes = {"Rss": 0, "Pss": 0}
    for pid in pids:
        for line in Path(f"/proc/{pid}/smaps_rollup").read_text().splitlines():
            name, _, rest = line.partition(":")
            if name in sizes:
                sizes[name] += int(rest.split()[0]) * 1024
    return sizes["Rss"] / 1e6, sizes["Pss"] / 1e6
