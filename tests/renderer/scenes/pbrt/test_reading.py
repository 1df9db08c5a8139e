# ruff: noqa: E501 - scenes read better unbroken
"""Files as in the wild are read; bad ones are one sentence with file and line; nothing is a traceback."""

from __future__ import annotations

import io
import struct
import subprocess
import sys
import zlib
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from PIL import Image

from renderer import catalog
from renderer.catalog import Entry, Parameter
from renderer.errors import DartboardError, SceneError
from renderer.scenes.pbrt import lexer, meshes, noise, parser, ply, spectra
from renderer.scenes.pbrt.convert import convert
from renderer.scenes.pbrt.lexer import Place
from renderer.scenes.pbrt.materials import remap
from tests.renderer.scenes.pbrt.conftest import CAMERA, FILM, Scenes

HERE = Place("a.pbrt", 1)
MESH = 'Shape "trianglemesh" "integer indices" [0 1 2] "point P" [0 0 0 1 0 0 0 1 0]'
PLY = (
    "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\n"
    "property float y\nproperty float z\n"
    "element face 1\nproperty list uchar int vertex_indices\nend_header\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n"
)


def test_files_as_in_the_wild(scenes: Scenes) -> None:
    """No brackets, old type names, spaces in quotes, comments everywhere: nothing of it is worth a word."""
    source = scenes(
        '# "a comment"\nMaterial "matte" "color Kd" [ .5 .4 # why\n .3 ]\n'
        'Shape "trianglemesh" "integer indices "[0 1 2] "point3 P" [0 0 0 1. 0 0 0 1e0 0] "normal  N" [0 0 -1 0 0 -1 0 0 -1]\n'
        'Shape\t"sphere" "float radius" .5 "float  zmin " -1 "bool x" "true"\r\nTranslate 1 0 0',
        options=CAMERA + FILM + 'Sampler "stratified" "integer xsamples" 3 "integer ysamples" [5] "bool jitter" false',
    )
    assert source.notes == ('scene.pbrt, line 10: "bool x" is no parameter of Shape "sphere" here; it is ignored',)
    assert (source.defaults.sampler, source.defaults.spp) == ("stratified:jitter=false", 15)
    assert (source.defaults.max_depth, source.defaults.integrator) == (6, "path")


def test_each_unknown_parameter_is_told_once_by_line(scenes: Scenes) -> None:
    source = scenes(
        'Shape "sphere" "float a" 1 "rgb b" [1 1 1]\nMaterial "matte" "float c" 1\nShape "sphere"\nShape "sphere"'
    )
    places = [note.split(":")[0] for note in source.notes]
    assert places == ["scene.pbrt, line 6", "scene.pbrt, line 6", "scene.pbrt, line 7"]


@pytest.mark.parametrize(
    ("options", "sampler", "spp", "words"),
    [
        ('Sampler "poissondisk" "integer numPoints" [200] "float minDist" [0.05]', "poissondisk:min_dist=0.05", 200, ""),
        ('Sampler "poissondisk" "integer numPoints" [200] "float minDist" [-1]', "poissondisk", 200, "minDist"),
        ('Sampler "poissondisk" "integer numPoints" [200] "float minDist" [0.15]', "poissondisk", 200, "minDist"),
        ('Sampler "relaxedpoissondisk" "integer numPoints" [8] "float minDist" [0.15]', "relaxedpoissondisk:min_dist=0.15", 8, ""),
        ('Sampler "random"', "independent", 4, ""),
        ('Sampler "halton" "integer pixelsamples" 10', "halton", 10, ""),
        ('Sampler "02sequence"', "sobol", 16, "same quality"),
        ('Sampler "maxmindist" "integer pixelsamples" 64', "pmj02bn", 64, "same quality"),
        ('Sampler "stratified"', "stratified", 16, ""),
        ('Sampler "magic"', "independent", 16, "unknown"),
    ],
)  # fmt: skip
def test_samplers(scenes: Scenes, options: str, sampler: str, spp: int, words: str) -> None:
    source = scenes("", options=CAMERA + FILM + options)
    assert (source.defaults.sampler, source.defaults.spp) == (sampler, spp)
    assert any(words in note for note in source.notes) if words else not source.notes


