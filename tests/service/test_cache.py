"""What is made of pictures is made once, kept within a limit, and never kept when making it failed."""

from __future__ import annotations

import threading
from concurrent.futures import ThreadPoolExecutor

import pytest

from service.pictures import Cache

THREADS = 16


def test_a_value_is_made_once_however_many_ask_at_once() -> None:
    cache, made, gate = Cache(100), [], threading.Barrier(THREADS)

    def make() -> bytes:
        made.append(1)
        threading.Event().wait(0.05)  # long enough for everybody to ask
        return b"picture"

    def ask(_: int) -> bytes:
        gate.wait()
        return cache.get("key", make)

    with ThreadPoolExecutor(THREADS) as pool:
        assert set(pool.map(ask, range(THREADS))) == {b"picture"}
    assert len(made) == 1


def test_a_failure_reaches_everybody_who_waits_and_is_forgotten() -> None:
    cache, gate = Cache(100), threading.Barrier(THREADS)

    def fail() -> bytes:
        threading.Event().wait(0.05)
        raise OSError("no such file")

    def ask(_: int) -> bytes:
        gate.wait()
        return cache.get("key", fail)

    with ThreadPoolExecutor(THREADS) as pool:
        for answer in [pool.submit(ask, index) for index in range(THREADS)]:
            with pytest.raises(OSError, match="no such file"):
                answer.result()
    assert cache.get("key", lambda: b"now it is there") == b"now it is there"


def test_the_least_used_go_first() -> None:
    cache = Cache(10)
    for key in "abc":
        cache.get(key, lambda: b"1234")
        cache.get("a", lambda: b"made again")
    assert cache.get("a", lambda: b"made again") == b"1234"
    assert cache.get("b", lambda: b"made again") == b"made again"
