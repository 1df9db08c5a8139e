# ruff: noqa: E501 - scenes read better unbroken
"""Fixed expectations: closed forms, where known points are seen, which way textures lie, which side lamps shine to."""

from __future__ import annotations

import io
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from PIL import Image

from renderer.images import write_picture
from tests.renderer.scenes.pbrt.conftest import FILM, Scenes

Picture = Callable[..., np.ndarray]
LAMP = 'LightSource "infinite" "rgb L" [1 1 1]\n'
QUAD = '"integer indices" [0 1 2 0 2 3] "float uv" [0 0 1 0 1 1 0 1] "point P" [-1 -1 0 1 -1 0 1 1 0 -1 1 0]'


def mark(x: float, y: float, z: float) -> str:
    """A small lamp at a place."""
    return f'AttributeBegin\nTranslate {x} {y} {z}\nAreaLightSource "diffuse" "rgb L" [1 1 1]\nShape "sphere" "float radius" .1\nAttributeEnd\n'


def seen(picture: np.ndarray) -> tuple[float, float]:
    """The centre of what is bright, in pixels (x to the right, y down)."""
    grey = picture.mean(axis=2)
    y, x = np.mgrid[: grey.shape[0], : grey.shape[1]] + 0.5
    return float((grey * x).sum() / grey.sum()), float((grey * y).sum() / grey.sum())


def test_a_matte_sphere_under_a_point_light(scenes: Scenes, picture: Picture) -> None:
    """Facing pixel: Kd/π · I · cos / d², lamp in line with the camera at a distance of 3 from the surface."""
    world = 'LightSource "point" "rgb I" [9 18 27] "point from" [0 0 -4]\nMaterial "matte" "rgb Kd" [.5 .5 .5]\nShape "sphere"'
    centre = picture(scenes(world), width=33, height=33)[16, 16]
    assert centre == pytest.approx(np.array([9, 18, 27]) / 9 * 0.5 / np.pi, rel=0.01)


def test_a_furnace(scenes: Scenes, picture: Picture) -> None:
    """A white sphere in white light cannot be seen."""
    found = picture(scenes(LAMP + 'Material "matte" "rgb Kd" [1 1 1]\nShape "sphere"'), spp=256, depth=40)
    assert found.mean() == pytest.approx(1, rel=0.003)
    assert found[8:24, 8:24].mean() == pytest.approx(1, rel=0.005)


# The camera is at (0, 0, −5) and looks along +z, y up: pbrt's +x is on the right. A place of x is seen at
# 16 + 16 · x / (5 · tan 20°) of 32 pixels.
@pytest.mark.parametrize(
    ("directives", "place", "where"),
    [
        ("", (0.9, 0, 0), (0.9, 0)),
        ("", (0, 0.9, 0), (0, 0.9)),
        ("Translate .5 .3 0", (0.3, 0.2, 0), (0.8, 0.5)),
        ("Scale 3 2 1", (0.3, 0.4, 0), (0.9, 0.8)),
        ("Scale -1 1 1", (0.9, 0.3, 0), (-0.9, 0.3)),
        ("Rotate 90 0 0 1", (0.9, 0, 0), (0, 0.9)),
        ("Transform [1 0 0 0 0 1 0 0 0 0 1 0 .5 -.4 0 1]", (0, 0, 0), (0.5, -0.4)),
        ("Translate .5 0 0 ConcatTransform [0 1 0 0 -1 0 0 0 0 0 1 0 0 0 0 1]", (0.4, 0, 0), (0.5, 0.4)),
        ('Translate .7 0 0 CoordinateSystem "a" Identity CoordSysTransform "a"', (0, 0, 0), (0.7, 0)),
        ('CoordSysTransform "camera" Translate 0 0 5', (0.6, 0.5, 0), (0.6, 0.5)),
        ("LookAt 0 0 0 0 0 1 0 1 0", (0.9, 0, 0), (0.9, 0)),
        ("TransformBegin Translate 9 9 9 TransformEnd", (0.5, 0, 0), (0.5, 0)),
        ("Translate 9 9 9 Identity", (0.5, 0, 0), (0.5, 0)),
    ],
)  # fmt: skip
def test_transforms_put_things_where_pbrt_does(
    scenes: Scenes, picture: Picture, directives: str, place: tuple[float, ...], where: tuple[float, float]
) -> None:
    x, y = seen(picture(scenes(f"{directives}\n{mark(*place)}"), spp=128))
    scale = 16 / (5 * np.tan(np.radians(20)))
    assert (x, y) == (pytest.approx(16 + scale * where[0], abs=0.5), pytest.approx(16 - scale * where[1], abs=0.5))


