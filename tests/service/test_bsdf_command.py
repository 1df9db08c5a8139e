"""``dartboard bsdf`` as people type it: the plugin's own values, notes on stderr, bad input in one sentence."""

from __future__ import annotations

import json

import numpy as np
import pytest

from renderer.bsdfs.formula import AnisoPhong
from tests.service.test_cli import dartboard, refused

WI, WO = "0.6,0,0.8", "-0.36,0.48,0.8"


def test_value_and_density_are_the_plugin_s() -> None:
    """A grey material has one number; directions are taken at unit length, with a note."""
    done = dartboard("bsdf", "anisophong:nu=100,nv=1000,rd=0.4,rs=0.3", "--wi=6,0,8", f"--wo={WO}", "--json")
    assert done.returncode == 0, done.stderr
    told = json.loads(done.stdout)
    material, wi, wo = AnisoPhong(0.4, 0.3, 100, 1000), np.array([0.6, 0, 0.8]), np.array([-0.36, 0.48, 0.8])
    assert told["eval"] == pytest.approx(material.f(wi, wo) * 0.8, rel=2e-5)
    assert told["pdf"] == pytest.approx(material.pdf(wi, wo), rel=2e-5)
    assert "--wi has a length of 10; taken at unit length" in done.stderr
    assert "--wo" not in done.stderr


def test_colours_have_three_values_and_people_get_words() -> None:
    done = dartboard("bsdf", "anisophong:rd=0.1 0.2 0.3", f"--wi={WI}", f"--wo={WO}", "--json")
    assert done.returncode == 0, done.stderr
    red, green, blue = json.loads(done.stdout)["eval"]
    assert red < green < blue
    done = dartboard("bsdf", "anisophong:rd=1.5", f"--wi={WI}", "--wo=0,0.6,-0.8")
    assert done.returncode == 0, done.stderr
    assert "f·cos θo = 0.0, pdf = 0.0" in done.stdout
    assert "rd = 1.5 is above 1" in done.stderr and "--wo is not above the horizon" in done.stderr


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("anisofong", f"--wi={WI}", f"--wo={WO}"), "did you mean 'anisophong'"),
        (("anisophong:nu=-3", f"--wi={WI}", f"--wo={WO}"), "nu = -3"),
        (("anisophong", "--wi=0,0,0", f"--wo={WO}"), "--wi = '0,0,0' has no length"),
        (("anisophong", f"--wi={WI}", "--wo=0,1"), "--wo = '0,1' is no direction; write three numbers"),
        (("anisophong", f"--wi={WI}", "--wo=0,nan,1"), "must be finite"),
        (("anisophong", f"--wi={WI}", f"--wo={WO}", "--device", "tpu"), "'tpu'"),
    ],
)
def test_bad_words_are_one_sentence(words: tuple[str, ...], said: str) -> None:
    refused(dartboard("bsdf", *words), 2, said)
