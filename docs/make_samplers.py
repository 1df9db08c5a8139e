"""
Make the pages of the samplers: ``python docs/make_samplers.py``, in an environment of ``./dartboard test``.

Text comes from where it is true: the catalog, and the docstring of each plugin's class, whose paragraphs begin with
what they tell ("When it wins: …"). Pictures and numbers are measured on points that the plugins draw, which takes some
minutes; the numbers are kept in ``docs/samplers/numbers.json``. ``--text`` writes the pages again without drawing
anything; ``--check`` says which of them are out of date, and is a test.
"""

from __future__ import annotations

import argparse
import ast
import json
import math
import os
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from renderer import catalog, devices
from renderer.catalog import Entry, Parameter
from renderer.samplers.analysis import SUMMARY_POINTS, full_grids, summary
from renderer.samplers.draw import draw
from renderer.samplers.figure import figure_png
from renderer.samplers.integrands import INTEGRANDS, mse

Points = NDArray[np.float64]

ROOT = Path(__file__).resolve().parent.parent
FOLDER = ROOT / "docs" / "samplers"
NUMBERS = FOLDER / "numbers.json"
SEED = 1
FIGURE = {"spp": 256, "sets": 64}
COUNTS = (16, 64, 256)  # spp of the tables
PICTURES, PIXELS = 16, 256  # that their numbers are means over: the pixels of one picture are not always independent
SHOWN = ("gaussian", "edge", "disc", "checkerboard")
UNDRAWN = ("pointset",)  # its points are the reader's own
REPLAYS = "replay"  # the parameter
TITLES = ("What it does", "When it wins", "When it loses", "Replays", "Source")  # of paragraphs
SHAPE = ["N", "distance", "void", "L2-star", "power", "grids"]

# Mitsuba's own samplers have no docstring of ours; what there is to know of them stands here, in the same form.
MITSUBAS = {
    "independent": """
    What it does: every sample is a random number of its own.

    When it wins: never by its error. It is the baseline that others are measured by, it has no structure that could
    meet one of the scene, and its error is known: variance / N.

    When it loses: everywhere else. Clumps and voids remain at any N, and the squared error falls as N^-1.

    Source: O'Neill 2014, "PCG: A Family of Simple Fast Space-Efficient Statistically Good Algorithms for Random Number
    Generation"; Mitsuba 3, ``independent``.
    """,
    "stratified": """
    What it does: the pixel is cut into n × n cells, n² = spp, with one uniform point in each. Further dimensions take
    the cells in another random order; 1D samples are stratified into spp intervals.

    When it wins: on integrands of two dimensions, against random points always and Poisson-disk points in the end. Its
    squared error falls as N^-2 where they are smooth and as N^-1.5 across edges, and it has no structure that could
    alias.

    When it loses: where x or y alone matters, because a projection on an axis has n strata and not n². Other spp than
    squares are rounded up.

    Source: Cook, Porter and Carpenter 1984, "Distributed Ray Tracing"; rates by Mitchell 1996, "Consequences of
    Stratified Sampling in Graphics"; Mitsuba 3, ``stratified``.
    """,
    "multijitter": """
    What it does: jittered points that are arranged within their cells so that the projections on x and y are stratified
    into N intervals as well. The arrangement is correlated from row to row, which spreads the points.

    When it wins: on integrands of two dimensions it is hard to beat at a fixed spp, and it has no favourite counts.

    When it loses: its rows are nearly a lattice: its spectrum has peaks at √N along the axes, and a pattern of that
    period aliases. Prefixes are no good sets, so a picture that is stopped early has little of it. Only three kinds of
    the elementary intervals are filled.

    Source: Kensler 2013, "Correlated Multi-Jittered Sampling" (Pixar Technical Memo 13-01); Mitsuba 3, ``multijitter``.
    """,
    "orthogonal": """
    What it does: the samples of all dimensions come from one orthogonal array of strength 2 (Bose): every pair of
    dimensions, not only neighbours, is stratified on a p × p grid.

    When it wins: where structure lies between dimensions that padded samplers pair at random, such as the x of a pixel
    and the y of a lamp.

    When it loses: by its counts, squares of primes: 256 becomes 289. Within a pair it is nearly a lattice, as
    multijitter is, and no net.

    Source: Jarosz, Enayet, Kensler, Kilpatrick and Christensen 2019, "Orthogonal Array Sampling for Monte Carlo
    Rendering"; Mitsuba 3, ``orthogonal``.
    """,
    "ldsampler": """
    What it does: one scrambled (0,2)-net per pixel, whose points serve every dimension in another order.

    When it wins: on integrands of two dimensions, as nets do: all elementary intervals are filled.

    When it loses: its scrambling is by exclusive or, which leaves the net's own structure (see the spectrum): it may be
    far better or far worse than Owen-scrambled points on one integrand and the other way round at the next spp. All
    dimensions of a pixel have the same points. spp is rounded up to a power of four.

    Source: Kollig and Keller 2002, "Efficient Multidimensional Sampling"; Mitsuba 3, ``ldsampler``.
    """,
}

