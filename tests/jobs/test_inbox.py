"""Requests to an owner without a server."""

from __future__ import annotations

import logging
import os
import subprocess
import sys
from pathlib import Path

import pytest

from jobs import inbox
from jobs.errors import DataDirectoryProblem
from tests.jobs.conftest import without_rights

ROOT = Path(__file__).parents[2]


def test_requests_come_in_the_order_they_were_posted_and_vanish(tmp_path):
    posted = [inbox.post(tmp_path, what, number) for number, what in enumerate(["cancel", "retry", "cancel"], start=1)]
    taken = []
    for request in inbox.take(tmp_path):
        assert posted[len(taken)].exists(), "it vanishes only after it was served"
        taken.append(request)
    assert [tuple(request.values()) for request in taken] == [("cancel", 1), ("retry", 2), ("cancel", 3)]
    assert not any(path.exists() for path in posted)
    assert list(inbox.take(tmp_path)) == []


def test_no_inbox_means_no_requests(tmp_path):
    assert list(inbox.take(tmp_path / "nowhere")) == []


@pytest.mark.parametrize(
    "content",
    [
        "", "{", "[]", "null", "[" * 4000, "\x00\udcff", '{"do": "cancel"}', '{"do": "explode", "experiment": 1}',
        '{"do": ["cancel"], "experiment": 1}', '{"do": "retry", "experiment": "1"}',
        '{"do": "retry", "experiment": true}', '{"do": "retry", "experiment": 1e400}',
        '{"do": "cancel", "experiment": 99999999999999999999}',
    ],
)  # fmt: skip
def test_what_is_no_request_is_logged_and_dropped_and_the_next_is_served(tmp_path, content, caplog):
    (tmp_path / "inbox").mkdir()
    bad = tmp_path / "inbox" / "0.json"
    bad.write_bytes(content.encode("utf-8", "surrogateescape"))
    inbox.post(tmp_path, "retry", 5)
    with caplog.at_level(logging.WARNING, "dartboard"):
        assert [request["experiment"] for request in inbox.take(tmp_path)] == [5]
    assert "0.json in the inbox is ignored" in caplog.text
    assert not bad.exists()


def test_what_is_still_being_written_is_left_alone(tmp_path):
    (tmp_path / "inbox").mkdir()
    part = tmp_path / "inbox" / "1.part"
    part.write_text('{"do": "can')
    (tmp_path / "inbox" / "folder.json").mkdir()
    assert list(inbox.take(tmp_path)) == []
    assert part.exists()


def test_a_request_whose_owner_is_killed_while_serving_it_comes_again(tmp_path):
    inbox.post(tmp_path, "cancel", 1)
    code = "import os, sys; from pathlib import Path; from jobs import inbox\n"
    code += "for request in inbox.take(Path(sys.argv[1])): os.kill(os.getpid(), 9)"
    assert subprocess.run([sys.executable, "-c", code, str(tmp_path)], cwd=ROOT).returncode == -9
    assert [request["experiment"] for request in inbox.take(tmp_path)] == [1]


def test_a_request_that_breaks_its_owner_does_not_come_again(tmp_path):
    inbox.post(tmp_path, "cancel", 1)
    with pytest.raises(ZeroDivisionError):
        for _ in inbox.take(tmp_path):
            raise ZeroDivisionError
    assert list(inbox.take(tmp_path)) == []


def test_who_may_not_write_is_told_another_way(public_folder):
    error = without_rights(lambda: inbox.post(public_folder, "cancel", 1))
    assert isinstance(error, DataDirectoryProblem)
    assert "cannot leave a request" in str(error) and "Ctrl-C" in str(error)
    assert not os.listdir(public_folder)
