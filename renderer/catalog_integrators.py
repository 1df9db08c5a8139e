"""The integrators of the catalog: what each does, what it takes, and where it comes from."""

from __future__ import annotations

import re

from renderer.catalog_samplers import MITSUBA
from renderer.catalog_types import Entry, Parameter

MAX_DEPTH = 10**6  # edges; fits Mitsuba's 32-bit integers, and no light survives as many
BDPT_DEPTH = 66  # edges: every lane of bdpt keeps its light path, and has room for 64 vertices

_DEPTH = Parameter("max_depth", int, None, "edges of the longest path; -1 is unlimited", "edges", -1, MAX_DEPTH,
                   banned=(0,), estimand=True)  # fmt: skip
_HIDE = Parameter("hide_emitters", bool, False, "lamps are not seen directly", estimand=True)
_ROULETTE = Parameter("rr_depth", int, 5, "edges before Russian roulette", "edges", 1, MAX_DEPTH)
_LIGHTS = Parameter(
    "light_sampler", str, "uniform", "which lamp is picked", late=True, options=("uniform", "power", "spatial", "bvh"),
    meanings=("any, as likely as any other", "the more power, the likelier",
              "the more it lights the place, the likelier", "down a tree of lamps, by distance and direction"),
)  # fmt: skip


def pair_of(value: object) -> str | None:
    """``[2, 1]``, ``"2-1"`` or ``"2, 1"`` as ``2-1``: s ≥ 0 vertices from a lamp, t ≥ 1 from the camera."""
    text = "-".join(map(str, value)) if isinstance(value, (list, tuple)) else str(value)
    match = re.fullmatch(r"(\d{1,2})\s*[-,]\s*(\d{1,2})", text.strip())
    if not match:
        return None
    s, t = int(match[1]), int(match[2])
    return f"{s}-{t}" if t >= 1 and 2 <= s + t <= BDPT_DEPTH + 1 else None


INTEGRATORS = (
    Entry("integrator", "path", "path tracing with next-event estimation and multiple importance sampling",
          MITSUBA, "path",
          parameters=(_DEPTH, _HIDE, _LIGHTS, _ROULETTE)),
    Entry("integrator", "bdpt", "bidirectional path tracing: paths from camera and lamps, joined in every way",
          "Dartboard", "bdpt",
          version=2, deepest=BDPT_DEPTH, cost=3.0,
          parameters=(
              Parameter("max_depth", int, None, "edges of the longest path", "edges", 1, BDPT_DEPTH, estimand=True),
              _HIDE, _LIGHTS,
              Parameter("heuristic", str, "power", "how ways to make the same path are weighed",
                        options=("power", "balance"),
                        meanings=("by the squares of their densities", "by their densities, as pbrt-v3 does")),
              Parameter("aim", bool, True, "half of the light paths go to glass and mirrors, where there are any"),
              Parameter("rr_depth", int, None, "edges of a subpath before Russian roulette", "edges", 1, MAX_DEPTH,
                        unset="none"),
              Parameter("debug_strategy", str, None, "draw only paths of s vertices from a lamp, t from the camera",
                        estimand=True, unset="all", reader=pair_of,
                        form=f"[s, t] or s-t, with s ≥ 0, t ≥ 1 and 2 ≤ s + t ≤ {BDPT_DEPTH + 1}"),
              Parameter("debug_weighted", bool, True, "these by their weight, false: in full", estimand=True),
          )),
    Entry("integrator", "direct", "direct light only: paths of at most two edges", MITSUBA, "direct", depth=2,
          parameters=(_HIDE, Parameter("emitter_samples", int, 1, "light samples per camera ray", "", 1, 1024),
                      Parameter("bsdf_samples", int, 1, "BSDF samples per camera ray", "", 1, 1024))),
    Entry("integrator", "ptracer", "particle tracing, from the lamps alone: glass and mirrors that are seen stay black",
          MITSUBA, "ptracer", aliases=("light",), parameters=(_DEPTH, _HIDE, _ROULETTE)),
    Entry("integrator", "volpath", "path tracing through smoke and fog, and straight through masks", MITSUBA, "volpath",
          parameters=(_DEPTH, _HIDE, _ROULETTE)),
)  # fmt: skip
