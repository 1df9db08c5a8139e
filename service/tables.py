"""Tables for people, on a terminal. Numbers that other programs read come from JSON and CSV instead."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from rich import box
from rich.console import Console
from rich.table import Table
from rich.text import Text

from jobs.results import Point
from renderer.catalog import is_replay
from renderer.metrics import METRICS
from renderer.parameters import told
from service.names import cell_name

SHOWN = ("relmse", "mse_cross", "mse")  # the first that has values stands for the experiment


def show_errors(points: list[Point]) -> None:
    """
    One table per scene, swept values and integrator: the error of every sampler at every spp, mean ± standard error.

    Samplers stand side by side where there is room for them, else one below the other. The lowest at each spp is bold,
    replays left out, which are wrong on purpose; spp that a sampler rounded are shown beside its number.
    """
    metric = next((name for name in SHOWN if any(point.metric == name for point in points)), None)
    if metric is None:
        return
    console = Console(highlight=False)
    of_metric = [point for point in points if point.metric == metric]
    tables: dict[str, list[Point]] = {}
    for point in of_metric:
        tables.setdefault(" · ".join([point.scene, *told(point.sweep), point.integrator]), []).append(point)
    for title, here in tables.items():
        table = _errors(title, here)
        if console.measure(table, options=console.options.update(width=10_000)).maximum > console.width:
            table = _errors(title, here, below=True)
        console.print(table)
    replicates = sorted({point.n for point in of_metric})
    counts = f"{replicates[0]}" if len(replicates) == 1 else f"{replicates[0]} to {replicates[-1]}"
    console.print(f"{metric} = {METRICS[metric].formula}; mean ± standard error over {counts} replicates")


def _errors(title: str, points: list[Point], *, below: bool = False) -> Table:
    """The errors of some samplers, side by side, or one ``below`` the other with parameters and errors on new lines."""
    samplers = list(dict.fromkeys(point.sampler for point in points))
    levels = sorted({point.spp for point in points})
    found = {(point.sampler, point.spp): point for point in points}
    right = {
        spp: [point.mean for point in points if point.spp == spp and not is_replay(point.sampler)] for spp in levels
    }
    table = Table(title=title, title_justify="left", box=box.SIMPLE_HEAD)
    line = "\n  " if below else " "
    names = [
        Text((sampler.replace(":", ":\n  ") if below else sampler) + (f"{line}(replay)" if is_replay(sampler) else ""))
        for sampler in samplers
    ]
    table.add_column("sampler" if below else "spp", justify="left" if below else "right", overflow="fold")
    for heading in (f"{spp} spp" for spp in levels) if below else names:
        table.add_column(heading, justify="right")
    rows = [(name, [(sampler, spp) for spp in levels]) for name, sampler in zip(names, samplers, strict=True)]
    if not below:
        rows = [(Text(str(spp)), [(sampler, spp) for sampler in samplers]) for spp in levels]
    for heading, places in rows:
        cells = (_cell(found.get(place), min(right[place[1]], default=None), below) for place in places)
        table.add_row(heading, *cells, end_section=below)
    return table


def _cell(point: Point | None, best: float | None, folded: bool) -> Text:
    if point is None:
        return Text("–", style="dim")
    line = "\n" if folded else " "
    error = f"{line}± {point.error:.1e}" if point.error is not None else ""
    rounded = f"{line}({point.spp_actual} spp)" if point.spp_actual != point.spp else ""
    return Text(
        f"{point.mean:.3e}{error}{rounded}", style="bold" if point.mean == best and not is_replay(point.sampler) else ""
    )


def show_experiments(rows: Iterable[tuple[int, str, str, dict[str, int], dict[str, int], int, int, int]]) -> None:
    """``dartboard status``: id, name, state, cells and references by state, pictures had and wanted, cells failed."""
    table = Table(box=box.SIMPLE_HEAD)
    for column in ("id", "name", "state", "cells done", "references done", "pictures", "failed"):
        table.add_column(column, justify="left" if column in ("name", "state") else "right")
    for experiment, name, state, cells, references, had, wanted, failed in rows:
        done = (f"{counts.get('done', 0)}/{sum(counts.values())}" for counts in (cells, references))
        table.add_row(str(experiment), Text(name), state, *done, f"{had}/{wanted}", str(failed or ""))
    Console(highlight=False).print(table)


def show_failures(failures: list[dict[str, Any]]) -> None:
    """What failed, why, and where its log is."""
    if not failures:
        return
    console = Console(stderr=True, highlight=False)
    console.print(f"[red]{len(failures)} cells failed[/red]; `dartboard retry` queues them again")
    for row in failures:
        log = f" (log: {row['log']})" if row["log"] else ""
        name = cell_name(row["scene"], row["integrator"], row["sampler"], row["spp"], row["sweep"])
        console.print(Text(f"  {name}: {row['error']}{log}"), soft_wrap=True)


def show_metrics(told: dict[str, Any]) -> None:
    """``dartboard measure``."""
    console = Console(highlight=False)
    table = Table(box=box.SIMPLE_HEAD)
    for column in ("metric", "value", "formula"):
        table.add_column(column, justify="right" if column == "value" else "left")
    for name, metric in told["metrics"].items():
        value = "not finite" if metric["value"] is None else f"{metric['value']:.6g}"
        table.add_row(name, value, metric["formula"])
    console.print(table)
    for role, count in told["nonfinite_pixels"].items():
        if count:
            console.print(f"[red]{count} pixels of the {role} are NaN or infinite[/red]")


def show_catalog(values: dict[str, list[dict[str, Any]]]) -> None:
    """``dartboard catalog``."""
    console = Console(highlight=False)
    for axis, entries in values.items():
        table = Table(title=axis, title_justify="left", box=box.SIMPLE_HEAD, show_header=False)
        table.add_column(style="bold", no_wrap=True)
        table.add_column()
        for entry in entries:
            lines = [entry["line"]]
            if entry.get("aliases"):
                lines.append(f"also called {', '.join(entry['aliases'])}")
            if entry.get("rounding"):
                lines.append(f"spp: {entry['rounding']}")
            lines += [_parameter(item) for item in entry.get("parameters", [])]
            table.add_row(entry["name"], "\n".join(lines))
        console.print(table)


def _parameter(item: dict[str, Any]) -> str:
    default = str(item["default"]).lower()
    if item["default"] is None:
        default = item["unset"]
    unit = f" {item['unit']}" if item["unit"] and item["default"] is not None else ""
    meanings = zip(item["options"], item["meanings"], strict=True)
    options = "".join(f"\n    {option}: {meaning}" for option, meaning in meanings if option)
    return f"  {item['name']} = {default or 'none'}{unit}: {item['line']}{options}"


def size(count: float) -> str:
    """``3.4 MB``, in powers of a thousand as disks are sold."""
    for unit in ("B", "kB", "MB", "GB"):
        if count < 1000:
            return f"{count:.3g} {unit}"
        count /= 1000
    return f"{count:.3g} TB"
