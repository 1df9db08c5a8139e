"""
LLVM: which libLLVM Dr.Jit compiles with, and why that one.

Dr.Jit loads a libLLVM when the first ``llvm_*`` variant is set and accepts version 15 and later. On x86-64, 15
and 16 then *abort the process* in the first kernel (they cannot select ``fminimum``), and what a file is called
says little about whether its own dependencies are there. So a library counts only after a child process has
compiled with it: ``find`` lists the candidates, ``probe`` tries one, ``choose`` takes the best that passed and
remembers it, ``environment`` is what a render process needs to use it. How to get one: ``llvm_apt``.

Scalar variants, which need no LLVM, are not offered: the pass loop draws with JIT arrays.

Standard library only, and nothing of ours but the errors: the launcher imports this before `.venv` exists.
"""

from __future__ import annotations

import contextlib
import json
import os
import re
import shutil
import sys
from collections.abc import Mapping
from glob import glob
from pathlib import Path
from typing import Any, NamedTuple

from renderer.errors import EnvironmentProblem

OLDEST = 17  # the first whose x86-64 back end selects the NaN-propagating minimum that Dr.Jit emits
KNOWN_GOOD = range(19, 23)  # major versions that rendered; others are tried after these
PROBE_SECONDS = 60  # a probe takes half a second; a cold disk may take ten

# The kernel cache goes to a throw-away folder: a kernel found in a cache would prove nothing.
PROBE = """
import resource, tempfile, os
resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
with tempfile.TemporaryDirectory() as folder:
    os.environ["DRJIT_CACHE_DIR"] = folder
    import drjit as dr
    from drjit.llvm import Float
    dr.eval(dr.minimum(dr.arange(Float, 4), dr.maximum(dr.opaque(Float, 2), 1)))
    dr.sync_thread()
    print(*dr.detail.llvm_version(), sep=".", flush=True)
"""
ASK_VERSION = """
import ctypes, sys
numbers = [ctypes.c_uint() for _ in range(3)]
ctypes.CDLL(sys.argv[1]).LLVMGetVersion(*map(ctypes.byref, numbers))
print(*(n.value for n in numbers), sep=".")
"""
CURE = (
    "install libLLVM 17 or newer (19 is the one we test): `sudo apt-get install libllvm19` on Debian and Ubuntu, "
    "`sudo dnf install llvm-libs` on Fedora, `sudo pacman -S llvm-libs` on Arch, `brew install llvm` on macOS, "
    "`conda install -c conda-forge libllvm19` in conda; or set DRJIT_LIBLLVM_PATH to a library you have"
)


class Library(NamedTuple):
    """A libLLVM on this machine. ``version`` is what its name says, '' when only loading it would tell."""

    path: Path
    version: str
    origin: str  # 'DRJIT_LIBLLVM_PATH', '.llvm' or 'system'

    @property
    def major(self) -> int:
        return int(self.version.partition(".")[0] or 0)


class Choice(NamedTuple):
    """The library to render with, its exact version, and the sentence that explains the choice."""

    path: Path
    version: str
    why: str


# ---------------------------------------------------------------------------------------------- what there is


def find(environ: Mapping[str, str] = os.environ, folders: list[str] | None = None) -> list[Library]:
    """
    Every libLLVM of this machine, the one to try first first; old ones are listed too, to be named in messages.

    The user's own comes first whatever it is, then versions known to work, then the rest, each newest first.
    ``folders`` replaces the usual places (patterns are allowed).
    """
    unpacked = [str(state_folder() / "*/usr/lib/*"), str(state_folder() / "*/usr/lib/llvm-*/lib")]
    found = _in_folders(unpacked, ".llvm") if folders is None else []
    found += _in_folders(_usual_folders(environ) if folders is None else folders, "system")
    if folders is None and not any(library.major >= OLDEST for library in found):
        found += _known_to_linker()
    unique = {library.path: library for library in reversed(found)}
    ranked = sorted(unique.values(), key=lambda one: (one.major in KNOWN_GOOD, _numbers(one.version)), reverse=True)
    if asked := environ.get("DRJIT_LIBLLVM_PATH", ""):
        named = [one.path for one in ranked if one.path.name == asked]  # a bare file name is searched, as Dr.Jit does
        path = Path(asked).resolve() if "/" in asked or not named else named[0]
        own = Library(path, _version_in(path.name), "DRJIT_LIBLLVM_PATH")
        ranked = [own, *(one for one in ranked if one.path != path)]
    return ranked


def _usual_folders(environ: Mapping[str, str]) -> list[str]:
    debian = ["/usr/lib/*-linux-gnu*", "/usr/lib/llvm-*/lib"]
    others = ["/usr/lib64", "/usr/lib64/llvm*/lib*", "/usr/lib/llvm/*/lib*", "/usr/lib", "/usr/local/lib"]
    brew = ["/opt/homebrew/opt/llvm*/lib", "/usr/local/opt/llvm*/lib"]
    conda = [prefix + "/lib" for prefix in (environ.get("CONDA_PREFIX"),) if prefix]
    return [*conda, *debian, *others, *brew]


