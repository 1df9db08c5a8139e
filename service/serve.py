"""
``dartboard serve`` and ``up``: the one owner of a data directory, with its dashboard, until a signal ends it.
"""

from __future__ import annotations

import contextlib
import ctypes
import logging
import signal
import socket
import sys
from collections.abc import Iterator
from pathlib import Path
from types import FrameType

import uvicorn

from jobs import experiments, grid, owner, plan
from jobs.dispatcher import Dispatcher
from jobs.store import Store
from renderer import devices
from renderer.errors import EnvironmentProblem
from service import security
from service.app import create
from service.engine import Engine
from service.hub import Hub

DEMO = Path(__file__).resolve().parent / "demo.toml"
GRACE_SECONDS = 2  # for requests under way when the server ends; streams end at once
BACKLOG = 256
M_ARENA_MAX = -8  # mallopt(3)

log = logging.getLogger("dartboard")


def serve(data: Path, *, host: str, port: int, device: str, demo: bool, token: str | None = None) -> int:
    """
    Own ``data`` and serve it until SIGINT or SIGTERM; 0.

    port   0 for any free one
    demo   submit the demo grid if the data directory has no experiment
    token  what every request must bring; needed where ``host`` is not loopback
    Raises ``EnvironmentProblem`` if the port or the data directory is in use or nothing can draw.
    """
    _spare_memory()
    logging.basicConfig(stream=sys.stderr, format="dartboard: %(message)s", level=logging.INFO)
    logging.getLogger("httpx").setLevel(logging.WARNING)
    token = security.check_token(host, token)
    owner.refuse_owned(data)  # before the port: a second start in the same place should name the first, not its port
    with _listen(host, port) as listening:
        url = _url(host, listening.getsockname()[1])
        with owner.own(data, url):
            hub = Hub()
            engine = Engine(data, devices.pick(device), on_change=hub.poke)
            engine.start()
            try:
                if demo:
                    submit_demo(engine)
                print(f"dartboard: {url} shows {data} ({engine.device.description}); Ctrl-C ends it", file=sys.stderr)
                _run(Server(hub, uvicorn.Config(
                    create(engine, hub, token), log_level="warning", access_log=False, server_header=False,
                    timeout_graceful_shutdown=GRACE_SECONDS, backlog=BACKLOG, loop="uvloop", http="httptools",
                )), listening)  # fmt: skip
            finally:
                hub.closing = True
                engine.stop()
    return 0


class Server(uvicorn.Server):
    """uvicorn that ends its streams first, and leaves the exit code to us."""

    def __init__(self, hub: Hub, config: uvicorn.Config):
        super().__init__(config)
        self.hub = hub

    async def shutdown(self, sockets: list[socket.socket] | None = None) -> None:
        self.hub.close()
        await super().shutdown(sockets)

    @contextlib.contextmanager
    def capture_signals(self) -> Iterator[None]:
        def end(number: int, frame: FrameType | None) -> None:
            self.handle_exit(number, frame)

        previous = {number: signal.signal(number, end) for number in (signal.SIGINT, signal.SIGTERM)}
        try:
            yield
        finally:
            for number, handler in previous.items():
                signal.signal(number, handler)


def submit_demo(engine: Engine) -> None:
    """The demo grid, if there is no experiment yet: the first start shows something."""

    def submit(store: Store, dispatcher: Dispatcher) -> None:
        if store.one("experiment_by_id", id=1) is None and not experiments.everything(store):
            dispatcher.submit(plan.expand(grid.read(DEMO)))

    engine.do(submit)


def _spare_memory() -> None:
    """Threads share two heaps; pictures that come and go would leave holes in one for each thread, 100 MB in all."""
    with contextlib.suppress(AttributeError, OSError):  # another C library than glibc
        ctypes.CDLL(None).mallopt(M_ARENA_MAX, 2)


def _run(server: Server, listening: socket.socket) -> None:
    server.run(sockets=[listening])


def _listen(host: str, port: int) -> socket.socket:
    """A socket that listens. Raises ``EnvironmentProblem`` for a port that is in use or not allowed."""
    try:
        family, _, _, _, address = socket.getaddrinfo(host.strip("[]"), port, type=socket.SOCK_STREAM)[0]
    except (OSError, UnicodeError) as error:
        raise EnvironmentProblem(f"--host {host} is no address of this machine ({error}); use 127.0.0.1") from None
    listening = socket.socket(family, socket.SOCK_STREAM)
    listening.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    try:
        listening.bind(address)
        listening.listen(BACKLOG)
    except OSError as error:
        listening.close()
        raise EnvironmentProblem(
            f"port {port} of {host} cannot be used ({error.strerror}); give another with --port N, or --port 0 for "
            f"any free one"
        ) from None
    listening.set_inheritable(False)
    return listening


def _url(host: str, port: int) -> str:
    """What to open in a browser."""
    shown = {"0.0.0.0": "127.0.0.1", "::": "[::1]"}.get(host, f"[{host}]" if ":" in host else host)
    return f"http://{shown}:{port}"
