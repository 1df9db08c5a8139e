"""``dartboard results`` and ``status``: reading a data directory, also beside the process that works on it."""

from __future__ import annotations

import io
import json
import sys
from dataclasses import asdict
from pathlib import Path
from typing import Any, TextIO

from jobs import experiments, owner, results
from jobs.artifacts import Artifacts
from jobs.experiments import Experiment, Standing
from jobs.store import Store
from renderer.errors import UnknownName
from service.output import whole
from service.tables import show_errors, show_experiments, show_failures

FORMATS = ("csv", "json", "table")
REPORTS = ("html",)


def write_results(name: str, data: Path, form: str, output: Path | None) -> None:
    """Every replicate of an experiment as CSV, JSON, or as the table that ``run`` prints."""
    known_format(form, FORMATS)
    store = Store.read(data)
    experiment = experiments.find(store, name)
    if form == "table":
        show_errors(results.summary(store, experiment.id))
    elif output is None:
        _write(store, experiment, form, sys.stdout)
    else:
        with whole(output) as file, io.TextIOWrapper(file, encoding="utf-8", newline="") as text:
            _write(store, experiment, form, text)


def _write(store: Store, experiment: Experiment, form: str, file: TextIO) -> None:
    write = results.write_csv if form == "csv" else results.write_json
    write(results.rows(store, experiment.id), file)


def report_of(name: str, data: Path, form: str, output: Path) -> None:
    """``dartboard report``: an experiment as one file that opens anywhere."""
    known_format(form, REPORTS)
    store = Store.read(data)
    write_report(store, Artifacts(data), experiments.find(store, name), output)


def write_report(store: Store, artifacts: Artifacts, experiment: Experiment, output: Path) -> None:
    from service.report import render_report

    with whole(output) as file:
        file.write(render_report(store, artifacts, experiment.id).encode())


def known_format(form: str, known: tuple[str, ...]) -> None:
    if form not in known:
        raise UnknownName("format", form, "--format", known)


def failures(store: Store, experiment: Experiment, data: Path) -> list[dict[str, Any]]:
    """The failed cells of an experiment, each with what it sets in its scene and the place of its log."""
    rows = store.rows("failures", experiment_id=experiment.id)
    return [row | {"sweep": json.loads(row["sweep"] or "{}"), "log": row["log"] and data / row["log"]} for row in rows]


def show_status(name: str | None, data: Path, *, as_json: bool) -> None:
    """One line per experiment, or one experiment with its failures."""
    store = Store.read(data)
    chosen = experiments.everything(store) if name is None else [experiments.find(store, name)]
    standings = [(experiment, experiments.standing(store, experiment.id)) for experiment in chosen]
    who = owner.peek(data)
    if as_json:
        told = [_as_json(experiment, standing) for experiment, standing in standings]
        print(json.dumps({"data": str(data), "owner": who, "experiments": told}, indent=2, ensure_ascii=False))
        return
    show_experiments(
        (
            experiment.id, experiment.name, standing.state, standing.cells, standing.references, standing.had,
            standing.wanted, standing.failed,
        )
        for experiment, standing in standings
    )  # fmt: skip
    print(_who(who, data))
    for experiment, standing in standings:
        if standing.failed:
            show_failures(failures(store, experiment, data))


def _who(who: dict[str, Any] | None, data: Path) -> str:
    if who is None:
        return f"nobody is working on {data}"
    at = f", a server at {who['url']}" if who.get("url") else ""
    return f"{data} is in use by process {who.get('pid')}{at}"


def _as_json(experiment: Experiment, standing: Standing) -> dict[str, Any]:
    told = {key: value for key, value in asdict(experiment).items() if key not in ("grid", "deleted_at")}
    return told | {"state": standing.state} | asdict(standing)
