"""
Devices: what can draw here, ``llvm`` (the CPU) or ``cuda`` (an NVIDIA GPU), and which one to use.

A device is *usable* when a child process has drawn with it: Dr.Jit's back ends can abort the process that tries them,
and a driver that is there may still be too old. Mitsuba is not imported here. A verdict is remembered beside LLVM's
(``renderer.llvm``), so that ``pick`` costs milliseconds from the second time on.

A render process gets ``{**os.environ, **device.environment}`` as its environment
and sets ``variant.name(device.name, colour)``.
"""

from __future__ import annotations

import os
import sys
import time
from dataclasses import dataclass, field
from glob import glob
from pathlib import Path

from renderer import llvm
from renderer.errors import EnvironmentProblem, UnknownName

NAMES = ("cuda", "llvm")  # in the order in which `auto` wants them
DRIVER_FILES = ("/dev/nvidiactl", "/dev/dxg", "/dev/nvhost-ctrl-gpu")  # a PC, WSL, a Jetson
PROBE_SECONDS = 120  # the first OptiX kernel of a driver takes ten or more
RETRY_SECONDS = 3600  # how long a refusal is believed; the user may be mending the driver

# A ray that meets a sphere needs all that a render needs: the driver, OptiX, and a kernel compiled for this GPU.
PROBE = """
import os, tempfile
with tempfile.TemporaryDirectory() as folder:
    os.environ["DRJIT_CACHE_DIR"] = folder
    import mitsuba as mi
    mi.set_variant("cuda_ad_rgb")
    scene = mi.load_dict({"type": "scene", "ball": {"type": "sphere"}})
    hit = scene.ray_intersect(mi.Ray3f(mi.Point3f(0, 0, -5), mi.Vector3f(0, 0, 1)))
    assert abs(hit.t[0] - 4) < 1e-3, hit.t
"""
CUDA_CURE = (
    "draw on the CPU (device 'llvm'), or install NVIDIA's driver 535 or newer with OptiX (`nvidia-smi` must list "
    "the GPU; in a container, start it with `--gpus all` and NVIDIA_DRIVER_CAPABILITIES=all)"
)


@dataclass(frozen=True)
class Device:
    """Something that draws: its name, what it is, why it was taken, and what its render process needs."""

    name: str
    description: str
    why: str
    environment: dict[str, str] = field(default_factory=dict)


def pick(name: str = "auto") -> Device:
    """
    The device of this name; ``auto`` asks DARTBOARD_DEVICE, then takes CUDA where it works and else LLVM.

    Raises ``UnknownName`` for a name that is none, ``EnvironmentProblem`` with the cure for one that cannot draw here.
    """
    where = ""
    if name == "auto" and os.environ.get("DARTBOARD_DEVICE"):
        name, where = os.environ["DARTBOARD_DEVICE"], "DARTBOARD_DEVICE"
    if name not in (*NAMES, "auto"):
        raise UnknownName("device", name, where, (*NAMES, "auto"))
    if name == "llvm":
        return _llvm()
    trouble = cuda_trouble()
    if not trouble:
        return Device(
            "cuda", _gpu_name(), f"an NVIDIA driver is here and a trial passed; Dr.Jit {llvm.drjit_version()}"
        )
    if name == "cuda":
        raise EnvironmentProblem(f"device 'cuda' cannot draw here: {trouble}. The way out: {CUDA_CURE}.")
    return _llvm()


def available() -> list[Device]:
    """Every device that can draw here, the one that ``auto`` takes first; empty if none can."""
    devices = []
    for name in NAMES:
        try:
            devices.append(pick(name))
        except EnvironmentProblem:  # why is for ``pick``, and for the doctor, to tell
            continue
    return devices


def _llvm() -> Device:
    choice = llvm.choose()
    threads = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    description = f"CPU, {threads} {'thread' if threads == 1 else 'threads'}, LLVM {choice.version}"
    return Device("llvm", description, choice.why, llvm.environment(choice))


def cuda_trouble() -> str:
    """Why CUDA cannot draw here, or '' when it can. Without a driver's device file no child process is started."""
    if not any(Path(file).exists() for file in DRIVER_FILES):
        return f"no NVIDIA driver is loaded ({DRIVER_FILES[0]} is missing)"
    visible = os.environ.get("CUDA_VISIBLE_DEVICES")
    if visible in ("", "-1"):
        return f"CUDA_VISIBLE_DEVICES={visible!r} hides every GPU"
    key = [_driver(), visible, llvm.drjit_version(), os.uname().nodename]
    note = llvm.read_note("cuda")
    if note.get("key") == key and (not note["trouble"] or time.time() - note["asked_at"] < RETRY_SECONDS):
        return str(note["trouble"])
    trouble = _try_cuda()
    llvm.write_note("cuda", {"key": key, "trouble": trouble, "asked_at": time.time()})
    return trouble


def _try_cuda() -> str:
    import subprocess

    try:
        done = subprocess.run([sys.executable, "-c", PROBE], capture_output=True, text=True, timeout=PROBE_SECONDS)
    except subprocess.TimeoutExpired:
        return f"the trial did not end within {PROBE_SECONDS} s"
    if done.returncode == 0:
        return ""
    lines = [line.strip() for line in done.stderr.splitlines() if line.strip()]
    return (
        f"the trial {'aborted' if done.returncode < 0 else 'failed'}: {lines[-1][:300] if lines else 'without a word'}"
    )


def _driver() -> str:
    """What identifies the driver; a new one deserves a new trial."""
    try:
        return Path("/proc/driver/nvidia/version").read_text("utf-8", "replace").partition("\n")[0]
    except OSError:
        return ""


def _gpu_name() -> str:
    for file in sorted(glob("/proc/driver/nvidia/gpus/*/information")):
        for line in Path(file).read_text("utf-8", "replace").splitlines():
            if line.startswith("Model:"):
                return line.removeprefix("Model:").strip()
    return "NVIDIA GPU"
