"""
The report: one experiment as one HTML file that opens anywhere, beside a paper or in ten years.

It asks no other host for anything and needs no server: pictures, plots and styles are in it, and so are all numbers, as
JSON. ``reading`` reads, ``panels`` puts together what may be compared, ``verdicts`` and ``findings`` say what follows
from it, ``thumbnails`` shrink the pictures, and ``report.html`` is the page.
"""

from __future__ import annotations

import shlex
from functools import cache
from typing import Any

from jinja2 import Environment, FileSystemLoader, StrictUndefined

from jobs.artifacts import Artifacts
from jobs.store import Store
from renderer import __version__
from renderer.metrics import METRICS
from service.report import figures, inline, setup, verdicts
from service.report.findings import findings
from service.report.numbers import numbers
from service.report.panels import sections
from service.report.reading import read
from service.report.thumbnails import thumbnails
from service.report.verdicts import verdict

# What the page may do, wherever it is: run its own scripts and show its own pictures, and ask nobody for anything.
POLICY = "default-src 'none'; img-src data:; style-src 'unsafe-inline'; script-src 'unsafe-inline'"
# From a server: in an origin of its own, so that no script in it can speak for the reader to the server.
SERVED_POLICY = f"sandbox allow-scripts allow-downloads; frame-ancestors 'none'; {POLICY}"
STYLES = ("report", "figures", "paper")
PLOTS = ("plan.js", "convergence.js")  # the dashboard's own drawing, in the order in which they need each other


def render_report(store: Store, artifacts: Artifacts, experiment_id: int) -> str:
    """
    The HTML of an experiment as it is now, finished or not.

    Raises ``NotFound`` for an experiment that is not there, ``WasDeleted`` for one in the trash.
    """
    reading = read(store, artifacts, experiment_id)
    scenes = sections(reading)
    panels = [panel for section in scenes for panel in section.panels]
    found = findings(reading, scenes)
    judged = {panel.id: verdict(panel, reading.metric) for panel in panels}
    text: str = _template().render(
        reading=reading, sections=scenes, findings=found, verdicts=judged,
        overall=verdicts.overall([one for one in judged.values() if one]),
        setup=setup.of(reading), pictures=thumbnails(panels, artifacts), metric=METRICS[reading.metric],
        metrics=METRICS, data=inline.data(numbers(reading, panels, found)), version=__version__,
    )  # fmt: skip
    return text.encode(errors="replace").decode()  # half a surrogate pair in a name is no text that a file can hold


@cache
def _template() -> Any:
    """The page, with the words that write its numbers."""
    environment = Environment(
        loader=FileSystemLoader(inline.HERE), autoescape=True, trim_blocks=True, lstrip_blocks=True,
        undefined=StrictUndefined,
    )  # fmt: skip
    plain = (
        figures.number, figures.factor, figures.ratio, figures.decimals, figures.duration, figures.count,
        figures.counted, figures.day, figures.stamp, figures.listed, figures.quiet_exponent, figures.breakable,
    )  # fmt: skip
    environment.filters |= {function.__name__: function for function in plain}
    environment.filters["shell"] = shlex.quote
    environment.globals |= {
        "policy": POLICY, "sentences": verdicts.sentences, "icon": inline.icon(),
        "css": inline.style(*(inline.HERE / f"{name}.css" for name in STYLES)),
        "plotly": inline.library(inline.WEB / "vendor" / "plotly-basic.min.js"),
        "script": inline.script(*(inline.WEB / "plots" / name for name in PLOTS), inline.HERE / "report.js"),
    }  # fmt: skip
    return environment.get_template("report.html")