def test_a_mirrored_camera(scenes: Scenes, picture: Picture) -> None:
    """Scale −1 before LookAt turns the picture left-right, as files from right-handed programs have it."""
    options = 'Scale -1 1 1\nLookAt 0 0 -5 0 0 0 0 1 0\nCamera "perspective" "float fov" 40\n' + FILM
    assert seen(picture(scenes(mark(0.9, 0, 0), options=options)))[0] < 12


def test_the_field_of_view_is_along_the_shorter_side(scenes: Scenes, picture: Picture) -> None:
    options = (
        'LookAt 0 0 -5 0 0 0 0 1 0 Camera "perspective" "float fov" 40\n'
        'Film "image" "integer xresolution" 64 "integer yresolution" 32'
    )
    x, y = seen(picture(scenes(mark(0.9, 0.9, 0), options=options), width=64, height=32, spp=128))
    scale = 16 / (5 * np.tan(np.radians(20)))
    assert (x, y) == (pytest.approx(32 + 0.9 * scale, abs=0.6), pytest.approx(16 - 0.9 * scale, abs=0.6))


def test_a_screen_window(scenes: Scenes, picture: Picture) -> None:
    """[0 1 −.5 .5]: the centre of the picture is half-way to the old right edge, and everything twice as large."""
    options = 'LookAt 0 0 -5 0 0 0 0 1 0 Camera "perspective" "float fov" 40 "float screenwindow" [0 1 -.5 .5]\n' + FILM
    middle = 5 * np.tan(np.radians(20)) / 2
    assert seen(picture(scenes(mark(middle, 0, 0), options=options), spp=128)) == pytest.approx((16, 16), abs=0.6)


LENS, FOCUS = 0.25, 5.0


@pytest.mark.parametrize(("distance", "zoom"), [(5.0, 1), (2.5, 1), (3.5, 1), (10.0, 1), (5.0, 2)])
def test_a_thin_lens(scenes: Scenes, picture: Picture, distance: float, zoom: float) -> None:
    """
    A point at the focal distance is sharp; another is a disc of radius lens · |focus − distance| / distance in the plane
    in focus. Of a disc of radius r the mean square distance from its centre is r²/2; the lamp and the pixels have a
    little of their own, less than a square pixel. A camera that is scaled has its lens and its focus scaled with it.
    """
    options = (
        f'Scale {zoom} {zoom} {zoom} LookAt 0 0 -5 0 0 0 0 1 0 Camera "perspective" "float fov" 40 '
        f'"float lensradius" {LENS * zoom} "float focaldistance" {FOCUS * zoom}\n' + FILM
    )
    lamp = f'AreaLightSource "diffuse"\nTranslate 0 0 {distance - 5}\nShape "sphere" "float radius" {0.01 * distance}'
    found = picture(scenes(lamp, options=options), spp=2048, width=64, height=64).mean(axis=2).astype(float)
    y, x = np.mgrid[:64, :64] - 31.5
    square = float((found * (x**2 + y**2)).sum() / found.sum())
    scale = 32 / np.tan(np.radians(20))  # pixels, of what is as large as its distance
    radius = LENS * abs(FOCUS - distance) / distance / FOCUS * scale
    own = 1 / 6 + (0.01 * scale) ** 2 / 2
    assert square - own == pytest.approx(radius**2 / 2, rel=0.03, abs=0.2)


BOX = [(x, y, z) for x in (-0.4, 0.6) for y in (-0.3, 0.5) for z in (-0.7, 0.2)]


@pytest.mark.parametrize(
    ("extra", "window", "per_unit"),
    [("", "", 16), ("Scale .5 .5 .5", "", 8), ("", '"float screenwindow" [-2 2 -2 2]', 8), ("Scale -1 1 1", "", 16)],
)
def test_an_orthographic_camera(scenes: Scenes, picture: Picture, extra: str, window: str, per_unit: float) -> None:
    """The corners of a box are where they project along the view: right = up × ahead, as pbrt's hands have it."""
    eye, ahead = np.array([3.0, 2, -4]), -np.array([3.0, 2, -4])
    ahead /= np.linalg.norm(ahead)
    right = np.cross([0, 1, 0], ahead)
    right /= np.linalg.norm(right)
    up = np.cross(ahead, right)
    if "-1" in extra:
        right = -right
    options = f'{extra} LookAt 3 2 -4 0 0 0 0 1 0\nCamera "orthographic" {window}\n' + FILM
    for corner in np.array(BOX):
        x, y = seen(picture(scenes(mark(*corner), options=options), spp=64))
        wanted = 16 + per_unit * (corner - eye) @ right, 16 - per_unit * (corner - eye) @ up
        assert (x, y) == pytest.approx(wanted, abs=0.15), corner


