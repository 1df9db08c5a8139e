"""
How long a stranger waits: from a bare checkout to the first picture, and from then on.

    python -m benchmarks.first_start [GRID]

The checkout is copied to a temporary folder, without `.venv` and `.llvm`, and started there with an empty HOME (so
pip and Dr.Jit have empty caches) and DARTBOARD_LLVM=unpack, which leaves this machine as it is. Root starts it as
another user. The second start has a new data directory and keeps the rest, as on a user's second day. The downloads
come over this machine's network, which the table cannot know: compare runs of one place.
"""

from __future__ import annotations

import argparse
import os
import re
import shutil
import signal
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

Said = list[tuple[float, str]]  # lines with the seconds at which they were said
Row = tuple[str, float, float | None]  # phase, seconds, goal

CHECKOUT = Path(__file__).resolve().parent.parent
NOBODY = 65534
LIMIT_SECONDS = 600
POLL_SECONDS = 0.01
FIRST_GOAL_SECONDS, SECOND_GOAL_SECONDS = 120.0, 3.0  # what issue 2 asks for


def main() -> int:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.first_start", description=__doc__.split("\n\n")[0])
    parser.add_argument("grid", nargs="?", default="examples/first.toml", help="relative to the checkout")
    grid = parser.parse_args().grid
    with bare_checkout() as folder:
        rows = []
        for name, goal in (("first", FIRST_GOAL_SECONDS), ("second", SECOND_GOAL_SECONDS)):
            picture, said = until_first_picture(folder, grid)
            repeat(name, said)
            if picture is None:
                print(f"the {name} start wrote no picture", file=sys.stderr)
                return 1
            rows += phases(name, said)
            rows.append((f"{name} start: first picture", picture, goal))
    show(rows)
    return 0


@contextmanager
def bare_checkout() -> Iterator[Path]:
    """A copy of what git knows or would add, which the user of this benchmark may write."""
    folder = Path(tempfile.mkdtemp(prefix="dartboard-first-start-"))
    folder.chmod(0o755)
    try:
        listing = subprocess.run(
            ["git", "ls-files", "-z", "--cached", "--others", "--exclude-standard"],
            cwd=CHECKOUT, check=True, capture_output=True, text=True,
        )  # fmt: skip
        for name in filter(None, listing.stdout.split("\0")):
            if (CHECKOUT / name).is_file():
                target = folder / "checkout" / name
                target.parent.mkdir(parents=True, exist_ok=True)
                shutil.copy(CHECKOUT / name, target)
        (folder / "home").mkdir()
        if os.geteuid() == 0:
            subprocess.run(["chown", "-R", f"{NOBODY}:{NOBODY}", str(folder)], check=True)
        yield folder
    finally:
        shutil.rmtree(folder, ignore_errors=True)


def until_first_picture(folder: Path, grid: str) -> tuple[float | None, Said]:
    """Seconds from the command to its first picture file, and each line it said with the second it said it."""
    data = folder / "data"
    shutil.rmtree(data, ignore_errors=True)
    started = time.monotonic()
    process = start(folder, "run", grid, "--data", str(data))
    said, listener = listen(process, started)
    picture = None
    while process.poll() is None and picture is None and time.monotonic() - started < LIMIT_SECONDS:
        if any(data.glob("images/**/*.exr")):
            picture = time.monotonic() - started
        time.sleep(POLL_SECONDS)
    if picture is None and any(data.glob("images/**/*.exr")):
        picture = time.monotonic() - started
    if process.poll() is None:
        end(process, signal.SIGINT)
    listener.join(5)
    return picture, said


def start(folder: Path, *words: str) -> subprocess.Popen[str]:
    """``./dartboard WORDS`` in a bare checkout, as somebody with an empty home; what it says comes on stderr."""
    kept = {name: value for name, value in os.environ.items() if name.startswith(("PIP_", "http", "HTTP"))}
    environment = {
        **kept, "HOME": str(folder / "home"), "PATH": "/usr/local/bin:/usr/bin:/bin", "DARTBOARD_LLVM": "unpack",
    }  # fmt: skip
    as_user: dict[str, Any] = {"user": NOBODY, "group": NOBODY, "extra_groups": []} if os.geteuid() == 0 else {}
    checkout = folder / "checkout"
    return subprocess.Popen(
        [str(checkout / "dartboard"), *words], cwd=checkout, env=environment, stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE, text=True, start_new_session=True, **as_user,
    )  # fmt: skip


def listen(process: subprocess.Popen[str], started: float) -> tuple[Said, threading.Thread]:
    """What the start says, which grows while it speaks, and who hears it."""
    said: Said = []

    def hear() -> None:
        for line in process.stderr or ():
            said.append((time.monotonic() - started, re.sub(r"/\S+/", "", line.rstrip())))

    listener = threading.Thread(target=hear, daemon=True)
    listener.start()
    return said, listener


def end(process: subprocess.Popen[str], how: signal.Signals) -> None:
    """Asks a start to end, and ends it where it does not."""
    process.send_signal(how)
    try:
        process.wait(20)
    except subprocess.TimeoutExpired:
        os.killpg(process.pid, signal.SIGKILL)
        process.wait()


def repeat(name: str, said: Said) -> None:
    print(f"--- {name} start said:\n" + "".join(f"{at:7.2f} s  {line}\n" for at, line in said))


def show(rows: Iterable[Row]) -> None:
    print(f"{'phase':<42}{'seconds':>9}{'goal':>8}")
    for label, seconds, limit in rows:
        print(f"{label:<42}{seconds:>9.2f}" + (f"{limit:>8.0f}" if limit else ""))


def phases(start: str, said: Said) -> list[Row]:
    """The launcher's own account: `ready in 17.0 s: .venv 0.1 s, packages 16.7 s, …`."""
    account = next((line.partition(" s: ")[2] for _, line in said if "ready in" in line), "")
    found = re.findall(r"([^,]+?) ([\d.]+) s(?:, |$)", account)
    return [(f"{start} start: {name}", float(seconds), None) for name, seconds in found]


if __name__ == "__main__":
    sys.exit(main())