def test_film_and_depth_are_defaults(scenes: Scenes) -> None:
    options = (
        'Film "image" "integer xresolution" 100 "integer yresolution" 50 "float cropwindow" [0 .5 .2 1]\n'
        'Integrator "directlighting"\n'
    )
    source = scenes("", options=options)
    assert (source.defaults.width, source.defaults.height, source.defaults.integrator) == (100, 50, "direct")
    assert (source.defaults.crop, source.notes) == ((0, 10, 50, 40), ())
    assert scenes("", options='Film "image" "float cropwindow" [0 1 0 1]').defaults.crop is None
    assert scenes("", options='Integrator "path" "integer maxdepth" 0').defaults.max_depth == 1


@pytest.mark.parametrize(
    ("line", "rfilter", "words"),
    [
        ("box", "box", ""),
        ('box" "float xwidth" 1 "float ywidth" 1', "box", "ends 0.5 pixels from its centre here, not 1"),
        ("triangle", "tent:radius=2", ""),
        ('triangle" "float xwidth" 1.5 "float ywidth" 3', "tent:radius=1.5", "ywidth = 3 is left out"),
        ("gaussian", "gaussian", ""),
        ('gaussian" "float alpha" 8 "float xwidth" 1 "float ywidth" 1', "gaussian:stddev=0.25", ""),
        ('gaussian" "float xwidth" 3 "float ywidth" 3', "gaussian", "ends 2 pixels from its centre here, not 3"),
        ('mitchell" "float B" 0 "float C" .5', "mitchell:B=0,C=0.5", ""),
        ('mitchell" "float C" 2', "box", "C = 2"),
        ('sinc" "float xwidth" 3 "float ywidth" 3', "lanczos", ""),
        ('sinc" "float tau" 3.5', "lanczos:lobes=4", "tau = 4 here, not 3.5"),
        ("magic", "box", "'magic' is unknown"),
        ('box" "float width" 1', "box", "no parameter of PixelFilter"),
    ],
)  # fmt: skip
def test_filters_are_defaults(scenes: Scenes, line: str, rfilter: str, words: str) -> None:
    """The filter that a cell has; what cannot be matched is said by line."""
    text = line if '"' in line else line + '"'
    source = scenes("", options=f'{CAMERA}{FILM}PixelFilter "{text}')
    assert source.defaults.rfilter == rfilter
    assert all(words in note and "line 4" in note for note in source.notes) and bool(source.notes) == bool(words)


TWO_LAMPS = 'LightSource "point" LightSource "distant"'


@pytest.mark.parametrize(
    ("line", "world", "integrator", "words"),
    [
        ('path" "string lightsamplestrategy" "power"', "", "path:light_sampler=power", ""),
        ('volpath" "string lightsamplestrategy" "spatial"', "", "path:light_sampler=spatial", "volpath"),
        ('path" "string lightsamplestrategy" "uniform"', TWO_LAMPS, "path", ""),
        ('path" "string lightsamplestrategy" "magic"', TWO_LAMPS, "path", "'magic' is left out"),
        ('path"', TWO_LAMPS, "path:light_sampler=spatial", ""),
        ('path"', 'LightSource "point"', "path", ""),
        ('bdpt"', TWO_LAMPS, "bdpt:light_sampler=power", ""),
        ('directlighting"', TWO_LAMPS, "direct", ""),
    ],
)
def test_how_lamps_are_picked_is_a_default(
    scenes: Scenes, monkeypatch: pytest.MonkeyPatch, line: str, world: str, integrator: str, words: str
) -> None:
    """pbrt's own default where there is a choice and the file does not say; nothing that the catalog does not offer."""
    _offer(monkeypatch, Parameter("light_sampler", str, "uniform", "", options=("uniform", "power", "spatial")))
    source = scenes(world, options=f'Integrator "{line}')
    assert source.defaults.integrator == integrator
    assert any(words in note for note in source.notes) if words else not source.notes


