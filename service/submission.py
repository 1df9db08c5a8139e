"""From the body of a request to a plan: a grid as JSON or TOML, with the scenes and points that its client has sent."""

from __future__ import annotations

import json
import platform
from dataclasses import asdict
from functools import partial
from typing import Any

from pydantic import ValidationError

from jobs import experiments, grid, plan
from jobs.artifacts import Artifacts
from jobs.estimate import estimate
from jobs.gridsweeps import Lister, nobody
from jobs.gridtoml import toml_of
from jobs.plan import Plan
from jobs.store import Store
from renderer.errors import DartboardError
from service import problems, schemas, uploadedpoints, uploads

TOML = "application/toml"
JSON = "application/json"


def read(body: bytes, content_type: str) -> schemas.Submission:
    """
    The submission in a body: JSON by its schema, or the text of a grid file. Raises ``DartboardError``.
    """
    kind = content_type.partition(";")[0].strip().lower()
    if kind == TOML:
        try:
            return schemas.Submission(toml=body.decode("utf-8-sig"), origin="the grid", scenes={}, points={})
        except UnicodeDecodeError:
            raise DartboardError("the body is not UTF-8 text; send the grid file as UTF-8") from None
    if kind not in ("", JSON):
        raise DartboardError(f"the body is {kind[:60]!r}; send {JSON} (a submission) or {TOML} (a grid file)")
    try:
        found = schemas.Submission.model_validate_json(body)
    except ValidationError as error:
        raise problems.of_model(error) from None
    if (found.grid is None) == (found.toml is None):
        raise DartboardError('the body needs one of "grid" (an object) and "toml" (the text of a grid file)')
    return found


def planned(store: Store, artifacts: Artifacts, asked: schemas.Submission, lister: Lister = nobody) -> Plan:
    """
    The cells that a submission means; ``lister`` knows what can be swept in a scene. Raises ``GridError`` with every
    problem found.
    """
    table: Any = asked.grid if asked.grid is not None else grid.loads(asked.toml or "", asked.origin)
    find = partial(uploads.find, store, artifacts, asked.scenes)
    points = partial(uploadedpoints.find, artifacts, asked.points)
    return plan.expand(grid.parse(table, find=find, points=points, origin=asked.origin, lister=lister))


def dry_run(store: Store, wanted: Plan) -> schemas.DryRun:
    """What a plan would render and cost beyond what is there."""
    cost = estimate(wanted, experiments.rates(store, platform.node()), experiments.replicates_had(store))
    asked = wanted.grid
    known = store.one("experiment_by_digest", digest=asked.digest)
    return schemas.DryRun(
        name=asked.name, axes=asked.axes, experiment=known["id"] if known and not known["deleted_at"] else None,
        toml=toml_of(json.loads(asked.text)), **asdict(cost),
    )  # fmt: skip
