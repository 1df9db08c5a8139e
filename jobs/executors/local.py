"""
Cells in a render process of this machine: one child per device, one order ahead.

The child is started when it is first needed, restarted when it dies, and replaced when an order needs another
colour mode or trust class. It is killed, not asked, to cancel: Mitsuba does not hear anything while a kernel
runs. Of the orders a dead child held, the one it was drawing is blamed and the others are handed to the next.
"""

from __future__ import annotations

import contextlib
import json
import os
import selectors
import signal
import subprocess
import sys
import time
from collections import deque
from dataclasses import dataclass, field
from pathlib import Path
from typing import IO, Any

from jobs.errors import DataDirectoryProblem
from jobs.executors.base import Done, Event, Failed, Finished, Order, Passed, Released, Started, as_json
from renderer.devices import Device
from renderer.errors import EnvironmentProblem
from renderer.variant import name as variant_name

AHEAD = 2  # orders a child holds: the one it draws and the next
STALL_SECONDS = 1800  # no sign of life for so long is a hang; a pass takes seconds, a huge kernel minutes
MAX_STARTS = 3  # children in a row that died before they were ready: the machine is at fault, not a cell
LOG_TAIL = 16_384  # bytes of a child's log that a failed cell keeps


@dataclass
class Child:
    """A running render process, the orders it was sent, and where its log stood when the first of them began."""

    process: subprocess.Popen[bytes]
    key: tuple[str, str]  # (colour, trust)
    log: IO[bytes]
    ready: bool = False
    sent: deque[Order] = field(default_factory=deque)
    drawing: bool = False  # True once the head of ``sent`` has started
    heard: float = field(default_factory=time.monotonic)
    log_start: int = 0
    partial: bytes = b""
    oom_kills: int = 0


