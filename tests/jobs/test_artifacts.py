"""Files of a data directory: whole or absent."""

from __future__ import annotations

import errno
import os

import pytest

from jobs import artifacts as module
from jobs.artifacts import Artifacts
from jobs.errors import DataDirectoryProblem
from tests.jobs.conftest import without_rights

DIGEST = "ab" + "0" * 62


def test_a_picture_has_one_place(artifacts, data):
    assert artifacts.picture(DIGEST, "cell", 7) == f"images/ab/{DIGEST}/cell-007.exr"
    assert artifacts.picture(DIGEST, "reference", 1234) == f"images/ab/{DIGEST}/reference-1234.exr"
    assert artifacts.path("images/x") == data / "images/x"


def test_adopting_moves_the_file_and_replaces_an_orphan(artifacts):
    name = artifacts.picture(DIGEST, "cell", 0)
    for content in ("of a process that died before its row", "of the next attempt"):
        (artifacts.work / "part").write_text(content)
        artifacts.adopt(artifacts.work / "part", name)
        assert artifacts.path(name).read_text() == content
        assert not (artifacts.work / "part").exists()


def test_the_file_is_on_disk_before_its_name_and_the_name_before_adopt_returns(artifacts, monkeypatch):
    """After a power cut there is no row without its file: content, rename, then every new folder up to a known one."""
    happened = []
    fsync, rename = os.fsync, module.Path.replace
    monkeypatch.setattr(module.os, "fsync", lambda fd: (happened.append(os.readlink(f"/proc/self/fd/{fd}")), fsync(fd)))
    monkeypatch.setattr(module.Path, "replace", lambda self, to: (happened.append("rename"), rename(self, to))[1])
    (artifacts.work / "part").write_text("picture")
    artifacts.adopt(artifacts.work / "part", artifacts.picture(DIGEST, "cell", 0))
    images = artifacts.data / "images"
    folders = [images / "ab" / DIGEST, images / "ab", images, artifacts.data]
    assert happened == [str(artifacts.work / "part"), "rename", *map(str, folders)]
    happened.clear()
    (artifacts.work / "part").write_text("picture")
    artifacts.adopt(artifacts.work / "part", artifacts.picture(DIGEST, "cell", 1))
    assert happened == [str(artifacts.work / "part"), "rename", str(folders[0])]


@pytest.mark.parametrize(
    ("number", "told"),
    [
        (errno.ENOSPC, "is full; free some space and run again: what was finished is there"),
        (errno.EDQUOT, "is full; free some space"),
        (errno.EROFS, r"cannot be written \(Read-only file system\); make it writable or choose another --data DIR"),
        (errno.EIO, "cannot be used: .*Input/output error.*; choose another --data DIR"),
    ],
)
def test_what_the_disk_refuses_is_one_sentence_and_the_file_stays(artifacts, monkeypatch, number, told):
    def refuse(descriptor):
        raise OSError(number, os.strerror(number))

    (artifacts.work / "part").write_text("picture")
    monkeypatch.setattr(module.os, "fsync", refuse)
    with pytest.raises(DataDirectoryProblem, match=told):
        artifacts.adopt(artifacts.work / "part", artifacts.picture(DIGEST, "cell", 0))
    assert (artifacts.work / "part").exists()
    assert not artifacts.path(artifacts.picture(DIGEST, "cell", 0)).exists()


def test_a_new_owner_finds_the_workshop_swept_and_the_pictures_in_place(artifacts, data):
    (artifacts.work / "half.exr").write_text("half")
    (artifacts.previews / "old.png").write_text("old")
    (artifacts.work / "part").write_text("picture")
    artifacts.adopt(artifacts.work / "part", artifacts.picture(DIGEST, "cell", 0))
    artifacts.write_log(3, "Segmentation fault")
    Artifacts(data).prepare()
    left = sorted(str(path.relative_to(data)) for path in data.rglob("*") if path.is_file())
    assert left == [artifacts.picture(DIGEST, "cell", 0), "logs/attempt-3.log"]
    assert list(artifacts.empty.iterdir()) == []


def test_a_log_is_kept_only_if_it_says_something(artifacts):
    assert artifacts.write_log(1, " \n") is None
    assert artifacts.path(artifacts.write_log(2, "LLVM ERROR: überlauf")).read_text() == "LLVM ERROR: überlauf"


def test_a_directory_without_rights_is_named(public_folder):
    error = without_rights(lambda: Artifacts(public_folder).prepare())
    assert isinstance(error, DataDirectoryProblem)
    assert f"the data directory {public_folder} cannot be written" in str(error)
