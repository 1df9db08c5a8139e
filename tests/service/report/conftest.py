"""Experiments for reports: small ones whose pictures are real EXR files, measured, some odd."""

from __future__ import annotations

import json
import re
from html.parser import HTMLParser
from typing import Any

import numpy as np

from jobs import points, queue
from jobs.artifacts import Artifacts
from jobs.experiments import Experiment
from jobs.measure import Measurer
from jobs.store import Store
from service.report import render_report
from tests.e2e.conftest import chromium as chromium
from tests.jobs.conftest import artifacts as artifacts
from tests.jobs.conftest import claim, draw, submit
from tests.jobs.conftest import data as data
from tests.jobs.conftest import store as store

VOID = {"meta", "link", "img", "br", "wbr", "input", "hr"}  # elements that have no end


def work_off(store: Store, artifacts: Artifacts, *, cells: int | None = None, failing: tuple[int, ...] = ()) -> None:
    """
    Draw and measure what is queued, ``cells`` cells at most; those in ``failing`` fail.

    A picture is a ramp with noise that falls with its spp, so that errors fall as they do in truth.
    """
    measurer, count = Measurer(store, artifacts), 0
    while (cells is None or count < cells) and (work := claim(store)):
        if count in failing:
            queue.fail(store, work, "nan_output", "3 pixels are </script><b>NaN</b>")
        else:
            for role, k in work.missing:
                measurer.add(draw(store, artifacts, work, role, k, _noisy(work, role, k)))
            queue.finish(store, work)
            points.refresh(store, [work.cell_id])
        count += 1
    while measurer.step(60):
        pass


def _noisy(work: queue.Work, role: str, k: int) -> np.ndarray:
    spp = work.spec.spp * (64 if role == "reference" else 1)
    rng = np.random.default_rng([int(work.digest[:8], 16), k, role == "reference"])
    width, height = work.spec.estimand.size
    ramp = np.linspace(0.2, 1.0, height)[:, None, None]
    return (ramp * (1 + rng.normal(0, 0.5, (height, width, 3)) / np.sqrt(spp))).astype(np.float32)


def finished(store: Store, artifacts: Artifacts, **keys: Any) -> Experiment:
    """A small experiment with all its numbers."""
    defaults = {"samplers": ["independent", "stratified"], "spp": [1, 4, 16], "replicates": 3}
    experiment = submit(store, **{**defaults, **keys})
    work_off(store, artifacts)
    return experiment


class Page(HTMLParser):
    """
    A report as a browser's parser sees it. Reading fails on an end tag that matches no start tag.

    elements  (tag, attributes) of every start tag
    text      all that is neither script nor style
    """

    def __init__(self, html: str):
        super().__init__()
        self.elements: list[tuple[str, dict[str, str | None]]] = []
        self.texts: list[str] = []
        self.open: list[str] = []
        self.feed(html)
        self.close()
        assert self.open == [], f"never closed: {self.open}"

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.elements.append((tag, dict(attrs)))
        if tag not in VOID:
            self.open.append(tag)

    def handle_endtag(self, tag: str) -> None:
        assert self.open[-1:] == [tag], f"</{tag}> at {self.getpos()} ends <{self.open[-1:]}>"
        self.open.pop()

    def handle_data(self, data: str) -> None:
        if not {"script", "style"} & set(self.open):
            self.texts.append(data)

    @property
    def text(self) -> str:
        """With every run of blanks as one."""
        return re.sub(r"\s+", " ", "".join(self.texts))

    def attributes(self, *names: str) -> list[str]:
        """Every value of these attributes."""
        return [value or "" for _, found in self.elements for name, value in found.items() if name in names]


def numbers_of(html: str) -> dict[str, Any]:
    """The JSON of a report, found as the report says that it can be found."""
    match = re.search(r'id="data">(.*?)</script>', html, re.S)
    assert match is not None
    found: dict[str, Any] = json.loads(match[1])
    return found


def page_of(store: Store, artifacts: Artifacts, experiment: Experiment) -> tuple[Page, str]:
    html = render_report(store, artifacts, experiment.id)
    return Page(html), html