def test_a_catalog_without_light_samplers(scenes: Scenes, monkeypatch: pytest.MonkeyPatch) -> None:
    _offer(monkeypatch)
    source = scenes(TWO_LAMPS, options='Integrator "path" "string lightsamplestrategy" "power"')
    assert source.defaults.integrator == "path"
    assert ["line 1" in note and "'power' is left out" in note for note in source.notes] == [True]
    assert scenes(TWO_LAMPS, options='Integrator "path"').notes == ()


def test_a_scene_for_bdpt_loads(scenes: Scenes, monkeypatch: pytest.MonkeyPatch, variant: str) -> None:
    """What draws it is the catalog's business; the scene names it, no more."""
    from renderer.scenes.load import load

    _offer(monkeypatch)
    source = scenes(MESH, options='Integrator "bdpt"')
    assert source.defaults.integrator == "bdpt" and load(source.folder, source.main, width=8, height=8).scene.shapes()


def _offer(monkeypatch: pytest.MonkeyPatch, *parameters: Parameter) -> None:
    """A catalog whose path and bdpt have these parameters and max_depth."""
    depth = Parameter("max_depth", int, None, "", estimand=True)
    known = {
        name: Entry("integrator", name, "", "", name, parameters=(depth, *parameters)) for name in ("path", "bdpt")
    }
    entries = catalog.entries
    monkeypatch.setattr(
        catalog, "entries", lambda axis: {**entries(axis), **known} if axis == "integrator" else entries(axis)
    )


# Of pbrt-v3's src/filters, along one axis and for its defaults, but the sinc's, which is Mitsuba's where τ is the radius.
ALONG = {
    "triangle": lambda x: np.maximum(0, 2 - x),
    "gaussian": lambda x: np.maximum(0, np.exp(-2 * x**2) - np.exp(-8)),
    "mitchell": lambda x: np.where(x > 1, -7 / 18 * x**3 + 2 * x**2 - 10 / 3 * x + 16 / 9, 7 / 6 * x**3 - 2 * x**2 + 8 / 9),
    'sinc" "float xwidth" 3 "float ywidth" 3 "float tau" 3': lambda x: np.sinc(x) * np.sinc(x / 3),
}  # fmt: skip


@pytest.mark.parametrize("kind", ALONG)
def test_filters_are_the_same_functions(scenes: Scenes, variant: str, kind: str) -> None:
    import mitsuba as mi

    text = kind if '"' in kind else kind + '" "float xwidth" 2'
    choice = catalog.resolve("rfilter", scenes("", options=f'PixelFilter "{text}').defaults.rfilter)
    x = np.linspace(0, 1.99, 50)
    found = np.array(mi.load_dict({"type": choice.name, **dict(choice.parameters)}).eval(mi.Float(x)))
    assert found / found[0] == pytest.approx(ALONG[kind](x) / ALONG[kind](0 * x)[0], abs=2e-3)


def png(width: int, height: int) -> bytes:
    """A grey picture, or the beginning of one that says that it is as large."""
    if width * height > 2**20:
        header = b"IHDR" + struct.pack(">IIBBBBB", width, height, 8, 0, 0, 0, 0)
        return b"\x89PNG\r\n\x1a\n" + struct.pack(">I", 13) + header + struct.pack(">I", zlib.crc32(header))
    file = io.BytesIO()
    Image.new("L", (width, height)).save(file, "PNG")
    return file.getvalue()


