"""
The render process: orders come in line by line, pictures and events go out.

``python -m jobs.render_process VARIANT`` reads one JSON order a line from stdin, renders its replicates in
turn and writes one JSON event a line to what was its stdout; everything that Mitsuba or Dr.Jit prints goes to
stderr, the log. It never sees the database, keeps one scene loaded (a second live one slows every kernel by
7 %, as virtual calls trace all of them; a plan goes scene by scene), and dies with its owner: by signal, or at
the end of stdin.

An order:  {"order": 7, "spec": canonical text of the cell, "scene": folder, "main": "scene.xml",
            "replicates": [["cell", 0], …], "out": folder for pictures, "preview": path or null,
            "points": folder of point files, or null}
Events:    ready · started · pass · replicate (a finished picture, "file" in the out folder) · done · failed
"""

from __future__ import annotations

import ctypes
import errno
import gc
import json
import os
import platform
import signal
import sys
import time
from importlib.metadata import version
from pathlib import Path
from typing import IO, Any

from jobs.executors.base import DISK_FULL

PASS_EVENT_SECONDS = 0.1  # between two progress events of one replicate
PREVIEW_SECONDS = 0.5  # between two previews, and before the first: quick cells need none
PREVIEW_SIDE = 256  # pixels: what an image grid shows


def main() -> int:
    """Serve orders until stdin ends."""
    _die_with_owner()
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is the owner's to handle
    events = os.fdopen(os.dup(1), "w", buffering=1, encoding="utf-8")
    os.dup2(2, 1)
    RenderProcess(sys.argv[1], events).serve(sys.stdin)
    return 0


class RenderProcess:
    """One variant, one trust class of scenes, orders one after another."""

    def __init__(self, variant: str, events: IO[str]):
        self.events = events
        from renderer.variant import use

        use(variant, int(os.environ.get("DARTBOARD_THREADS", "0")) or None)
        import drjit as dr

        self.variant = variant
        self.threads = dr.thread_count()
        self.versions = {name: version(name) for name in ("mitsuba", "drjit")}
        self.loaded: Any = None
        self.loaded_key: tuple[Any, ...] | None = None

    def serve(self, orders: IO[str]) -> None:
        self.tell("ready", versions=self.versions, threads=self.threads, variant=self.variant)
        for line in orders:
            order = json.loads(line)
            self.tell("started", order=order["order"])
            try:
                self.render(order)
            except Exception as error:
                error_class, message = explain(error)
                if not hasattr(error, "error_class"):
                    sys.excepthook(*sys.exc_info())  # into the log
                self.tell("failed", order=order["order"], error_class=error_class, message=message)
            else:
                self.tell("done", order=order["order"])

    def render(self, order: dict[str, Any]) -> None:
        from renderer.errors import NonFinitePicture
        from renderer.images import write_picture
        from renderer.metrics import nonfinite
        from renderer.render import Progress, render
        from renderer.spec import CellSpec, seed

        spec = CellSpec.parse(order["spec"])
        loaded = self.load(Path(order["scene"]), order["main"], spec)
        wanted = [(role, int(k)) for role, k in order["replicates"]]
        previews = Previews(order["preview"])
        last = 0.0

        def on_pass(progress: Progress) -> None:
            nonlocal last
            now = time.monotonic()
            if now - last >= PASS_EVENT_SECONDS or progress.passes_done == progress.passes > 1:
                last = now
                role, k = wanted[progress.replicate]
                previews.show(progress)
                self.tell("pass", order=order["order"], role=role, k=k, done=progress.passes_done,
                          passes=progress.passes, seconds=progress.seconds, preview=previews.count)  # fmt: skip

        seeds = [seed(spec.digest, k, reference=role == "reference") for role, k in wanted]
        points = Path(order["points"]) if order["points"] else None
        for (role, k), rendering in zip(wanted, render(spec, loaded, seeds, on_pass, points), strict=True):
            file = Path(order["out"]) / f"{order['order']}-{role}-{k}.exr"
            timing = {"render_seconds": rendering.render_seconds, "compile_seconds": rendering.compile_seconds}
            header = {
                "spec": spec.text, "digest": spec.digest, "role": role, "replicate": str(k),
                "seed": str(rendering.seed), "versions": json.dumps(self.versions), "variant": self.variant,
                "timing": json.dumps(timing), "threads": str(self.threads), "machine": platform.node(),
            }  # fmt: skip
            write_picture(file, rendering.picture, header)
            if bad := nonfinite(rendering.picture):
                pixels = rendering.picture.shape[0] * rendering.picture.shape[1]
                raise NonFinitePicture(
                    f"{bad} of {pixels} pixels of replicate {k} are NaN or infinite; the picture is {file.name}: "
                    f"look for degenerate geometry or a lamp of no size in the scene"
                )
            self.tell("replicate", order=order["order"], role=role, k=k, file=file.name, seed=rendering.seed,
                      threads=self.threads, **timing)  # fmt: skip

    def load(self, folder: Path, main: str, spec: Any) -> Any:
        """The scene as the estimand sees it: the one that is loaded, or a new one in its place."""
        from renderer.scenes.load import load

        estimand = spec.estimand
        key = (str(folder), main, estimand.width, estimand.height, estimand.crop, estimand.rfilter)
        if key != self.loaded_key:
            self.loaded = self.loaded_key = None
            gc.collect()  # gone before the next one comes, cycles included
            self.loaded = load(
                folder, main, width=estimand.width, height=estimand.height, crop=estimand.crop,
                rfilter=estimand.rfilter.name, rfilter_parameters=dict(estimand.rfilter.parameters),
            )  # fmt: skip
            self.loaded_key = key
        return self.loaded

    def tell(self, event: str, **values: Any) -> None:
        self.events.write(json.dumps({"event": event, **values}) + "\n")


