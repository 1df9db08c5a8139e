"""`kill -9` at any moment: no picture is lost, half-written or counted twice, and the next owner goes on."""

from __future__ import annotations

import random
import subprocess
import sys
from pathlib import Path

from jobs import queue
from jobs.store import Store
from tests.jobs.conftest import assert_sound, select

ROOT = Path(__file__).parents[2]

# An owner: everything it does to the directory, with small files in place of pictures, a line per finished one.
OWNER = """
import sys
from pathlib import Path
from functools import partial
from jobs import experiments, grid, owner, plan, queue
from jobs.artifacts import Artifacts
from jobs.store import Store
from renderer.scenes import sources
data = Path(sys.argv[1])
with owner.own(data):
    artifacts = Artifacts(data)
    artifacts.prepare()
    store = Store.open(data)
    queue.recover(store)
    for name, replicates in (("one", 2), ("two", 3)):
        asked = {"name": name, "scenes": "cornell_box", "spp": [*range(1, 100)], "replicates": replicates}
        spec = grid.parse({**asked, "reference": {"spp": 200}}, find=partial(sources.find, base=data), origin="a test")
        experiments.submit(store, plan.expand(spec), artifacts.scenes)
        print(name, flush=True)
    while work := queue.claim(store, machine="here", device="llvm"):
        for role, k in work.missing:
            name = artifacts.picture(work.digest, role, k)
            (artifacts.work / "part").write_text(name * 100)
            artifacts.adopt(artifacts.work / "part", name)
            queue.finish_replicate(store, work, role, k, image=name, seed=k, render_seconds=0.5, compile_seconds=0.5,
                                   threads=2, neighbours=0)
            print(name, flush=True)
        queue.finish(store, work)
    store.close()
"""
WANTED = 99 * 3 + 2
KILLS = 10


def owner(data: Path) -> subprocess.Popen:
    command = [sys.executable, "-c", OWNER, str(data)]
    return subprocess.Popen(command, stdout=subprocess.PIPE, text=True, cwd=ROOT)


def test_an_owner_that_is_killed_at_any_moment_loses_nothing(data):
    """Killed while it submits, in the middle of a file, between a file and its row, or somewhere else."""
    rng = random.Random(20)
    told: set[str] = set()
    for _ in range(KILLS):
        with owner(data) as process:
            lines = [process.stdout.readline() for _ in range(rng.randrange(1, 25))]
            process.kill()
            lines += process.stdout.readlines()
        told |= {line.strip() for line in lines if line.startswith("images") and line.endswith(".exr\n")}
        check(data, told).close()
    with owner(data) as process:
        lines = process.stdout.read().split()
    assert process.returncode == 0
    assert len(lines) > 2, "the kills came too late to mean anything"
    told |= {line for line in lines if line.startswith("images")}
    assert len(told) == WANTED
    store = check(data, told)
    assert select(store, "select distinct state from cell") == [("done",)]
    assert queue.claim(store, machine="here", device="llvm") is None
    store.close()


def check(data: Path, told: set[str]) -> Store:
    """What must hold whenever an owner has died."""
    store = Store.open(data)
    assert_sound(store)
    images = [row[0] for row in select(store, "select image from replicate")]
    assert len(images) == len(set(images))
    assert told <= set(images), "a picture that was finished is lost"
    for image in images:
        assert (data / image).read_text() == image * 100
    whole = {f"{path.relative_to(data)}" for path in (data / "images").rglob("*.exr")}
    assert len(whole - set(images)) <= KILLS, "one file without a row at most for each kill"
    for image in whole:
        assert (data / image).read_text() == image * 100, "no file is half-written"
    counted = select(
        store,
        "select count(*) from experiment_cell where had <> (select count(*) from replicate "
        "where replicate.cell_id = experiment_cell.cell_id and replicate.role = experiment_cell.role "
        "and k < replicates)",
    )
    assert counted == [(0,)]
    return store
