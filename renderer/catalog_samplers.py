"""
The samplers of the catalog: Mitsuba's with their rounding rules, and ours with their limits and replays.

Ours render every spp that is asked, up to the length of their tables. A *replay* shows a published mistake on purpose
(those of a student report on pbrt-v3): its label says so, and it is plotted at the spp that was asked.
Plugins of ours have names of their own, as Mitsuba ignores in silence a plugin whose name is taken. No Mitsuba here.
"""

from __future__ import annotations

import math

from renderer.catalog_types import Entry, Parameter, Values
from renderer.errors import BadParameter, shown
from renderer.samplers.packing import check_min_dist

MITSUBA = "Mitsuba 3.9"
OURS = "Dartboard"
TABLE_POINTS = 2**16  # of one set: longer tables would not stay in a cache
PMJ_POINTS = 2**14  # of one set: the largest that is made in less than a minute
HALTON_POINTS = 2**31 // (128 * 243)  # its index over a tile of 128 × 243 pixels has 31 bits: exact divisions
MAX_FILE_NAME = 200  # characters

IGNORE_SPP = "ignore_spp"
IGNORED_SPP = 16  # what ignore_spp renders: the default of pbrt-v3's parameter, which nobody had set
FIXED_DISTANCE = (IGNORE_SPP, "zeros", "truncated", "random_fill")  # of poissondisk: at the distance of the report


def _square(spp: int) -> int:
    """Stratified: strata on an n×n grid, so the next square."""
    return (math.isqrt(spp - 1) + 1) ** 2


