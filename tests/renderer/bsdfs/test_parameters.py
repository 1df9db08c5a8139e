"""What people type after ``dartboard bsdf``, and that the lists of our BSDFs are one list."""

from __future__ import annotations

import pytest

from renderer.bsdfs.parameters import BSDFS, read
from renderer.errors import DartboardError
from renderer.plugins import bsdfs
from renderer.scenes.allowed import OUR_BSDFS


def test_defaults_numbers_and_colours_are_read() -> None:
    name, values = read("anisophong:nu=1e3,rd=0.1 0.2 0.3, normalization=pbrt")
    assert name == "anisophong"
    assert values == {
        "rd": (0.1, 0.2, 0.3), "rs": 0.5, "nu": 1000.0, "nv": 100.0, "importance_sampling": True,
        "normalization": "pbrt",
    }  # fmt: skip


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("anisofong", "unknown bsdf 'anisofong' in BSDF; known: anisophong; did you mean 'anisophong'?"),
        ("anisophong:mu=1", "unknown parameter of bsdf 'anisophong': 'mu' in BSDF"),
        ("anisophong:nu", "write NAME or NAME:key=value"),
        ("anisophong:nu=-1", "nu = -1 of bsdf 'anisophong' in BSDF is not allowed; it is a number of at least 0"),
        ("anisophong:nu=nan", "nu = nan of bsdf"),
        ("anisophong:rs=2", "rs = 2 of bsdf 'anisophong' in BSDF is not allowed; it is a number from 0 to 1"),
        ("anisophong:rd=0.1 0.2", "red, green and blue with spaces between"),
        ("anisophong:rd=0.1 0.2 1.2", "it is a number from 0 to 1"),
        ("anisophong:normalization=pbrt4", "one of as2000, pbrt"),
    ],
)
def test_bad_words_are_one_sentence(text: str, said: str) -> None:
    with pytest.raises(DartboardError) as refusal:
        read(text)
    assert said in str(refusal.value)


def test_the_lists_of_our_bsdfs_agree(variant: str) -> None:
    """What is registered, what a scene may name and what the command line knows; and each name is ours."""
    import mitsuba as mi

    assert set(bsdfs()) == OUR_BSDFS == set(BSDFS)
    for name, plugin in bsdfs().items():
        assert isinstance(mi.load_dict({"type": name}), plugin)
