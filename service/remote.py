"""
Commands against a server: ``submit``, ``run`` beside a server, ``status``, ``cancel`` and its like, ``results``,
``report``.

The words, tables and exit codes are those of the same commands on a data directory.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Sequence
from pathlib import Path

from jobs.results import Point
from service.client import Client
from service.control import Action
from service.following import follow, measured
from service.outcome import Outcome, say, tell
from service.output import refuse_unwritable, whole
from service.readout import FORMATS, REPORTS, known_format
from service.schemas import Cell, Experiment, Worker
from service.sending import pack, send
from service.tables import show_errors, show_experiments, show_failures

BACK = {"paused": "resume", "cancelled": "retry"}  # what leads back from a state


def submit_grid(file: Path, url: str, *, wait: bool, as_json: bool) -> int:
    """Hand a grid to a server, and with ``wait`` follow it to its end; the exit code."""
    parcel = pack(file)
    with Client(url) as client:
        client.health()  # a wrong address is said before anything is sent
        experiment, new = send(client, parcel)
        if wait:
            say(_submitted(client, experiment, new))
            return _to_the_end(client, experiment.id, None, as_json=as_json)
        if as_json:
            told = experiment.model_dump() | {"new": new, "url": page(client, experiment.id)}
            print(json.dumps(told, indent=2, ensure_ascii=False))
        else:
            print(_submitted(client, experiment, new))
    return 0


def run_there(file: Path, data: Path, url: str, *, device: str, report: Path | None, as_json: bool) -> int:
    """``dartboard run`` on a data directory that the server at ``url`` owns."""
    parcel = pack(file)
    with Client(url) as client:
        serving = client.health()
        say(f"the server at {client.url} owns {data}: it renders the grid, on {serving.worker.device}")
        if device != "auto":
            say(f"--device {device} does not count here: the server has its own; it was chosen when it started")
        experiment, new = send(client, parcel)
        say(_submitted(client, experiment, new))
        return _to_the_end(client, experiment.id, report, as_json=as_json)


def change_there(what: Action, name: str, url: str) -> str:
    """Cancel, retry, pause or resume an experiment; a sentence about what was done."""
    with Client(url) as client:
        before = client.find(name)
        after = client.act(before.id, what)
    kept = f"{after.had} of {after.wanted} pictures are kept"
    if after.state in BACK:
        return f"{after.name!r} is {after.state}; {kept}; `{_back(client, after)}` goes on"
    if what in ("cancel", "pause") or after.had == after.wanted:
        return f"{after.name!r} is {after.state}: there is nothing to {what}"
    return f"{after.wanted - after.had} pictures of {after.name!r} are queued"


def show_status_of(url: str, name: str | None, *, as_json: bool) -> None:
    """One line per experiment, or one experiment with its failures; and what the server does."""
    with Client(url) as client:
        chosen = list(reversed(client.experiments())) if name is None else [client.find(name)]
        worker = client.worker()
        if as_json:
            experiments = [Experiment.model_validate(one.model_dump(), extra="ignore").model_dump() for one in chosen]
            told = {"server": client.url, "worker": worker.model_dump(), "experiments": experiments}
            print(json.dumps(told, indent=2, ensure_ascii=False))
            return
        show_experiments(
            (one.id, one.name, one.state, one.cells, one.references, one.had, one.wanted, one.failed) for one in chosen
        )
        print(_doing(client, worker))
        for one in chosen:
            if one.failed:
                show_failures(failures(client, one.id, list(client.cells(one.id))))


def download_results(name: str, url: str, form: str, output: Path | None) -> None:
    """Every replicate of an experiment as CSV, JSON, or as the table that ``run`` prints."""
    known_format(form, FORMATS)
    with Client(url) as client:
        experiment = client.find(name).id
        path = f"/api/experiments/{experiment}/results.{form}"
        if form == "table":
            show_errors(points(list(client.cells(experiment))))
        elif output is None:
            client.download(path, sys.stdout.buffer)
        else:
            with whole(output) as file:
                client.download(path, file)


def download_report(name: str, url: str, form: str, output: Path) -> None:
    """An experiment as one file that opens anywhere, made by the server."""
    known_format(form, REPORTS)
    refuse_unwritable(output)
    with Client(url) as client:
        _report(client, client.find(name).id, output)


def _report(client: Client, experiment: int, output: Path) -> None:
    with whole(output) as file:
        client.download(f"/api/experiments/{experiment}/report", file)


def _to_the_end(client: Client, experiment: int, report: Path | None, *, as_json: bool) -> int:
    """Follow, then tell what came of it."""
    start = client.experiment(experiment)
    last, interrupted = follow(client, start)
    cells = [] if interrupted else measured(client, start)
    outcome = Outcome(
        last.id, last.name, last.state, last.cells, last.references, last.had, last.wanted, start.had, points(cells),
        failures(client, last.id, cells), _left(client, last) if interrupted else None,
    )  # fmt: skip
    at = f"--server {client.url}"
    number = f"every number: dartboard results {last.id} {at} --format csv"
    where = f"pictures and plots at {page(client, last.id)}; {number}"
    if report and not interrupted:
        _report(client, last.id, report)
    tell(outcome, where=where, go_on=_back(client, last), as_json=as_json)
    return outcome.exit_code


def points(cells: Sequence[Cell]) -> list[Point]:
    """The mean errors of cells, as ``jobs.results.summary`` has them."""
    return [
        Point(
            cell.scene, cell.integrator, cell.sampler, cell.spp, cell.spp_actual, metric, n, mean, error,
            tuple(cell.sweep.items()),
        )
        for cell in cells
        if cell.role == "cell"
        for metric, (mean, error, n) in cell.metrics.items()
    ]  # fmt: skip


def failures(client: Client, experiment: int, cells: Sequence[Cell]) -> list[dict[str, object]]:
    """The failed ones, each with the address of its log."""
    return [
        {
            "scene": cell.scene, "sweep": cell.sweep, "integrator": cell.integrator, "sampler": cell.sampler,
            "spp": cell.spp, "error": cell.error, "log": f"{client.url}/api/cells/{cell.cell}/attempts",
        }
        for cell in cells
        if cell.state == "failed"
    ]  # fmt: skip


def page(client: Client, experiment: int) -> str:
    """Where a browser shows it."""
    return f"{client.url}/experiments/{experiment}"


def _submitted(client: Client, experiment: Experiment, new: bool) -> str:
    cells, references = (sum(counts.values()) for counts in (experiment.cells, experiment.references))
    known = "" if new else " (that grid was there already)"
    return (
        f"{experiment.name} is experiment {experiment.id}{known}: {cells} cells, {references} for reference, "
        f"{experiment.had} of {experiment.wanted} pictures are there\n{page(client, experiment.id)}"
    )


def _left(client: Client, experiment: Experiment) -> str:
    return (
        f"the server at {client.url} goes on with {experiment.name!r}; "
        f"`dartboard cancel {experiment.id} --server {client.url}` stops it"
    )


def _back(client: Client, experiment: Experiment) -> str:
    """The command that goes on with an experiment that was stopped."""
    return f"dartboard {BACK.get(experiment.state, 'retry')} {experiment.id} --server {client.url}"


def _doing(client: Client, worker: Worker) -> str:
    what = {"rendering": f"renders {worker.description}", "stalled": f"is stalled: {worker.trouble}"}
    return f"the server at {client.url} {what.get(worker.state, f'is {worker.state}')}; {worker.queued} cells wait"
