"""Pictures over HTTP: what is sent is what was rendered, in every form, and says for how long it may be kept."""

from __future__ import annotations

import io
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from jobs import queue
from jobs.dispatcher import Dispatcher
from jobs.store import Store
from renderer.images import read_picture
from renderer.metrics import METRICS, Reference
from renderer.previews import error_png, preview_png, to_half
from service import engine as engines
from service import schemas
from service.engine import Engine
from service.hub import Hub
from tests.jobs.painter import Painter
from tests.service.conftest import PAINT, House, answer, house_of, refusal

WIDTH, HEIGHT = 16, 12


@pytest.fixture
def finished(house: House) -> dict[str, schemas.Cell]:
    """One cell and its reference, finished and measured."""
    house.submit(samplers=["independent"], spp=[4])
    house.finish(1)
    page = answer(house.client.get("/api/experiments/1/cells"), schemas.Cells)
    return {cell.role: cell for cell in page.cells}


def file_of(house: House, cell: schemas.Cell, k: int) -> np.ndarray:
    with house.engine.readers.lend() as store:
        rows = store.rows("images", cell_id=cell.cell, role=cell.role)
    return read_picture(house.artifacts.path(rows[k]["image"]))


def pixels(house: House, cell: int, **query: object) -> np.ndarray:
    response = house.client.get(f"/api/cells/{cell}/pixels", params=query)
    assert response.headers["content-type"] == "application/octet-stream"
    size = int(response.headers["x-height"]), int(response.headers["x-width"])
    return np.frombuffer(response.content, "<f2").reshape(*size, 3)


def opened(content: bytes) -> np.ndarray:
    return np.asarray(Image.open(io.BytesIO(content)))


def test_pixels_are_the_picture_rounded_to_half(house: House, finished: dict[str, schemas.Cell]) -> None:
    """A cell's first replicate by default, a reference's mean; top row first."""
    cell, reference = finished["cell"], finished["reference"]
    for k in range(2):
        np.testing.assert_array_equal(pixels(house, cell.cell, k=k), to_half(file_of(house, cell, k)))
    np.testing.assert_array_equal(pixels(house, cell.cell), to_half(file_of(house, cell, 0)))
    mean = np.mean([file_of(house, reference, k) for k in range(2)], axis=0, dtype=float).astype(np.float32)
    np.testing.assert_array_equal(pixels(house, reference.cell, role="reference"), to_half(mean))
    assert pixels(house, cell.cell, size=16).shape == (HEIGHT, WIDTH, 3)


def test_previews_and_error_maps_are_made_of_the_same_pixels(house: House, finished: dict[str, schemas.Cell]) -> None:
    cell, reference = finished["cell"], finished["reference"]
    picture = file_of(house, cell, 1)
    shown = house.client.get(f"/api/cells/{cell.cell}/preview.png", params={"k": 1, "ev": 1.5, "tone": "gamma22"})
    np.testing.assert_array_equal(opened(shown.content), opened(preview_png(picture, ev=1.5, tone="gamma22")))
    against = Reference(*(file_of(house, reference, k) for k in range(2)))
    for name, metric in METRICS.items():
        query = {"reference": reference.cell, "k": 1, "max": 0.25}
        shown = house.client.get(f"/api/cells/{cell.cell}/error/{name}.png", params=query)
        expected = error_png(metric.error_map(picture, against), 0.25)
        np.testing.assert_array_equal(opened(shown.content), opened(expected), err_msg=name)


def test_a_picture_comes_as_the_file_that_was_rendered(house: House, finished: dict[str, schemas.Cell]) -> None:
    cell = finished["cell"]
    response = house.client.get(f"/api/cells/{cell.cell}/image.exr", params={"k": 1})
    with house.engine.readers.lend() as store:
        row = store.rows("images", cell_id=cell.cell, role="cell")[1]
    assert response.content == house.artifacts.path(row["image"]).read_bytes()
    assert "attachment" in response.headers["content-disposition"]


ADDRESSES = [
    "preview.png", "preview.png?k=1&v=done", "preview.png?k=mean", "preview.png?ev=2", "pixels", "pixels?k=mean",
    "pixels?size=16", "error/mse.png?reference={reference}", "error/mse.png?reference={reference}&k=mean&max=2",
    "error/relmse.png?reference={reference}",
]  # fmt: skip


