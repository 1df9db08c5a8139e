"""The hub, step by step: one piece of work for all pages, and no page that is told less than it believes."""

from __future__ import annotations

import asyncio
import json
import threading

import pytest

from renderer.errors import DartboardError
from service import hub as hubs
from service.api.events import Follower
from service.engine import Moment
from service.hub import EndOfStream, Hub, event, stream
from tests.service.conftest import House


class FakeEngine:
    moment = Moment()


def test_work_is_shared_by_all_who_ask_in_one_step() -> None:
    async def main() -> None:
        hub, done = Hub(), []

        async def work() -> bytes:
            await asyncio.sleep(0)
            done.append(1)
            return b"news %d" % len(done)

        first = await asyncio.gather(*(hub.share(("a",), work) for _ in range(50)))
        assert set(first) == {b"news 1"}
        assert await hub.share(("b",), work) == b"news 2"
        hub.shared.clear()  # a step
        assert await hub.share(("a",), work) == b"news 3"

    asyncio.run(main())


def test_one_that_goes_away_takes_nothing_from_the_others() -> None:
    async def main() -> None:
        hub, gate = Hub(), asyncio.Event()

        async def work() -> bytes:
            await gate.wait()
            return b"news"

        leaving, staying = (asyncio.ensure_future(hub.share(("a",), work)) for _ in range(2))
        await asyncio.sleep(0)
        leaving.cancel()
        gate.set()
        assert await staying == b"news"

    asyncio.run(main())


def test_an_error_reaches_all_who_wait_for_it_and_nobody_later() -> None:
    async def main() -> None:
        hub = Hub()

        async def fail() -> bytes:
            raise DartboardError("no")

        told = await asyncio.gather(*(hub.share(("a",), fail) for _ in range(3)), return_exceptions=True)
        assert [str(error) for error in told] == ["no"] * 3
        hub.shared.clear()

        async def work() -> bytes:
            return b"news"

        assert await hub.share(("a",), work) == b"news"

    asyncio.run(main())


def test_nothing_is_kept_where_nothing_happens(monkeypatch: pytest.MonkeyPatch) -> None:
    """Pages that come and go while the engine sleeps, each with a revision of its own."""
    monkeypatch.setattr(hubs, "STEP_SECONDS", 0.001)

    async def main() -> None:
        hub = Hub()

        async def work() -> bytes:
            return b"news"

        for seen in range(100):
            await hub.share((1, seen), work)
        while hub.shared:
            await asyncio.sleep(0.001)

    asyncio.run(main())


def test_a_poke_is_heard_from_any_thread_and_at_any_time() -> None:
    """Before there is a loop, while it runs, and after it has ended."""
    hub = Hub()
    hub.poke()

    async def main() -> None:
        turning = asyncio.ensure_future(hub.run())
        await asyncio.sleep(0)
        seen = hub.turned
        thread = threading.Thread(target=hub.poke)
        thread.start()
        assert await hub.step(seen)
        thread.join()
        turning.cancel()

    asyncio.run(main())
    hub.poke()


def test_a_page_that_is_told_what_another_had_asked_for_misses_nothing(house: House) -> None:
    """
    Two pages have seen the same. The first is answered, then something happens, and the second is answered with the
    same words within the same step: it has to go on from what these words say, and not from now.
    """
    house.painter.allowed = 0
    number = house.submit().id
    house.client.post(f"/api/experiments/{number}/pause")
    house.watch.until(lambda: house.engine.moment.state == "idle")
    start = house.engine.moment.revision

    async def main() -> None:
        hub = Hub()
        first, second = (Follower(house.engine, hub, number, start) for _ in range(2))
        told = await first.news(house.engine.moment)
        await asyncio.to_thread(house.client.post, f"/api/experiments/{number}/cancel")
        same = await second.news(house.engine.moment)
        assert same == told
        assert second.seen == first.seen
        hub.shared.clear()  # the next step
        for page in (first, second):
            news = await page.news(house.engine.moment)
            assert news is not None
            update = json.loads(news.decode().partition("data: ")[2])
            assert update["reload"]
            assert update["experiment"]["state"] == "cancelled"
            assert await page.news(house.engine.moment) is None

    asyncio.run(main())


def test_a_stream_keeps_its_connection_alive(monkeypatch: pytest.MonkeyPatch) -> None:
    """A comment when nothing happens for long: proxies and browsers close what is silent."""
    monkeypatch.setattr(hubs, "KEEP_ALIVE_SECONDS", 0.001)

    async def main() -> None:
        hub = Hub()

        async def nothing(moment: Moment) -> None:
            return None

        told = stream(hub, FakeEngine, nothing)  # type: ignore[arg-type]
        assert await anext(told) == b"retry: 1000\n\n"
        assert [await anext(told) for _ in range(3)] == [b": still here\n\n"] * 3
        hub.close()
        assert [message async for message in told] == []

    asyncio.run(main())


def test_a_stream_ends_with_its_last_word() -> None:
    async def main() -> None:
        async def end(moment: Moment) -> bytes:
            raise EndOfStream(b"bye")

        assert [message async for message in stream(Hub(), FakeEngine, end)][1:] == [b"bye"]  # type: ignore[arg-type]

    asyncio.run(main())


def test_a_page_whose_news_cannot_be_read_waits_for_the_next_step() -> None:
    """A disk that stumbles for a moment is no reason to hang up."""

    async def main() -> None:
        hub, tries = Hub(), iter([DartboardError("the disk"), b"news"])

        async def news(moment: Moment) -> bytes:
            found = next(tries)
            if isinstance(found, DartboardError):
                raise found
            return found

        told = stream(hub, FakeEngine, news)  # type: ignore[arg-type]
        assert await anext(told) == b"retry: 1000\n\n"
        waiting = asyncio.ensure_future(anext(told))
        await asyncio.sleep(0)
        await asyncio.sleep(0)
        hub._turn()
        assert await waiting == b"news"

    asyncio.run(main())


def test_a_hub_that_is_closing_begins_no_stream() -> None:
    async def main() -> None:
        hub = Hub()
        hub.close()

        async def news(moment: Moment) -> bytes:
            raise AssertionError("nobody may be told anything now")

        assert [message async for message in stream(hub, FakeEngine, news)] == [b"retry: 1000\n\n"]  # type: ignore[arg-type]

    asyncio.run(main())


def test_events_are_written_as_the_standard_reads_them() -> None:
    assert event("update", '{"a":"b\\n"}', 7) == b'event: update\nid: 7\ndata: {"a":"b\\n"}\n\n'
    assert event("gone", "{}") == b"event: gone\ndata: {}\n\n"
