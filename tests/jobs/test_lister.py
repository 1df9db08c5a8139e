"""Asking a real child what can be swept in a scene, and what becomes of the question when the child does not answer."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from jobs import lister as module
from jobs.lister import SceneLister
from renderer import devices
from renderer.errors import EnvironmentProblem, SceneError
from renderer.scenes import sources

ROOM = Path(__file__).resolve().parent.parent / "renderer"  # the folder of a scene for tests, "swept"


def test_a_scene_is_asked_once(monkeypatch: pytest.MonkeyPatch) -> None:
    lister = SceneLister(lambda: devices.pick("llvm"))
    source = sources.find("swept", ROOM)
    known = lister(source, "rgb")
    assert known is not None and known["white_sphere.bsdf.alpha"].now == 0.25
    assert known["near_sphere.bsdf.reflectance.value"].now == (0.85, 0.36, 0.08)

    def refuse(*words: Any, **keys: Any) -> None:
        raise AssertionError("it was asked again")

    monkeypatch.setattr(subprocess, "run", refuse)
    assert lister(source, "rgb") is known
    assert not {"mitsuba", "drjit"} & {name.split(".")[0] for name in vars(module)}


def test_a_scene_that_mitsuba_refuses_is_an_error(tmp_path: Path) -> None:
    (tmp_path / "scene.xml").write_text('<scene version="3.0.0"><shape type="sphere"/></scene>')
    with pytest.raises(SceneError, match=r"scene '\.': the scene scene.xml has no camera"):
        SceneLister(lambda: devices.pick("llvm"))(sources.find(".", tmp_path), "rgb")


@pytest.mark.parametrize("code", ["import os; os.abort()", "print('what?')", "print('[1]')", "raise SystemExit(3)", ""])
def test_a_child_that_fails_leaves_the_question_open(code: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """The render process will tell; a grid is not refused because of what this machine lacks."""
    run = subprocess.run
    monkeypatch.setattr(subprocess, "run", lambda words, **keys: run([sys.executable, "-c", code], **keys))
    assert SceneLister(lambda: devices.pick("llvm"))(sources.find("swept", ROOM), "rgb") is None


def test_so_does_a_machine_without_a_device() -> None:
    def none() -> devices.Device:
        raise EnvironmentProblem("no LLVM")

    assert SceneLister(none)(sources.find("swept", ROOM), "rgb") is None