# What the columns of the tables are.
EVENNESS = """
*distance*: smallest distance of two points on the torus, relative to the hexagonal bound √(2/(√3 N)). *void*: radius of
the largest empty disc, relative to the hexagonal lattice's. *L2-star*: discrepancy, and *power* at the lowest
frequencies, 0 < |k| < 1.5, both relative to random points. *grids*: of all ways to cut the pixel into N equal boxes,
columns × rows, those with one point in each box.
"""
ERRORS = f"""
Mean squared error on the [test functions](../../renderer/samplers/integrands.py), divided by that of as many random
points, over {PIXELS} pixels of {PICTURES} pictures; some per cent uncertain. *slope*: how the mean squared error falls
with N between the ends; random points have −1. Only the two dimensions of a pixel are tested here. In a render, padded
samplers meet the rest of the integrand at random, and every slope is −1 in the end.
"""
MISTAKES = """
The same for samplers that show a published mistake on purpose, against the spp that were *asked*: how a student report
on pbrt-v3 came to its flat and rising curves. None of them is a sampler to render with.
"""


def main() -> None:
    parser = argparse.ArgumentParser(description="Make the pages of the samplers in docs/samplers.")
    how = parser.add_mutually_exclusive_group()
    how.add_argument("--text", action="store_true", help="write the pages only, with the numbers that are there")
    how.add_argument("--check", action="store_true", help="write nothing; fail if a page is out of date")
    options = parser.parse_args()
    FOLDER.mkdir(exist_ok=True)
    if not (options.text or options.check):
        measure_all()
    written = pages(json.loads(NUMBERS.read_text("utf-8")))
    if options.check:
        found = {file.name: file.read_text("utf-8") for file in FOLDER.glob("*.md")}
        old = sorted(name for name in written.keys() | found.keys() if written.get(name) != found.get(name))
        if old:
            sys.exit(f"out of date in docs/samplers: {', '.join(old)}; run `python docs/make_samplers.py --text`")
        return
    for name, text in written.items():
        (FOLDER / name).write_text(text, "utf-8")


# ------------------------------------------------------------------------------------------ pictures and numbers


def measure_all() -> None:
    """The figure of every sampler, and numbers.json."""
    os.environ.update(devices.pick("llvm").environment)
    from renderer.variant import use

    use("llvm_ad_rgb")
    numbers: dict[str, dict[str, Any]] = {}
    for entry in catalog.entries("sampler").values():
        if entry.name in UNDRAWN:
            continue
        for label in (entry.name, *replays(entry)):
            numbers[label] = {str(count): measure(label, count) for count in COUNTS}
            print(f"{label}: measured")
        points = drawn(entry.name, FIGURE["spp"], FIGURE["sets"], SEED)
        picture = FOLDER / f"{entry.name}.png"
        picture.write_bytes(figure_png(points, entry.name, summary(points)))
        print(f"{picture.relative_to(ROOT)}: {picture.stat().st_size / 1000:.0f} kB")
    NUMBERS.write_text(json.dumps(numbers, indent=1, ensure_ascii=False) + "\n", "utf-8")


def drawn(label: str, count: int, sets: int, seed: int) -> Points:
    """What ``dartboard points`` would write."""
    choice = catalog.resolve("sampler", label)
    return draw(choice, catalog.rendered_spp(choice, count), sets, seed)[0]


