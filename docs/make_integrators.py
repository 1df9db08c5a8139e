"""
Make the tables and the gallery of the integrators: ``python docs/make_integrators.py``, in an environment of
``./dartboard test``.

The pages in docs/integrators are written by hand, but for what stands between ``<!-- made: … -->`` and ``<!-- end
-->``: that comes from the catalog, and for the gallery from ``gallery.json``, which is written as the pictures are
drawn. ``--text`` writes these parts again without drawing; ``--check`` says which pages are out of date, and is a test;
``--spp`` is for a hurry.

The gallery gives every integrator the time that ``path`` takes for its spp, by a measurement just before.
"""

from __future__ import annotations

import argparse
import json
import os
import re
import statistics
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from make_samplers import meaning, rounded, table

from renderer import catalog, devices
from renderer.catalog import Entry, Parameter
from renderer.metrics import METRICS, Reference
from renderer.scenes.builtin import BUILTIN
from renderer.scenes.sources import find
from renderer.spec import CellSpec, Estimand, seed

ROOT = Path(__file__).resolve().parent.parent
FOLDER = ROOT / "docs" / "integrators"
NUMBERS = FOLDER / "gallery.json"
BLOCK = re.compile(r"(<!-- made: (?P<what>[^>]+) -->\n).*?(<!-- end -->)", re.DOTALL)

SIDE, SPP, REFERENCE_SPP = 256, 64, 512  # pixels; of path; of the reference
ROUNDS = 3  # of the measurement
QUALITY = 75  # of the JPEG
ONE_LAMP = ("path", "bdpt", "ptracer", "volpath", "direct")
GLASS = ("path", "bdpt:aim=false", "bdpt", *ONE_LAMP[2:])
MANY_LAMPS = ("path", "path:light_sampler=spatial", "bdpt", "bdpt:light_sampler=spatial", *ONE_LAMP[2:])
SCENES = {  # what is shown, and the integrator of the reference
    "hidden_lamp": (ONE_LAMP, "bdpt"),
    "glass_caustic": (GLASS, "bdpt"),
    "many_lights": (MANY_LAMPS, "path:light_sampler=spatial"),
}
OTHERS = {  # pictures with another expectation: an error would mean nothing
    ("hidden_lamp", "direct"): "direct light alone",
    ("glass_caustic", "direct"): "direct light alone",
    ("many_lights", "direct"): "direct light alone",
    ("glass_caustic", "ptracer"): "does not see the glass",
}


def main() -> None:
    parser = argparse.ArgumentParser(description="Make the tables and the gallery in docs/integrators.")
    how = parser.add_mutually_exclusive_group()
    how.add_argument("--text", action="store_true", help="write the pages only, with the numbers that are there")
    how.add_argument("--check", action="store_true", help="write nothing; fail if a page is out of date")
    parser.add_argument("--spp", type=int, default=SPP, help="of path; the reference gets more in proportion")
    options = parser.parse_args()
    if not (options.text or options.check):
        draw_all(options.spp)
    numbers = json.loads(NUMBERS.read_text("utf-8"))
    old = []
    for file in sorted(FOLDER.glob("*.md")):
        text = file.read_text("utf-8")
        new = BLOCK.sub(lambda found: f"{found[1]}{made(found['what'], numbers)}\n{found[3]}", text)
        if new != text:
            old.append(file.name)
            if not options.check:
                file.write_text(new, "utf-8")
    if options.check and old:
        sys.exit(f"out of date in docs/integrators: {', '.join(old)}; run `python docs/make_integrators.py --text`")


# ------------------------------------------------------------------------------------------ text


def made(what: str, numbers: Mapping[str, Any]) -> str:
    """What stands in the block of that name."""
    entries = catalog.entries("integrator")
    if what == "integrators":
        rows = [[f"[{name}]({name}.md)", entry.line, entry.source, depth(entry)] for name, entry in entries.items()]
        return table(["integrator", "what it does", "from", "max_depth"], rows)
    if what == "gallery":
        return gallery(numbers)
    return parameters(entries[what.removeprefix("parameters of ")])


def depth(entry: Entry) -> str:
    if entry.depth is not None:
        return f"always {entry.depth}"
    return f"1 to {entry.deepest}" if entry.deepest else "any, or unlimited"


def parameters(entry: Entry) -> str:
    rows = [[f"`{item.name}`", default(item), item.unit, item.allowed, meaning(item)] for item in entry.parameters]
    parts = [table(["parameter", "default", "unit", "allowed", "what it does"], rows)]
    if entry.aliases:
        parts.append(f"Also called {', '.join(f'`{alias}`' for alias in entry.aliases)}.")
    return "\n\n".join(parts)


