"""
Pictures as files: OpenEXR in and out, with what is needed to make them again in the header.

Data is written as float32 scanlines with ZIP compression: lossless, and read by every EXR tool. A picture is
a (H, W, 3) float32 array of linear radiance, rows from the top. Nothing here needs Mitsuba.
"""

from __future__ import annotations

import contextlib
import os
import threading
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from renderer.errors import DartboardError

HEADER_PREFIX = "dartboard:"  # every attribute of ours is text under this name

_STDOUT = threading.Lock()  # two threads that swap it would leave it swapped

Floats = NDArray[np.float32]


def write_picture(path: Path, picture: NDArray[Any], header: Mapping[str, str]) -> None:
    """
    Write a (H, W, 3) picture as float32 ZIP EXR at ``path`` (which appears half-written while this runs: write
    beside the final name and rename). ``header`` values must be text: EXR integers over 32 bits become 0.
    """
    import OpenEXR

    attributes: dict[str, Any] = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
    attributes |= {HEADER_PREFIX + key: value for key, value in header.items()}
    with OpenEXR.File(attributes, {"RGB": np.ascontiguousarray(picture, np.float32)}) as file:
        file.write(str(path))


def read_picture(path: Path) -> Floats:
    """
    The picture of an EXR file of any origin as (H, W, 3) float32.

    Reads RGB, RGBA (alpha dropped) and Y (repeated); half and float. Raises ``DartboardError`` for a file that
    is missing, no EXR, damaged, or has other channels.
    """
    with _open(path) as file:
        channels = file.channels()
        for name in ("RGB", "RGBA", "Y"):
            if name in channels:
                pixels = np.array(channels[name].pixels, np.float32)  # a copy: the file's memory ends with it
                break
        else:
            names = ", ".join(sorted(channels)) or "none"
            raise DartboardError(f"{path} has no RGB channels to measure; it has: {names}")
    if pixels.ndim == 2:
        return np.repeat(pixels[:, :, None], 3, axis=2)
    return np.ascontiguousarray(pixels[:, :, :3])


def read_header(path: Path) -> dict[str, str]:
    """Our own header attributes of an EXR file, without the prefix; empty for a file of another origin."""
    with _open(path, header_only=True) as file:
        header = dict(file.header())
    return {key[len(HEADER_PREFIX) :]: str(value) for key, value in header.items() if key.startswith(HEADER_PREFIX)}


@contextlib.contextmanager
def _open(path: Path, **options: bool) -> Iterator[Any]:
    """An OpenEXR file; its many exceptions for bad files become one sentence, its warnings on stdout are hushed."""
    import OpenEXR

    if not path.is_file():
        raise DartboardError(f"no picture at {path}; give the path of an EXR file")
    try:
        with _stdout_to_stderr(), OpenEXR.File(str(path), **options) as file:
            yield file
    except DartboardError:
        raise
    except Exception as error:  # RuntimeError, ValueError or UnicodeDecodeError, by the kind of damage
        raise DartboardError(f"{path} cannot be read ({type(error).__name__}); is it an EXR file?") from error


@contextlib.contextmanager
def _stdout_to_stderr() -> Iterator[None]:
    """OpenEXR prints warnings to the C stdout, where they would spoil ``--json``. One thread at a time."""
    with _STDOUT:
        saved = os.dup(1)
        try:
            os.dup2(2, 1)
            yield
        finally:
            os.dup2(saved, 1)
            os.close(saved)
