"""
``dartboard run``: a grid to its end, without a server.

This process becomes the owner of the data directory, so it records everything; one child renders. Ctrl-C and
SIGTERM end both within seconds and keep what is finished; the next run goes on from there.
"""

from __future__ import annotations

import json
import platform
import signal
from pathlib import Path
from types import FrameType

from jobs import experiments, grid, measure, owner, plan, queue, results
from jobs.artifacts import Artifacts
from jobs.dispatcher import Dispatcher
from jobs.executors.local import LocalExecutor
from jobs.experiments import Experiment, Standing
from jobs.store import Store
from renderer import devices
from renderer.errors import UnknownName
from service.progress import Follower, console
from service.settings import usable_kernel_caches
from service.tables import show_errors, show_failures

EXECUTORS = ("local",)  # "ray" comes with the extra of that name


def run_grid(file: Path, data: Path, *, device: str, executor: str, as_json: bool) -> int:
    """
    Run the grid in ``file`` and print its errors; the exit code: 0 done, 1 some cells failed or were cancelled,
    130 interrupted.

    Bad input is found before anything is written to ``data``.
    """
    if executor not in EXECUTORS:
        raise UnknownName("executor", executor, "--executor", EXECUTORS)
    planned = plan.expand(grid.read(file))
    chosen = devices.pick(device)
    artifacts = Artifacts(data)
    with owner.own(data):
        artifacts.prepare()
        store = Store.open(data)
        queue.recover(store)
        experiment, _ = experiments.submit(store, planned, artifacts.scenes)
        before = experiments.standing(store, experiment.id)
        interrupted = False
        if before.finished:
            measure.catch_up(store, artifacts)  # an owner that was killed after its last picture left it unmeasured
        else:
            interrupted = _render(store, artifacts, experiment, planned, before, chosen)
        standing = experiments.standing(store, experiment.id)
        _tell(store, experiment, before, standing, interrupted, data, as_json)
        store.close()
    return 130 if interrupted else 0 if standing.state == "done" else 1


def _render(
    store: Store, artifacts: Artifacts, experiment: Experiment, planned: plan.Plan, before: Standing,
    device: devices.Device,
) -> bool:  # fmt: skip
    """Work until nothing is left; True if a signal ended it."""
    console.print(f"{experiment.name} (experiment {experiment.id}) on {device.description}")
    local = LocalExecutor(
        device, kernels=usable_kernel_caches(artifacts.data), logs=artifacts.logs, cwd=artifacts.empty
    )
    follower = Follower(planned, store.value("samples_left", experiment_id=experiment.id) or 0, before)
    dispatcher = Dispatcher(
        store, artifacts, local, machine=platform.node(), device=device.name, experiment=experiment.id,
        on_news=follower.hear,
    )  # fmt: skip
    interrupted = False

    def stop(number: int, frame: FrameType | None) -> None:
        nonlocal interrupted
        interrupted = True
        dispatcher.stop()

    previous = {number: signal.signal(number, stop) for number in (signal.SIGINT, signal.SIGTERM)}
    try:
        with follower:
            dispatcher.run()
    finally:
        local.close()
        for number, handler in previous.items():
            signal.signal(number, handler)
    return interrupted


def _tell(
    store: Store, experiment: Experiment, before: Standing, standing: Standing, interrupted: bool, data: Path,
    as_json: bool,
) -> None:  # fmt: skip
    """What came of it: counts and, at the end, the table of errors."""
    if as_json:
        points = [point.__dict__ for point in results.summary(store, experiment.id)]
        told = {
            "experiment": experiment.id, "name": experiment.name, "state": standing.state,
            "cells": standing.cells, "references": standing.references, "pictures": standing.had,
            "wanted": standing.wanted, "interrupted": interrupted, "points": points,
        }  # fmt: skip
        print(json.dumps(told, indent=2, ensure_ascii=False))
        return
    if interrupted:
        console.print(f"stopped: {standing.had} of {standing.wanted} pictures are there; run it again to go on")
        return
    if standing.state == "cancelled":
        console.print(f"cancelled: {standing.had} of {standing.wanted} pictures are there; `dartboard retry` goes on")
    elif standing.had == before.had and standing.state == "done":
        console.print(f"nothing to do: all {standing.had} pictures of {experiment.name!r} are there")
    show_errors(results.summary(store, experiment.id))
    show_failures(list(store.rows("failures", experiment_id=experiment.id)), data)
    console.print(f"pictures in {data / 'images'}; every number: dartboard results {experiment.id} --format csv")
