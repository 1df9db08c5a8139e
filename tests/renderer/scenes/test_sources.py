"""A scene is its content: one digest, one complete copy, and a sentence when there is none."""

from __future__ import annotations

import hashlib
import os
import shutil
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest

from renderer.errors import EnvironmentProblem, SceneError, UnknownName
from renderer.scenes.builtin import BUILTIN
from renderer.scenes.sources import SceneDefaults, find, snapshot
from tests.renderer.scenes.conftest import Write
from tests.renderer.scenes.samples import MESH, SPECTRUM, SPHERE, TRIANGLE, xml

BODY = f"""
<bsdf type="diffuse"><spectrum name="reflectance" filename="tables/grey.spd"/></bsdf>
<include filename="part.xml"/>{MESH.format("mesh.ply")}"""
FILES: dict[str, bytes | str] = {"tables/grey.spd": SPECTRUM, "mesh.ply": TRIANGLE, "part.xml": xml(SPHERE)}


@pytest.fixture
def folder(write: Write) -> Path:
    """A scene of four files."""
    return write(BODY, FILES)


def digest(folder: Path) -> str:
    return find(str(folder), Path("/")).digest


def test_the_digest_is_the_content_s(folder: Path, tmp_path: Path) -> None:
    """Another folder, other dates, other files beside, another way to name it: the same scene."""
    before = digest(folder)
    copy = tmp_path / "elsewhere" / "copy"
    shutil.copytree(folder, copy)
    os.utime(copy / "mesh.ply", (0, 0))
    (copy / "README.md").write_text("notes")
    (copy / "about.toml").write_text("title = 'x'")
    (copy / "old.exr").write_bytes(b"123")
    assert digest(copy) == before
    assert find("copy/scene.xml", copy.parent).digest == before


def test_the_digest_is_the_same_on_every_machine(tmp_path: Path) -> None:
    """A value written down: a change of the recipe would orphan every snapshot and every cell."""
    (tmp_path / "scene.xml").write_bytes(b'<scene version="3.0.0"/>')
    inner = hashlib.sha256(b'<scene version="3.0.0"/>').hexdigest()
    expected = hashlib.sha256(f'["scene.xml",[["scene.xml","{inner}"]]]'.encode()).hexdigest()
    assert digest(tmp_path) == expected


def test_the_digest_is_the_same_in_another_process(folder: Path) -> None:
    """No order of hashing, no environment gets into it."""
    code = "import sys; from pathlib import Path; from renderer.scenes.sources import find; "
    code += "print(find(sys.argv[1], Path('/')).digest)"
    for seed in ("1", "2"):
        environment = {**os.environ, "PYTHONHASHSEED": seed, "TZ": "Asia/Tokyo"}
        out = subprocess.check_output([sys.executable, "-c", code, str(folder)], env=environment, text=True)
        assert out.strip() == digest(folder)


@pytest.mark.parametrize("name", ["scene.xml", "part.xml", "mesh.ply", "tables/grey.spd"])
def test_any_byte_of_any_file_changes_the_digest(folder: Path, name: str) -> None:
    """One byte more, at the end, in each file that belongs to the scene."""
    before = digest(folder)
    with (folder / name).open("ab") as file:
        file.write(b"\n")
    assert digest(folder) != before


def test_files_are_listed_with_size_and_hash(folder: Path) -> None:
    """The main file and what it refers to, sorted; nothing else."""
    (folder / "unrelated.ply").write_text(TRIANGLE)
    source = find(str(folder), Path("/"))
    assert [file.path for file in source.files] == ["mesh.ply", "part.xml", "scene.xml", "tables/grey.spd"]
    assert source.files[0].size == len(TRIANGLE)
    assert source.files[0].sha256 == hashlib.sha256(TRIANGLE.encode()).hexdigest()
    assert (source.main, source.builtin) == ("scene.xml", False)