def measure(label: str, count: int) -> dict[str, Any]:
    """What the tables say of a sampler at one spp; errors are divided by those of as many random points."""
    points = np.concatenate([drawn(label, count, PIXELS, SEED + k) for k in range(PICTURES)])
    rendered = points.shape[1]
    compared = count if catalog.is_replay(label) else rendered  # a replay is read against what was asked
    found = summary(points[:: max(1, len(points) * rendered // SUMMARY_POINTS)])
    return {
        "spp_actual": rendered,
        "distance": rounded(found["min_distance"]["relative"]),
        "void": rounded(found["coverage_radius"]["relative"]),
        "l2_star": rounded(found["l2_star"]["relative"]),
        "power": rounded(found["low_frequency_power"]),
        "filled": len(full_grids(found)),
        "grids": len(found["intervals"]),
        "errors": {
            name: rounded(mse(INTEGRANDS[name], points) / INTEGRANDS[name].variance * compared) for name in SHOWN
        },
    }


def replays(entry: Entry) -> list[str]:
    """The labels of an entry's replays: of a parameter that is called so."""
    options = [option for item in entry.parameters if item.name == REPLAYS for option in item.replays]
    return [f"{entry.name}:{REPLAYS}={option}" for option in options]


def rounded(value: float) -> float:
    """To three digits: more would be noise."""
    return float(f"{value:.3g}")


# ------------------------------------------------------------------------------------------ pages


def pages(numbers: Mapping[str, Any]) -> dict[str, str]:
    """Every page by its file name."""
    texts = MITSUBAS | docstrings()
    entries = catalog.entries("sampler").values()
    found = {f"{entry.name}.md": page(entry, texts[entry.name], numbers) for entry in entries}
    return found | {"README.md": overview(numbers)}


def docstrings() -> dict[str, str]:
    """
    The docstring of every plugin's class by the plugin's name.

    Read from the source, because importing a plugin needs a Mitsuba with a variant; ``renderer/plugins.py`` says which
    class has which name.
    """
    tree = ast.parse((ROOT / "renderer" / "plugins.py").read_text("utf-8"))
    modules = {
        alias.name: node.module
        for node in ast.walk(tree)
        if isinstance(node, ast.ImportFrom) and node.module
        for alias in node.names
    }
    return {
        str(key.value): docstring(modules[value.id], value.id)
        for node in ast.walk(tree)
        if isinstance(node, ast.Dict)
        for key, value in zip(node.keys, node.values, strict=True)
        if isinstance(key, ast.Constant) and isinstance(value, ast.Name) and value.id in modules
    }


def docstring(module: str, name: str) -> str:
    source = ROOT.joinpath(*module.split(".")).with_suffix(".py").read_text("utf-8")
    (defined,) = (node for node in ast.parse(source).body if isinstance(node, ast.ClassDef) and node.name == name)
    return ast.get_docstring(defined) or ""


def paragraphs(text: str) -> dict[str, str]:
    """Paragraphs by the words before their colon; the one that begins with none of TITLES is "", what it is."""
    found = {}
    for paragraph in text.strip().replace("``", "`").split("\n\n"):
        title, _, rest = " ".join(paragraph.split()).partition(": ")
        if title in TITLES:
            found[title] = rest[:1].upper() + rest[1:]
        else:
            found[""] = " ".join([found.get("", ""), *paragraph.split()]).strip()
    return found


def page(entry: Entry, text: str, numbers: Mapping[str, Any]) -> str:
    """The page of one sampler."""
    told = paragraphs(text)
    parts = [f"# {entry.name}", told.get("") or f"{entry.line[:1].upper()}{entry.line[1:]}."]
    if entry.name not in UNDRAWN:
        asked = f"{entry.name} --spp {FIGURE['spp']} --sets {FIGURE['sets']} --seed {SEED}"
        parts += [
            f"![Points, spectrum and distances of {entry.name}]({entry.name}.png)",
            f"Dashed: random points. Drawn by `dartboard points {asked} -o points.npz --plot {entry.name}.png`.",
        ]
    for title in TITLES[:3]:
        parts += [f"## {title}", told[title]] if title in told else []
    parts += ["## Parameters", parameters(entry)]
    if entry.name in numbers:
        rows = [shape(found) for found in numbers[entry.name].values()]
        told_of = "Columns are explained [beside the other samplers](README.md)."
        parts += ["## In numbers", table(SHAPE, rows), errors(numbers, [entry.name]), told_of]
    if "Replays" in told:
        parts += ["## Replays", told["Replays"], errors(numbers, replays(entry))]
    parts += ["## Source", told["Source"], "[All samplers](README.md)"]
    return "\n\n".join(filter(None, parts)) + "\n"


def parameters(entry: Entry) -> str:
    """What it can be told, and which spp it renders."""
    counts = f"Samples per pixel: {spp(entry)}."
    if entry.aliases:
        counts += f" Also called {', '.join(f'`{alias}`' for alias in entry.aliases)}."
    if not entry.parameters:
        return f"None. {counts}"
    rows = [[f"`{item.name}`", default(item), item.unit, item.allowed, meaning(item)] for item in entry.parameters]
    return table(["parameter", "default", "unit", "allowed", "what it does"], rows) + "\n\n" + counts


def spp(entry: Entry) -> str:
    return entry.rounding + (f", at most {entry.limit}" if entry.limit else "")


def default(item: Parameter) -> str:
    if item.default is None or item.default == "":
        return "required" if item.required else "not set"
    return f"`{str(item.default).lower() if isinstance(item.default, bool) else item.default}`"


def meaning(item: Parameter) -> str:
    options = [f"`{option}`: {item.meaning(option)}" for option in item.options if option and item.meaning(option)]
    return "; ".join([item.line, *options])


def overview(numbers: Mapping[str, Any]) -> str:
    """README.md: every sampler beside the others."""
    entries = catalog.entries("sampler").values()
    names = [entry.name for entry in entries if entry.name in numbers]
    mistakes = [label for entry in entries for label in replays(entry) if label in numbers]
    listed = [[f"[{entry.name}]({entry.name}.md)", entry.line, entry.source, spp(entry)] for entry in entries]
    largest = str(COUNTS[-1])
    even = [[name, *shape(numbers[name][largest])] for name in names]
    parts = [
        "# Samplers", "What draws the numbers of a render. `python docs/make_samplers.py` makes these pages.",
        table(["sampler", "what it is", "from", "samples per pixel"], listed),
        f"## How even their points are, at {largest} samples per pixel", table(["sampler", *SHAPE], even), EVENNESS,
        "## Their errors relative to random points", errors(numbers, names), ERRORS,
        "## Replays", MISTAKES, errors(numbers, mistakes),
    ]  # fmt: skip
    return "\n\n".join(part.strip() for part in parts if part) + "\n"


def shape(found: Mapping[str, Any]) -> list[str]:
    """A row of evenness."""
    numbers = [f"{found[key]:g}" for key in ("distance", "void", "l2_star", "power")]
    return [str(found["spp_actual"]), *numbers, f"{found['filled']} of {found['grids']}"]


def errors(numbers: Mapping[str, Any], labels: list[str]) -> str:
    """Relative errors at every count and the slope between the ends, by integrand."""
    labels = [label for label in labels if label in numbers]
    if not labels:
        return ""
    heads = [f"{name} {' / '.join(map(str, COUNTS))}" for name in SHOWN]
    rows = []
    for label in labels:
        row = [f"`{label}`"]
        for name in SHOWN:
            values = [numbers[label][str(count)]["errors"][name] for count in COUNTS]
            row += [" / ".join(f"{value:g}" for value in values), slope(numbers[label], name, label)]
        rows.append(row)
    return table(["sampler", *(cell for head in heads for cell in (head, "slope"))], rows)


def slope(counts: Mapping[str, Any], name: str, label: str) -> str:
    """log MSE over log N between the ends; N is what is rendered, or for a replay what was asked."""
    ends = [counts[str(count)] for count in (COUNTS[0], COUNTS[-1])]
    asked = catalog.is_replay(label)
    n = [COUNTS[0], COUNTS[-1]] if asked else [end["spp_actual"] for end in ends]
    low, high = (end["errors"][name] / count for end, count in zip(ends, n, strict=True))
    return f"{math.log(high / low) / math.log(n[1] / n[0]):+.2f}".replace("-", "−")


def table(heads: list[str], rows: list[list[str]]) -> str:
    """A table in Markdown."""
    lines = [heads, ["---"] * len(heads), *rows]
    return "\n".join("| " + " | ".join(cell.replace("|", "\\|") for cell in line) + " |" for line in lines)


if __name__ == "__main__":
    main()
