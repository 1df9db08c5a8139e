"""
Where things are: the data directory, the server and the kernel caches, from the command line, the environment, or by
default.
"""

from __future__ import annotations

import os
from pathlib import Path

from renderer.errors import BadParameter

DEFAULT_DATA = "dartboard-data"


def data_directory(given: Path | None) -> Path:
    """``--data``, else the variable DARTBOARD_DATA, else ``./dartboard-data``; nothing is created."""
    return Path(given or os.environ.get("DARTBOARD_DATA") or DEFAULT_DATA)


def place(data: Path | None, server: str | None) -> Path | str:
    """
    Where a command reads an experiment: a data directory, or the address of a server (a text).

    What the command line says counts more than the environment; there DARTBOARD_SERVER more than DARTBOARD_DATA.
    Raises ``BadParameter`` if the command line says both.
    """
    if data is not None and server is not None:
        raise BadParameter(f"--data {data} and --server {server} are two places; give one of them")
    if data is None:
        server = server or os.environ.get("DARTBOARD_SERVER")
    return server or data_directory(data)


def server_address(given: str | None) -> str:
    """``--server``, else DARTBOARD_SERVER. Raises ``BadParameter`` without either."""
    address = given or os.environ.get("DARTBOARD_SERVER")
    if not address:
        raise BadParameter("which server? give --server URL, or set DARTBOARD_SERVER; `dartboard up` starts one")
    return address


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
