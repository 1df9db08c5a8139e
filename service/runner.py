"""
``dartboard run``: a grid to its end, without a server.

This process becomes the owner of the data directory, so it records everything; one child renders. Ctrl-C and
SIGTERM end both within seconds and keep what is finished; the next run goes on from there.
"""

from __future__ import annotations

import platform
import signal
from functools import partial
from pathlib import Path
from types import FrameType

from rich.markup import escape

from jobs import experiments, grid, measure, owner, plan, queue, results
from jobs.artifacts import Artifacts
from jobs.dispatcher import Dispatcher
from jobs.executors.local import LocalExecutor
from jobs.experiments import Experiment, Standing
from jobs.lister import SceneLister
from jobs.store import Store
from renderer import devices
from renderer.errors import UnknownName
from service.outcome import Outcome, tell
from service.output import refuse_unwritable
from service.progress import Bars, Follower, console
from service.readout import failures, write_report
from service.settings import usable_kernel_caches

EXECUTORS = ("local",)  # "ray" comes with the extra of that name


def run_grid(file: Path, data: Path, *, device: str, executor: str, report: Path | None, as_json: bool) -> int:
    """
    Run the grid in ``file``, print its errors and write the ``report``; the exit code: 0 done, 1 some cells failed or
    were cancelled, 130 interrupted.

    Bad input is found before anything is written to ``data``. Where a server owns ``data`` it gets the grid.
    """
    if executor not in EXECUTORS:
        raise UnknownName("executor", executor, "--executor", EXECUTORS)
    if report:
        refuse_unwritable(report)
    asked = grid.read(file, SceneLister(partial(devices.pick, device)))
    if url := (owner.peek(data) or {}).get("url"):
        from service.remote import run_there

        return run_there(file, data, url, device=device, report=report, as_json=as_json)
    planned, chosen, artifacts = plan.expand(asked), devices.pick(device), Artifacts(data)
    with owner.own(data):
        artifacts.prepare()
        store = Store.open(data)
        queue.recover(store)
        experiment, _ = experiments.submit(store, planned, artifacts.scenes, points=artifacts.points)
        before = experiments.standing(store, experiment.id)
        interrupted = False
        if before.finished:
            measure.catch_up(store, artifacts)  # an owner that was killed after its last picture left it unmeasured
        else:
            interrupted = _render(store, artifacts, experiment, planned, before, chosen)
        outcome = _outcome(store, experiment, before, interrupted, data)
        if report and not interrupted:
            write_report(store, artifacts, experiment, report)
        store.close()
    number = f"every number: dartboard results {experiment.id} --format csv"
    tell(outcome, where=f"pictures in {data / 'images'}; {number}", go_on="dartboard retry", as_json=as_json)
    return outcome.exit_code


def _render(
    store: Store, artifacts: Artifacts, experiment: Experiment, planned: plan.Plan, before: Standing,
    device: devices.Device,
) -> bool:  # fmt: skip
    """Work until nothing is left; True if a signal ended it."""
    console.print(escape(f"{experiment.name} (experiment {experiment.id}) on {device.description}"))
    local = LocalExecutor(
        device, kernels=usable_kernel_caches(artifacts.data), logs=artifacts.logs, cwd=artifacts.empty
    )
    bars = Bars(before.wanted, before.had)
    follower = Follower(planned, store.value("samples_left", experiment_id=experiment.id) or 0, bars)
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
        with bars:
            dispatcher.run()
    finally:
        local.close()
        for number, handler in previous.items():
            signal.signal(number, handler)
    return interrupted


def _outcome(store: Store, experiment: Experiment, before: Standing, interrupted: bool, data: Path) -> Outcome:
    standing = experiments.standing(store, experiment.id)
    return Outcome(
        experiment.id, experiment.name, standing.state, standing.cells, standing.references, standing.had,
        standing.wanted, before.had, results.summary(store, experiment.id), failures(store, experiment, data),
        "stopped; run it again to go on" if interrupted else None,
    )  # fmt: skip