class LocalExecutor:
    """
    Renders on one device of this machine.

    kernels  folder for the kernel caches, one below it per trust class; the tables of samplers lie in ``tables`` beside
             it, one folder per trust class too: no scene's process reads what another's wrote
    logs     folder for the log of the render process
    cwd      an empty folder: Mitsuba looks for plugins in the working directory
    Not thread-safe: one thread submits, cancels and reads events (a child dies with the thread that started it).
    """

    def __init__(self, device: Device, *, kernels: Path, logs: Path, cwd: Path, threads: int | None = None):
        self.device, self.kernels, self.logs, self.cwd, self.threads = device, kernels, logs, cwd, threads
        self.child: Child | None = None
        self.waiting: deque[Order] = deque()  # submitted, not yet sent to a child
        self.happened: list[Event] = []
        self.failed_starts = 0
        self.selector = selectors.DefaultSelector()
        self.wake_read, self.wake_write = os.pipe()
        os.set_blocking(self.wake_read, False)
        os.set_blocking(self.wake_write, False)
        self.selector.register(self.wake_read, selectors.EVENT_READ)

    def room(self) -> int:
        held = len(self.waiting) + (len(self.child.sent) if self.child else 0)
        return max(AHEAD - held, 0)

    def submit(self, order: Order) -> None:
        self.waiting.append(order)
        self._feed()

    def cancel(self, order: int) -> None:
        for waiting in list(self.waiting):
            if waiting.order == order:
                self.waiting.remove(waiting)
                self.happened.append(Released(order))
        child = self.child
        if child and any(sent.order == order for sent in child.sent):
            rest = [sent for sent in child.sent if sent.order != order]
            self._end_child()
            self.happened.append(Released(order))
            self.waiting.extendleft(reversed(rest))
            self._feed()

    def events(self, timeout: float) -> list[Event]:
        if not self.happened:
            for key, _ in self.selector.select(timeout):
                if key.fd == self.wake_read:
                    with contextlib.suppress(BlockingIOError):
                        os.read(self.wake_read, 4096)
                else:
                    self._read()
        self._watch()
        self._feed()
        happened, self.happened = self.happened, []
        return happened

    def wake(self) -> None:
        with contextlib.suppress(BlockingIOError):
            os.write(self.wake_write, b"!")

    def warm_up(self, colour: str, trust: str) -> None:
        """Start the child before the first order is known, so that its imports overlap the caller's work."""
        if self.child is None:
            self._start((colour, trust))

    def rest(self) -> None:
        if self.child is not None and not self.child.sent and not self.waiting:
            self._end_child()

    def close(self) -> None:
        self._end_child()
        self.waiting.clear()
        self.selector.close()
        os.close(self.wake_read)
        os.close(self.wake_write)

    # -- the child ------------------------------------------------------------------------------------------

    def _feed(self) -> None:
        """Send what waits to the child that fits it; change the child when it is idle and does not fit."""
        while self.waiting:
            order = self.waiting[0]
            key = (order.colour, order.trust)
            if self.child is not None and self.child.key != key:
                if self.child.sent:
                    return
                self._end_child()
            child = self.child or self._start(key)
            line = json.dumps(as_json(order)).encode() + b"\n"
            try:
                assert child.process.stdin is not None
                child.process.stdin.write(line)
                child.process.stdin.flush()
            except BrokenPipeError:
                return  # it has just died: ``_read`` finds the end of its events and deals with what it held
            if not child.sent:
                child.log_start = child.log.seek(0, os.SEEK_END)
                child.heard = time.monotonic()
            child.sent.append(self.waiting.popleft())

    def _start(self, key: tuple[str, str]) -> Child:
        colour, trust = key
        cache, tables = self.kernels / trust[:16], self.kernels.with_name("tables") / trust[:16]
        try:
            for folder in (cache, tables, self.logs, self.cwd):
                folder.mkdir(parents=True, exist_ok=True)
            log = open(self.logs / "render.log", "a+b")  # noqa: SIM115 - lives as long as the child
        except OSError as error:
            raise DataDirectoryProblem(
                f"cannot write the log folder {self.logs}: {error.strerror}; free space or choose another --data"
            ) from error
        environment = {
            **os.environ,
            **self.device.environment,
            "DRJIT_CACHE_DIR": str(cache),
            "DARTBOARD_TABLES": str(tables),
            "DARTBOARD_OWNER": str(os.getpid()),
            "PYTHONPATH": os.pathsep.join(filter(None, [str(_root()), os.environ.get("PYTHONPATH")])),
            "PYTHONUNBUFFERED": "1",
        }
        if self.threads:
            environment["DARTBOARD_THREADS"] = str(self.threads)
        process = subprocess.Popen(
            [sys.executable, "-m", "jobs.render_process", variant_name(self.device.name, colour)],
            stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=log, cwd=self.cwd, env=environment,
            start_new_session=True,  # Ctrl-C in the terminal reaches the owner only
        )  # fmt: skip
        assert process.stdout is not None
        os.set_blocking(process.stdout.fileno(), False)
        self.selector.register(process.stdout, selectors.EVENT_READ)
        self.child = Child(process, key, log, log_start=log.seek(0, os.SEEK_END))
        return self.child

    def _end_child(self) -> None:
        """Kill it and forget it."""
        child, self.child = self.child, None
        if child is None:
            return
        assert child.process.stdout is not None and child.process.stdin is not None
        self.selector.unregister(child.process.stdout)
        with contextlib.suppress(ProcessLookupError):
            os.killpg(child.process.pid, signal.SIGKILL)
        child.process.wait()
        child.process.stdout.close()
        with contextlib.suppress(BrokenPipeError):
            child.process.stdin.close()
        child.log.close()

    def _read(self) -> None:
        """Everything the child has written; its end, if it has ended."""
        child = self.child
        if child is None:
            return
        assert child.process.stdout is not None
        while True:
            try:
                data = os.read(child.process.stdout.fileno(), 65536)
            except BlockingIOError:
                return
            if not data:
                self._died(child)
                return
            child.heard = time.monotonic()
            *lines, child.partial = (child.partial + data).split(b"\n")
            for line in lines:
                self._hear(child, json.loads(line))

    def _hear(self, child: Child, told: dict[str, Any]) -> None:
        kind = told.pop("event")
        if kind == "ready":
            child.ready = True
            self.failed_starts = 0
        elif kind == "started":
            child.drawing = True
            child.oom_kills = _oom_kills()
            child.log_start = child.log.seek(0, os.SEEK_END)
            self.happened.append(Started(**told))
        elif kind == "pass":
            self.happened.append(Passed(**told))
        elif kind == "replicate":
            self.happened.append(Finished(**told, device=self.device.description, neighbours=0))
        elif kind == "done":
            self._end_head(child, Done(told["order"]))
        elif kind == "failed":
            self._end_head(child, Failed(**told, log=self._log_tail(child)))

    def _end_head(self, child: Child, event: Event) -> None:
        child.sent.popleft()
        child.drawing = False
        self.happened.append(event)

    def _died(self, child: Child) -> None:
        """The child ended by itself: blame the order it was drawing, keep the others for the next child."""
        code = child.process.wait()
        log = self._log_tail(child)
        held = list(child.sent)
        blamed = held.pop(0) if held and child.drawing else None
        started = child.ready
        self._end_child()
        self.waiting.extendleft(reversed(held))
        if blamed is not None:
            error_class, message = explain_exit(code, _oom_kills() > child.oom_kills)
            self.happened.append(Failed(blamed.order, error_class, message, log))
        if not started:
            self.failed_starts += 1
            if self.failed_starts >= MAX_STARTS:
                raise EnvironmentProblem(
                    f"the render process does not start ({explain_exit(code, False)[1]}); its last words: "
                    f"{_last_line(log)}; see `dartboard doctor` and {self.logs / 'render.log'}"
                )

    def _watch(self) -> None:
        """Kill a child that has been silent for too long while it draws."""
        child = self.child
        if child and child.drawing and time.monotonic() - child.heard > STALL_SECONDS:
            log, held = self._log_tail(child), list(child.sent)
            self._end_child()
            self.waiting.extendleft(reversed(held[1:]))
            message = f"no pass ended for {STALL_SECONDS} s; the render process was killed"
            self.happened.append(Failed(held[0].order, "timeout", message, log))

    def _log_tail(self, child: Child) -> str:
        end = child.log.seek(0, os.SEEK_END)
        child.log.seek(max(child.log_start, end - LOG_TAIL))
        return child.log.read().decode(errors="replace")


def explain_exit(code: int, oom: bool) -> tuple[str, str]:
    """(error class, one sentence) for the exit code of a render process."""
    if code >= 0:
        return "crash", f"the render process ended with exit code {code}"
    try:
        name = signal.Signals(-code).name
    except ValueError:
        name = f"signal {-code}"
    if -code == signal.SIGKILL and oom:
        return "out_of_memory", "the render process was killed for want of memory; ask for a smaller resolution"
    return "crash", f"the render process was ended by {name}"


def _oom_kills() -> int:
    """How often this kernel has killed for want of memory since it started; 0 where it does not say."""
    with contextlib.suppress(OSError, ValueError):
        for line in Path("/proc/vmstat").read_text().splitlines():
            if line.startswith("oom_kill "):
                return int(line.split()[1])
    return 0


def _last_line(log: str) -> str:
    lines = [line.strip() for line in log.splitlines() if line.strip()]
    return repr(lines[-1]) if lines else "none"


def _root() -> Path:
    """The folder that holds the packages: the child runs in an empty one."""
    return Path(__file__).resolve().parent.parent.parent