class Previews:
    """
    A small file that refines while a cell renders: the first replicate so far as a float16 array (H, W, 3) of at most
    PREVIEW_SIDE pixels a side, replaced in one step. Whoever shows it does the tone mapping, and the dispatcher
    removes it: a page may still ask for it while the finished picture is moved into place.
    """

    def __init__(self, path: str | None):
        self.path = Path(path) if path else None
        self.last = time.monotonic()
        self.count = 0

    def show(self, progress: Any) -> None:
        if self.path is None or time.monotonic() - self.last < PREVIEW_SECONDS:
            return
        import numpy as np

        from renderer.previews import shrink, to_half

        temporary = self.path.with_suffix(".part")
        with temporary.open("wb") as file:
            np.save(file, to_half(shrink(progress.picture(), PREVIEW_SIDE)))
        temporary.replace(self.path)
        self.last = time.monotonic()
        self.count += 1


def explain(error: Exception) -> tuple[str, str]:
    """(error class, one sentence) of what stopped a cell."""
    text = str(error).strip() or type(error).__name__
    if hasattr(error, "error_class"):
        return error.error_class, text
    if isinstance(error, MemoryError) or "out of memory" in text.lower() or "bad_alloc" in text:
        return "out_of_memory", "not enough memory for one pass; ask for a smaller resolution or crop"
    if any(os.strerror(number) in text for number in (errno.ENOSPC, errno.EDQUOT)):  # OpenEXR tells it in words only
        return DISK_FULL, text
    return "crash", f"{type(error).__name__}: {text.splitlines()[0]}"


def _die_with_owner() -> None:
    """Ask the kernel for SIGKILL when the owner's thread that started this process ends (Linux)."""
    owner = os.getppid()
    if sys.platform == "linux":
        ctypes.CDLL(None, use_errno=True).prctl(1, signal.SIGKILL)  # PR_SET_PDEATHSIG
    expected = os.environ.get("DARTBOARD_OWNER")
    if expected and int(expected) != owner:
        os._exit(1)  # it died before the request was heard


if __name__ == "__main__":
    sys.exit(main())
