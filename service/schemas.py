"""
The wire: what goes over HTTP, in and out.

Names here are the names in OpenAPI and, generated from it, in ``web/openapi.d.ts``; nothing else defines a shape.
Request models are strict (``false`` is no 0), answers hold plain values. Times are UTC, ISO 8601.
"""

from __future__ import annotations

from typing import Any, Literal

from pydantic import BaseModel, ConfigDict, Field

State = Literal["queued", "running", "done", "failed", "cancelled", "paused"]
Role = Literal["cell", "reference"]
Digest = str


class Wire(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)


# -- problems ----------------------------------------------------------------------------------------------------------


class Fault(Wire):
    """One thing that is wrong with a request. ``field`` is the grid's key that it concerns, where one can be told."""

    detail: str
    field: str | None = None


class Problem(Wire):
    """RFC 9457: what went wrong, in a sentence with the way out. ``problems`` lists every fault of a grid."""

    type: str = Field(examples=["urn:dartboard:bad-grid"])
    title: str = Field(examples=["the grid cannot be run"])
    status: int = Field(examples=[422])
    detail: str
    instance: str = Field(examples=["/api/experiments"])
    problems: list[Fault] = []


# -- submitting --------------------------------------------------------------------------------------------------------


class Submission(BaseModel):
    """
    A grid as an object, or as the text of a TOML file; one of the two. ``scenes`` says which uploaded scene
    (``POST /api/scenes``) a name in the grid's ``scenes`` stands for; built-in scenes need no entry. ``points`` says
    the same of the files of ``pointset`` samplers (``POST /api/points``).
    """

    model_config = ConfigDict(
        strict=True,
        extra="forbid",
        json_schema_extra={
            "examples": [
                {"grid": {"name": "first", "scenes": ["cornell_box"], "samplers": ["independent"], "spp": [4, 16]}},
                {"toml": 'scenes = ["room"]\nspp = [16]\n', "scenes": {"room": "0" * 64}},
            ]
        },
    )

    grid: dict[str, Any] | None = None
    toml: str | None = Field(None, max_length=2**24)
    origin: str = Field("grid", max_length=200, description="what sentences call the grid: the name of its file")
    scenes: dict[str, Digest] = Field({}, max_length=1000)
    points: dict[str, Digest] = Field({}, max_length=1000)


class Rounded(Wire):
    """A sampler that does not render the spp that was asked."""

    sampler: str
    asked: int
    rendered: int


class DryRun(Wire):
    """What a grid would render and cost. ``rough``: nothing like it was timed on this machine yet."""

    name: str
    axes: dict[str, int] = Field(examples=[{"scenes": 2, "samplers": 3, "integrators": 1, "spp": 4, "replicates": 4}])
    cells: int
    references: int
    replicates: int = Field(description="pictures wanted, references included")
    reused: int = Field(description="how many of these are there already")
    rounded: list[Rounded]
    samples: int
    seconds: float
    disk_bytes: int
    rough: bool
    experiment: int | None = Field(description="the experiment that this very grid already is")
    toml: str = Field(description="the grid as a file for `dartboard run`")


class Scene(Wire):
    """A scene that a grid may name: built in, or uploaded and vetted."""

    name: str
    digest: Digest
    builtin: bool
    main: str
    width: int
    height: int
    max_depth: int
    integrator: str
    sampler: str
    spp: int
    reference: str = Field(default="", description="how it is made where a grid says nothing about it")
    files: list[str]
    notes: list[str] = Field(
        default=[], description="of a pbrt file, in the answer to its upload: what was replaced or ignored, by line"
    )


class SceneParameter(Wire):
    """What can be swept in a scene, by the name that a grid gives it. ``now``: what the scene's file says."""

    name: str
    kind: Literal["number", "colour"]
    now: float | tuple[float, float, float] | None


class PointFile(Wire):
    """A point file that a grid may name: ``sets`` sets of ``count`` points, each a pixel's samples at most."""

    name: str
    digest: Digest
    sets: int
    count: int


# -- experiments -------------------------------------------------------------------------------------------------------


class Experiment(Wire):
    """An experiment and how far it is. ``had`` and ``wanted`` count pictures, references included."""

    id: int
    name: str
    state: State
    created_at: str
    cells: dict[str, int] = Field(description="cells by state")
    references: dict[str, int] = Field(description="references by state")
    had: int
    wanted: int
    failed: int
    seconds_left: float | None = Field(description="estimate for what is still wanted; null when unknown or nothing")


class SceneInfo(Wire):
    """A scene of an experiment: the size of its pictures, and how its reference is made (null: none)."""

    name: str
    width: int
    height: int
    reference: str | None


class MetricInfo(Wire):
    name: str
    line: str
    formula: str
    epsilon: float
    lower_is_better: bool | None