TURNS = {
    "": np.eye(3),
    "Rotate 90 1 0 0": np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]]),
    "Rotate -90 1 0 0 Rotate 30 0 0 1": np.array([[1.0, 0, 0], [0, 0, 1], [0, -1, 0]])
    @ np.array([[np.sqrt(3) / 2, -0.5, 0], [0.5, np.sqrt(3) / 2, 0], [0, 0, 1]]),
    "Scale -1 1 1": np.diag([-1.0, 1, 1]),
    "Scale 2 2 2": np.eye(3),
}


@pytest.mark.parametrize("turn", TURNS)
@pytest.mark.parametrize(("row", "column"), [(31, 0), (32, 53), (15, 75), (48, 120)])
def test_an_environment_map_lies_as_in_pbrt(scenes: Scenes, picture: Picture, turn: str, row: int, column: int) -> None:
    """
    A bright texel is seen in the direction (sin θ cos φ, sin θ sin φ, cos θ) of the light's own space, with θ = π v from
    the map's upper edge and φ = 2π u from its left one: the map's middle row is the horizon, z is up, and x at its left.
    Mitsuba's rows go all the way to the poles, so one is up to half a row off.
    """
    height, width = 64, 128
    texels = np.zeros((height, width, 3), np.float32)
    texels[row, column] = 1
    theta, phi = np.pi * (row + 0.5) / height, 2 * np.pi * (column + 0.5) / width
    way = TURNS[turn] @ [np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)]
    options = f'LookAt 0 0 0 {way[0]} {way[1]} {way[2]} .3 .5 .7\nCamera "perspective" "float fov" 16\n' + FILM
    write_picture(scenes.folder / "sky.exr", texels, {})
    world = f'AttributeBegin {turn}\nLightSource "infinite" "string mapname" "sky.exr"\nAttributeEnd'
    found = picture(scenes(world, options=options), spp=64)
    assert seen(found) == pytest.approx((16, 16), abs=180 / height / 2 * 32 / 16)
    assert found.max() > 0.8


def quarters(found: np.ndarray) -> np.ndarray:
    """Which of red, green, blue is strongest at four places inside the quad: top left, top right, bottom left, right."""
    return np.array([found[row, column] for row in (12, 20) for column in (12, 20)]).argmax(axis=1)


def png(rows: Any) -> bytes:
    file = io.BytesIO()
    Image.fromarray(np.array(rows, np.uint8)).save(file, "PNG")
    return file.getvalue()


RED, GREEN, BLUE = [255, 0, 0], [0, 255, 0], [0, 0, 255]
FOUR = png(np.kron(np.array([[RED, GREEN], [BLUE, RED]]), np.ones((16, 16, 1))))


@pytest.mark.parametrize("scale", ["", '"float scale" 0.5'])  # copied as it is, and baked
def test_a_picture_lies_as_in_pbrt(scenes: Scenes, picture: Picture, scale: str) -> None:
    """v points up: the picture's top row is at v = 1, on top where y is up."""
    world = f'Texture "t" "spectrum" "imagemap" "string filename" "t.png" {scale}\nMaterial "matte" "texture Kd" "t"\n'
    source = scenes(LAMP + world + f'Shape "trianglemesh" {QUAD}', files={"t.png": FOUR})
    found = picture(source)
    assert quarters(found).tolist() == [0, 1, 2, 0]
    assert found[12, 12, 0] == pytest.approx(0.5 if scale else 1, rel=0.05)


def test_a_picture_on_a_sphere_is_not_upside_down(scenes: Scenes, picture: Picture) -> None:
    """A sphere's v grows along its z axis, here up."""
    world = 'Texture "t" "spectrum" "imagemap" "string filename" "t.png"\nMaterial "matte" "texture Kd" "t"\n'
    top_bottom = png([[BLUE] * 4] * 4 + [[RED] * 4] * 4)
    for extra in ("", "Scale -1 1 1\n", "Scale 1 1.01 1\n"):
        source = scenes(LAMP + world + extra + 'Rotate -90 1 0 0\nShape "sphere"', files={"t.png": top_bottom})
        found = picture(source)
        assert (found[10, 16].argmax(), found[22, 16].argmax()) == (2, 0), extra


def test_a_checkerboard(scenes: Scenes, picture: Picture) -> None:
    """tex1 where floor(s) + floor(t) is even: at the bottom left and top right of two by two squares."""
    world = (
        'Texture "c" "spectrum" "checkerboard" "float uscale" 2 "float vscale" 2 "rgb tex1" [1 0 0] "rgb tex2" [0 1 0]\n'
        f'Material "matte" "texture Kd" "c"\nShape "trianglemesh" {QUAD}'
    )
    assert quarters(picture(scenes(LAMP + world))).tolist() == [1, 0, 0, 1]