def test_a_name_may_be_a_built_in_a_file_or_a_folder(folder: Path) -> None:
    """A built-in wins over a folder of its name; ``./`` names the folder."""
    shutil.copytree(folder, folder.parent / "cornell_box")
    assert find("cornell_box", folder.parent).builtin
    assert not find("./cornell_box", folder.parent).builtin
    (folder / "scene.xml").rename(folder / "room.xml")
    (folder / "part.xml").rename(folder / "part.data")
    (folder / "room.xml").write_text(xml(SPHERE))
    assert find("scene", folder.parent).main == "room.xml"  # the only .xml file there


WRONG = {
    "nowhere.xml": "scene 'nowhere.xml' is not in {base}; a scene is a path from there, or one of "
    + ", ".join(BUILTIN),
    "notes.txt": "scene 'notes.txt' is neither an .xml nor a .pbrt file; name a Mitsuba or pbrt-v3 file, or "
    "a folder that holds one",
    "text.xml": "scene 'text.xml' is refused: text.xml is not well-formed XML: syntax error in line 1",
    "bsdf.xml": "scene 'bsdf.xml' is refused: bsdf.xml, line 2: unknown plugin type 'difuse'; did you mean 'diffuse'?",
    "none": "the folder 'none' holds no .xml file, and no .pbrt file; name the file, or call the main one scene.xml",
    "two": "the folder 'two' holds the 2 files a.xml, b.xml; name the file, or call the main one scene.xml",
    "a.xml": "scene 'a.xml' is refused: a.xml, line 2: the file 'gone.ply' does not exist in the scene's folder",
}


@pytest.mark.parametrize("name", WRONG)
def test_says_what_is_wrong(tmp_path: Path, name: str) -> None:
    """One sentence: what, where, what is allowed, the way out."""
    (tmp_path / "notes.txt").write_text("notes")
    (tmp_path / "text.xml").write_text("hello")
    (tmp_path / "bsdf.xml").write_text(xml('<bsdf type="difuse"/>'))
    (tmp_path / "a.xml").write_text(xml(MESH.format("gone.ply")))
    (tmp_path / "none").mkdir()
    (tmp_path / "two").mkdir()
    for main in ("a.xml", "b.xml"):
        (tmp_path / "two" / main).write_text(xml(""))
    with pytest.raises(SceneError) as caught:
        find(name, tmp_path)
    assert str(caught.value) == WRONG[name].format(base=tmp_path)


def test_a_word_that_is_no_scene_is_an_unknown_name(tmp_path: Path) -> None:
    """With the built-ins, and the nearest of them."""
    with pytest.raises(UnknownName, match=r"unknown scene 'cornel_box'; known: .*; did you mean 'cornell_box'\?"):
        find("cornel_box", tmp_path)


@pytest.mark.parametrize("name", ["", ".", "/", "x" * 5000, "a\0b", "\n", "../..", "~"])
def test_odd_names_are_errors_not_tracebacks(tmp_path: Path, name: str) -> None:
    """Names that no file system takes, and folders that are no scenes."""
    with pytest.raises((SceneError, UnknownName)):
        find(name, tmp_path)


def test_many_faults_are_counted(write: Write) -> None:
    """An error shows the first three."""
    with pytest.raises(SceneError, match=r"; and 7 more$"):
        find(str(write('<evil a="1"/>\n' * 10)), Path("/"))