class ExperimentDetail(Experiment):
    """An experiment with its axes, in the order of its grid, and the grid as TOML."""

    revision: int
    scenes: list[SceneInfo]
    integrators: list[str]
    samplers: list[str]
    spp: list[int]
    sweeps: dict[str, list[Any]] = Field(description="parameter → values, where the grid sweeps materials")
    replicates: int
    metrics: list[MetricInfo]
    default_metric: str
    toml: str
    paths: dict[str, str] = Field({}, description="uploaded scenes: name → digest")
    points: dict[str, str] = Field({}, description="point files of pointset samplers: name → digest")
    replays: list[str] = Field([], description="the samplers that show a published mistake, plotted at the spp asked")


class Deleted(Wire):
    """What a deletion takes, or would take (``dry_run``). It can be undone (``restore``) until ``final_at``."""

    id: int
    name: str
    cells: int = Field(description="cells that no other experiment wants")
    pictures: int
    disk_bytes: int
    final_at: str


# -- cells -------------------------------------------------------------------------------------------------------------

Measured = tuple[float, float | None, int]


class Cell(Wire):
    """
    A cell as one experiment sees it. ``cell`` names it in ``/api/cells/{cell}/…``; ``position`` is its place in the
    plan. ``metrics``: name → [mean, standard error or null, n] over the replicates that the experiment wants.
    """

    position: int
    cell: int
    role: Role
    scene: str
    integrator: str
    sampler: str
    spp: int = Field(description="asked")
    spp_actual: int = Field(description="rendered, after the sampler's rounding")
    replay: bool = Field(False, description="its sampler shows a published mistake: never to be recommended")
    sweep: dict[str, Any] = {}
    state: State
    had: int
    wanted: int
    reference: int | None = Field(None, description="the cell that this one is measured against")
    seconds: float | None = Field(None, description="mean render time of a replicate, without compiling")
    metrics: dict[str, Measured] = {}
    error_class: str | None = None
    error: str | None = None


class Cells(Wire):
    """
    A page of cells in the order of the plan. ``next`` is the ``start`` of the following page, null at the end.
    Keep the ``revision`` of the *first* page and ask for ``after`` it later: only what changed since comes back.
    """

    revision: int
    next: int | None
    cells: list[Cell]


class Attempt(Wire):
    """One try at a cell; ``outcome`` is null while it runs. ``log`` holds the last words of its render process."""

    id: int
    started_at: str
    ended_at: str | None
    machine: str
    device: str
    outcome: str | None
    error: str | None
    log: str | None


class Attempts(Wire):
    attempts: list[Attempt]


# -- convergence -------------------------------------------------------------------------------------------------------


class Point(Wire):
    """Mean error over ``n`` replicates at the spp that was rendered; ``low`` to ``high`` is its 95 % interval."""

    cell: int
    spp: int
    spp_actual: int
    n: int
    mean: float
    error: float | None = Field(description="standard error of the mean; null for one replicate")
    low: float | None
    high: float | None
    seconds: float | None = Field(description="mean render time of a replicate")


class Slope(Wire):
    """Exponent b of error ~ spp^b, weighted least squares on logarithms, with its 95 % interval."""

    value: float
    low: float
    high: float


class Series(Wire):
    """
    One curve. ``replay``: its sampler shows a published mistake; it is drawn, and its slope fitted, at the spp asked.
    ``alike``: all its renders were timed under the same conditions, so its seconds may be compared.
    ``floor``: what an exact picture would measure, the noise of the reference; a mean near it says little.
    """

    scene: str
    integrator: str
    sampler: str
    sweep: dict[str, Any] = {}
    points: list[Point]
    slope: Slope | None
    alike: bool
    replay: bool = False
    floor: float | None = None


class Convergence(Wire):
    """Error against spp or seconds. What the plot, the table of the report and ``results`` show: one reading."""

    metric: MetricInfo
    revision: int
    series: list[Series]


# -- the service -------------------------------------------------------------------------------------------------------


class Worker(Wire):
    """
    What renders, and what it does now. ``state``: idle, starting, rendering, or stalled with its ``trouble``
    (a full disk, a renderer that does not start), which is tried again by itself.
    """

    state: Literal["idle", "starting", "rendering", "stalled"]
    device: str
    trouble: str | None
    experiment: int | None
    cell: int | None
    description: str | None = Field(description="scene · integrator · sampler · spp of what is being drawn")
    queued: int = Field(description="cells that wait")


class Health(Wire):
    status: Literal["ok", "stalled"]
    version: str
    data: str
    machine: str
    pid: int
    started_at: str
    revision: int
    worker: Worker


class Progress(Wire):
    """Event ``progress``: a picture that is being drawn. ``preview`` grows when there is a new preview to fetch."""

    cell: int
    role: Role
    replicate: int
    done: int
    passes: int
    seconds: float
    preview: int


class Update(Wire):
    """
    Event ``update`` of an experiment's stream: what changed since the event before. ``reload``: everything may have
    changed (cancelled, paused, retried …); ask for all cells again.
    """

    revision: int
    experiment: Experiment
    worker: Worker
    reload: bool
    cells: list[Cell]


class Overview(Wire):
    """Event ``update`` of the general stream: every experiment, newest first, and the worker."""

    revision: int
    experiments: list[Experiment]
    worker: Worker
