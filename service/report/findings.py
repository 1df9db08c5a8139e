"""
Findings: what a reader has to know before believing a number, in plain words.

A finding is no guess: it is counted, or chance would produce it less than once in a hundred such experiments. The
dashboard finds the same by the same rules (web/views/experiment/findings.js).
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import Literal

from jobs.store import Row
from renderer import catalog
from service.report.figures import counted, listed, ratio
from service.report.panels import Line, Section
from service.report.reading import Reading
from service.report.student import tail

CHANCE = 0.01  # of one false alarm in the whole experiment
LEAST = 3  # standard errors from 1 that a brightness must be
MOST_NAMED = 4
BIAS = "mean_ratio"


@dataclass(frozen=True)
class Finding:
    """``kind``: bad (numbers are missing), warn (numbers mislead) or note (numbers need a word)."""

    kind: Literal["bad", "warn", "note"]
    text: str


def findings(reading: Reading, sections: list[Section]) -> list[Finding]:
    """The gravest first."""
    lines = [line for section in sections for panel in section.panels for line in panel.lines]
    return [
        *_failures(reading.cells), *_missing(reading), *_biases(sections, lines), *_timings(lines),
        *_references(reading, sections), *_replays(lines), *_roundings(lines), *_replicates(reading),
        *_negative(lines),
    ]  # fmt: skip


def _failures(cells: list[Row]) -> Iterator[Finding]:
    failed = [cell for cell in cells if cell["state"] == "failed"]
    if failed:
        causes = Counter((cell["error_class"] or "unknown").replace("_", " ") for cell in failed)
        told = ", ".join(f"{count} {cause}" for cause, count in causes.items())
        yield Finding("bad", f"{counted(len(failed), 'cell')} failed ({told}); their numbers are missing here.")


def _missing(reading: Reading) -> Iterator[Finding]:
    states = Counter(cell["state"] for cell in reading.cells if cell["state"] not in ("done", "failed"))
    if states:
        told = listed(f"{count} {state}" for state, count in states.items())
        yield Finding("bad", f"Not every cell is finished: {told}. What is missing may change what is said here.")
    unmeasured = sum(
        cell["state"] == "done" and cell["reference"] is not None and not cell["metrics"]
        for cell in reading.cells
        if cell["role"] == "cell"
    )
    if unmeasured:
        reason = "their reference is not finished, or the pictures could not be compared with it"
        yield Finding(
            "bad", f"{counted(unmeasured, 'finished cell has', 'finished cells have')} no error yet: {reason}."
        )


def _biases(sections: list[Section], lines: list[Line]) -> Iterator[Finding]:
    """The curves whose brightness chance does not explain, each by its clearest point. Replays are wrong anyway."""
    lines = [line for line in lines if not line.replay]
    tests = sum(_off(point) > 0 for line in lines for point in line.points[BIAS].values())
    found: list[tuple[float, str]] = []
    for section in sections:
        for line in (line for panel in section.panels for line in panel.lines if not line.replay):
            point = max(line.points[BIAS].values(), key=_off, default=None)
            if point and _off(point) > LEAST and tail(_off(point), point["n"] - 1) * tests < CHANCE:
                found.append((_off(point), _bias(section.scene, line, point)))
    told = [text for _, text in sorted(found, reverse=True)]
    yield from (Finding("warn", text) for text in told[:MOST_NAMED])
    if len(told) > MOST_NAMED:
        more = counted(len(told) - MOST_NAMED, "more curve has", "more curves have")
        yield Finding("warn", f"{more} a {BIAS} that chance does not explain.")


def _bias(scene: str, line: Line, point: Row) -> str:
    mean, error = ratio(point["mean"], point["error"])
    return (
        f"{scene} · {line.integrator} · {line.sampler} · {point['spp']} spp: {BIAS} {mean} ± {error} is "
        f"{_off(point):.1f} standard errors from 1 (n = {point['n']}). The picture or its reference is biased."
    )


def _off(point: Row) -> float:
    """Standard errors from 1; 0 where they are not known."""
    return abs(point["mean"] - 1) / point["error"] if point["error"] else 0.0


def _timings(lines: list[Line]) -> Iterator[Finding]:
    unlike = list(dict.fromkeys(f"{line.sampler} · {line.integrator}" for line in lines if not line.alike))
    if unlike:
        yield Finding(
            "warn",
            f"Some pictures were timed under other conditions than the rest (machine, threads or neighbours), so the "
            f"seconds of these curves cannot be compared: {listed(unlike, MOST_NAMED)}.",
        )


def _references(reading: Reading, sections: list[Section]) -> Iterator[Finding]:
    without = [scene["name"] for scene in reading.grid["scenes"] if scene["reference"] is None]
    if without:
        yield Finding("note", f"{listed(without, MOST_NAMED)}: no reference was asked for, so there are no errors.")
    told: dict[str, None] = {}
    for section in sections:
        groups = [panel for panel in section.panels if panel.reference and panel.sweep == section.panels[0].sweep]
        if len(groups) > 1:
            told[listed(", ".join(panel.integrators) for panel in groups)] = None
    for integrators in told:
        yield Finding(
            "note",
            f"{integrators} count different paths. Each has a reference of its own; their errors are not compared.",
        )


def _replays(lines: list[Line]) -> Iterator[Finding]:
    """Each sampler that is wrong on purpose, with what is wrong."""
    for sampler in dict.fromkeys(line.sampler for line in lines if line.replay):
        yield Finding(
            "note",
            f"{sampler} is a replay: it shows a published mistake ({catalog.mistake(sampler)}), at the spp that was "
            "asked, and is in no comparison.",
        )


def _roundings(lines: list[Line]) -> Iterator[Finding]:
    ways: dict[str, dict[str, None]] = {}
    for line in lines:
        if line.replay:
            continue
        changed = {cell["spp"]: cell["spp_actual"] for cell in line.cells.values() if cell["spp_actual"] != cell["spp"]}
        if changed:
            text = ", ".join(f"{asked} → {changed[asked]}" for asked in sorted(changed))
            ways.setdefault(text, {})[line.sampler] = None
    for text, samplers in ways.items():
        yield Finding(
            "note",
            f"{listed(samplers, MOST_NAMED)} cannot render every spp; asked → rendered: {text}. "
            f"Plots use what was rendered.",
        )


def _replicates(reading: Reading) -> Iterator[Finding]:
    if reading.grid["replicates"] == 1:
        yield Finding(
            "note", "One replicate of each cell: how sure its errors are cannot be said. Two or more would tell."
        )


def _negative(lines: Iterable[Line]) -> Iterator[Finding]:
    """mse_cross is an unbiased estimate and may fall below zero, where a logarithmic plot cannot show it."""
    count = sum(point["mean"] <= 0 for line in lines for point in line.points["mse_cross"].values())
    if count:
        yield Finding(
            "note",
            f"mse_cross of {counted(count, 'cell')} is not above zero: smaller than its own noise. "
            f"It stands in the tables, and no plot shows it.",
        )
