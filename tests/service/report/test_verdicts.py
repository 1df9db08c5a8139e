"""What is said to be certain is certain by its intervals, and nothing else is."""

from __future__ import annotations

from typing import Any

import pytest

from service.report.panels import Line, Panel
from service.report.verdicts import apart, overall, sentences, verdict

SPP = (4, 16, 64)


def point(mean: float, half: float | None, spp: int = 64, spp_actual: int | None = None) -> dict[str, Any]:
    low, high = (None, None) if half is None else (mean - half, mean + half)
    error = None if half is None else half / 2
    return {"spp": spp, "spp_actual": spp_actual or spp, "n": 4, "mean": mean, "error": error, "low": low, "high": high}


def line(name: str, *points: dict[str, Any], slope: tuple[float, float, float] | None = None) -> Line:
    made = Line("path", name, name, cells={spp: {} for spp in SPP})
    made.points["relmse"] = {one["spp"]: one for one in points}
    made.slopes["relmse"] = slope and dict(zip(("value", "low", "high"), slope, strict=True))
    return made


def panel(*lines: Line) -> Panel:
    return Panel("panel", "cornell_box", {}, ["path"], list(lines), {"cell": 9})


def said(*lines: Line) -> str:
    found = verdict(panel(*lines), "relmse")
    assert found is not None
    return " ".join(sentences(found)).replace("\u00a0", " ")


@pytest.mark.parametrize(
    ("one", "other", "expected"),
    [
        (point(1, 0.1), point(2, 0.1), True),
        (point(2, 0.1), point(1, 0.1), True),
        (point(1, 0.6), point(2, 0.5), False),
        (point(1, 0.5), point(2, 0.5), False),  # touching is no gap
        (point(1, None), point(2, 0.1), None),
    ],
)
def test_two_errors_are_apart_where_their_intervals_do_not_overlap(one, other, expected):
    assert apart(one, other) is expected


def test_the_lowest_is_named_with_its_ratio_to_the_baseline():
    text = said(line("independent", point(0.03, 0.001)), line("stratified", point(0.01, 0.001)))
    assert text.startswith(
        "The lowest relmse at 64 spp, 1.00e-2 ± 5.0e-4, is that of stratified: 0.333 × that of independent."
    )
    assert "Its 95 % interval is apart from the other." in text


def replayed(one: Line) -> Line:
    one.replay = True
    return one


def test_a_replay_is_never_the_best_and_in_no_comparison():
    wrong = replayed(line("poissondisk:replay=zeros", point(0.001, 0.0001), slope=(-3.0, -3.1, -2.9)))
    right = [line("independent", point(0.03, 0.001), slope=(-1.0, -1.1, -0.9)), line("sobol", point(0.01, 0.001))]
    assert said(wrong, *right) == said(*right), "it changes nothing that is said about the others"
    found = verdict(panel(wrong, *right), "relmse")
    assert found is not None and found.best is right[1] and found.panel.baseline is right[0]
    assert [found.standing(one) for one in found.rows] == ["a replay", "apart from the lowest", "lowest"]
    assert panel(wrong, *right).lowest("relmse", 64) == 0.01
    assert overall([found, found]) == overall([verdict(panel(*right), "relmse")] * 2)


def test_where_there_are_only_replays_nothing_is_recommended():
    text = said(replayed(line("a:replay=zeros", point(0.001, 0.0001))), replayed(line("b", point(0.002, 0.0001))))
    assert text == "There are only replays here, which show published mistakes: none is to be chosen."
    alone = said(replayed(line("a:replay=zeros", point(0.001, 0.0001))), line("independent", point(0.03, 0.001)))
    assert alone.startswith("independent reaches 3.00e-2")


def test_what_overlaps_is_named():
    lines = [line("a", point(0.03, 0.001)), line("b", point(0.011, 0.002)), line("c", point(0.01, 0.001))]
    assert "Its 95 % interval is apart from that of a, but overlaps that of b." in said(*lines)
    assert "That is not certain: its 95 % interval overlaps that of a." in said(
        line("a", point(0.011, 0.002)), line("c", point(0.01, 0.001)), line("d", point(0.03, 0.001))
    )
    assert "overlaps all others" in said(*(line(name, point(0.01, 0.005)) for name in "abc"))


def test_the_baseline_may_win():
    assert "is that of a, the baseline." in said(line("a", point(0.01, 0.001)), line("b", point(0.02, 0.001)))


def test_without_intervals_nothing_is_certain():
    text = said(line("a", point(0.02, None)), line("b", point(0.01, None)))
    assert "nobody can say how sure that is" in text and "apart" not in text


def test_curves_are_compared_at_the_highest_spp_that_all_have():
    long = line("a", point(0.03, 0.001, 16), point(0.001, 0.0001, 64))
    short = line("b", point(0.02, 0.001, 16))
    found = verdict(panel(long, short), "relmse")
    assert found is not None and (found.spp, found.best) == (16, short)
    unmeasured = line("c")
    found = verdict(panel(long, unmeasured), "relmse")
    assert found is not None and found.spp == 64 and found.rows == [long]
    assert verdict(panel(unmeasured), "relmse") is None


def test_an_spp_that_was_rounded_is_said():
    assert "at 64 spp (81 rendered)" in said(line("a", point(0.01, 0.001, 64, 81)), line("b", point(0.02, 0.001)))


def test_slopes_are_told_with_their_intervals():
    flat = line("a", point(0.03, 0.001), slope=(-1.0, -1.02, -0.98))
    steep = line("b", point(0.02, 0.001), slope=(-1.3, -1.4, -1.2))
    text = said(flat, steep)
    assert "fastest with b, like spp to the power −1.30 (95 %: −1.40 to −1.20); with a the power is −1.00" in text
    assert "intervals overlap" not in text
    unsure = line("b", point(0.02, 0.001), slope=(-1.3, -2.0, -0.6))
    assert "and the two intervals overlap" in said(flat, unsure)


def test_many_comparisons_are_summed_up():
    def judged(low: float, half: float, winner: str):
        names = ("a", "b") if winner == "b" else ("b", "a")
        found = verdict(panel(line(names[0], point(0.03, half)), line(names[1], point(low, half))), "relmse")
        assert found is not None
        return found

    sure, unsure, other = judged(0.01, 0.001, "b"), judged(0.02, 0.02, "b"), judged(0.01, 0.001, "a")
    told = [(overall(found) or "").replace("\u00a0", " ") for found in ([sure], [sure, unsure], [sure, unsure, other])]
    assert told[0] == ""
    assert told[1].startswith("In both comparisons b has the lowest error, in 1 of them with a 95 % interval apart")
    assert "belongs to b (2 times, certain in 1) and a (1 time, certain in 1)" in told[2]
