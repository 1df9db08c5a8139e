"""Tables for a terminal: readable at any width, and fair to whom they compare."""

from __future__ import annotations

import pytest

from jobs.results import Point
from service.tables import show_errors

SAMPLERS = ["independent", "poissondisk:replay=zeros", "relaxedpoissondisk:min_dist=0.1,lloyd_iterations=3", "sobol"]


def points() -> list[Point]:
    return [
        Point("room", "path", sampler, spp, spp, "relmse", 4, mean / spp, mean / spp / 10)
        for sampler, mean in zip(SAMPLERS, (1.0, 0.1, 0.7, 0.5), strict=True)
        for spp in (4, 16, 64)
    ]


@pytest.mark.parametrize("width", [60, 80, 120, 400])
def test_every_number_and_every_name_is_there_at_any_width(
    width: int, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("COLUMNS", str(width))
    show_errors(points())
    told = capsys.readouterr().out
    assert "…" not in told and max(map(len, told.splitlines())) <= width
    for point in points():
        assert f"{point.mean:.3e}" in told
    letters = "".join(told.split())
    assert "lloyd_iterations=3" in letters or width < 100
    assert "(replay)" in letters


def test_samplers_stand_side_by_side_where_they_fit(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    for width, first in ((80, "sampler"), (400, "spp")):
        monkeypatch.setenv("COLUMNS", str(width))
        show_errors(points())
        assert capsys.readouterr().out.splitlines()[2].split()[0] == first


def test_a_replay_is_never_the_lowest(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    monkeypatch.setenv("COLUMNS", "400")
    monkeypatch.setenv("FORCE_COLOR", "1")
    show_errors(points())
    bold = [line.split("\x1b[1m")[1].split("\x1b")[0] for line in capsys.readouterr().out.splitlines() if "e-0" in line
            and "\x1b[1m" in line]  # fmt: skip
    assert [text.split(" ")[0] for text in bold] == [f"{0.5 / spp:.3e}" for spp in (4, 16, 64)]