PNG, VAST = png(64, 64), png(100_000, 100_000)
BAD = {
    "unknown directive": ("Shpae \"sphere\"", "line 6: unknown directive 'Shpae'; did you mean Shape?"),
    "never ended": ("AttributeBegin", "line 6: AttributeBegin is not ended"),
    "never begun": ("AttributeEnd", "line 6: AttributeEnd without its AttributeBegin"),
    "another block": ("AttributeBegin\nTransformEnd", "line 7: TransformEnd without its TransformBegin"),
    "include cycle": ('Include "scene.pbrt"', "line 6: 'scene.pbrt' includes itself"),
    "include outside": ('Include "../x.pbrt"', "line 6: the included file '../x.pbrt' leads out of the scene's folder"),
    "include absolute": ('Include "/etc/passwd"', "leads out of the scene's folder"),
    "include missing": ('Include "none.pbrt"', "line 6: the included file 'none.pbrt' does not exist"),
    "texture outside": ('Texture "t" "float" "imagemap" "string filename" "/a.png"', "line 6: the picture '/a.png' leads out"),
    "texture missing": ('Material "matte" "texture Kd" "none"\nShape "sphere"', "unknown texture 'none' in scene.pbrt, line 6"),
    "texture no picture": ('Texture "t" "spectrum" "imagemap" "string filename" "no.png"\nMaterial "matte" "texture Kd" "t"\nShape "sphere"',
                           "line 6: the picture 'no.png' cannot be read here"),
    "texture cut": ('Texture "t" "spectrum" "imagemap" "string filename" "cut.png"\nMaterial "matte" "texture Kd" "t"\nShape "sphere"',
                    "line 6: the picture 'cut.png' cannot be read here"),
    "texture too large": ('Texture "t" "spectrum" "imagemap" "string filename" "big.png" "float scale" 2\nMaterial "matte" "texture Kd" "t"\nShape "sphere"',
                          "line 6: the picture 'big.png' "),
    "sky no picture": ('LightSource "infinite" "string mapname" "no.exr"', "line 6: the picture 'no.exr' cannot be read here"),
    "sky no hdr": ('LightSource "infinite" "string mapname" "no.hdr"', "line 6: the picture 'no.hdr' cannot be read here"),
    "sky no picture at all": ('LightSource "infinite" "string mapname" "cut.ply"', "line 6: cut.ply is no picture"),
    "mesh outside": ('Shape "plymesh" "string filename" "../a.ply"', "line 6: the mesh '../a.ply' leads out"),
    "ply truncated": ('Shape "plymesh" "string filename" "cut.ply"', "line 6: the mesh 'cut.ply' is truncated"),
    "not a ply": ('Shape "plymesh" "string filename" "scene.pbrt"', "is no PLY file"),
    "open list": ('Shape "sphere" "float radius" [1', "line 6: the list that starts here has no ']'"),
    "open string": ('Shape "sphere', "line 6: a string that is not closed in its line"),
    "mixed list": ('Shape "sphere" "float radius" [1 "a"]', "line 6"),
    "a word in numbers": ('Shape "sphere" "float radius" [1 two]', "line 6: 'two' is no number"),
    "infinite": ("Translate 1e999 0 0", "line 6: a number is infinite"),
    "nan": ('Shape "sphere" "float radius" [nan]', "line 6"),
    "too few numbers": ("Translate 1 2", "line 6: Translate takes 3 numbers, and here are 2"),
    "no value": ('Shape "sphere" "float radius"', "line 6: the parameter 'radius' of Shape \"sphere\" has no value"),
    "no type": ('Shape "sphere" "radius" 1', "line 6: 'radius' of Shape \"sphere\" is no parameter"),
    "flat": ("Scale 0 1 1", "line 6: Scale makes everything flat"),
    "bad index": ('Shape "trianglemesh" "integer indices" [0 1 9] "point P" [0 0 0 1 0 0 0 1 0]', "refers to vertex 9"),
    "two thirds of a point": ('Shape "trianglemesh" "integer indices" [0 1 2] "point P" [0 0]', "line 6: 'P' of type point3"),
    "no points": ('Shape "trianglemesh" "integer indices" [0 1 2]', "line 6: Shape \"trianglemesh\" has no P"),
    "curve": ('Shape "curve"\nShape "nurbs"', "line 6: the shape 'curve' is not supported"),
    "unknown shape": ('Shape "blob"', "line 6: the shape 'blob' is unknown"),
    "no material": ('NamedMaterial "x"', "unknown material 'x'"),
    "no object": ('ObjectInstance "x"', "unknown object 'x'"),
    "negative exponent": ('Material "anisotropicPhong" "float nu" -1\nShape "sphere"', "line 6: nu = -1"),
    "goniometric": ('LightSource "goniometric"', "line 6: the light 'goniometric' is not supported"),
    "camera late": ('Camera "perspective"', "line 6: Camera after WorldBegin"),
}  # fmt: skip


