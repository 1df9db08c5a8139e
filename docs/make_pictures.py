"""Make the pictures of README.md: ``python docs/make_pictures.py``, in an environment that ./dartboard has prepared."""

from __future__ import annotations

import subprocess
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
PICTURES = (("cornell_box", "independent", 16), ("cornell_box", "multijitter", 256), ("defocus", "multijitter", 256))


def main() -> None:
    import mitsuba as mi

    mi.set_variant("llvm_ad_rgb")
    with tempfile.TemporaryDirectory() as folder:
        for scene, sampler, spp in PICTURES:
            exr = Path(folder) / "picture.exr"
            subprocess.run(
                [sys.executable, "-m", "service.cli", "render", scene, "--sampler", sampler, "--integrator", "path",
                 "--spp", str(spp), "--size", "256x256", "-o", str(exr)], cwd=ROOT, check=True,
            )  # fmt: skip
            png = ROOT / "docs" / "images" / f"{scene}-{spp}.png"
            png.parent.mkdir(exist_ok=True)
            mi.Bitmap(str(exr)).convert(mi.Bitmap.PixelFormat.RGB, mi.Struct.Type.UInt8, True).write(str(png))


if __name__ == "__main__":
    main()
