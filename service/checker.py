"""``dartboard check``: what a grid would render, and what it would cost. Renders nothing, writes nothing."""

from __future__ import annotations

import gc
import json
import platform
from dataclasses import asdict
from pathlib import Path
from typing import Any

from jobs import experiments, grid, plan
from jobs.estimate import Estimate, estimate
from jobs.lister import SceneLister
from jobs.store import FILE, Store
from renderer import devices
from service.progress import duration
from service.tables import size


def check_grid(file: Path, data: Path, *, as_json: bool) -> None:
    """Print the dry run of the grid in ``file`` against what ``data`` has, if it is there."""
    gc.disable()  # this process ends with the answer; looking for garbage among 10⁵ cells takes a fifth of its time
    planned = plan.expand(grid.read(file, SceneLister(devices.pick)))
    rates: dict[tuple[str, str], float] = {}
    had: dict[tuple[str, plan.Role], int] = {}
    if (data / FILE).is_file():
        store = Store.read(data)
        rates, had = experiments.rates(store, platform.node()), experiments.replicates_had(store)
        store.close()
    cost = estimate(planned, rates, had)
    if as_json:
        print(json.dumps(_as_json(planned, cost), indent=2, ensure_ascii=False))
    else:
        _show(planned, cost, data)


def _as_json(planned: plan.Plan, cost: Estimate) -> dict[str, Any]:
    return {"name": planned.grid.name, "axes": planned.grid.axes, **asdict(cost)}


def _show(planned: plan.Plan, cost: Estimate, data: Path) -> None:
    asked = planned.grid
    print(
        f"{asked.name}: {len(asked.scenes)} scenes × {len(asked.integrators)} integrators × "
        f"{len(asked.samplers)} samplers × {len(asked.spp)} spp, {asked.replicates} replicates each"
    )
    for sweep in asked.sweeps:
        where = "" if len(sweep.scenes) == len(asked.scenes) else f" in {', '.join(sweep.scenes)}"
        print(f"  sweep        {sweep.parameter}: {len(sweep.values)} values{where}")
    print(f"  cells        {cost.cells}, and {cost.references} references")
    print(f"  pictures     {cost.replicates}, of which {cost.reused} are in {data}")
    for rounded in cost.rounded:
        print(f"  rounded spp  {rounded.sampler}: {rounded.asked} asked, {rounded.rendered} rendered")
    guess = " (a guess: nothing like it was timed on this machine yet)" if cost.rough and cost.samples else ""
    print(f"  time         about {duration(cost.seconds)}{guess}" if cost.samples else "  time         nothing to do")
    print(f"  disk         about {size(cost.disk_bytes)}")
