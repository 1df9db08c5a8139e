"""
Data directories for tests, and the few steps that make one: submit, claim, finish.

Pictures are written as real EXR files only where something reads them; the queue itself never looks into one.
"""

from __future__ import annotations

import os
import pickle
import shutil
import sys
import tempfile
import traceback
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from jobs import experiments, plan, queue
from jobs.artifacts import Artifacts
from jobs.experiments import Experiment
from jobs.queue import Work
from jobs.store import Store
from renderer.images import write_picture
from tests.jobs.grids import parse

NOBODY = 65534
SIZE = 9  # pixels, both ways


@pytest.fixture
def data(tmp_path) -> Path:
    return tmp_path / "data"


@pytest.fixture
def store(data) -> Iterator[Store]:
    store = Store.open(data)
    yield store
    store.close()


@pytest.fixture
def artifacts(data) -> Artifacts:
    artifacts = Artifacts(data)
    artifacts.prepare()
    return artifacts


@pytest.fixture
def public_folder() -> Iterator[Path]:
    """A folder that every user may enter, unlike pytest's own."""
    folder = Path(tempfile.mkdtemp(prefix="dartboard-test-"))
    folder.chmod(0o755)
    yield folder
    shutil.rmtree(folder)


def planned(**keys: Any) -> plan.Plan:
    """The cells of a small grid."""
    defaults = {"resolution": [SIZE, SIZE], "spp": [1, 2], "replicates": 2, "reference": {"spp": 8}}
    return plan.expand(parse({**defaults, **keys}))


def submit(store: Store, **keys: Any) -> Experiment:
    return experiments.submit(store, planned(**keys), store.path.parent / "scenes")[0]


def claim(store: Store, **keys: Any) -> Work | None:
    return queue.claim(store, machine="here", device="llvm", **keys)


def record(store: Store, work: Work, role: str, k: int, image: str = "images/none.exr") -> int:
    """A finished replicate's row, without a file."""
    return queue.finish_replicate(
        store, work, role, k, image=image, seed=k, render_seconds=0.25 + k, compile_seconds=0.5, threads=2, neighbours=0
    )


def work_off(store: Store, **keys: Any) -> list[Work]:
    """Claim and finish until nothing is left; what was claimed, in order."""
    done = []
    while work := claim(store, **keys):
        for role, k in work.missing:
            record(store, work, role, k)
        queue.finish(store, work)
        done.append(work)
    return done


def picture(digest: str, role: str, k: int, size: tuple[int, int] = (SIZE, SIZE)) -> np.ndarray:
    """Some radiance that depends on nothing but its name."""
    rng = np.random.default_rng([int(digest[:8], 16), k, role == "reference"])
    return rng.gamma(2.0, 0.1, (size[1], size[0], 3)).astype(np.float32)


def draw(store: Store, artifacts: Artifacts, work: Work, role: str, k: int, pixels: np.ndarray | None = None) -> int:
    """A finished replicate with its file."""
    temporary, name = artifacts.work / "drawn.exr", artifacts.picture(work.digest, role, k)
    write_picture(temporary, picture(work.digest, role, k) if pixels is None else pixels, {})
    artifacts.adopt(temporary, name)
    return record(store, work, role, k, name)


def select(store: Store, sql: str, *parameters: Any) -> list[tuple[Any, ...]]:
    """What the database holds, for assertions."""
    return list(store.connection.execute(sql, parameters))


def dump(store: Store) -> dict[str, list[tuple[Any, ...]]]:
    """Every row of every table."""
    tables = [row[0] for row in select(store, "select name from sqlite_schema where type = 'table' order by name")]
    return {table: select(store, f"select * from {table} order by 1, 2") for table in tables}


def assert_sound(store: Store) -> None:
    """The file is whole, and no row points nowhere."""
    assert select(store, "pragma integrity_check") == [("ok",)]
    assert select(store, "pragma foreign_key_check") == []


def without_rights(function: Callable[[], Any]) -> Any:
    """
    What ``function`` returns, or the error it raises, in a child process that is not root.

    Rights of files do not bind root, and tests often run as root in a container.
    """
    read, write = os.pipe()
    child = os.fork()
    if child == 0:
        try:
            if os.getuid() == 0:
                os.setgid(NOBODY)
                os.setuid(NOBODY)
            try:
                told: Any = function()
            except Exception as error:
                told = error
            os.write(write, pickle.dumps(told))
            os._exit(0)
        except BaseException:
            traceback.print_exc(file=sys.__stderr__)
            os._exit(1)
    os.close(write)
    with os.fdopen(read, "rb") as pipe:
        content = pipe.read()
    assert os.waitpid(child, 0)[1] == 0
    return pickle.loads(content)