def _in_folders(patterns: list[str], origin: str) -> list[Library]:
    files = (file for pattern in patterns for file in sorted(glob(pattern + "/libLLVM*")))
    paths = (Path(file).resolve() for file in files if _NAME.fullmatch(os.path.basename(file)))
    return [Library(path, _version_in(path.name), origin) for path in dict.fromkeys(paths) if path.is_file()]


def _known_to_linker() -> list[Library]:
    """What `ldconfig -p` lists: libraries in folders that only /etc/ld.so.conf names."""
    ldconfig = shutil.which("ldconfig") or "/sbin/ldconfig"
    listing = run_tool([ldconfig, "-p"]).stdout if Path(ldconfig).exists() else ""
    folders = [os.path.dirname(path) for path in re.findall(r"^\s*libLLVM\S* .*=> (\S+)$", listing, re.M)]
    return _in_folders(list(dict.fromkeys(folders)), "system")


# libLLVM-14.0.6.so.1, libLLVM-15.so.1, libLLVM.so.19.1, libLLVM.so, libLLVM.dylib; not libLLVM-18-rust-1.79.so
_NAME = re.compile(r"libLLVM(?:-(?P<dashed>[\d.]*\d))?\.(?:so|dylib)(?:\.(?P<dotted>[\d.]+))?")


def _version_in(name: str) -> str:
    match = _NAME.fullmatch(name)
    return (match["dashed"] or match["dotted"] or "") if match else ""


def _numbers(version: str) -> tuple[int, ...]:
    return tuple(int(part) for part in version.split(".") if part)


# ---------------------------------------------------------------------------------------------- what works


def probe(library: Library, python: str = sys.executable) -> tuple[str, str]:
    """
    ``(exact version, "")`` when Dr.Jit compiles with this library, else ``("", reason)``.

    The trial runs in a child process, because a library that does not fit ends it with SIGABRT.
    """
    if not library.path.is_file():
        return "", "there is no such file"
    version = library.version
    if not version:
        answer = run_tool([python, "-c", ASK_VERSION, str(library.path)])
        version = answer.stdout.strip() or "older than 16"  # LLVMGetVersion came with 16
        if "OSError" in answer.stderr:
            return "", last_line(answer.stderr)
    if not version[0].isdigit() or _numbers(version)[0] < OLDEST:
        return "", f"version {version} is too old, {OLDEST} or newer is needed"
    trial = run_tool([python, "-c", PROBE], {**os.environ, **_variables(library.path)}, PROBE_SECONDS)
    if trial.returncode == 0:
        return trial.stdout.strip(), ""
    if "No module named 'drjit'" in trial.stderr:
        raise EnvironmentProblem(f"{python} has no Dr.Jit, so no LLVM can be tried; start the program with ./dartboard")
    trouble = re.search(r"LLVM ERROR: .*|Unable to load .*", trial.stderr)
    says = trouble[0][:200].strip() if trouble else last_line(trial.stderr)
    return "", f"Dr.Jit {'aborts' if trial.returncode < 0 else 'fails'} with it: {says or 'no answer in time'}"


def choose(python: str = sys.executable, environ: Mapping[str, str] = os.environ) -> Choice:
    """
    The library to render with. Raises ``EnvironmentProblem`` with the cure when none passes the probe.

    The choice is remembered for as long as the file, Dr.Jit, the machine and DRJIT_LIBLLVM_PATH stay the same.
    """
    if known := remembered(python, environ):
        return known
    return _remember(decide(find(environ), python), python, environ)


def decide(libraries: list[Library], python: str = sys.executable) -> Choice:
    """The first of ``libraries`` that passes the probe, and why it and not the others."""
    refused: list[str] = []
    too_old = [one.version for one in libraries if one.version and one.major < OLDEST]
    for library in libraries:
        if library.version in too_old and library.origin != "DRJIT_LIBLLVM_PATH":
            continue
        version, trouble = probe(library, python)
        if trouble:
            refused.append(f"{library.path}{_asked(library)}: {trouble}")
            continue
        reason = "DRJIT_LIBLLVM_PATH asks for it" if _asked(library) else "the best that passed the probe"
        others = [f"{_listed(too_old)} found but too old"] if too_old else []
        others += [f"refused {entry}" for entry in refused]
        return Choice(library.path, version, "; ".join([reason, *others]))
    found = [f"this machine has only {_listed(too_old)}" if too_old else "none was found", *refused]
    raise EnvironmentProblem(
        f"no usable LLVM: Dr.Jit draws on the CPU through libLLVM {OLDEST} or newer, and {'; '.join(found)}. "
        f"The cure: {CURE}."
    )


def environment(choice: Choice, environ: Mapping[str, str] = os.environ) -> dict[str, str]:
    """The variables to add to ``environ`` for a render process, so that Dr.Jit loads exactly this library."""
    return _variables(choice.path, environ)


