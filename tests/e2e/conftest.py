"""A browser and servers for the tests that need them, and what they leave behind when they fail."""

from __future__ import annotations

import os
import shutil
import signal
from collections.abc import Generator, Iterator
from pathlib import Path
from typing import Any

import pytest
from playwright.sync_api import Browser, sync_playwright

from tests.e2e.browser import ARGUMENTS, SMALL, Server, Watch


@pytest.fixture(scope="module")
def chromium() -> Iterator[Browser]:
    """
    Debian's Chromium, or the one in PATH. A developer may lack it, CI may not.

    Playwright keeps an event loop running in the thread that uses it; tests that run a loop of their own come after it.
    """
    path = shutil.which("chromium") or shutil.which("chromium-browser")
    if path is None:
        missing = "there is no chromium in PATH; `apt-get install chromium` runs these tests"
        pytest.fail(missing) if os.environ.get("CI") else pytest.skip(missing)
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=path, args=ARGUMENTS)
        yield browser
        browser.close()


@pytest.fixture
def watch(chromium: Browser, tmp_path: Path) -> Iterator[Watch]:
    """Opens pages; the test fails if one of them asked another host for something, or complained."""
    watch = Watch(chromium, tmp_path)
    yield watch
    faults = watch.faults()
    left = watch.evidence() if faults else ""
    watch.close()
    assert not faults, f"{faults}\n{left}"


@pytest.fixture
def empty(tmp_path: Path) -> Iterator[Server]:
    """A server on which nothing is, yet."""
    server = Server(tmp_path)
    yield server
    server.stop(signal.SIGKILL)


@pytest.fixture
def demo(tmp_path: Path) -> Iterator[Server]:
    """``dartboard up`` on an empty data directory."""
    server = Server(tmp_path, "up")
    yield server
    server.stop(signal.SIGKILL)


@pytest.fixture(scope="session")
def finished(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Server]:
    """A server on which experiment 1 is the small grid, finished. Tests leave it as it is."""
    server = Server(tmp_path_factory.mktemp("finished"))
    server.run(SMALL)
    yield server
    server.stop(signal.SIGKILL)


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(item: pytest.Item, call: pytest.CallInfo[None]) -> Generator[None, Any, Any]:
    """After a failure, while the pages are still open: pictures and logs, and where they are."""
    report = yield
    watch = getattr(item, "funcargs", {}).get("watch")
    if report.when == "call" and report.failed and watch is not None:
        report.sections.append(("what the browser showed", watch.evidence()))
    return report
