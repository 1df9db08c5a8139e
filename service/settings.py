"""Where things lie: the data directory and the kernel caches, from the command line, the environment, or by default."""

from __future__ import annotations

import os
from pathlib import Path

DEFAULT_DATA = "dartboard-data"


def data_directory(given: Path | None) -> Path:
    """``--data``, else the variable DARTBOARD_DATA, else ``./dartboard-data``; nothing is created."""
    return Path(given or os.environ.get("DARTBOARD_DATA") or DEFAULT_DATA)


def kernel_caches() -> Path:
    """
    The folder of the compiled kernels, one below it per trust class, shared by every data directory of a user:
    a second experiment starts warm. In XDG_CACHE_HOME, else in ``~/.cache``.
    """
    return Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "dartboard" / "kernels"


def usable_kernel_caches(otherwise: Path) -> Path:
    """``kernel_caches``, made if need be; a folder in ``otherwise`` for a user whose home cannot be written."""
    folder = kernel_caches()
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError:
        return otherwise / "kernels"
    return folder if os.access(folder, os.W_OK | os.X_OK) else otherwise / "kernels"