def test_defaults_are_what_the_file_says(write: Write) -> None:
    """Through parameters, includes and channel-adding integrators; Mitsuba's defaults where an element is silent."""
    camera = """<default name="w" value="640"/><sensor type="thinlens">
        <film type="hdrfilm"><integer name="width" value="$w"/><integer name="height" value="360"/></film>
        <sampler type="multijitter"><integer name="sample_count" value="64"/></sampler></sensor>
        <sensor type="perspective"><film type="hdrfilm"/></sensor>"""
    body = """<include filename="camera.xml"/><integrator type="aov"><integrator type="volpath">
        <integer name="max_depth" value="9"/></integrator></integrator>"""
    expected = SceneDefaults(640, 360, 9, "volpath", "multijitter", 64)
    assert find(str(write(body, {"camera.xml": xml(camera)})), Path("/")).defaults == expected
    silent = (
        '<integrator type="path"/><sensor type="thinlens"><film type="hdrfilm"/><sampler type="stratified"/></sensor>'
    )
    assert find(str(write(silent)), Path("/")).defaults == SceneDefaults(768, 576, -1, "path", "stratified", 4)
    assert find(str(write("")), Path("/")).defaults == SceneDefaults(256, 256, 6, "path", "independent", 16)


def test_an_integrator_keeps_its_parameters(write: Write) -> None:
    """As people write them; max_depth stands alone, since it can be said alone."""
    body = """<integrator type="path"><integer name="max_depth" value="9"/><integer name="rr_depth" value="3"/>
        <boolean name="hide_emitters" value="true"/></integrator>"""
    defaults = find(str(write(body)), Path("/")).defaults
    assert (defaults.integrator, defaults.max_depth) == ("path:hide_emitters=true,rr_depth=3", 9)


def test_crop_and_filter_are_what_the_file_says(write: Write) -> None:
    """Box where it is silent, whatever Mitsuba has by default; a crop without a width is as wide as the film."""
    film = """<sensor type="perspective"><film type="hdrfilm"><integer name="width" value="100"/>
        <integer name="height" value="50"/>{}</film></sensor>"""
    defaults = find(str(write(film.format(""))), Path("/")).defaults
    assert (defaults.crop, defaults.rfilter) == (None, "box")
    said = (
        '<integer name="crop_offset_x" value="10"/><integer name="crop_width" value="25"/>'
        '<rfilter type="gaussian"><float name="stddev" value="0.4"/></rfilter>'
    )
    defaults = find(str(write(film.format(said))), Path("/")).defaults
    assert (defaults.crop, defaults.rfilter) == ((10, 0, 25, 50), "gaussian:stddev=0.4")


@pytest.mark.parametrize(
    ("size", "crop"),
    [((100, 50), (10, 0, 25, 50)), ((200, 100), (20, 0, 50, 100)), ((30, 50), (3, 0, 8, 50)), ((1, 1), (0, 0, 1, 1))],
)
def test_a_crop_stays_the_same_part_of_the_picture(size: tuple[int, int], crop: tuple[int, ...]) -> None:
    """In a film of another size; never less than a pixel, never outside."""
    assert SceneDefaults(100, 50, crop=(10, 0, 25, 50)).crop_at(*size) == crop


def test_a_snapshot_is_the_scene_and_nothing_else(folder: Path, tmp_path: Path) -> None:
    """Named by its digest, found again as the same scene, made once."""
    (folder / "README.md").write_text("notes")
    source = find(str(folder), Path("/"))
    made = snapshot(source, tmp_path / "store")
    assert made == tmp_path / "store" / source.digest
    files = sorted(path.relative_to(made).as_posix() for path in made.rglob("*") if path.is_file())
    assert files == ["mesh.ply", "part.xml", "scene.xml", "tables/grey.spd"]
    assert digest(made) == source.digest
    before = (made / "mesh.ply").stat().st_mtime_ns
    assert snapshot(source, tmp_path / "store") == made
    assert (made / "mesh.ply").stat().st_mtime_ns == before
    assert list((tmp_path / "store").iterdir()) == [made]


def test_a_link_inside_the_folder_is_copied_as_a_file(folder: Path, tmp_path: Path) -> None:
    """A snapshot stands alone."""
    (folder / "mesh.ply").rename(folder / "real.ply")
    (folder / "mesh.ply").symlink_to("real.ply")
    made = snapshot(find(str(folder), Path("/")), tmp_path / "store")
    assert not (made / "mesh.ply").is_symlink()
    assert (made / "mesh.ply").read_text() == TRIANGLE


