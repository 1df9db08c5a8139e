"""
What a scene file may hold: the plugins, elements, attributes, values and kinds of files that are allowed.

All of it is written out as allow-lists, so what a later Mitsuba adds is refused until somebody has looked at it.
``vet`` applies them to the XML, ``load`` to the nodes that Mitsuba makes of it. No Mitsuba here.
"""

from __future__ import annotations

import difflib
import re
from pathlib import PurePosixPath

from renderer.errors import shown

# What Mitsuba 3.9 ships, without
#   blender                                 reads memory at an address that the file names
#   batch, irradiancemeter, radiancemeter   make no picture of a scene: several cameras in one film, or one number
#   timed_sunsky                            fails in every compiled kernel, of Mitsuba's own integrators as well
PLUGINS = frozenset(
    """
    area aov bitmap blackbody blendbsdf blendphase box bsplinecurve bumpmap catmullrom checkerboard circular conductor
    constant constvolume cube cylinder d65 depth dielectric diffuse direct directional directionalarea disk distant
    ellipsoids ellipsoidsmesh envmap gaussian gridvolume hair hdrfilm heterogeneous hg homogeneous independent instance
    irregular isotropic lanczos ldsampler linearcurve mask measured measured_polarized merge mesh_attribute mitchell
    moment multijitter normalmap null obj orthogonal orthographic path perspective plastic ply point polarizer pplastic
    principled principledthin projector ptracer rawconstant rayleigh rectangle regular retarder roughconductor
    roughdielectric roughplastic sdfgrid serialized sggx shapegroup specfilm sphere spot srgb stokes stratified sunsky
    tabphase tent thindielectric thinlens twosided uniform volpath volpathmis volume
    """.split()  # noqa: SIM905 - a hundred words read better than a hundred quoted lines
)
INSTEAD = {"timed_sunsky": "no variant that compiles can render it in Mitsuba 3.9; take sunsky and its hour"}
OUR_BSDFS = frozenset({"anisophong"})  # renderer.plugins.bsdfs, which cannot be asked without Mitsuba
# Of renderer.plugins.samplers, those that need no file. A file's sampler is replaced by the cell's, but may be named.
OUR_SAMPLERS = frozenset(
    {"eliminated", "halton", "pmj02bn", "poissondisk", "relaxedpoissondisk", "sobol", "zsobol"}
)  # fmt: skip
OUR_INTEGRATORS = frozenset({"bdpt"})  # by the catalog's name: a scene's integrator is a default, and never loaded
# Registered from Python: our materials and samplers, and Mitsuba's own integrators. Those are replaced by the cell's,
# as every integrator of a file, but may be named.
PYTHON_PLUGINS = OUR_BSDFS | OUR_SAMPLERS | OUR_INTEGRATORS | {
    "direct_projective", "prb", "prb_basic", "prb_projective", "prbvolpath", "volprim_rf_basic",
}  # fmt: skip

EXTENSIONS = frozenset(  # what Mitsuba's plugins read: meshes, pictures, tables; never .so
    {".obj", ".ply", ".serialized", ".exr", ".hdr", ".rgbe", ".pfm", ".ppm", ".png", ".jpg", ".jpeg", ".bmp", ".tga"}
    | {".spd", ".vol", ".bsdf", ".txt", ".data"}
)

OBJECTS = frozenset(
    {"bsdf", "emitter", "film", "integrator", "medium", "phase", "rfilter", "sampler", "sensor", "shape"}
    | {"spectrum", "texture", "volume"}
)
_OBJECT = frozenset({"type", "id", "name"})
_XYZ = frozenset({"x", "y", "z", "value"})
ATTRIBUTES: dict[str, frozenset[str]] = {
    **dict.fromkeys(OBJECTS, _OBJECT),
    **dict.fromkeys(("float", "integer", "boolean", "string", "rgb", "default"), frozenset({"name", "value"})),
    **dict.fromkeys(("point", "vector"), _XYZ | {"name"}),
    **dict.fromkeys(("translate", "scale"), _XYZ),
    "rotate": _XYZ | {"angle"},
    "lookat": frozenset({"origin", "target", "up"}),
    "matrix": frozenset({"value"}),
    "transform": frozenset({"name"}),
    "spectrum": _OBJECT | {"value", "filename"},
    "ref": frozenset({"id", "name"}),
    "alias": frozenset({"id", "as"}),
    "include": frozenset({"filename", "name"}),
    "scene": frozenset({"version"}),
}


def unknown_plugin(name: str | None) -> str:
    """The sentence for a plugin that is not in the lists."""
    if name in INSTEAD:
        return f"plugin type {name!r} is refused: {INSTEAD[name]}"
    close = difflib.get_close_matches(name or "", PLUGINS | OUR_BSDFS, n=1)
    others = ", ".join(sorted(OUR_BSDFS))
    hint = f"did you mean {close[0]!r}?" if close else f"known are the plugins that Mitsuba 3.9 ships, and {others}"
    return f"unknown plugin type {shown(name or '')}; {hint}"


def string_fault(value: str) -> str | None:
    """
    Why a text value that is not a file name is refused, or None.

    Plugins build paths from some of them (a conductor's ``material`` becomes data/ior/NAME.spd): none may hold a path.
    """
    if re.search(r"[/\\\x00-\x1f\x7f]|\.\.", value):
        return "looks like a path; only a plain word or numbers are allowed here"
    return None


def file_fault(value: str) -> str | None:
    """Why a file name is refused by its spelling alone, or None."""
    path = PurePosixPath(value)
    if not value or not value.isprintable() or "\\" in value:
        return "is not a file name"
    if path.is_absolute() or ".." in path.parts or re.match(r"~|[A-Za-z]:", value):
        return "leads out of the scene's folder; name a file inside it"
    if "$" in value:
        return "is put together with '$'; write the file name out"
    if "plugins" in (part.lower() for part in path.parts):
        return "is in a folder named 'plugins', where Mitsuba looks for code; rename the folder"
    return None
