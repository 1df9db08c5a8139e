"""
What browser tests share: a real server that may be killed, and a browser that listens.

``Server`` is a process of its own on a free port with a data directory of its own. ``Watch`` opens pages and takes down
whatever must not happen in any of them: a request to another host, an error on the console (a violation of the
content security policy is one), an exception, an answer that is an error and that the test has not announced.
"""

from __future__ import annotations

import json
import os
import re
import signal
import subprocess
import sys
import threading
from collections.abc import Callable
from pathlib import Path
from typing import Any

import httpx
from playwright.sync_api import Browser, BrowserContext, ConsoleMessage, Error, Locator, Page, Request, Response, expect

ROOT = Path(__file__).resolve().parent.parent.parent
ARGUMENTS = ["--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"]  # WebGL 2 without a GPU
PATIENCE_MS = 60_000  # a loaded machine is no fault; what never comes fails all the same
OWN = re.compile(r"(data|blob|about):")
# The last preview of a picture is deleted when the picture is there; who asks for it just then learns that it is gone.
OVERTAKEN = r"404 GET /api/cells/\d+/preview\.png\?.*&v=p\d+$"

SMALL = """
name = "small"
scenes = ["cornell_box"]
samplers = ["independent", "stratified"]
integrators = ["path", "direct"]
spp = [4, 16, 64]
replicates = 3
resolution = [32, 24]
reference = { spp = 256 }
"""

expect.set_options(timeout=PATIENCE_MS)


def environment() -> dict[str, str]:
    kept = {name: value for name, value in os.environ.items() if not name.startswith("DARTBOARD_")}
    return {**kept, "PYTHONPATH": str(ROOT), "COLUMNS": "120"}


