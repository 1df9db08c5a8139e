"""
Thumbnails: pictures small enough that a whole report can be sent by mail.

Each is one replicate of a cell, or the mean of a reference, tone-mapped and inlined as a PNG. Noise hardly shrinks, so
the size in pixels decides: the largest that fits the budget is taken for all, and where even the smallest does not fit,
some columns of spp are left out. The report says so.
"""

from __future__ import annotations

import base64
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from jobs.artifacts import Artifacts
from jobs.store import Row
from renderer.errors import DartboardError
from renderer.images import read_picture
from renderer.previews import preview_png, shrink
from service.report.panels import Panel

BUDGET_BYTES = 5_500_000  # of all pictures as text: with the plots' 1.2 MB and the numbers about 8 MB at most
SIDES = (256, 192, 128, 96, 64, 48, 32)  # pixels of the longer side
LEAST_SHOWN = 100  # pixels; smaller ones are doubled
TRIED = 6  # pictures that are made to learn how large they become


@dataclass
class Thumbnails:
    """
    side     pixels of the longer side, at most
    width    pixels of the widest of them
    reduced  True if pictures are larger than that in truth
    spp      panel's id → which columns have pictures
    uris     (cell, role) → data URI
    """

    side: int
    width: int = 0
    reduced: bool = False
    spp: dict[str, list[int]] = field(default_factory=dict)
    uris: dict[tuple[int, str], str] = field(default_factory=dict)

    @property
    def shown(self) -> int:
        """Pixels of a page that a picture gets: as many as it has, or twice as many where that is little."""
        return self.width if self.width > LEAST_SHOWN else 2 * self.width

    def of(self, cell: Row) -> str | None:
        return self.uris.get((cell["cell"], cell["role"]))

    def left_out(self, panel: Panel) -> bool:
        return len(self.spp[panel.id]) < len(panel.spp)


def thumbnails(panels: Sequence[Panel], artifacts: Artifacts, budget: int = BUDGET_BYTES) -> Thumbnails:
    """The pictures of all panels, as large and as many as ``budget`` bytes hold."""
    every = (cell for panel in panels for cell in _cells(panel, panel.spp) if cell["images"])
    drawn = list({(cell["cell"], cell["role"]): cell for cell in every}.values())
    made = Thumbnails(SIDES[-1])
    size = 0.0
    for made.side in SIDES:
        size = _typical(drawn, artifacts, made.side)
        if size * len(drawn) <= budget:
            break
    fits = size * len(drawn) <= budget
    for panel in panels:
        made.spp[panel.id] = panel.spp if fits else _columns(panel.spp, _share(panels, budget / size))
        for cell in _cells(panel, made.spp[panel.id]):
            key = (cell["cell"], cell["role"])
            if key not in made.uris and (picture := _picture(cell, artifacts)) is not None:
                small = shrink(picture, made.side)
                made.uris[key] = _uri(small)
                made.width = max(made.width, small.shape[1])
                made.reduced = made.reduced or small.shape != picture.shape
    return made


def _cells(panel: Panel, spp: Sequence[int]) -> Iterator[Row]:
    if panel.reference:
        yield panel.reference
    for line in panel.lines:
        yield from (line.cells[asked] for asked in spp if asked in line.cells)


def _share(panels: Sequence[Panel], pictures: float) -> float:
    """Of all columns, how much so many pictures fill, once every reference has one of them."""
    references = sum(panel.reference is not None for panel in panels)
    return max(0.0, pictures - references) / sum(len(panel.lines) * len(panel.spp) for panel in panels)


def _columns(spp: list[int], share: float) -> list[int]:
    """As many as fit a share of the budget, evenly spread, the highest among them."""
    count = min(len(spp), int(share * len(spp)))
    if count <= 1:
        return spp[len(spp) - count :]
    return [spp[round(place * (len(spp) - 1) / (count - 1))] for place in range(count)]


def _typical(cells: list[Row], artifacts: Artifacts, side: int) -> float:
    """Bytes of a thumbnail: the mean over some of them, and a little more."""
    some = cells[:: max(1, len(cells) // TRIED)]
    sizes = [len(_uri(shrink(picture, side))) for cell in some if (picture := _picture(cell, artifacts)) is not None]
    return 1.1 * sum(sizes) / len(sizes) if sizes else 0.0


def _picture(cell: Row, artifacts: Artifacts) -> NDArray[np.float32] | None:
    """The mean of a cell's pictures; None where there are none, or a file is lost."""
    try:
        pictures = [read_picture(artifacts.path(name)) for name in cell["images"]]
    except DartboardError:
        return None
    return np.asarray(np.mean(pictures, axis=0, dtype=np.float64), np.float32) if pictures else None


def _uri(picture: NDArray[np.float32]) -> str:
    return "data:image/png;base64," + base64.b64encode(preview_png(picture)).decode()