@pytest.mark.parametrize("case", BAD)
def test_bad_input_is_one_sentence_with_its_line(scenes: Scenes, case: str) -> None:
    world, words = BAD[case]
    nothing = dict.fromkeys(("no.png", "no.exr", "no.hdr"), "no picture")
    files = {"cut.ply": PLY[:-12], "cut.png": PNG[:-20], "big.png": VAST, **nothing}
    scenes.write(world, options=CAMERA + FILM, files=files)
    with pytest.raises(SceneError) as error:
        scenes.find()
    assert words in str(error.value)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (b"", "there is no WorldBegin"),
        (b"WorldBegin\n", "there is no WorldEnd"),
        (b"WorldBegin\n# M\xfcller\nWorldEnd", "line 2: the file is not UTF-8"),
        ("WorldBegin".encode("utf-16"), "is not UTF-8"),
        (b"WorldBegin\n\0", "line 2: the file holds zero bytes"),
        (b'Camera "realistic"\nWorldBegin WorldEnd', "line 1: the camera 'realistic' is not supported"),
        (b'Film "image" "float cropwindow" [.5 .5 0 1]\nWorldBegin WorldEnd', "line 1: the cropwindow holds no pixel"),
        (b'PixelFilter "gaussian" "float alpha" 0\nWorldBegin WorldEnd', "line 1: alpha = 0 of PixelFilter"),
        (b'Scale 1 2 1\nCamera "perspective"\nWorldBegin WorldEnd', "line 2: the transform of the camera stretches"),
    ],
)
def test_bad_files(scenes: Scenes, text: bytes, words: str) -> None:
    scenes.raw(text)
    with pytest.raises(SceneError, match=words):
        scenes.find()


def test_limits(scenes: Scenes, monkeypatch: pytest.MonkeyPatch) -> None:
    """Text, directives and vertices are bounded, before they take memory; a mesh counts by its header."""
    monkeypatch.setattr(parser, "DIRECTIVES_MAX", 1000)
    scenes.write("Identity\n" * 2000)
    with pytest.raises(SceneError, match="more than 1000 directives"):
        scenes.find()
    scenes.write('Shape "plymesh" "string filename" "big.ply"',
                 files={"big.ply": PLY.replace("vertex 3", f"vertex {meshes.VERTICES_MAX + 1}")})  # fmt: skip
    with pytest.raises(SceneError, match="line 6: the scene has more than 20000000 vertices"):
        scenes.find()
    monkeypatch.setattr(parser, "TEXT_MAX", 100)
    scenes.write("# " + "x" * 100)
    with pytest.raises(SceneError, match="of pbrt text"):
        scenes.find()


def test_a_link_leads_nowhere(scenes: Scenes, tmp_path: Path) -> None:
    (tmp_path / "secret.pbrt").write_text("Identity")
    scenes.write('Include "link.pbrt"')
    (scenes.folder / "link.pbrt").symlink_to(tmp_path / "secret.pbrt")
    with pytest.raises(SceneError, match="a link that leads out"):
        scenes.find()


def test_includes_are_read_in_place(scenes: Scenes) -> None:
    scenes.write(
        'Include "sub/a.pbrt"\nShape "sphere" "float y" 1', files={"sub/a.pbrt": 'Shape "sphere" "float x" 1\n'}
    )
    assert [note.split(":")[0] for note in scenes.find().notes] == ["sub/a.pbrt, line 1", "scene.pbrt, line 7"]


def binary_ply(order: str, name: str) -> bytes:
    header = PLY.partition("end_header\n")[0].replace("ascii", name) + "end_header\n"
    faces = np.array([(3, (0, 1, 2))], [("n", "u1"), ("i", order + "i4", 3)])
    return header.encode() + np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0]], order + "f4").tobytes() + faces.tobytes()