LIT = 'Translate 0 0 2 Material "matte" "rgb Kd" [1 1 1]\nShape "trianglemesh" "integer indices" [0 1 2 0 2 3] "point P" [-9 -9 0 9 -9 0 9 9 0 -9 9 0]'
TRIANGLES = 'Shape "trianglemesh" "integer indices" [0 1 2 0 2 3] "point P" [-1 -1 0 1 -1 0 1 1 0 -1 1 0]'


@pytest.mark.parametrize("shape", [TRIANGLES, 'Shape "disk"'])
@pytest.mark.parametrize(
    ("directives", "away"), [("", True), ("ReverseOrientation", False), ("Scale -1 1 1", True), ("Scale 1 1 -1", False),
                             ("ReverseOrientation Scale -1 1 1", False), ("ReverseOrientation Scale 1 1 -1", True)]
)  # fmt: skip
def test_the_side_to_which_a_lamp_shines(
    scenes: Scenes, picture: Picture, shape: str, directives: str, away: bool
) -> None:
    """Towards its normal (+z, away from the camera), as the transform carries it; ReverseOrientation turns it round."""
    lamp = f'AttributeBegin\n{directives}\nAreaLightSource "diffuse" "rgb L" [1 1 1]\n{shape}\nAttributeEnd\n'
    assert (picture(scenes(lamp), spp=16)[16, 16].mean() < 0.5) == away


@pytest.mark.parametrize("shape", [TRIANGLES, 'Shape "disk"', 'Shape "sphere"', 'Shape "cone"',
                                   'Rotate 90 1 0 0 Shape "cylinder"', 'Rotate 90 1 0 0 Shape "sphere" "float phimax" 180'])  # fmt: skip
@pytest.mark.parametrize("directives", ["", "ReverseOrientation", "Scale 1 1 -1", "Rotate 180 0 1 0"])
@pytest.mark.parametrize(("place", "camera"), [("0 0 0", "0 0 -5"), ("900 -900 900", "900 -900 895")])
def test_a_twosided_lamp_shines_to_both_sides(
    scenes: Scenes, picture: Picture, shape: str, directives: str, place: str, camera: str
) -> None:
    """Each of its pixels has its radiance, whichever side is seen: no ray takes one side for the other."""
    lamp = f'Material "matte" "rgb Kd" [0 0 0] AttributeBegin\nTranslate {place} {directives}\nAreaLightSource "diffuse" "rgb L" [2 2 2] "bool twosided" "true"\n{shape}\nAttributeEnd\n'
    source = scenes(lamp, options=f'LookAt {camera} {place} 0 1 0\nCamera "perspective" "float fov" 8\n' + FILM)
    assert not any("twosided" in note for note in source.notes)
    assert picture(source, spp=16) == pytest.approx(2)


def test_a_twosided_lamp_lights_both_sides(scenes: Scenes, picture: Picture) -> None:
    """A small lamp half-way between two walls gives both the same light."""
    wall = 'Material "matte" "rgb Kd" [1 1 1]\nTranslate {} 0 0 Rotate 90 0 1 0\nShape "disk" "float radius" 9\n'
    walls = "".join(f"AttributeBegin\n{wall.format(x)}AttributeEnd\n" for x in (-1, 1))
    lamp = 'AreaLightSource "diffuse" "rgb L" [2 2 2] "bool twosided" "true"\nRotate 90 0 1 0\nShape "disk" "float radius" .2'
    found = picture(scenes(walls + lamp), spp=2048)
    assert found[12:20, :6].mean() == pytest.approx(found[12:20, 26:].mean(), rel=0.02)
    assert found[12:20, :6].mean() > 0.001


def test_instances(scenes: Scenes, picture: Picture) -> None:
    """An object is drawn where its instances are, with its own transform inside; and not where it is defined."""
    world = (
        'ObjectBegin "o"\nTranslate .2 0 0\nMaterial "matte" "rgb Kd" [1 1 1]\nShape "sphere" "float radius" .15\nObjectEnd\n'
        'LightSource "point" "point from" [0 0 -9] "rgb I" [99 99 99]\nAttributeBegin Translate .7 .5 0 ObjectInstance "o" AttributeEnd'
    )
    x, y = seen(picture(scenes(world), spp=128))
    scale = 16 / (5 * np.tan(np.radians(20)))
    assert (x, y) == (pytest.approx(16 + 0.9 * scale, abs=0.7), pytest.approx(16 - 0.5 * scale, abs=0.7))
