"""Grids for tests: hypothesis strategies over what a user may write, and a short way to parse one."""

from __future__ import annotations

from functools import partial
from pathlib import Path

from hypothesis import strategies as st

from jobs import grid
from jobs.gridspec import GridSpec
from renderer.errors import DartboardError
from renderer.scenes import sources

HERE = Path(__file__).parent

SAMPLERS = [
    "independent", "random", "stratified", "stratified:jitter=false", "multijitter", "orthogonal", "ldsampler",
    {"type": "multijitter", "jitter": False}, {"jitter": True, "type": "stratified"},
]  # fmt: skip
INTEGRATORS = [
    "path", "direct", "path:rr_depth=3", "path:max_depth=2", {"type": "path", "max_depth": 6},
    {"type": "path", "hide_emitters": True}, {"type": "path", "max_depth": -1}, "direct:emitter_samples=2",
]  # fmt: skip
SCENES = ["cornell_box", "defocus"]

references = st.booleans() | st.fixed_dictionaries(
    {},
    optional={
        "integrator": st.sampled_from(["path", {"type": "path", "rr_depth": 9}]),
        "sampler": st.sampled_from(SAMPLERS),
        "spp": st.integers(1, 10**5),
        "replicates": st.integers(1, 8).map(lambda pairs: 2 * pairs),
    },
)
settings_of_a_scene = {
    "resolution": st.tuples(st.integers(9, 500), st.integers(9, 500)).map(list),
    "crop": st.tuples(*[st.integers(0, 4)] * 2, *[st.integers(1, 5)] * 2).map(list),
    "max_depth": st.sampled_from([-1, 1, 2, 6, 10.0]),
    "rfilter": st.sampled_from(["box", "tent", {"type": "gaussian", "stddev": 0.4}]),
    "reference": references,
}


def some(values: list, most: int = 4):
    """One value alone, or a list of some of them."""
    return st.sampled_from(values) | st.lists(st.sampled_from(values), min_size=1, max_size=most)


def tables():
    """Valid grids as parsed TOML."""
    return (
        st.fixed_dictionaries(
            {"scenes": some(SCENES)},
            optional={
                "name": st.sampled_from(["a grid", "another"]),
                "samplers": some(SAMPLERS),
                "integrators": some(INTEGRATORS),
                "spp": st.integers(1, 99) | st.lists(st.integers(1, 99), min_size=1, max_size=6),
                "replicates": st.integers(1, 50),
                "colour": st.sampled_from(["rgb", "spectral"]),
                **settings_of_a_scene,
            },
        )
        .flatmap(_with_sweeps)
        .flatmap(_with_scene_tables)
    )


PARAMETERS = ["sphere.bsdf.nu", "lamp.radiance", "white.reflectance"]
swept_values = some([10, 1000.0, 0.25, [0.1, 0.5, 1.0], [1, 0, 0]])


def _with_sweeps(table):
    """Now and then up to two sweeps, some of them in some of the scenes only."""
    sweep = st.fixed_dictionaries({"values": swept_values}, optional={"scenes": some(written(table))})
    sweeps = st.dictionaries(st.sampled_from(PARAMETERS), sweep, min_size=1, max_size=2).map(
        lambda found: [{"parameter": parameter, **rest} for parameter, rest in found.items()]
    )
    return (st.none() | sweeps).map(lambda found: {**table, "sweep": found} if found else table)


def written(table):
    return table["scenes"] if isinstance(table["scenes"], list) else [table["scenes"]]


def _with_scene_tables(table):
    own = st.dictionaries(
        st.sampled_from(written(table)), st.fixed_dictionaries({}, optional=settings_of_a_scene),
        max_size=len(set(written(table))),
    )  # fmt: skip
    return own.map(lambda scene: {**table, "scene": scene} if scene else table)


def parse(table=None, base: Path = HERE, **keys) -> GridSpec:
    """A grid of the cornell box and whatever else is said."""
    return grid.parse(
        {"scenes": ["cornell_box"], **(table or {}), **keys}, find=partial(sources.find, base=base), origin="grid.toml"
    )


def complaints(table=None, **keys) -> tuple[str, ...]:
    """What is wrong with a grid; nothing if it is accepted. Any other error than ours is a failure."""
    try:
        parse(table, **keys)
    except DartboardError as error:
        return error.problems
    return ()