def test_many_copy_at_once(folder: Path, tmp_path: Path) -> None:
    """All get the same complete folder, and no half-made one is left."""
    source = find(str(folder), Path("/"))
    with ThreadPoolExecutor(16) as pool:
        made = set(pool.map(lambda _: snapshot(source, tmp_path / "store"), range(64)))
    assert made == {tmp_path / "store" / source.digest}
    assert list((tmp_path / "store").iterdir()) == list(made)


@pytest.mark.parametrize("change", ["edited", "removed", "redirected"])
def test_a_file_that_changed_meanwhile_is_an_error(folder: Path, tmp_path: Path, change: str) -> None:
    """What was vetted is what is copied, or nothing is."""
    source = find(str(folder), Path("/"))
    mesh = folder / "mesh.ply"
    if change == "edited":
        mesh.write_text(TRIANGLE + "\n")
    else:
        mesh.unlink()
        if change == "redirected":
            mesh.symlink_to("/etc/hostname")
    verb = "removed" if change == "removed" else "changed"
    with pytest.raises(SceneError, match=f"mesh.ply was {verb} while it was copied; submit again"):
        snapshot(source, tmp_path / "store")
    assert list((tmp_path / "store").iterdir()) == []


KILLED = """
import os, signal, sys
from pathlib import Path
from renderer.scenes import sources
left = int(sys.argv[3])
def count(call):
    def counted(*args):
        global left
        left -= 1
        if left < 0:
            os.kill(os.getpid(), signal.SIGKILL)
        return call(*args)
    return counted
sources.os.fsync = count(os.fsync)
sources._copy = count(sources._copy)
sources.snapshot(sources.find(sys.argv[1], Path("/")), Path(sys.argv[2]))
"""


def test_a_copier_may_be_killed_at_any_moment(folder: Path, tmp_path: Path) -> None:
    """The snapshot is absent or complete, the next copier makes it, and leavings are swept after an hour."""
    source = find(str(folder), Path("/"))
    for moment in range(0, 11, 2):
        store = tmp_path / f"store{moment}"
        store.mkdir()
        subprocess.run([sys.executable, "-c", KILLED, str(folder), str(store), str(moment)], check=False)
        target = store / source.digest
        assert not target.exists() or digest(target) == source.digest
        for left in store.glob(".scene-*"):
            os.utime(left, (0, 0))
        (store / "other").mkdir()
        assert digest(snapshot(source, store)) == source.digest
        assert target.exists()


def test_leavings_of_the_dead_are_swept_and_of_the_living_kept(folder: Path, tmp_path: Path) -> None:
    """Old half-made copies go; a fresh one may be at work."""
    for name, age in (("old", 0), ("new", None)):
        (tmp_path / "store" / f".scene-{name}").mkdir(parents=True)
        if age is not None:
            os.utime(tmp_path / "store" / f".scene-{name}", (age, age))
    snapshot(find(str(folder), Path("/")), tmp_path / "store")
    assert sorted(path.name for path in (tmp_path / "store").glob(".scene-*")) == [".scene-new"]


def test_a_store_that_cannot_be_written_is_a_problem_of_the_machine(folder: Path, tmp_path: Path) -> None:
    """The scene is fine; the sentence is about the place."""
    (tmp_path / "store").write_text("a file where the folder should be")
    with pytest.raises(EnvironmentProblem, match="cannot copy scene .* to .*store: File exists; "):
        snapshot(find(str(folder), Path("/")), tmp_path / "store")


def test_built_in_scenes_are_found_from_anywhere(tmp_path: Path) -> None:
    """And their metadata is no part of them."""
    for name, scene in BUILTIN.items():
        source = find(name, tmp_path)
        assert source.builtin and source.folder == scene.folder
        assert "about.toml" not in [file.path for file in source.files]
