"""Our plugins are ours in every variant, and draw in all that we ship."""

from __future__ import annotations

import os
import subprocess
import sys

from renderer import devices
from renderer.catalog import entries
from renderer.plugins import bsdfs, integrators, samplers

DRAWN = """
import sys
from pathlib import Path
from renderer import catalog
from renderer.scenes import sources
from renderer.scenes.load import load
from renderer.spec import CellSpec, Estimand
from renderer.variant import use

use(sys.argv[1])
from renderer.render import render

source = sources.find("cornell_box", Path())
loaded = load(source.folder, source.main, width=16, height=16)
axis = sys.argv[2]
for name in sys.argv[3:]:
    estimand = Estimand(source.digest, 16, 16, 6, catalog.resolve("rfilter", "box"))
    sampler = catalog.resolve("sampler", name if axis == "sampler" else "independent")
    integrator = catalog.resolve("integrator", name if axis == "integrator" else "path")
    spec = CellSpec(estimand, integrator, sampler, catalog.rendered_spp(sampler, 64))
    print(name, next(render(spec, loaded, [1])).picture.clip(0, 1).mean())
"""


def test_every_name_that_we_register_is_ours(variant: str) -> None:
    """Mitsuba ignores in silence a plugin whose name is taken."""
    import mitsuba as mi

    for name, plugin in {**samplers(), **bsdfs(), **integrators()}.items():
        assert isinstance(mi.load_dict({"type": name}), plugin)


def test_the_catalog_and_the_list_of_plugins_agree(variant: str) -> None:
    ours = {entry.plugin for entry in entries("sampler").values() if entry.source == "Dartboard"}
    assert ours == set(samplers())


def test_all_samplers_draw_in_spectral_mode() -> None:
    """The mean of ``independent``, roughly (lamps are cut off, as noise): one that breaks shows as black or NaN."""
    names = [name for name in entries("sampler") if name != "pointset"]
    means = spectral_means("sampler", names)
    assert all(abs(mean - means["independent"]) < 0.1 * means["independent"] for mean in means.values()), means


def test_all_integrators_draw_in_spectral_mode() -> None:
    """The same of those that see all light, whatever picks the lamps."""
    names = ["path", "path:light_sampler=spatial", "bdpt", "bdpt:light_sampler=power,heuristic=balance", "volpath",
             "ptracer"]  # fmt: skip
    means = spectral_means("integrator", names)
    assert all(abs(mean - means["path"]) < 0.1 * means["path"] for mean in means.values()), means


def spectral_means(axis: str, names: list[str]) -> dict[str, float]:
    said = subprocess.run(
        [sys.executable, "-c", DRAWN, "llvm_ad_spectral", axis, *names], capture_output=True, text=True, check=False,
        env={**os.environ, **devices.pick("llvm").environment},
    )  # fmt: skip
    assert said.returncode == 0, said.stderr
    means = {line.split()[0]: float(line.split()[1]) for line in said.stdout.splitlines()}
    assert set(means) == set(names)
    return means
