"""``dartboard results`` and ``status``: reading a data directory, also beside the process that works on it."""

from __future__ import annotations

import json
import sys
from dataclasses import asdict
from pathlib import Path
from typing import Any, TextIO

from rich import box
from rich.console import Console
from rich.table import Table

from jobs import experiments, owner, results
from jobs.experiments import Experiment, Standing
from jobs.store import Store
from renderer.errors import UnknownName
from service.tables import show_errors, show_failures

FORMATS = ("csv", "json", "table")


def write_results(name: str, data: Path, form: str, output: Path | None) -> None:
    """Every replicate of an experiment as CSV, JSON, or as the table that ``run`` prints."""
    if form not in FORMATS:
        raise UnknownName("format", form, "--format", FORMATS)
    store = Store.read(data)
    experiment = experiments.find(store, name)
    if form == "table":
        show_errors(results.summary(store, experiment.id))
        return
    if output is None:
        _write(store, experiment, form, sys.stdout)
        return
    part = output.with_name(output.name + ".part")
    with part.open("w", encoding="utf-8", newline="") as file:
        _write(store, experiment, form, file)
    part.replace(output)


def _write(store: Store, experiment: Experiment, form: str, file: TextIO) -> None:
    write = results.write_csv if form == "csv" else results.write_json
    write(results.rows(store, experiment.id), file)


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
    console = Console(highlight=False)
    table = Table(box=box.SIMPLE_HEAD)
    for column in ("id", "name", "state", "cells done", "references done", "pictures", "failed"):
        table.add_column(column, justify="left" if column in ("name", "state") else "right")
    for experiment, standing in standings:
        table.add_row(
            str(experiment.id), experiment.name, standing.state, _part(standing.cells), _part(standing.references),
            f"{standing.had}/{standing.wanted}", str(standing.failed or ""),
        )  # fmt: skip
    console.print(table)
    console.print(f"{data} is in use by process {who.get('pid')}" if who else f"nobody is working on {data}")
    for experiment, standing in standings:
        if standing.failed:
            show_failures(list(store.rows("failures", experiment_id=experiment.id)), data)


def _part(counts: dict[str, int]) -> str:
    return f"{counts.get('done', 0)}/{sum(counts.values())}"


def _as_json(experiment: Experiment, standing: Standing) -> dict[str, Any]:
    return asdict(experiment) | {"state": standing.state} | asdict(standing)
