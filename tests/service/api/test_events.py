"""
The streams behind every open page, over real sockets: what a page is told makes it show what is true, whatever happens
in between, also to the connection.
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator

import pytest

from service import schemas
from service.app import create
from service.hub import RETRY_MILLISECONDS, Hub
from service.security import HEADERS
from tests.service.conftest import PATIENCE, House, measure, refusal
from tests.service.live import Live, Page, eventually


@pytest.fixture
def live(house: House, monkeypatch: pytest.MonkeyPatch) -> Iterator[Live]:
    """The house again, with a hub of its own, behind a socket."""
    monkeypatch.setattr("service.hub.KEEP_ALIVE_SECONDS", 2.0 * PATIENCE)  # a stream that is silent fails its test
    house.hub = Hub()
    house.engine.on_change = lambda: (house.hub.poke(), house.watch.poke())  # type: ignore[func-returns-value]
    house.app = create(house.engine, house.hub)
    live = Live(house)
    live.start()
    yield live
    live.stop()


def test_a_stream_begins_with_how_things_stand(house: House, live: Live) -> None:
    """How soon to come back, then an update with an id; the headers of every answer, and no compression."""
    house.painter.allowed = 0
    number = house.submit().id
    stream = live.follow(f"/api/experiments/{number}/events", accept_encoding="gzip")
    response = stream.response
    for name, value in HEADERS.items():
        assert response.getheader(name.decode()) == value.decode()
    assert response.getheader("cache-control") == "no-cache"
    assert response.getheader("content-encoding") is None
    assert response.read(len(f"retry: {RETRY_MILLISECONDS}\n\n")) == f"retry: {RETRY_MILLISECONDS}\n\n".encode()
    update = stream.update()
    assert (update.experiment.id, update.reload, update.cells) == (number, False, [])
    stream.close()


def test_a_page_that_follows_shows_what_is_true_after_every_picture(house: House, live: Live) -> None:
    """One picture at a time: each comes as an update of its cells, with the numbers as soon as they are measured."""
    house.painter.allowed = 0
    number = house.submit().id
    page = Page(house, number).load()
    stream = live.follow(f"/api/experiments/{number}/events?after={page.revision}")
    page.apply(stream.update())
    for drawn in range(1, 11):
        house.painter.allow(1)
        while sum(row.had for row in page.rows.values()) < drawn:
            page.apply(stream.update())
    while page.house.experiment(number).state != "done" or not page.is_true():
        page.apply(stream.update())
    assert all(len(row.metrics) == 4 for row in page.rows.values() if row.role == "cell")
    stream.close()


def test_progress_is_told_of_what_is_drawn_for_this_experiment(house: House, live: Live) -> None:
    house.painter.allowed = 0
    mine, other = house.submit(), house.submit(name="other", spp=[9], reference=False)
    here, there = (live.follow(f"/api/experiments/{found.id}/events") for found in (mine, other))
    house.painter.allow(1)
    progress = schemas.Progress.model_validate_json(here.next("progress").data)
    cells = {cell.cell for cell in Page(house, mine.id).load().rows.values()}
    assert progress.cell in cells
    assert (progress.role, progress.done, progress.passes) == ("cell", 1, 1)
    house.painter.allow(9)
    there.until(lambda update: update.worker.experiment == other.id)
    assert not [event for event in there.seen if event.name == "progress"]
    here.close()
    there.close()


def test_a_stream_goes_on_from_the_last_event_that_was_seen(house: House, live: Live) -> None:
    """The connection breaks, two pictures are drawn meanwhile: exactly those come, and nothing a second time."""
    house.painter.allowed = 2
    number = house.submit(reference=False).id
    page = Page(house, number).load()
    stream = live.follow(f"/api/experiments/{number}/events?after={page.revision}")
    while not (page.is_true() and sum(row.had for row in page.rows.values()) == 2):
        page.apply(stream.update())
    stream.close()
    again = live.follow(f"/api/experiments/{number}/events?after=0", Last_Event_ID=str(page.revision))
    update = again.update()
    assert (update.reload, update.cells) == (False, []), "the header counts more than the address, and nothing is new"
    again.close()
    before = dict(page.rows)
    house.painter.allow(2)
    house.watch.until(lambda: house.count("replicate") == 4 and house.engine.moment.revision == revision(house))
    third = live.follow(f"/api/experiments/{number}/events", Last_Event_ID=str(page.revision))
    told = []
    while not page.is_true():
        page.apply(update := third.update())
        assert not update.reload
        told += [cell.position for cell in update.cells]
    assert sorted(told) == [place for place, row in page.rows.items() if before[place] != row]
    third.close()


def revision(house: House) -> int:
    with house.engine.readers.lend() as store:
        return store.revision()


@pytest.mark.parametrize("action", ["pause", "resume", "cancel", "retry"])
def test_what_happens_to_all_of_it_is_a_word_to_load_again(house: House, live: Live, action: str) -> None:
    house.painter.allowed = 1
    number = house.submit().id
    if action == "resume":
        house.client.post(f"/api/experiments/{number}/pause")
    page = Page(house, number).load()
    stream = live.follow(f"/api/experiments/{number}/events?after={page.revision}")
    page.apply(stream.update())
    house.client.post(f"/api/experiments/{number}/{action}")
    update = stream.until(lambda update: update.reload)[-1]
    page.apply(update)
    assert update.experiment.state == {"pause": "paused", "cancel": "cancelled"}.get(action, update.experiment.state)
    while not page.is_true():
        page.apply(stream.update())
    stream.close()


def test_a_revision_of_another_database_is_a_word_to_load_again(house: House, live: Live) -> None:
    """A page that was open when the data directory was replaced."""
    number = house.submit().id
    stream = live.follow(f"/api/experiments/{number}/events", Last_Event_ID="123456789")
    update = stream.update()
    assert update.reload
    assert update.revision < 123456789
    stream.close()


def test_a_deleted_experiment_says_so_and_ends(house: House, live: Live) -> None:
    house.painter.allowed = 1
    number = house.submit().id
    stream = live.follow(f"/api/experiments/{number}/events")
    stream.update()
    assert house.client.delete(f"/api/experiments/{number}").status_code == 200
    assert stream.rest()[-1].name == "gone"
    refusal(house.client.get(f"/api/experiments/{number}/events"), 404, "experiment-deleted")
    refusal(house.client.get("/api/experiments/99/events"), 404, "not-found")
    assert house.client.post(f"/api/experiments/{number}/restore").status_code == 200
    back = live.follow(f"/api/experiments/{number}/events?after=0")
    assert back.update().reload
    back.close()


def test_what_another_experiment_draws_is_news_where_it_is_shared(house: House, live: Live) -> None:
    house.painter.allowed = 0
    one = house.submit(name="one", spp=[4], reference=False)
    two = house.submit(name="two", spp=[4, 9], reference=False)
    house.client.post(f"/api/experiments/{two.id}/pause")
    page = Page(house, two.id).load()
    stream = live.follow(f"/api/experiments/{two.id}/events?after={page.revision}")
    house.painter.allow(100)
    house.finish(one.id)
    while not page.is_true():
        page.apply(stream.update())
    assert [row.had for row in page.rows.values() if row.spp == 4] == [2, 2]
    stream.close()


def test_thirty_pages_end_up_with_the_same_truth(house: House, live: Live) -> None:
    """Opened at different times, reading at their own pace, one of them reconnecting all the time."""
    house.painter.allowed = 0
    number = house.submit(spp=[1, 2, 3, 4, 5], samplers=["independent", "stratified", "multijitter"]).id
    pages = [Page(house, number) for _ in range(30)]
    failures: list[BaseException] = []

    def follow(page: Page, restless: bool) -> None:
        try:
            page.load()
            stream = live.follow(f"/api/experiments/{number}/events?after={page.revision}")
            while True:
                update = stream.update()
                page.apply(update)
                if update.experiment.state == "done" and update.worker.state == "idle" and page.is_true():
                    break
                if restless:
                    stream.close()
                    stream = live.follow(f"/api/experiments/{number}/events", Last_Event_ID=str(page.revision))
            stream.close()
        except BaseException as error:
            failures.append(error)

    threads = [threading.Thread(target=follow, args=(page, index == 0)) for index, page in enumerate(pages)]
    for thread in threads:
        thread.start()
        house.painter.allow(2)
    for thread in threads:
        thread.join()
    assert not failures
    assert all(page.rows == pages[0].rows for page in pages)
    assert all(row.state == "done" for row in pages[0].rows.values())


def test_a_page_that_is_closed_leaves_nothing_behind(house: House, live: Live, monkeypatch: pytest.MonkeyPatch) -> None:
    """No task, no message kept for it, no connection to the database: however it goes away, at the next comment."""
    monkeypatch.setattr("service.hub.KEEP_ALIVE_SECONDS", 0.1)
    number = house.submit().id
    house.finish(number)
    eventually(lambda: not house.hub.shared)
    before = live.tasks()
    for _ in range(3):
        streams = [live.follow(f"/api/experiments/{number}/events?after={after}") for after in range(10)]
        streams += [live.follow("/api/events") for _ in range(10)]
        for stream in streams:
            stream.next("update")
        assert live.tasks() > before
        for index, stream in enumerate(streams):
            stream.tear() if index % 2 else stream.close()
        eventually(lambda: live.tasks() == before and not house.hub.shared)
    assert house.engine.readers.free.qsize() <= 6


def test_the_list_follows_every_experiment_and_the_worker(house: House, live: Live) -> None:
    stream = live.follow("/api/events")

    def until(condition: Callable[[schemas.Overview], bool]) -> schemas.Overview:
        while not condition(found := schemas.Overview.model_validate_json(stream.next("update").data)):
            pass
        return found

    assert until(lambda seen: True).experiments == []
    house.painter.allowed = 0
    first = house.submit(name="first", reference=False)
    seen = until(lambda seen: seen.worker.state == "rendering")
    assert [found.name for found in seen.experiments] == ["first"]
    second = house.submit(name="second", spp=[1])
    house.painter.allow(100)
    seen = until(lambda seen: [found.state for found in seen.experiments] == ["done", "done"])
    assert [found.id for found in seen.experiments] == [second.id, first.id]
    house.client.delete(f"/api/experiments/{first.id}")
    until(lambda seen: [found.id for found in seen.experiments] == [second.id])
    stream.close()


def test_a_stall_is_on_every_page_and_goes_from_it(house: House, live: Live, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("service.engine.RETRY_SECONDS", 0.01)
    obstacle = house.artifacts.data / "images"
    obstacle.write_text("in the way")
    number = house.submit().id
    stream = live.follow(f"/api/experiments/{number}/events")
    stalled = stream.until(lambda update: update.worker.state == "stalled")[-1]
    assert stalled.worker.trouble and "a data directory is a folder" in stalled.worker.trouble
    obstacle.unlink()
    stream.until(lambda update: update.worker.state == "idle" and update.experiment.state == "done")
    house.do(lambda store, dispatcher: measure(dispatcher))
    stream.close()


def test_a_server_that_ends_ends_its_streams(house: House, live: Live) -> None:
    """A whole stream up to its last event, and a clean end: a browser comes back by itself."""
    number = house.submit().id
    house.finish(number)
    streams = [live.follow(f"/api/experiments/{number}/events"), live.follow("/api/events")]
    for stream in streams:
        stream.next("update")
    live.server.should_exit = True
    for stream in streams:
        assert {event.name for event in stream.rest()} == {"update"}


@pytest.mark.parametrize(
    "path", ["events?after=-1", "events?after=x", "events?after=99999999999999999999", "events?after=1.5"]
)
def test_a_revision_that_is_none_is_refused(house: House, path: str) -> None:
    number = house.submit().id
    refusal(house.client.get(f"/api/experiments/{number}/{path}"), 422)


@pytest.mark.parametrize("seen", ["-1", "x", "9" * 30, "1.5"])
def test_a_last_event_that_is_none_is_refused(house: House, seen: str) -> None:
    number = house.submit().id
    refusal(house.client.get(f"/api/experiments/{number}/events", headers={"last-event-id": seen}), 422)