def read_ply(folder: Path, content: bytes) -> meshes.Mesh:
    (folder / "a.ply").write_bytes(content)
    return ply.read(folder / "a.ply", "a.ply", HERE, meshes.Budget())


def test_ply_of_every_format(tmp_path: Path) -> None:
    for content in (PLY.encode(), binary_ply("<", "binary_little_endian"), binary_ply(">", "binary_big_endian")):
        mesh = read_ply(tmp_path, content)
        assert mesh.faces.tolist() == [[0, 1, 2]] and mesh.vertices.tolist() == [[0, 0, 0], [1, 0, 0], [0, 1, 0]]
        for cut in range(1, len(content) - 2):
            with pytest.raises(SceneError, match=r"a.pbrt, line 1"):
                read_ply(tmp_path, content[:cut])


def test_quads_become_two_triangles(tmp_path: Path) -> None:
    text = (
        PLY.replace("vertex 3", "vertex 4").replace("face 1", "face 2").replace("3 0 1 2", "1 1 0\n4 0 1 3 2\n3 0 1 2")
    )
    assert read_ply(tmp_path, text.encode()).faces.tolist() == [[0, 1, 3], [0, 3, 2], [0, 1, 2]]


def colour(text: str, folder: Path) -> np.ndarray:
    (folder / "main.pbrt").write_text(f'LightSource "point" {text}')
    home = parser.Folder(folder)
    (found,) = parser.directives(home, "main.pbrt")
    return spectra.colour(found.parameters.items["I"], home)


def test_colours(tmp_path: Path) -> None:
    """A flat spectrum is grey of luminance 1 in every spelling; a body of 6500 K is nearly white, one of 2700 K red."""
    (tmp_path / "flat.spd").write_text("# flat\n400 1\n700 1 # end\n")
    flat = colour('"spectrum I" [700 1 400 1]', tmp_path)
    assert flat @ [0.2127, 0.7152, 0.0722] == pytest.approx(470 / 471, rel=1e-3)  # pbrt's own sum
    assert (colour('"spectrum I" "flat.spd"', tmp_path) == flat).all()
    assert colour('"xyz I" [.9505 1 1.089]', tmp_path) == pytest.approx(1, rel=2e-3)
    assert colour('"rgb I" [1 2 3]', tmp_path).tolist() == [1, 2, 3]
    day, lamp = colour('"blackbody I" [6500 1]', tmp_path), colour('"blackbody I" [2700 2]', tmp_path)
    assert day.max() / day.min() < 1.15 and lamp[0] > 2 * lamp[1] > 4 * lamp[2] > 0
    with pytest.raises(SceneError, match="does not exist"):
        colour('"spectrum I" "none.spd"', tmp_path)


def test_roughness_and_noise() -> None:
    """pbrt's curve at its ends, and noise that vanishes at no half cell by accident: known and bounded."""
    assert remap(1.0) == pytest.approx(1.62142) and remap(0.0) == remap(1e-3)
    x, y = np.meshgrid(np.linspace(-5, 5, 101), np.linspace(-5, 5, 101))
    found = noise.noise(x, y)
    assert np.abs(found).max() <= 1 and found.std() > 0.1
    assert noise.noise(x + 256, y) == pytest.approx(found, abs=1e-9)


MATERIALS = [
    "matte",
    "plastic",
    "mirror",
    "glass",
    "metal",
    "uber",
    "substrate",
    "disney",
    "anisotropicPhong",
    "translucent",
    "",
]


