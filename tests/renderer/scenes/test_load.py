"""A loaded scene is the file's own, seen through the film that was asked for."""

from __future__ import annotations

import re
import threading
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from renderer.errors import SceneError
from renderer.scenes.builtin import BUILTIN
from renderer.scenes.vet import vet
from tests.renderer.scenes.conftest import Write
from tests.renderer.scenes.samples import MESH, SENSOR, SPECTRUM, SPHERE, TRIANGLE, xml

pytestmark = pytest.mark.usefixtures("llvm")

AXES = ["x", "y", "diagonal", "smaller", "larger"]


def rays(sensor: Any) -> np.ndarray:
    """Origins and directions of the sensor's rays through a grid of film and lens positions."""
    import drjit as dr
    import mitsuba as mi

    u, v = dr.meshgrid(dr.linspace(mi.Float, 0, 1, 7), dr.linspace(mi.Float, 0, 1, 5))
    ray, _ = sensor.sample_ray(0, 0.5, mi.Point2f(u, v), mi.Point2f(v, u), True)
    return np.concatenate([np.array(ray.o), np.array(ray.d)])


def with_film(text: str, film: str) -> str:
    """A scene file in which every film says ``film``."""
    return re.sub(r"<film .*?</film>", f'<film type="hdrfilm">{film}</film>', text, flags=re.DOTALL)


def film_of(width: int, height: int, crop: tuple[int, int, int, int] | None, rfilter: str) -> str:
    values = {"width": width, "height": height}
    if crop:
        values |= dict(zip(("crop_offset_x", "crop_offset_y", "crop_width", "crop_height"), crop, strict=True))
    return "".join(f'<integer name="{k}" value="{v}"/>' for k, v in values.items()) + f'<rfilter type="{rfilter}"/>'


@pytest.mark.parametrize("name", sorted(BUILTIN))
@pytest.mark.parametrize("crop", [None, (5, 7, 16, 8)])
@pytest.mark.parametrize(("width", "height", "rfilter"), [(32, 48, "box"), (48, 32, "gaussian")])
def test_the_camera_is_as_if_the_file_had_said_so(
    name: str, crop: tuple[int, int, int, int] | None, width: int, height: int, rfilter: str
) -> None:
    """Rays and picture equal those of a file that names the film itself."""
    import mitsuba as mi

    from renderer.scenes.load import load

    folder = BUILTIN[name].folder
    ours = load(folder, "scene.xml", width=width, height=height, crop=crop, rfilter=rfilter)
    text = with_film((folder / "scene.xml").read_text("utf-8"), film_of(width, height, crop, rfilter))
    theirs = mi.load_string(text, optimize=False)  # merging changes the order of lamps, and so the noise
    assert np.array_equal(rays(ours.sensor), rays(theirs.sensors()[0]))
    film = ours.sensor.film()
    assert (ours.width, ours.height) == tuple(film.size()) == (width, height)
    assert ours.crop == (*film.crop_offset(), *film.crop_size()) == (crop or (0, 0, width, height))
    assert film.rfilter().radius() == theirs.sensors()[0].film().rfilter().radius()
    integrator = mi.load_dict({"type": "path", "max_depth": 4})
    a = np.array(mi.render(ours.scene, integrator=integrator, spp=4, seed=1))
    b = np.array(mi.render(theirs, integrator=integrator, spp=4, seed=1))
    assert a.shape == (*reversed(ours.crop[2:]), 3)
    np.testing.assert_allclose(a, b, rtol=1e-3, atol=1e-4)


@pytest.mark.parametrize("axis", AXES)
@pytest.mark.parametrize(("width", "height"), [(64, 20), (20, 64)])
def test_every_fov_axis_sees_the_new_shape(write: Write, axis: str, width: int, height: int) -> None:
    """The angle is that of the asked film, not of the file's."""
    import mitsuba as mi

    from renderer.scenes.load import load

    body = SPHERE + SENSOR.replace(
        "</sensor>", f'<string name="fov_axis" value="{axis}"/><film type="hdrfilm"></film></sensor>'
    )
    theirs = mi.load_string(with_film(xml(body), film_of(width, height, None, "box")))
    ours = load(write(body), "scene.xml", width=width, height=height)
    assert np.array_equal(rays(ours.sensor), rays(theirs.sensors()[0]))


