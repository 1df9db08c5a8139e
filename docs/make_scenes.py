"""
Make the gallery of the scenes: ``python docs/make_scenes.py [NAME …]``, in an environment of ``./dartboard test``.

Text comes from where it is true, each scene's ``about.toml``; a picture is what the scene's own integrator draws, 512 ×
512 at SPP samples per pixel, noise and all. ``--text`` writes the page again without drawing; ``--spp`` is for a hurry.
"""

from __future__ import annotations

import argparse
import json
import os
from pathlib import Path

from renderer import devices
from renderer.scenes.builtin import BUILTIN, BuiltinScene
from renderer.scenes.sources import find
from renderer.spec import seed
from service.single import cell

ROOT = Path(__file__).resolve().parent.parent
PAGE = ROOT / "docs" / "scenes.md"
FOLDER = ROOT / "docs" / "scenes"
SIDE, SPP = 512, 128  # pixels, samples per pixel
QUALITY = 75  # of the JPEG: below 150 kB for every scene
TOLD = {
    "good_for": "Good for", "hard_part": "Hard part", "bad_for": "Not for", "lamp_in_frame": "Lamp in the picture",
    "source": "Source",
}  # fmt: skip

HEAD = """\
# The scenes

Each is a folder of [renderer/scenes](../renderer/scenes) and a name in a grid: `scenes = ["sphere_figure"]`. All are
closed and have a mean luminance near 0.2. Unless a grid says otherwise they render at 256 × 256 and are measured
against the reference given here, its spp in all. Pictures: the scene's own integrator, {spp} samples per pixel. This
page is made by `docs/make_scenes.py` from the scenes' `about.toml`.
"""


def main() -> int:
    parser = argparse.ArgumentParser(prog="python docs/make_scenes.py")
    parser.add_argument("names", nargs="*", metavar="NAME", help="scenes to draw again; default: all")
    parser.add_argument("--spp", type=int, default=SPP)
    parser.add_argument("--threads", type=int)
    parser.add_argument("--text", action="store_true", help="write the page only")
    options = parser.parse_args()
    if unknown := sorted(set(options.names) - set(BUILTIN)):
        parser.error(f"unknown scene {unknown[0]!r}; known: {', '.join(BUILTIN)}")
    if not options.text:
        FOLDER.mkdir(exist_ok=True)
        device = devices.pick("auto")
        os.environ.update(device.environment)
        from renderer.variant import name, use

        use(name(device.name, "rgb"), options.threads)
        for scene in options.names or BUILTIN:
            draw(scene, options.spp)
    PAGE.write_text(page(), "utf-8")
    return 0


def draw(scene: str, spp: int) -> None:
    """Writes the JPEG of a scene."""
    import mitsuba as mi

    from renderer.render import render
    from renderer.scenes.load import load

    source = find(scene, Path())
    loaded = load(source.folder, source.main, width=SIDE, height=SIDE)
    spec = cell(source, integrator=None, sampler=None, spp=spp, size=f"{SIDE}x{SIDE}", max_depth=None)
    (drawn,) = render(spec, loaded, [seed(spec.digest, 0)])
    bitmap = mi.Bitmap(drawn.picture)
    shown = bitmap.convert(mi.Bitmap.PixelFormat.RGB, mi.Struct.Type.UInt8, srgb_gamma=True)
    shown.write(str(FOLDER / f"{scene}.jpg"), quality=QUALITY)
    print(f"{scene}: {(FOLDER / f'{scene}.jpg').stat().st_size / 1000:.0f} kB")


def page() -> str:
    return "\n".join([HEAD.format(spp=SPP), *(section(scene) for scene in BUILTIN.values())])


def section(scene: BuiltinScene) -> str:
    told = [f"- *{title}*: {text}" for field, title in TOLD.items() if (text := getattr(scene, field))]
    told.append(f"- *Reference*: {', '.join(f'`{key} = {json.dumps(item)}`' for key, item in scene.reference.items())}")
    return "\n".join(
        [f"## `{scene.name}` {scene.title}", "", scene.summary, "", f"![{scene.title}](scenes/{scene.name}.jpg)", "",
         *told, ""]
    )  # fmt: skip


if __name__ == "__main__":
    raise SystemExit(main())
