"""What routes need, from the application they belong to: the engine, the hub, and a connection to read with."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Annotated

from fastapi import Depends, Path, Request

from jobs import experiments
from jobs.experiments import Experiment
from jobs.store import Store
from service.engine import Engine
from service.hub import Hub

LARGEST_ID = 2**63 - 1  # what SQLite holds


def engine(request: Request) -> Engine:
    """The engine of this server."""
    found: Engine = request.app.state.engine
    return found


def hub(request: Request) -> Hub:
    """The hub of this server."""
    found: Hub = request.app.state.hub
    return found


EngineDep = Annotated[Engine, Depends(engine)]
HubDep = Annotated[Hub, Depends(hub)]


def store(engine: EngineDep) -> Iterator[Store]:
    """A read-only connection until the route has returned: a stream that lives for hours keeps none."""
    with engine.readers.lend() as lent:
        yield lent


StoreDep = Annotated[Store, Depends(store, scope="function")]
ExperimentId = Annotated[int, Path(ge=1, le=LARGEST_ID, description="of an experiment")]
CellId = Annotated[int, Path(ge=1, le=LARGEST_ID, description="of a cell")]


def experiment(store: StoreDep, experiment_id: ExperimentId) -> Experiment:
    """The experiment in the path. Raises ``NotFound``."""
    return experiments.get(store, experiment_id)


ExperimentDep = Annotated[Experiment, Depends(experiment)]
