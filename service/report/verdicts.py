"""
Verdicts: which curve of a panel has the lowest error at the highest common spp, and how sure that is.

Two errors are told apart only where their 95 % intervals do not overlap; with one replicate there are no intervals and
nothing is certain. Words are made here from numbers, and from nothing else.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass

from jobs.store import Row
from service.report.figures import counted, decimals, factor, joined, listed, number
from service.report.panels import Line, Panel

MOST_NAMED = 4
P95 = "95\u00a0%"
APART = f"a {P95} interval apart from all others"


@dataclass(frozen=True)
class Verdict:
    """
    What a panel says by a metric at ``spp``, the highest that all its curves have.

    tied  other curves whose intervals overlap that of the best; None without intervals
    """

    panel: Panel
    metric: str
    spp: int
    best: Line
    tied: list[Line] | None

    @property
    def rows(self) -> list[Line]:
        """The measured curves in the order of the panel."""
        return self.panel.measured(self.metric)

    @property
    def compared(self) -> list[Line]:
        """Those that the best is chosen among: a replay, which is wrong on purpose, is in no comparison."""
        return [line for line in self.rows if not line.replay]

    def point(self, line: Line) -> Row:
        return line.points[self.metric][self.spp]

    def ratio(self, line: Line) -> float | None:
        """Error relative to the baseline's; None where that says nothing."""
        base = self.panel.baseline.point(self.metric, self.spp)
        own = self.point(line)["mean"]
        return own / base["mean"] if base and base["mean"] > 0 and own > 0 else None

    def standing(self, line: Line) -> str:
        """How a curve compares with the best one."""
        if line.replay:
            return "a replay"
        if line is self.best:
            return "lowest"
        if self.tied is None:
            return "unknown: one replicate"
        return "overlaps the lowest" if line in self.tied else "apart from the lowest"

    @property
    def certain(self) -> bool:
        """Whether the best is told apart from every other curve."""
        return self.tied == [] and len(self.compared) > 1


def verdict(panel: Panel, metric: str) -> Verdict | None:
    """None where nothing is measured."""
    spp = panel.common_spp(metric)
    if spp is None:
        return None
    lines = panel.measured(metric)
    right = [line for line in lines if not line.replay] or lines
    best = min(right, key=lambda line: line.points[metric][spp]["mean"])
    known = [(line, apart(best.points[metric][spp], line.points[metric][spp])) for line in right if line is not best]
    tied = None if any(found is None for _, found in known) else [line for line, found in known if not found]
    return Verdict(panel, metric, spp, best, tied)


def apart(one: Row, other: Row) -> bool | None:
    """Whether two 95 % intervals do not overlap; None where there are none."""
    if None in (one["low"], other["low"]):
        return None
    return bool(one["high"] < other["low"] or other["high"] < one["low"])


def sentences(found: Verdict) -> list[str]:
    """A verdict in plain words."""
    if not found.compared:
        return ["There are only replays here, which show published mistakes: none is to be chosen.", *_slopes(found)]
    if len(found.compared) == 1:
        only = found.compared[0]
        return [f"{only.name} reaches {value(found.point(only))} at {_spp(found, only)}.", *_slopes(found)]
    return [_lowest(found), _certainty(found), *_slopes(found)]


def value(point: Row) -> str:
    """``4.87e-4 ± 7.6e-6``: mean and standard error."""
    return number(point["mean"]) + (f"\u00a0±\u00a0{number(point['error'], 2)}" if point["error"] is not None else "")


def _lowest(found: Verdict) -> str:
    best, base = found.best, found.panel.baseline
    text = f"The lowest {found.metric} at {_spp(found, best)}, {value(found.point(best))}, is that of {best.name}"
    if best is base:
        return f"{text}, the baseline."
    ratio = found.ratio(best)
    return text + (f": {factor(ratio)} × that of {base.name}." if ratio else ".")


def _certainty(found: Verdict) -> str:
    if found.tied is None:
        return "With one replicate nobody can say how sure that is."
    if not found.tied:
        return f"Its {P95} interval is apart from {'all others' if len(found.compared) > 2 else 'the other'}."
    every = len(found.tied) == len(found.compared) - 1 > 1
    names = "all others" if every else "that of " + listed((line.name for line in found.tied), MOST_NAMED)
    base = found.panel.baseline
    if base in found.tied or found.best is base:
        return f"That is not certain: its {P95} interval overlaps {names}."
    return f"Its {P95} interval is apart from that of {base.name}, but overlaps {names}."


def _slopes(found: Verdict) -> list[str]:
    """How fast the errors fall: the steepest curve, and the baseline."""
    fitted = [(line, slope) for line in found.compared or found.rows if (slope := line.slopes[found.metric])]
    if not fitted:
        return []
    if len(fitted) == 1:
        line, slope = fitted[0]
        return [f"With {line.name} the error falls like spp to the power {slope_text(slope)}."]
    steepest, slope = min(fitted, key=lambda pair: pair[1]["value"])
    text = f"Errors fall fastest with {steepest.name}, like spp to the power {slope_text(slope)}"
    base = found.panel.baseline.slopes[found.metric]
    if steepest is found.panel.baseline or base is None:
        return [f"{text}."]
    sure = "" if slope["high"] < base["low"] else ", and the two intervals overlap"
    return [f"{text}; with {found.panel.baseline.name} the power is {slope_text(base)}{sure}."]


def slope_text(slope: Row) -> str:
    """``−1.20 (95 %: −1.25 to −1.16)``."""
    return f"{decimals(slope['value'])} ({P95}: {decimals(slope['low'])} to {decimals(slope['high'])})"


def _spp(found: Verdict, line: Line) -> str:
    rendered = found.point(line)["spp_actual"]
    return f"{found.spp} spp" if rendered == found.spp else f"{found.spp} spp ({rendered} rendered)"


def overall(found: list[Verdict]) -> str | None:
    """One sentence over all panels with something to choose from; None for fewer than two."""
    chosen = [one for one in found if len(one.compared) > 1]
    if len(chosen) < 2:
        return None
    wins = Counter(one.best.sampler for one in chosen)
    certain = Counter(one.best.sampler for one in chosen if one.certain)
    if len(wins) == 1:
        [sampler] = wins
        sure = {0: "in none of them", len(chosen): "in each"}.get(certain[sampler], f"in {certain[sampler]} of them")
        both = "both" if len(chosen) == 2 else f"all {len(chosen)}"
        return f"In {both} comparisons {sampler} has the lowest error, {sure} with {APART}."
    parts = [f"{sampler} ({_often(times, certain[sampler])})" for sampler, times in wins.most_common()]
    return f"In {len(chosen)} comparisons the lowest error belongs to {joined(parts)}; certain means {APART}."


def _often(times: int, certain: int) -> str:
    return f"{counted(times, 'time')}, certain in {certain or 'none'}"