def test_a_browser_asks_again_and_is_told_that_it_has_it(house: House, finished: dict[str, schemas.Cell]) -> None:
    """
    The same address shows another picture when another data directory is served, or when a mean has grown: nothing is
    kept without asking, and what is asked for again does not travel again.
    """
    tags = set()
    for address in ADDRESSES:
        path = f"/api/cells/{finished['cell'].cell}/" + address.format(reference=finished["reference"].cell)
        first = house.client.get(path)
        assert first.headers["cache-control"] == "private, no-cache"
        for _ in range(2):
            again = house.client.get(path, headers={"if-none-match": first.headers["etag"]})
            assert (again.status_code, again.content) == (304, b"")
            assert again.headers["etag"] == first.headers["etag"]
        other = house.client.get(path, headers={"if-none-match": '"other"'})
        assert (other.status_code, other.content) == (200, first.content)
        tags.add(first.headers["etag"])
    assert len(tags) == len(ADDRESSES), "different pictures, different tags"


def test_a_picture_of_another_data_directory_has_another_tag(
    house: House, finished: dict[str, schemas.Cell], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Cell 1 there is not cell 1 here, at the very same address."""
    here = house.client.get("/api/cells/1/pixels")
    painter = Painter()
    monkeypatch.setattr(engines, "LocalExecutor", lambda *_, **__: painter)
    engine = Engine(tmp_path / "other", PAINT, on_change=house.watch.poke)
    engine.start()
    there = house_of(engine, painter, house.watch, Hub())
    there.submit(samplers=["independent"], spp=[9])
    there.finish(1)
    answer = there.client.get("/api/cells/1/pixels", headers={"if-none-match": here.headers["etag"]})
    engine.stop()
    assert answer.status_code == 200
    assert answer.content != here.content


def test_a_reference_that_grows_changes_what_is_made_of_it(house: House, finished: dict[str, schemas.Cell]) -> None:
    """Another experiment wants more of it: its mean and the error maps are new, the first pictures are not."""
    cell, reference = finished["cell"].cell, finished["reference"].cell
    paths = {
        "mean": f"/api/cells/{reference}/preview.png?role=reference",
        "error": f"/api/cells/{cell}/error/mse.png?reference={reference}",
        "first": f"/api/cells/{reference}/preview.png?role=reference&k=0",
    }
    before = {name: house.client.get(path).headers["etag"] for name, path in paths.items()}
    house.submit(name="more", samplers=["independent"], spp=[4], reference={"spp": 64, "replicates": 4})
    house.finish(2)
    after = {name: house.client.get(path).headers["etag"] for name, path in paths.items()}
    assert {name for name in paths if before[name] != after[name]} == {"mean", "error"}


def test_while_nothing_is_finished_what_is_drawn_so_far_is_shown(house: House) -> None:
    """The small file of the render process, whatever its size; 404 before there is one; never to be kept."""
    house.painter.allowed = 0
    house.submit(samplers=["independent"], spp=[4])
    path = "/api/cells/1/preview.png?v=1"
    refusal(house.client.get(path), 404)
    refusal(house.client.get("/api/cells/1/pixels"), 404)
    refusal(house.client.get("/api/cells/1/error/mse.png?reference=1"), 404)

    def digest(store: Store, _: object) -> str:
        found = store.one("cell_by_id", id=1)
        assert found is not None
        return str(found["digest"])

    partial = np.full((HEIGHT, WIDTH, 3), 0.5, np.float16)
    np.save(house.artifacts.preview(house.do(digest)), partial)
    response = house.client.get(path)
    np.testing.assert_array_equal(opened(response.content), opened(preview_png(partial.astype(np.float32))))
    assert response.headers["cache-control"] == "no-store"
    house.artifacts.preview(house.do(digest)).write_bytes(b"half a file")
    refusal(house.client.get(path), 404)


@pytest.mark.parametrize("query, word", [
    ({"size": 100}, ""), ({"ev": 21}, ""), ({"ev": "nan"}, ""), ({"tone": "aces"}, "srgb"), ({"k": "-1"}, ""),
    ({"k": "one"}, "mean"), ({"role": "lamp"}, ""), ({"max": 0}, ""), ({"max": "inf"}, ""), ({"k": "²"}, ""),
])  # fmt: skip
def test_what_no_preview_has_is_refused(
    house: House, finished: dict[str, schemas.Cell], query: dict[str, object], word: str
) -> None:
    found = refusal(house.client.get(f"/api/cells/{finished['cell'].cell}/preview.png", params=query), 422)
    assert word in found.detail


@pytest.mark.parametrize("path", ["preview.png", "pixels", "image.exr", "attempts", "error/mse.png?reference=1"])
@pytest.mark.parametrize("cell", [99, 2**63 - 1])
def test_an_unknown_cell_is_404(house: House, path: str, cell: int) -> None:
    refusal(house.client.get(f"/api/cells/{cell}/{path}"), 404, "not-found")


def test_a_replicate_that_nobody_wanted_and_a_metric_that_nobody_knows(
    house: House, finished: dict[str, schemas.Cell]
) -> None:
    cell, reference = finished["cell"].cell, finished["reference"].cell
    refusal(house.client.get(f"/api/cells/{cell}/pixels?k=2"), 404)
    refusal(house.client.get(f"/api/cells/{cell}/error/psnr.png?reference={reference}"), 422, "unknown-name")
    refusal(house.client.get(f"/api/cells/{cell}/error/mse.png?reference={cell}"), 404)


@pytest.mark.parametrize(
    "damage", [Path.unlink, lambda path: path.write_bytes(b"half a file")], ids=["gone", "damaged"]
)
def test_a_picture_whose_file_is_gone_says_so(
    house: House, finished: dict[str, schemas.Cell], damage: Callable[[Path], object]
) -> None:
    """Somebody tidied up in the data directory: a sentence without its path, and all else is still shown."""
    cell, reference = finished["cell"].cell, finished["reference"].cell
    with house.engine.readers.lend() as store:
        path = house.artifacts.path(store.rows("images", cell_id=cell, role="cell")[0]["image"])
    damage(path)
    for form in ("preview.png", "pixels", f"error/mse.png?reference={reference}", "preview.png?k=mean"):
        detail = refusal(house.client.get(f"/api/cells/{cell}/{form}"), 404, "not-found").detail
        assert "gone or damaged" in detail and str(house.artifacts.data) not in detail
    assert house.client.get(f"/api/cells/{cell}/preview.png?k=1").status_code == 200
    assert answer(house.client.get("/api/experiments/1/cells"), schemas.Cells).cells[0].metrics


def test_the_log_of_a_try_that_failed(house: House) -> None:
    """The last words of its render process, or that they are gone."""
    house.painter.allowed = 0
    house.submit(samplers=["independent"], spp=[4], reference=False)

    def fail(store: Store, dispatcher: Dispatcher) -> None:
        (work,) = dispatcher.under_way.values()
        kept = dispatcher.artifacts.write_log(work.attempt_id, "the last words")
        queue.fail(store, work, "nan_output", "3 pixels are NaN", kept)

    house.watch.until(lambda: house.engine.moment.drawing)
    house.do(fail)
    (tried,) = answer(house.client.get("/api/cells/1/attempts"), schemas.Attempts).attempts
    assert (tried.outcome, tried.error, tried.log) == ("nan_output", "3 pixels are NaN", "the last words")
    (cell,) = answer(house.client.get("/api/experiments/1/cells"), schemas.Cells).cells
    assert (cell.state, cell.error_class, cell.error) == ("failed", "nan_output", "3 pixels are NaN")
    for log in house.artifacts.logs.iterdir():
        log.unlink()
    (tried,) = answer(house.client.get("/api/cells/1/attempts"), schemas.Attempts).attempts
    assert tried.log == "(the log is gone)"


def test_the_history_of_a_cell(house: House, finished: dict[str, schemas.Cell]) -> None:
    found = answer(house.client.get(f"/api/cells/{finished['cell'].cell}/attempts"), schemas.Attempts)
    assert [one.outcome for one in found.attempts] == ["done"]
    assert found.attempts[0].ended_at is not None


def test_a_real_render_is_served(rendered: House) -> None:
    """The whole way once with Mitsuba: rendered, measured, sent; error falls and brightness is right."""
    page = answer(rendered.client.get("/api/experiments/1/cells"), schemas.Cells)
    cells = {(cell.sampler, cell.spp): cell for cell in page.cells if cell.role == "cell"}
    for sampler in ("independent", "stratified"):
        few, many = cells[sampler, 4], cells[sampler, 16]
        assert few.metrics["relmse"][0] > many.metrics["relmse"][0]
        assert many.seconds is not None
    shown = pixels(rendered, cells["independent", 16].cell)
    assert shown.shape == (HEIGHT, WIDTH, 3)
    assert 0.05 < float(shown.mean()) < 5