def _variables(path: Path, environ: Mapping[str, str] = os.environ) -> dict[str, str]:
    folders = _unpacked_dependencies(path)
    if not folders:
        return {"DRJIT_LIBLLVM_PATH": str(path)}
    search = dict.fromkeys([*folders, *filter(None, environ.get("LD_LIBRARY_PATH", "").split(":"))])
    return {"DRJIT_LIBLLVM_PATH": str(path), "LD_LIBRARY_PATH": ":".join(search)}


def _unpacked_dependencies(path: Path) -> list[str]:
    """Folders of the other libraries that came with an unpacked LLVM; the dynamic linker has to be told of them."""
    root = state_folder()
    if not path.is_relative_to(root):
        return []
    package = root / path.relative_to(root).parts[0]
    beside = (file for top in ("lib", "usr/lib") for file in package.glob(top + "/*/*.so*"))
    return sorted({str(file.parent) for file in beside if not file.name.startswith("libLLVM")})


def _asked(library: Library) -> str:
    return " (from DRJIT_LIBLLVM_PATH)" if library.origin == "DRJIT_LIBLLVM_PATH" else ""


def _listed(versions: list[str]) -> str:
    names = sorted(set(versions), key=_numbers)
    return " and ".join(filter(None, [", ".join(names[:-1]), names[-1]]))


# ---------------------------------------------------------------------------------------------- what was chosen


def state_folder() -> Path:
    """Where verdicts and an unpacked LLVM live: `.llvm/` of a checkout, else the user's cache folder."""
    checkout = Path(__file__).resolve().parent.parent
    if (checkout / "requirements.lock").exists():
        return checkout / ".llvm"
    return Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "dartboard"


def remembered(python: str = sys.executable, environ: Mapping[str, str] = os.environ) -> Choice | None:
    """The choice of an earlier start, if nothing it rests on has changed. Costs a few file reads."""
    note = read_note("llvm")
    asked = environ.get("DRJIT_LIBLLVM_PATH", "")
    if asked not in (note.get("asked"), note.get("path")) or note.get("key") != _key(note["path"], python):
        return None
    return Choice(Path(note["path"]), note["version"], note["why"])


def _remember(choice: Choice, python: str, environ: Mapping[str, str]) -> Choice:
    asked = environ.get("DRJIT_LIBLLVM_PATH", "")
    key = _key(str(choice.path), python)
    write_note("llvm", {"asked": asked, **choice._asdict(), "path": str(choice.path), "key": key})
    return choice


def _key(path: str, python: str) -> list[str] | None:
    """What a verdict rests on: the file as it is, Dr.Jit's version, and the machine (a checkout may be shared)."""
    try:
        file = os.stat(path)
    except OSError:
        return None
    return [str(file.st_size), str(file.st_mtime_ns), drjit_version(python), os.uname().nodename]


def drjit_version(python: str = sys.executable) -> str:
    """Dr.Jit's version from the folder beside it, without importing it or starting Python; '' if not found."""
    folders = glob(str(Path(python).parent.parent / "lib/python3*/site-packages/drjit-*.dist-info"))
    return Path(folders[0]).name.removeprefix("drjit-").removesuffix(".dist-info") if folders else ""


def read_note(name: str) -> dict[str, Any]:
    try:
        note = json.loads((state_folder() / f"{name}.json").read_text("utf-8"))
    except (OSError, ValueError):
        return {}
    return note if isinstance(note, dict) else {}


def write_note(name: str, note: Mapping[str, Any]) -> None:
    """Keep a verdict for the next start. Where nothing can be written, the next start finds out again."""
    file = state_folder() / f"{name}.json"
    beside = file.with_name(f"{file.name}.{os.getpid()}")
    try:
        file.parent.mkdir(parents=True, exist_ok=True)
        beside.write_text(json.dumps(note, indent=1), "utf-8")
        beside.replace(file)
    except OSError:
        with contextlib.suppress(OSError):
            beside.unlink()


class Answer(NamedTuple):
    returncode: int
    stdout: str
    stderr: str


def run_tool(
    command: list[str],
    env: Mapping[str, str] | None = None,
    timeout: float = 900,  # seconds: 26 MB over a slow line
    cwd: Path | None = None,
    inherit: tuple[int, ...] = (),
) -> Answer:
    """A child process to its end, in English, with no questions asked and no terminal."""
    import subprocess  # here, because a warm start needs no child process and this import is its largest

    plain = {**(env or os.environ), "LC_ALL": "C", "DEBIAN_FRONTEND": "noninteractive"}
    try:
        done = subprocess.run(
            command, env=plain, timeout=timeout, cwd=cwd, pass_fds=inherit,
            stdin=subprocess.DEVNULL, capture_output=True, text=True, errors="replace",
        )  # fmt: skip
    except subprocess.TimeoutExpired:
        return Answer(124, "", "")
    except OSError as error:
        return Answer(127, "", str(error))
    return Answer(done.returncode, done.stdout, done.stderr)


def last_line(text: str) -> str:
    """What a tool said last, without the addresses it may name."""
    lines = [line.strip() for line in text.splitlines() if line.strip() and not line.startswith("W:")]
    return re.sub(r"\s*\w+://\S+", "", lines[-1]) if lines else ""
