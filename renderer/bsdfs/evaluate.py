"""
A BSDF as its plugin evaluates it for one pair of directions: what ``dartboard bsdf`` prints.

``python -m renderer.bsdfs.evaluate --bsdf JSON --wi JSON --wo JSON [--variant V]`` does it in a process of its own and
prints ``{"eval": [r, g, b], "pdf": p}``. ``--bsdf`` is a dictionary of parameters with a ``type``; a reflectance of
three numbers is a colour.
"""

from __future__ import annotations

import argparse
import json
import os
import sys
from collections.abc import Mapping, Sequence
from typing import Any


def evaluate(bsdf: Mapping[str, Any], wi: Sequence[float], wo: Sequence[float]) -> dict[str, Any]:
    """
    ``eval``: f(wi, wo) |cos θo| in red, green and blue, per steradian; ``pdf``: the density of ``sample``, per
    steradian. Directions are unit vectors in the local frame, away from the surface. Needs a variant of RGB.
    """
    import drjit as dr
    import mitsuba as mi

    described = {
        key: {"type": "rgb", "value": list(value)} if isinstance(value, (list, tuple)) else value
        for key, value in bsdf.items()
    }
    plugin: Any = mi.load_dict(described)
    si: Any = dr.zeros(mi.SurfaceInteraction3f)
    si.wi = mi.Vector3f(*wi)
    value, pdf = plugin.eval_pdf(mi.BSDFContext(), si, mi.Vector3f(*wo))
    return {"eval": [float(channel[0]) for channel in value], "pdf": float(pdf[0])}


def main() -> int:
    parser = argparse.ArgumentParser(prog="python -m renderer.bsdfs.evaluate")
    for name in ("--bsdf", "--wi", "--wo"):
        parser.add_argument(name, type=json.loads, required=True)
    parser.add_argument("--variant", default="llvm_ad_rgb")
    options = parser.parse_args()
    from renderer.variant import use

    use(options.variant, int(os.environ.get("DARTBOARD_THREADS", "0")) or None)
    print(json.dumps(evaluate(options.bsdf, options.wi, options.wo)))
    return 0


if __name__ == "__main__":
    sys.exit(main())
