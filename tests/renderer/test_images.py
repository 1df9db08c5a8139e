"""Pictures survive the disk to the last bit, and a bad file is one sentence, never a crash."""

from __future__ import annotations

import contextlib
from pathlib import Path

import numpy as np
import OpenEXR
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from renderer.errors import DartboardError
from renderer.images import read_header, read_picture, write_picture


def random_picture(height: int = 9, width: int = 7) -> np.ndarray:
    return np.random.default_rng(1).gamma(0.5, size=(height, width, 3)).astype(np.float32)


def test_a_picture_comes_back_bit_by_bit(tmp_path: Path) -> None:
    picture = random_picture()
    write_picture(tmp_path / "a.exr", picture, {"spec": '{"spp":64}', "timing": "1.5"})
    np.testing.assert_array_equal(read_picture(tmp_path / "a.exr"), picture)
    assert read_header(tmp_path / "a.exr") == {"spec": '{"spp":64}', "timing": "1.5"}
    with OpenEXR.File(str(tmp_path / "a.exr")) as file:
        assert file.header()["compression"] == OpenEXR.ZIP_COMPRESSION
        assert file.channels()["RGB"].pixels.dtype == np.float32


@pytest.mark.parametrize("kind", [np.float16, np.float32])
def test_pictures_of_other_programs_are_read(tmp_path: Path, kind: type) -> None:
    """Half or float; RGB, RGBA with the alpha left out, or one luminance channel repeated."""
    picture = random_picture().astype(kind)
    alpha = np.concatenate([picture, np.ones((9, 7, 1), kind)], axis=-1)
    grey = picture[..., 0].copy()
    files = {"rgb": {"RGB": picture}, "rgba": {"RGBA": alpha}, "y": {"Y": grey}}
    for name, channels in files.items():
        with OpenEXR.File({"type": OpenEXR.scanlineimage}, channels) as file:
            file.write(str(tmp_path / f"{name}.exr"))
    for name in ("rgb", "rgba"):
        np.testing.assert_array_equal(read_picture(tmp_path / f"{name}.exr"), picture.astype(np.float32))
    repeated = np.repeat(grey[..., None], 3, axis=-1).astype(np.float32)
    np.testing.assert_array_equal(read_picture(tmp_path / "y.exr"), repeated)
    assert read_header(tmp_path / "y.exr") == {}


def test_other_channels_are_named(tmp_path: Path) -> None:
    with OpenEXR.File({"type": OpenEXR.scanlineimage}, {"depth.Z": random_picture()[..., 0].copy()}) as file:
        file.write(str(tmp_path / "z.exr"))
    with pytest.raises(DartboardError, match="no RGB channels to measure"):
        read_picture(tmp_path / "z.exr")


def test_missing_and_foreign_files_are_one_sentence(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "text.exr").write_text("no picture")
    for path in (tmp_path / "none.exr", tmp_path / "text.exr", tmp_path):
        with pytest.raises(DartboardError, match="EXR file"):
            read_picture(path)
    assert capfd.readouterr().out == ""  # OpenEXR's own warnings must not reach --json


@settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(position=st.integers(0, 10**6), change=st.integers(1, 255), cut=st.booleans())
def test_damaged_files_never_crash(tmp_path: Path, position: int, change: int, cut: bool) -> None:
    """A flipped byte or a missing end gives a picture of some kind or a ``DartboardError``, nothing else."""
    good = tmp_path / "good.exr"
    if not good.exists():
        write_picture(good, random_picture(), {"spec": "{}"})
    content = bytearray(good.read_bytes())
    position %= len(content)
    content[position] = (content[position] + change) % 256
    (tmp_path / "bad.exr").write_bytes(content[:position] if cut else content)
    with contextlib.suppress(DartboardError):
        assert read_picture(tmp_path / "bad.exr").shape[-1] == 3