def test_film_sampler_and_integrator_of_the_file_are_gone(write: Write) -> None:
    """Whatever they are: a film of 60000 by 60000 pixels costs nothing, an unknown parameter of theirs is no error."""
    import mitsuba as mi

    from renderer.scenes.load import load

    body = f"""<integrator type="stokes"><integrator type="ptracer"><float name="what" value="1"/></integrator>
        </integrator><sensor type="perspective"><film type="specfilm"><integer name="width" value="60000"/>
        <integer name="height" value="60000"/></film><sampler type="multijitter"/></sensor>{SPHERE}"""
    loaded = load(write(body), "scene.xml", width=8, height=6, rfilter="gaussian", rfilter_parameters={"stddev": 0.7})
    assert loaded.scene.integrator() is None
    assert loaded.sensor.film().rfilter().radius() == pytest.approx(2.8)
    assert np.array(mi.render(loaded.scene, integrator=mi.load_dict({"type": "path"}), spp=1)).shape == (6, 8, 3)


def test_the_first_of_several_sensors_is_used(write: Write) -> None:
    """Also when it is named by reference, and when the others stand in an included file."""
    from renderer.scenes.load import load

    body = f"""<include filename="camera.xml"/>{SENSOR}{SPHERE}"""
    camera = '<sensor type="orthographic" id="first"/><sensor type="perspective" id="second"/>'
    loaded = load(write(body, {"camera.xml": xml(camera)}), "scene.xml", width=8, height=6)
    assert [sensor.id() for sensor in loaded.scene.sensors()] == ["first"]
    assert loaded.sensor.id() == "first"