def dartboard(*words: object) -> str:
    """What a command prints; it must succeed."""
    done = subprocess.run(
        [sys.executable, "-m", "service.cli", *map(str, words)],
        cwd=ROOT, capture_output=True, text=True, timeout=300, env=environment(),
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    return done.stdout


class Server:
    """``dartboard serve``, or ``up``, which queues the demo. After ``stop``, ``start`` goes on at the same address."""

    def __init__(self, folder: Path, command: str = "serve"):
        self.command, self.data, self.log, self.port = command, folder / "data", folder / "server.log", 0
        self.start()

    def start(self) -> None:
        words = [self.command, "--port", self.port, "--data", self.data, "--device", "llvm"]
        self.process = subprocess.Popen(
            [sys.executable, "-m", "service.cli", *map(str, words)],
            cwd=ROOT, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True, env=environment(), process_group=0,
        )  # fmt: skip
        settled = threading.Event()
        self.listener = threading.Thread(target=self._listen, args=(settled,), daemon=True)
        self.listener.start()
        assert settled.wait(PATIENCE_MS / 1000) and self.port, f"it did not start:\n{self.log.read_text()}"

    def _listen(self, settled: threading.Event) -> None:
        """Copy the server's words into a file, so that no pipe fills; its address is among them."""
        assert self.process.stderr is not None
        with self.log.open("a") as log:
            for line in self.process.stderr:
                log.write(line)
                log.flush()
                if found := re.search(r"(http://127\.0\.0\.1:(\d+)) shows", line):
                    self.url, self.port = found[1], int(found[2])
                    settled.set()
        settled.set()

    def stop(self, number: signal.Signals = signal.SIGTERM) -> int:
        """End it; its exit code."""
        self.process.send_signal(number)
        code = self.process.wait(timeout=PATIENCE_MS / 1000)
        self.listener.join()
        return code

    def get(self, path: str) -> Any:
        return httpx.get(self.url + path, trust_env=False, timeout=60).raise_for_status().json()

    def post(self, path: str, **content: Any) -> httpx.Response:
        return httpx.post(self.url + path, trust_env=False, timeout=60, **content)

    def submit(self, grid: str) -> int:
        """Queue a grid; the number of its experiment."""
        answer = self.post("/api/experiments", content=grid.encode(), headers={"content-type": "application/toml"})
        assert answer.is_success, answer.text
        return int(answer.json()["id"])

    def run(self, grid: str) -> int:
        """Submit a grid and wait for its end, as its stream tells it; the number of its experiment."""
        number = self.submit(grid)
        path = f"{self.url}/api/experiments/{number}/events?after=0"
        with httpx.stream("GET", path, trust_env=False, timeout=60) as events:
            for line in events.iter_lines():
                told = json.loads(line[5:]) if line.startswith("data:") else {}
                if told.get("experiment", {}).get("state", "queued") not in ("queued", "running"):
                    return number
        raise AssertionError(f"the stream of experiment {number} ended before it did")


class Watch:
    """Opens pages and listens to them. What a test expects to go wrong it announces with ``allow``."""

    def __init__(self, browser: Browser, folder: Path):
        self.browser, self.folder = browser, folder
        self.contexts: list[BrowserContext] = []
        self.servers: list[Server] = []
        self.seen: list[str] = []
        self.allowed = [OVERTAKEN]

    def open(self, server: Server, path: str = "/", **options: Any) -> Page:
        """A page of a server, in a browser profile of its own. ``options`` are those of a Playwright context."""
        self.servers.append(server)
        page = self._context(server.url + "/", **options).new_page()
        page.goto(server.url + path)
        return page

    def open_file(self, file: Path) -> Page:
        """A file, as a double click opens it. It may read nothing but itself."""
        page = self._context(file.as_uri()).new_page()
        page.goto(file.as_uri())
        return page

    def allow(self, *patterns: str) -> None:
        """Announce faults, as regular expressions of ``404 GET /path``, ``net::ERR_… GET /path`` or ``console: …``."""
        self.allowed += patterns

    def faults(self) -> list[str]:
        """What went wrong unannounced. A request that the page itself gave up is none."""
        return [
            line for line in self.seen
            if "net::ERR_ABORTED" not in line and not any(re.search(pattern, line) for pattern in self.allowed)
        ]  # fmt: skip

    def evidence(self) -> str:
        """Leave what the pages show and have said in ``folder``; where that is."""
        left = []
        for number, page in enumerate(page for context in self.contexts for page in context.pages):
            picture = self.folder / f"page-{number}.png"
            try:
                page.screenshot(path=picture, timeout=5_000)
            except Error as error:  # a page that hangs: the logs are all the more wanted
                self.seen.append(f"no picture of page {number}: {error.message}")
            left.append(f"{picture} is {page.url}")
        log = self.folder / "browser.log"
        log.write_text("\n".join([*left, *self.seen]) + "\n")
        return "\n".join([*left, str(log), *(str(server.log) for server in self.servers)])

    def close(self) -> None:
        for context in self.contexts:
            context.close()

    def _context(self, home: str, **options: Any) -> BrowserContext:
        """A browser profile whose pages may ask for addresses that begin with ``home``."""
        context = self.browser.new_context(**{"viewport": {"width": 1280, "height": 800}, **options})
        context.set_default_timeout(PATIENCE_MS)
        self.contexts.append(context)

        def name(request: Request) -> str:
            return f"{request.method} /{request.url.removeprefix(home)}"

        def asked(request: Request) -> None:
            if not request.url.startswith(home) and not OWN.match(request.url):
                self.seen.append(f"a request left the host: {request.url}")

        def answered(answer: Response) -> None:
            if answer.status >= 400:
                self.seen.append(f"{answer.status} {name(answer.request)}")

        def said(word: ConsoleMessage) -> None:
            # What the browser itself says of answers that are errors, `answered` and `failed` say better.
            if word.type == "error" and not word.text.startswith("Failed to load resource"):
                self.seen.append(f"console: {word.text}")

        context.on("request", asked)
        context.on("response", answered)
        context.on("requestfailed", lambda request: self.seen.append(f"{request.failure} {name(request)}"))
        context.on("console", said)
        context.on("weberror", lambda error: self.seen.append(f"exception: {error.error}"))
        return context


# -- the page, by what it means --


def state(page: Page) -> Locator:
    """The state of the experiment that the page shows."""
    return page.get_by_role("main").locator(".state[data-state]").first


def facts(page: Page) -> Locator:
    """How many of its pictures are there."""
    return page.get_by_text(re.compile(r"^[\d\s]+of[\d\s]+pictures?$")).first


def bar(page: Page) -> Locator:
    """Its state bar, whose name is its numbers."""
    return page.get_by_role("img", name=re.compile(r"^\d+.cells?: "))


def tiles(page: Page) -> Locator:
    """The cells of the image grid that are drawn."""
    return page.locator("#pictures [role=gridcell][data-cell]")


def picture(page: Page, name: str) -> Locator:
    """A picture of the grid, by what it is: ``cornell_box · path · stratified · 4 spp``."""
    return tiles(page).get_by_role("img", name=name)


def viewer(page: Page) -> Locator:
    return page.get_by_role("dialog", name="Picture viewer")


def shown(page: Page) -> Locator:
    """The large picture of the viewer, named by what it is."""
    return viewer(page).get_by_role("region").first


def words(*all_of: str) -> re.Pattern[str]:
    """A text that holds each of these as whole words, in any order."""
    return re.compile("".join(rf"(?=.*(?<!\w){re.escape(one)}(?!\w))" for one in all_of), re.DOTALL)


def drawn(page: Page) -> bytes:
    """The pixels of the large picture as the screen has them, without what lies over its edge."""
    box = shown(page).locator("[data-view]").bounding_box()
    assert box is not None
    width, height = box["width"] / 2, box["height"] / 2
    return page.screenshot(
        clip={"x": box["x"] + width / 2, "y": box["y"] + height / 2, "width": width, "height": height}
    )


def until(page: Page, holds: Callable[[], bool], what: str) -> None:
    """Frame after frame, until something holds that no locator can wait for."""
    for _ in range(PATIENCE_MS // 20):
        if holds():
            return
        page.evaluate("() => new Promise((resolve) => setTimeout(() => requestAnimationFrame(resolve), 20))")
    raise AssertionError(f"it never came that {what}")
