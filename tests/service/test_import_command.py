"""``dartboard import`` as people type it: a folder that is a Mitsuba scene, whole or not there at all."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from renderer.errors import DartboardError
from renderer.scenes import sources
from service.importing import import_scene
from tests.service.test_cli import dartboard

SCENE = (
    'Film "image" "integer xresolution" 8 "integer yresolution" 8\nWorldBegin\nShape "sphere" "float x" 1\nWorldEnd\n'
)


def test_a_folder_to_edit(tmp_path: Path) -> None:
    (tmp_path / "a.pbrt").write_text(SCENE)
    done = dartboard("import", tmp_path / "a.pbrt", "-o", tmp_path / "out", "--json")
    assert done.returncode == 0, done.stderr
    told = json.loads(done.stdout)
    assert told["notes"] == ['a.pbrt, line 3: "float x" is no parameter of Shape "sphere" here; it is ignored']
    source = sources.find("out", tmp_path)
    assert (source.defaults.width, source.defaults.spp) == (told["width"], told["spp"]) == (8, 16)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["a.pbrt", "out"]


@pytest.mark.parametrize(
    ("text", "output", "words"),
    [
        ("Shpae", "out", "a.pbrt, line 1: unknown directive"),
        (SCENE, "a.pbrt", "is there already"),
        (SCENE, "none/out", "make it first"),
    ],
)
def test_bad_input_leaves_nothing(tmp_path: Path, text: str, output: str, words: str) -> None:
    (tmp_path / "a.pbrt").write_text(text)
    with pytest.raises(DartboardError, match=words):
        import_scene(tmp_path / "a.pbrt", tmp_path / output)
    assert [path.name for path in tmp_path.iterdir()] == ["a.pbrt"]


def test_only_pbrt_files(tmp_path: Path) -> None:
    (tmp_path / "a.xml").write_text("<scene/>")
    for name, words in (("a.xml", "needs no import"), ("none.pbrt", "no scene at")):
        with pytest.raises(DartboardError, match=words):
            import_scene(tmp_path / name, tmp_path / "out")