def test_files_are_found_below_the_scene_s_folder(
    write: Write, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """Whatever the working directory is, in included files too; the process's resolver is left as it was."""
    import mitsuba as mi

    from renderer.scenes.load import load

    monkeypatch.chdir(tmp_path)
    before = [str(path) for path in mi.file_resolver()]
    body = f"""{SENSOR}<include filename="sub/part.xml"/><bsdf type="diffuse" id="grey">
        <spectrum name="reflectance" filename="sub/grey.spd"/></bsdf>
        <bsdf type="conductor" id="gold"><string name="material" value="Au"/></bsdf>"""
    files: dict[str, bytes | str] = {
        "sub/part.xml": xml('<include filename="more.xml"/>' + MESH.format("sub/mesh.ply")),
        "sub/more.xml": xml('<include filename="most.xml"/>'),
        "more.xml": xml("<evil/>"),  # the nearer one counts
        "most.xml": xml(SPHERE),
        "sub/mesh.ply": TRIANGLE,
        "sub/grey.spd": SPECTRUM,
    }
    folder = write(body, files)
    assert vet(folder, "scene.xml") == []
    loaded = load(folder, "scene.xml", width=8, height=8)
    assert len(loaded.scene.shapes()) == 2
    assert [str(path) for path in mi.file_resolver()] == before


def test_equal_materials_stay_apart(write: Write) -> None:
    """A sweep of one must not change the other: each keeps its own key."""
    import mitsuba as mi

    from renderer.scenes.load import load

    body = SENSOR + "".join(
        f'<shape type="sphere" id="{name}"><bsdf type="diffuse"><rgb name="reflectance" value="0.5"/></bsdf></shape>'
        for name in ("left", "right")
    )
    loaded = load(write(body), "scene.xml", width=8, height=8)
    keys = [key for key in mi.traverse(loaded.scene).keys() if "reflectance" in key]  # noqa: SIM118 - no mapping
    assert keys == ["left.bsdf.reflectance.value", "right.bsdf.reflectance.value"]


WRONG = {
    "no sensor": (SPHERE, "has no camera; add a <sensor>, such as <sensor type='perspective'>"),
    "unknown parameter": (
        SENSOR + '<shape type="sphere"><float name="radiuss" value="1"/></shape>',
        'Found 1 unreferenced property in shape plugin of type "sphere": - float "radiuss": 1',
    ),
    "not a number": (
        SENSOR + '<shape type="sphere"><float name="radius" value="big"/></shape>',
        'scene.xml (line 2, col 89): could not parse floating point value "big"',
    ),
    "broken reference": (SENSOR + '<shape type="sphere"><ref id="gold"/></shape>', 'unresolved reference to "gold"'),
    "broken mesh": (SENSOR + MESH.format("broken.ply"), "broken.ply"),
    "wrong kind": (SENSOR + '<bsdf type="sphere"/>', "sphere"),
    "unvetted plugin": (SENSOR + '<bsdf type="evil"/>', "is refused: unknown plugin type 'evil'"),
    "unknown metal": (
        SENSOR + '<bsdf type="conductor"><string name="material" value="Unobtainium"/></bsdf>',
        "Unobtainium",
    ),
    "table": (
        SENSOR + '<bsdf type="diffuse"><spectrum name="reflectance" filename="secret.spd"/></bsdf>',
        "secret.spd",
    ),
}


@pytest.mark.parametrize("fault", WRONG)
def test_says_what_is_wrong_in_one_line(write: Write, fault: str) -> None:
    """Mitsuba's words without its source positions, this machine's paths, or the content of files."""
    from renderer.scenes.load import load

    body, words = WRONG[fault]
    folder = write(body, {"broken.ply": "ply\nformat nonsense\n", "secret.spd": "hunter2 is the password\n"})
    with pytest.raises(SceneError) as caught:
        load(folder, "scene.xml", width=8, height=8)
    text = str(caught.value)
    assert text.startswith("the scene scene.xml ") and words in text
    assert "\n" not in text and ".cpp" not in text and str(folder) not in text and "hunter2" not in text


def test_an_unknown_filter_is_a_scene_error(write: Write) -> None:
    """The film's filter is made by the same call, so its error comes the same way."""
    from renderer.scenes.load import load

    with pytest.raises(SceneError, match="nonsense"):
        load(write(SENSOR), "scene.xml", width=8, height=8, rfilter="nonsense")


def test_a_missing_scene_is_a_scene_error(tmp_path: Path) -> None:
    """A snapshot that somebody deleted."""
    from renderer.scenes.load import load

    with pytest.raises(SceneError, match=r"the scene scene\.xml cannot be loaded: File not found"):
        load(tmp_path, "scene.xml", width=8, height=8)


def test_threads_take_turns(write: Write, tmp_path: Path) -> None:
    """Two loads in one process never see each other's files."""
    from renderer.scenes.load import load

    folders = []
    for i in range(4):
        folder = tmp_path / str(i)
        folder.mkdir()
        (folder / "scene.xml").write_text(xml(SENSOR + MESH.format("mesh.ply") * (i + 1)))
        (folder / "mesh.ply").write_text(TRIANGLE)
        folders.append(folder)
    counts: dict[int, int] = {}

    def count(i: int) -> None:
        counts[i] = len(load(folders[i], "scene.xml", width=4, height=4).scene.shapes())

    threads = [threading.Thread(target=count, args=(i,)) for i in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert counts == {0: 1, 1: 2, 2: 3, 3: 4}


@pytest.mark.usefixtures("llvm")
def test_what_a_plugin_of_ours_refuses_is_one_sentence(write: Write) -> None:
    """Its message comes with a traceback of Python, which is nobody's business."""
    from renderer.scenes.load import load

    body = SENSOR + '<shape type="sphere"><bsdf type="anisophong"><float name="nu" value="-1"/></bsdf></shape>'
    with pytest.raises(SceneError, match="nu") as refused:
        load(write(body), "scene.xml", width=8, height=8)
    assert "Traceback" not in str(refused.value) and ".py" not in str(refused.value)