def _near_square(spp: int) -> int:
    """Multijitter: a grid of ⌊√spp⌋ columns and as many rows as it takes."""
    columns = math.isqrt(spp)
    return columns * -(-spp // columns)


def _prime_square(spp: int) -> int:
    """Orthogonal (Bose's arrays): the square of a prime, at least 4."""
    side = max(2, math.isqrt(spp - 1) + 1)
    while any(side % divisor == 0 for divisor in range(2, math.isqrt(side) + 1)):
        side += 1
    return side * side


def _power_of_four(spp: int) -> int:
    """(0,2)-nets of Kollig and Keller: a power of four, at least 4."""
    power = 4
    while power < spp:
        power *= 4
    return power


def _check_replay(values: Values, where: str) -> None:
    """A replay is the construction as it was published, and nobody relaxed that."""
    replay, iterations = values.get("replay"), values.get("lloyd_iterations")
    if replay and iterations:
        raise BadParameter(
            f"lloyd_iterations = {iterations} of {where} does not go with replay = {replay}, which shows what was "
            "published as it was; leave out one of them"
        )


def _check_poissondisk(values: Values, where: str) -> None:
    _check_replay(values, where)
    replay, distance = values.get("replay"), values.get("min_dist")
    if replay in FIXED_DISTANCE and distance is not None:
        raise BadParameter(
            f"min_dist = {distance} of {where} means nothing with replay = {replay}, whose distance is the published "
            "one; leave out one of them"
        )


def _check_distance(values: Values, spp: int, where: str) -> None:
    """So many points must have room at that distance. Raises ``BadParameter`` with the largest feasible one."""
    if (distance := values.get("min_dist")) is not None:
        check_min_dist(spp, float(distance), f"poissondisk ({where})")


def _check_file(values: Values, where: str) -> None:
    name = str(values["file"])
    if not name.strip() or len(name) > MAX_FILE_NAME or not name.isprintable() or "," in name or name != name.strip():
        raise BadParameter(
            f"file = {shown(name)} of {where} is not allowed; name a .npz file, in 1 to {MAX_FILE_NAME} printable "
            "characters without a comma"
        )


_JITTER = Parameter("jitter", bool, True, "random position in a stratum; false takes its centre, which is biased")
_MIN_DIST = "least distance between two points, on the torus"
_LLOYD = Parameter("lloyd_iterations", int, 0, "steps of Lloyd relaxation: more even, less random", "steps", 0, 1000)
_MISTAKES = {
    "": "the correct sampler",
    IGNORE_SPP: f"renders {IGNORED_SPP} samples per pixel, whatever was asked",
    "zeros": "points that find no room stay at (0, 0)",
    "truncated": "points grow outward from a seed and stop before they cover the pixel",
    "random_fill": "points that find no room are plain random",
    "four_dimensions": "plain random numbers from the fifth dimension on",
}
_REPLAY = Parameter("replay", str, "", "shows a published mistake in place of the correct sampler",
                    options=tuple(_MISTAKES), meanings=tuple(_MISTAKES.values()),
                    replays=tuple(filter(None, _MISTAKES)))  # fmt: skip
_SCRAMBLE = Parameter("scramble", str, "shift", "what makes every pixel and dimension use other points",
                      options=("shift", "owen", "none"), replays=("none",), meanings=(
                          "a random toroidal shift for each pixel and dimension",
                          "Owen scrambling, which keeps nets nets",
                          "the points as they are, the same in every pixel: biased"))  # fmt: skip

SAMPLERS = (
    Entry("sampler", "independent", "plain random numbers (PCG32): the baseline", MITSUBA, "independent",
          aliases=("random",)),
    Entry("sampler", "stratified", "one jittered point per cell of a square grid", MITSUBA, "stratified",
          parameters=(_JITTER,), rounds=_square, rounding="up to a square"),
    Entry("sampler", "multijitter", "correlated multi-jittered points (Kensler 2013)", MITSUBA, "multijitter",
          parameters=(_JITTER,), rounds=_near_square, rounding="up to a near-square grid"),
    Entry("sampler", "orthogonal", "orthogonal arrays of strength 2 (Jarosz et al. 2019)", MITSUBA, "orthogonal",
          parameters=(_JITTER,), rounds=_prime_square, rounding="up to the square of a prime"),
    Entry("sampler", "ldsampler", "one (0,2)-net per pixel, permuted per dimension (Kollig and Keller 2002)", MITSUBA,
          "ldsampler", rounds=_power_of_four, rounding="up to a power of four"),
    Entry("sampler", "halton", "the Halton sequence over the whole picture, scrambled (Halton 1960; after pbrt)", OURS,
          "halton", limit=HALTON_POINTS),
    Entry("sampler", "sobol", "Owen-scrambled Sobol' points, a (0,2)-net in each pair of dimensions (Burley 2020)",
          OURS, "sobol"),
    Entry("sampler", "zsobol", "Sobol' points along a Morton curve: errors of neighbours differ (Ahmed and Wonka 2020)",
          OURS, "zsobol"),
    Entry("sampler", "pmj02bn", "progressive multi-jittered (0,2) points with blue noise (Christensen et al. 2018)",
          OURS, "pmj02bn", limit=PMJ_POINTS),
    Entry("sampler", "poissondisk", "Poisson-disk points: random, but none near another (Ebeida et al. 2012)", OURS,
          "poissondisk", limit=TABLE_POINTS, check=_check_poissondisk, check_spp=_check_distance, parameters=(
              Parameter("min_dist", float, None, f"{_MIN_DIST}, at most 0.82/√spp",
                        "pixels", 0, 1, banned=(0,), unset="the largest"), _LLOYD, _REPLAY)),
    Entry("sampler", "relaxedpoissondisk", "dart throwing whose distance shrinks until all points have room "
          "(McCool and Fiume 1992)", OURS, "relaxedpoissondisk", limit=TABLE_POINTS, check=_check_replay, parameters=(
              Parameter("min_dist", float, None, f"{_MIN_DIST}, to begin with",
                        "pixels", 0, 1, banned=(0,), unset="the largest"), _LLOYD, _REPLAY)),
    Entry("sampler", "eliminated", "of five times as many random points, those that lie most evenly (Yuksel 2015)",
          OURS, "eliminated", limit=TABLE_POINTS),
    Entry("sampler", "pointset", "points of your own, from a .npz file that lies beside the grid", OURS, "pointset",
          check=_check_file, parameters=(
              Parameter("file", str, None, "a .npz file with points: float (K, N, 2) or (N, 2) in [0, 1)",
                        required=True, unset="a file"),
              _SCRAMBLE)),
)  # fmt: skip