def test_every_material_and_shape_loads(scenes: Scenes, variant: str) -> None:
    """All of them in one scene, with alpha, bumps, textures, mixes and roughness: Mitsuba takes what we write."""
    from renderer.scenes.load import load

    world = (
        'Texture "dots" "spectrum" "dots" "float uscale" 4\nTexture "bump" "float" "checkerboard"\n'
        'Texture "mixed" "spectrum" "mix" "texture tex1" "dots" "float amount" .5\nTexture "uv" "spectrum" "uv"\n'
        'MakeNamedMaterial "a" "string type" "matte" "texture Kd" "mixed" "texture bumpmap" "bump"\n'
        'MakeNamedMaterial "b" "string type" "mirror"\nNamedMaterial "a"\nShape "sphere"\n'
        'Material "mix" "string namedmaterial1" "a" "string namedmaterial2" "b"\nShape "disk" "texture alpha" "bump"\n'
        'Material "glass" "float uroughness" .1 "float vroughness" .2\nShape "cylinder"\n'
        'Material "uber" "rgb opacity" [.5 .5 .5]\nShape "sphere" "rgb Kd" [.1 .2 .3] "float phimax" 90\n'
        'Material "metal" "float uroughness" .1 "float vroughness" .3 "rgb eta" [2 2 2]\nShape "cone"\nShape "paraboloid"\n'
        'Shape "heightfield" "integer nu" 2 "integer nv" 2 "float Pz" [0 0 0 1]\n' + MESH + "\n"
        'LightSource "spot" "rgb I" [1 1 1]\nLightSource "distant" "blackbody L" [6000 1]\nMakeNamedMedium "m" "string type" "homogeneous"\n'
    )  # fmt: skip
    world += "".join(f'Material "{name}"\nShape "sphere"\n' for name in MATERIALS)
    source = scenes(world)
    loaded = load(source.folder, source.main, width=8, height=8)
    assert len(loaded.scene.shapes()) == 8 + len(MATERIALS)
    for told in ("plastic", "substrate", "disney", "translucent", "media", "baked", "cone", "spot light"):
        assert any(told in note for note in source.notes), told
    assert len(set(source.notes)) == len(source.notes)


def test_the_same_file_is_the_same_scene(scenes: Scenes) -> None:
    """Its digest is that of what was made; the folder lives as long as the source."""
    first, second = scenes(MESH), scenes.find()
    assert first.digest == second.digest and first.folder != second.folder
    folder = first.folder
    del first
    assert not folder.exists() and second.folder.is_dir()


def test_conversion_loads_no_mitsuba(scenes: Scenes) -> None:
    scenes.write(MESH)
    code = (
        "import sys; from pathlib import Path; from renderer.scenes import sources\n"
        "sources.find('scene.pbrt', Path(sys.argv[1])); assert not {'mitsuba', 'drjit'} & set(sys.modules)"
    )
    root = Path(__file__).parents[4]
    done = subprocess.run([sys.executable, "-c", code, scenes.folder], cwd=root, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr


PIECES = st.sampled_from(['"', "[", "]", "#", "\n", " ", "1", "-.5e3", "true", '"float radius"', "Shape", '"sphere"', "WorldBegin",
                          "WorldEnd", "AttributeBegin", "AttributeEnd", "Translate", "\\", "é", '"rgb Kd" [1 1 1]', "LookAt",
                          'Material "matte"', 'ObjectBegin "a"', "ObjectEnd", '"string filename" "x"', "Include"])  # fmt: skip


@settings(
    max_examples=150, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture], derandomize=True
)
@given(st.lists(PIECES, max_size=30).map(" ".join) | st.text(max_size=60))
def test_any_text_is_a_scene_or_a_sentence(tmp_path: Path, text: str) -> None:
    (tmp_path / "a.pbrt").write_bytes(text.encode("utf-8", "surrogatepass"))
    out = tmp_path / "out"
    out.mkdir(exist_ok=True)
    try:
        convert(tmp_path / "a.pbrt", out)
    except DartboardError as error:
        assert "a.pbrt" in str(error)


@settings(max_examples=150, deadline=None, derandomize=True)
@given(st.binary(max_size=200))
def test_any_bytes_are_tokens_or_a_sentence(data: bytes) -> None:
    try:
        lines = [token.place.line for token in lexer.tokens(data, "a.pbrt")]
        assert lines == sorted(lines)
    except SceneError as error:
        assert "a.pbrt, line " in str(error)
