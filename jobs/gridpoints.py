"""
Point files of a grid: what ``pointset:file=my.npz`` means beside this grid.

The catalog knows that there is a file; here it is found and read, and the choice gets the digest of its points, so
that a file that changed is another sampler and its cells are other cells. The label keeps the file's base name. Two
files of one grid that share it keep the paths that are written: no two curves have one name. No Mitsuba is imported.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from pathlib import PurePath

from jobs.fields import Table
from renderer import catalog
from renderer.errors import BadParameter, shown
from renderer.samplers.pointfile import PointSource
from renderer.spec import Choice

PointFinder = Callable[[str], PointSource]  # raises DartboardError for what is no point file


def nowhere(name: str) -> PointSource:
    """The finder of a grid that lies beside no files. Raises ``BadParameter``."""
    raise BadParameter(f"point file {shown(name)}: this grid can name no files; send the file first")


def file_of(sampler: Choice) -> str | None:
    """The point file that a sampler draws, by its name in the grid; None for any other sampler."""
    return str(dict(sampler.parameters)["file"]) if sampler.name == "pointset" else None


def points_of(grid: Table, samplers: Iterable[Choice], find: PointFinder) -> dict[str, PointSource]:
    """The point files of a grid by their names in it. What is wrong is noted in the grid's problems and left out."""
    found: dict[str, PointSource] = {}
    for name in dict.fromkeys(filter(None, map(file_of, samplers))):
        source = grid.problems.attempt(lambda name=name: _placed(grid, name, find))  # type: ignore[misc]
        if source:
            found[name] = source
    return found


def bind(samplers: Iterable[Choice], found: dict[str, PointSource]) -> list[Choice]:
    """The samplers, each once, with the points of their files; those whose file was not found are left out."""
    names = _short_names(list(found.values()))
    bound: dict[str, Choice] = {}
    for sampler in samplers:
        name = file_of(sampler)
        if name in found:
            sampler = with_points(sampler, found[name], names[name])
        if name is None or name in found:
            bound.setdefault(sampler.text, sampler)
    return list(bound.values())


def with_points(sampler: Choice, source: PointSource, name: str) -> Choice:
    """A ``pointset`` that knows the content of its file, and is called by ``name``."""
    values = {**dict(sampler.parameters), "file": name, catalog.POINTS: source.digest}
    return replace(sampler, parameters=tuple(sorted(values.items())))


def check_count(source: PointSource, spp: int, where: str) -> None:
    """Raises ``BadParameter`` for more samples per pixel than a file has points in each set."""
    if spp > source.count:
        raise BadParameter(
            f"{where}: {spp} samples per pixel were asked, but each set of {shown(source.name)} has {source.count} "
            f"points; ask for at most {source.count}, or give a file with more points"
        )


def _placed(grid: Table, name: str, find: PointFinder) -> PointSource:
    """The file, or its error with the place where it is named."""
    try:
        return find(name)
    except BadParameter as error:
        raise BadParameter(f"{grid.place('samplers')}: {error}") from None


def _short_names(found: Sequence[PointSource]) -> dict[str, str]:
    """Base names, but for different files that share one: these keep what is written."""
    digests = {(PurePath(source.name).name, source.digest) for source in found}
    shared = Counter(base for base, _ in digests)
    bases = {source.name: PurePath(source.name).name for source in found}
    return {name: name if shared[base] > 1 else base for name, base in bases.items()}