def default(item: Parameter) -> str:
    if item.default is None:
        return item.unset
    return f"`{str(item.default).lower() if isinstance(item.default, bool) else item.default}`"


def gallery(numbers: Mapping[str, Any]) -> str:
    """The pictures of each scene in two rows."""
    parts = []
    for scene, drawn in numbers.items():
        told = drawn["reference"]
        shown = [("reference", f"reference: `{told['integrator']}`", f"{told['spp']} spp")]
        shown += [(label, f"`{label}`", caption(scene, label, found)) for label, found in drawn["pictures"].items()]
        parts += [f"## `{scene}` {BUILTIN[scene].title}", BUILTIN[scene].hard_part]
        half = (len(shown) + 1) // 2
        for row in (shown[:half], shown[half:]):
            pictures = [f"![{BUILTIN[scene].title}, {label}]({file_of(scene, label)})" for label, _, _ in row]
            parts.append(table([head for _, head, _ in row], [pictures, [text for _, _, text in row]]))
    return "\n\n".join(parts)


def caption(scene: str, label: str, found: Mapping[str, Any]) -> str:
    told = f"{found['spp']} spp in {found['seconds']:.2g} s"
    if (scene, label) in OTHERS:
        return f"{told}; {OTHERS[scene, label]}, {100 * found['brightness']:.0f} % of all"
    return f"{told}; relMSE {found['relmse']:g}"


def file_of(scene: str, label: str) -> str:
    return f"{scene}-{re.sub(':light_sampler=|[:=]', '-', label)}.jpg"


# ------------------------------------------------------------------------------------------ pictures


def draw_all(spp: int) -> None:
    """Every picture, and gallery.json."""
    os.environ.update(devices.pick("auto").environment)
    from renderer.variant import use

    use("llvm_ad_rgb")
    numbers = {scene: draw_scene(scene, *asked, spp) for scene, asked in SCENES.items()}
    NUMBERS.write_text(json.dumps(numbers, indent=1, ensure_ascii=False) + "\n", "utf-8")


def draw_scene(scene: str, labels: tuple[str, ...], reference: str, spp: int) -> dict[str, Any]:
    from renderer.render import render
    from renderer.scenes.load import load

    source = find(scene, Path())
    loaded = load(source.folder, source.main, width=SIDE, height=SIDE)
    estimand = Estimand(source.digest, SIDE, SIDE, source.defaults.max_depth, catalog.resolve("rfilter", "box"))

    def draw(label: str, count: int, replicate: int, of_reference: bool = False) -> tuple[float, Any]:
        integrator, sampler = catalog.resolve("integrator", label), catalog.resolve("sampler", "independent")
        spec = CellSpec(estimand, integrator, sampler, count)
        drawn = next(render(spec, loaded, [seed(spec.digest, replicate, reference=of_reference)]))
        return drawn.render_seconds, drawn.picture

    costs: dict[str, list[float]] = {label: [] for label in labels}
    for number in range(-1, ROUNDS):  # the first makes the kernels
        for label in labels:
            seconds, _ = draw(label, max(1, spp // 4), number + 1)
            if number >= 0:
                costs[label].append(seconds)
    reference_spp = spp * REFERENCE_SPP // SPP
    exact = draw(reference, reference_spp, 0, of_reference=True)[1]
    save(exact, scene, "reference")
    pictures = {}
    for label in labels:
        count = max(1, round(spp * statistics.median(costs["path"]) / statistics.median(costs[label])))
        seconds, picture = draw(label, count, 0)
        save(picture, scene, label)
        pictures[label] = {"spp": count, "seconds": rounded(seconds)} | {
            key: rounded(METRICS[metric].value(picture, Reference(exact)))
            for key, metric in (("relmse", "relmse"), ("brightness", "mean_ratio"))
        }
        print(f"{scene} {label}: {pictures[label]}")
    return {"reference": {"integrator": reference, "spp": reference_spp}, "pictures": pictures}


def save(picture: Any, scene: str, label: str) -> None:
    import mitsuba as mi

    bitmap = mi.Bitmap(np.ascontiguousarray(picture, np.float32))
    shown = bitmap.convert(mi.Bitmap.PixelFormat.RGB, mi.Struct.Type.UInt8, srgb_gamma=True)
    file = FOLDER / file_of(scene, label)
    shown.write(str(file), quality=QUALITY)
    print(f"{file.name}: {file.stat().st_size / 1000:.0f} kB")


if __name__ == "__main__":
    main()
