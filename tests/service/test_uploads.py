"""Scenes over the wire: a good folder arrives whole; whatever else an archive holds is refused and leaves nothing."""

from __future__ import annotations

import errno
import io
import os
import stat
import struct
import zipfile
from collections.abc import Callable
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from renderer.errors import SceneError
from service import bodies, schemas, uploads
from service.problems import TooLarge
from tests.service.conftest import House, answer, answers, refusal

SCENE = """<scene version="3.0.0">
  <integrator type="path"><integer name="max_depth" value="4"/></integrator>
  <sensor type="perspective">
    <film type="hdrfilm"><integer name="width" value="12"/><integer name="height" value="8"/></film>
  </sensor>
  <emitter type="constant"/>
  <shape type="sphere"/>
</scene>"""
WITH_MESH = SCENE.replace(
    '<shape type="sphere"/>', '<shape type="ply"><string name="filename" value="meshes/a.ply"/></shape>'
)
MESH = b"ply\nformat ascii 1.0\nelement vertex 0\nelement face 0\nend_header\n"


def packed(files: dict[str, str | bytes], compression: int = zipfile.ZIP_DEFLATED) -> bytes:
    file = io.BytesIO()
    with zipfile.ZipFile(file, "w", compression) as archive:
        for name, content in files.items():
            archive.writestr(name, content)
    return file.getvalue()


def special(name: str, mode: int, content: bytes = b"/etc/passwd") -> bytes:
    """An archive with one entry of another kind beside a good scene."""
    file = io.BytesIO(packed({"scene.xml": SCENE}))
    with zipfile.ZipFile(file, "a") as archive:
        entry = zipfile.ZipInfo(name)
        entry.external_attr = mode << 16
        archive.writestr(entry, content)
    return file.getvalue()


def encrypted() -> bytes:
    """The flag alone: nobody asks for a password that nobody would give."""
    content = bytearray(packed({"scene.xml": SCENE}))
    for signature, offset in ((b"PK\x03\x04", 6), (b"PK\x01\x02", 8)):
        at = content.index(signature) + offset
        content[at] |= 1
    return bytes(content)


def lying_about_its_size(size: int) -> bytes:
    """A bomb whose directory says that it unpacks to ten bytes."""
    content = bytearray(packed({"scene.xml": b" " * size}))
    for signature, offset in ((b"PK\x03\x04", 22), (b"PK\x01\x02", 24)):
        at = content.index(signature) + offset
        content[at : at + 4] = struct.pack("<I", 10)
    return bytes(content)


def twice() -> bytes:
    file = io.BytesIO()
    with zipfile.ZipFile(file, "w") as archive, pytest.warns(UserWarning, match="Duplicate"):
        archive.writestr("scene.xml", SCENE)
        archive.writestr("scene.xml", SCENE)
    return file.getvalue()


def upload(house: House, content: bytes, name: str = "room", **query: str):
    return house.client.post(
        "/api/scenes", params={"name": name, **query}, content=content, headers={"content-type": "application/zip"}
    )


def left_behind(house: House) -> list[Path]:
    return list(house.artifacts.work.glob("upload-*")) + list(house.artifacts.scenes.glob("*"))


def test_a_folder_arrives_with_what_it_refers_to_and_nothing_else(house: House) -> None:
    content = packed({"scene.xml": WITH_MESH, "meshes/a.ply": MESH, "meshes/unused.ply": MESH, "notes.txt": "mine"})
    scene = answer(upload(house, content), schemas.Scene)
    assert (scene.name, scene.main, scene.builtin) == ("room", "scene.xml", False)
    assert (scene.width, scene.height, scene.max_depth) == (12, 8, 4)
    assert scene.files == ["meshes/a.ply", "scene.xml"]
    folder = house.artifacts.scene_folder(scene.digest)
    kept = {str(path.relative_to(folder)): path.read_bytes() for path in folder.rglob("*") if path.is_file()}
    assert kept == {"scene.xml": WITH_MESH.encode(), "meshes/a.ply": MESH}
    assert not list(house.artifacts.work.glob("upload-*"))
    known = answers(house.client.get("/api/scenes"), schemas.Scene)
    assert scene in known
    references = {one.name: one.reference for one in known}
    assert references["room"] == "path, independent, 2 × 2048 spp"
    assert references["hidden_lamp"].startswith("bdpt, "), "where nobody says how, a scene does"


def test_the_same_folder_is_the_same_scene_however_it_was_packed(house: House) -> None:
    plain = answer(upload(house, packed({"scene.xml": SCENE})), schemas.Scene)
    wrapped = answer(upload(house, packed({"room/scene.xml": SCENE}, zipfile.ZIP_STORED)), schemas.Scene)
    assert plain.digest == wrapped.digest


PBRT = """Film "image" "integer xresolution" 12 "integer yresolution" 8 "float cropwindow" [0 .5 0 1]
Sampler "stratified" "integer xsamples" 2 "integer ysamples" 3
WorldBegin
Include "parts/lamp.pbrt"
Material "plastic"
Shape "plymesh" "string filename" "parts/a.ply"
WorldEnd
"""
PBRT_FILES = {
    "parts/lamp.pbrt": 'LightSource "infinite" "rgb L" [1 1 1]\n',
    "parts/a.ply": b"ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n"
    b"element face 1\nproperty list uchar int vertex_indices\nend_header\n0 0 3\n1 0 3\n0 1 3\n3 0 1 2\n",
}


def test_a_pbrt_file_arrives_as_the_scene_that_is_made_of_it(house: House) -> None:
    """With its includes and meshes; its settings are the scene's, what was replaced is said, and a grid may name it."""
    content = packed({"room/scene.pbrt": PBRT, **{f"room/{name}": part for name, part in PBRT_FILES.items()}})
    scene = answer(upload(house, content), schemas.Scene)
    assert (scene.name, scene.main, scene.files) == ("room", "scene.xml", ["meshes/00001.ply", "scene.xml"])
    assert (scene.width, scene.height, scene.sampler, scene.spp, scene.max_depth) == (12, 8, "stratified", 6, 6)
    assert ["scene.pbrt, line 5" in note and "plastic" in note for note in scene.notes] == [True]
    grid = {"scenes": ["room"], "spp": [1], "reference": False}
    body = {"grid": grid, "scenes": {"room": scene.digest}}
    submitted = answer(house.client.post("/api/experiments", json=body), schemas.Experiment)
    told = house.client.get(f"/api/experiments/{submitted.id}").json()
    assert [(one["name"], one["width"], one["height"]) for one in told["scenes"]] == [("room", 6, 8)]


def test_a_pbrt_archive_that_cannot_be_read_is_one_sentence(house: House) -> None:
    """With the file and the line, no path of this machine, and nothing kept."""
    for files, words in (
        ({"scene.pbrt": PBRT.replace("Shape", "Shpae"), **PBRT_FILES}, "scene.pbrt, line 6: unknown directive 'Shpae'"),
        ({"scene.pbrt": PBRT, "parts/lamp.pbrt": 'Include "../scene.pbrt"'}, "line 1"),
        ({"scene.pbrt": PBRT, "parts/lamp.pbrt": 'Include "/etc/passwd"'}, "parts/lamp.pbrt, line 1"),
        ({"a.pbrt": PBRT, "b.pbrt": PBRT}, "the 2 files a.pbrt, b.pbrt"),
    ):
        told = refusal(upload(house, packed(files)), 422, "bad-scene").detail
        assert words in told and str(house.artifacts.data) not in told and "\n" not in told
    assert not left_behind(house)


def test_the_main_file_may_be_named(house: House) -> None:
    both = packed({"day.xml": SCENE, "night.xml": SCENE.replace("12", "16")})
    assert "2 files day.xml, night.xml" in refusal(upload(house, both), 422, "bad-scene").detail
    assert answer(upload(house, both, main="night.xml"), schemas.Scene).width == 16
    for wrong in ("dusk.xml", "../day.xml", "/etc/passwd"):
        refusal(upload(house, both, main=wrong), 422)


def test_an_uploaded_scene_is_what_a_grid_names_and_nothing_else_of_this_machine_is(
    house: House, tmp_path: Path
) -> None:
    (tmp_path / "mine.xml").write_text(SCENE)
    scene = answer(upload(house, packed({"scene.xml": SCENE})), schemas.Scene)
    grid = {"scenes": ["my room"], "spp": [1], "reference": False}
    body = {"grid": grid, "scenes": {"my room": scene.digest}}
    assert house.client.post("/api/experiments?dry_run=true", json=body).status_code == 200
    for name in (str(tmp_path / "mine.xml"), "../mine.xml", "/etc/passwd", ".", ""):
        refusal(house.client.post("/api/experiments", json={"grid": {**grid, "scenes": [name]}}), 422, "bad-grid")
    for digest in ("0" * 64, "", "../../etc", scene.digest.upper()):
        refusal(house.client.post("/api/experiments", json={**body, "scenes": {"my room": digest}}), 422, "bad-grid")


@pytest.mark.parametrize(
    ("content", "word"),
    [
        (lambda: packed({"../scene.xml": SCENE}), "leads out"),
        (lambda: packed({"a/../../scene.xml": SCENE}), "leads out"),
        (lambda: packed({"/scene.xml": SCENE}), "leads out"),
        (lambda: packed({"C:\\scene.xml": SCENE}), "refused"),
        (lambda: packed({"scene.xml": SCENE, "plugins/evil.obj": b""}), "plugins"),
        (lambda: packed({"scene.xml": SCENE, "evil.so": b"\x7fELF"}), "extension"),
        (lambda: packed({"scene.xml": SCENE, "run": b"#!"}), "extension"),
        (lambda: special("link.ply", stat.S_IFLNK | 0o777), "link"),
        (lambda: special("disk.ply", stat.S_IFBLK | 0o666), "device"),
        (lambda: special("pipe.ply", stat.S_IFIFO | 0o666), "regular"),
        (encrypted, "encrypted"),
        (twice, "twice"),
        (lambda: packed({"scene.xml": SCENE.replace("sphere", "../../evil")}), "unknown plugin"),
        (lambda: packed({"scene.xml": WITH_MESH.replace("meshes/a.ply", "/etc/passwd")}), "leads out"),
        (lambda: packed({"scene.xml": WITH_MESH}), "a.ply"),
        (lambda: packed({"scene.xml": '<!DOCTYPE x [<!ENTITY a "b">]>' + SCENE}), "document type"),
        (lambda: packed({"scene.xml": "not xml"}), "XML"),
        (lambda: packed({"a.xml": SCENE, "b.xml": SCENE + " "}), "2 files"),
        (lambda: packed({"readme.txt": "hello"}), "no .xml"),
        (lambda: packed({}), "no .xml"),
        (lambda: b"", "zip"),
        (lambda: b"PK\x03\x04 and then nothing", "zip"),
        (lambda: packed({"scene.xml": SCENE})[:-40], "zip"),
        (lambda: packed({"scene.xml": SCENE})[60:], "zip"),
    ],
)  # fmt: skip
def test_what_is_no_scene_is_refused_in_words_and_leaves_nothing(
    house: House, content: Callable[[], bytes], word: str
) -> None:
    found = refusal(upload(house, content()), 422, "bad-scene")
    assert word.lower() in found.detail.lower(), found.detail
    assert str(house.artifacts.data) not in found.detail
    assert left_behind(house) == []


def test_a_bomb_is_stopped_while_it_unpacks(house: House, monkeypatch: pytest.MonkeyPatch) -> None:
    """What counts is what is written, not what the archive says: it may say nothing, or lie."""
    monkeypatch.setattr(uploads, "MAX_BYTES", 2**20)
    written = 0
    original = uploads._write

    def watched(*arguments):
        nonlocal written
        left = original(*arguments)
        written += arguments[3] - left
        return left

    monkeypatch.setattr(uploads, "_write", watched)
    assert "1 MiB" in refusal(upload(house, packed({"scene.xml": b" " * 2**24})), 413, "too-large").detail
    many = {f"{n}.obj": b" " * 2**18 for n in range(64)}
    refusal(upload(house, packed(many)), 413, "too-large")
    refusal(upload(house, lying_about_its_size(2**24)), 422, "bad-scene")
    assert written <= 2**20
    assert left_behind(house) == []


def test_too_many_files_are_refused_before_any_is_written(house: House, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(uploads, "_write", lambda *_: pytest.fail("it was unpacked"))
    many = packed({f"{n}.obj": b"" for n in range(uploads.MAX_FILES + 1)}, zipfile.ZIP_STORED)
    assert "2001 files" in refusal(upload(house, many), 413, "too-large").detail


def test_a_body_over_the_limit_is_cut_off(house: House, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(bodies, "SCENE_BYTES", 2**20)
    monkeypatch.setattr(bodies, "GRID_BYTES", 2**20)
    refusal(upload(house, b"x" * (2**20 + 1)), 413, "too-large")
    refusal(house.client.post("/api/experiments", content=b"x" * (2**20 + 1)), 413, "too-large")
    pieces = (b"x" * 2**16 for _ in range(32))  # without a length: it is counted as it comes
    refusal(house.client.post("/api/scenes?name=room", content=pieces), 413, "too-large")


def test_a_main_file_is_one_of_the_archive(house: House, tmp_path: Path) -> None:
    """Not a scene of this machine, not one beside the folder, not a built-in one, and not a name of any length."""
    (tmp_path / "mine.xml").write_text(SCENE)
    (house.artifacts.work / "beside.xml").write_text(SCENE)
    both = packed({"day.xml": SCENE, "night.xml": SCENE, "sub/dusk.xml": SCENE})
    outside = [str(tmp_path / "mine.xml"), "../beside.xml", "sub/../../beside.xml", "cornell_box", "a" * 200, "", "."]
    for main in [*outside, "ü" * 200, "sub", "DAY.XML", "day.xml/"]:
        found = refusal(upload(house, both, main=main), 422, "bad-scene")
        assert "it holds day.xml, night.xml, sub/dusk.xml" in found.detail
    assert left_behind(house) == []
    assert answer(upload(house, both, main="sub/dusk.xml"), schemas.Scene).files == ["dusk.xml"]


def test_names_of_any_script_arrive(house: House) -> None:
    scene = WITH_MESH.replace("meshes/a.ply", "größe/部屋 é.ply")
    found = answer(upload(house, packed({"scene.xml": scene, "größe/部屋 é.ply": MESH})), schemas.Scene)
    assert (house.artifacts.scene_folder(found.digest) / "größe" / "部屋 é.ply").read_bytes() == MESH


@pytest.mark.parametrize(
    ("files", "word"),
    [
        ({"a.xml": SCENE, "a.xml/b.ply": MESH}, "twice"),
        ({"scene.xml": SCENE, "x" * 256 + ".ply": MESH}, "too long a name"),
        ({"scene.xml": SCENE, "ü" * 128 + ".ply": MESH}, "too long a name"),
        ({"scene.xml": SCENE, "d/" * 600 + "a.ply": MESH}, "too long a name"),
        ({"scene.xml": SCENE, "$HOME.ply": MESH}, "put together"),
        ({"scene.xml": SCENE, "a\x01.ply": MESH}, "not a file name"),
    ],
)
def test_a_name_that_no_folder_holds_is_the_archives_fault(
    house: House, files: dict[str, str | bytes], word: str
) -> None:
    found = refusal(upload(house, packed(files)), 422, "bad-scene")
    assert word in found.detail
    assert str(house.artifacts.data) not in found.detail
    assert left_behind(house) == []


@pytest.mark.parametrize("method", [zipfile.ZIP_BZIP2, zipfile.ZIP_LZMA])
def test_only_usual_packing_is_unpacked(house: House, method: int) -> None:
    """An LZMA stream may ask for gigabytes before it gives a byte."""
    assert "unusual way" in refusal(upload(house, packed({"scene.xml": SCENE}, method)), 422, "bad-scene").detail


def test_a_list_of_files_is_not_read_to_its_end_to_be_refused(house: House, monkeypatch: pytest.MonkeyPatch) -> None:
    """A hundred thousand entries, also where a zip64 record says how many they are."""
    monkeypatch.setattr(uploads.zipfile, "ZipFile", lambda *_: pytest.fail("it was read"))
    entry = struct.pack("<4s6H3L5H2L", b"PK\1\2", *[20] * 2, *[0] * 4, *[0] * 3, 1, *[0] * 4, 0, 0) + b"a"
    entries, count = entry * 10**5, 10**5
    end = struct.pack("<4s4H2LH", b"PK\5\6", 0, 0, count % 2**16, count % 2**16, len(entries), 0, 0)
    refusal(upload(house, entries + end), 413, "too-large")
    locator = struct.pack("<4sLQL", b"PK\6\7", 0, len(entries), 1)
    refusal(upload(house, entries + locator + end), 413, "too-large")


GOOD = packed({"room/scene.xml": WITH_MESH, "room/meshes/a.ply": MESH})


@given(
    changes=st.lists(st.tuples(st.integers(0, len(GOOD) - 1), st.integers(0, 255)), min_size=1, max_size=6),
    cut=st.none() | st.integers(0, len(GOOD)),
    twice=st.booleans(),
)
@settings(max_examples=400, deadline=None, derandomize=True)
def test_a_damaged_archive_is_unpacked_or_refused_and_nothing_else(
    tmp_path_factory: pytest.TempPathFactory, changes: list[tuple[int, int]], cut: int | None, twice: bool
) -> None:
    """Any bytes changed, cut off, or said twice: no error but ours, and no file outside of the folder."""
    content = bytearray(GOOD)
    for place, byte in changes:
        content[place] = byte
    damaged = bytes(content[:cut]) * (2 if twice else 1)
    folder = tmp_path_factory.mktemp("unpacked")
    try:
        uploads._unpack(io.BytesIO(damaged), folder / "inside", "room")
    except (SceneError, TooLarge) as error:
        assert str(error).isprintable()
        assert str(folder) not in str(error)
    assert {path.name for path in folder.iterdir()} <= {"inside"}


@given(content=st.binary(max_size=300))
@settings(max_examples=200, deadline=None, derandomize=True)
def test_no_bytes_at_all_make_the_reading_stumble(tmp_path_factory: pytest.TempPathFactory, content: bytes) -> None:
    for start in (b"", b"PK\x03\x04", b"PK\x05\x06"):
        with pytest.raises((SceneError, TooLarge)):
            uploads._unpack(io.BytesIO(start + content), tmp_path_factory.getbasetemp() / "never", "room")


@pytest.mark.parametrize("place", ["body", "folder", "file"])
def test_a_full_disk_is_not_the_archives_fault(house: House, monkeypatch: pytest.MonkeyPatch, place: str) -> None:
    def full(*_: object, **__: object) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    where = {
        "body": (bodies.tempfile, "TemporaryFile"), "folder": (uploads.tempfile, "TemporaryDirectory"),
        "file": (Path, "mkdir"),
    }  # fmt: skip
    monkeypatch.setattr(*where[place], full)
    found = refusal(upload(house, packed({"scene.xml": SCENE})), 507, "data-directory")
    assert "is full; free some space" in found.detail


def test_a_snapshot_that_somebody_damaged_hides_no_other(house: House) -> None:
    first, second = (answer(upload(house, packed({"scene.xml": SCENE + " " * n})), schemas.Scene) for n in range(2))
    main = house.artifacts.scene_folder(first.digest) / "scene.xml"
    main.chmod(0o644)
    main.write_text("no scene at all")
    listed = {scene.digest for scene in answers(house.client.get("/api/scenes"), schemas.Scene)}
    assert second.digest in listed and first.digest not in listed


def test_an_uploaded_scene_is_rendered_from_its_snapshot(rendered: House) -> None:
    """From a zip to a measured picture, in a render process of its own; its experiment says which files it is of."""
    content = packed({"room/scene.xml": SCENE})
    scene = answer(upload(rendered, content, name="my room"), schemas.Scene)
    grid = {"name": "uploaded", "scenes": ["my room"], "spp": [4], "replicates": 2, "reference": {"spp": 32}}
    body = {"grid": grid, "scenes": {"my room": scene.digest}}
    found = answer(rendered.client.post("/api/experiments", json=body), schemas.Experiment)
    rendered.finish(found.id)
    detail = answer(rendered.client.get(f"/api/experiments/{found.id}"), schemas.ExperimentDetail)
    assert detail.paths == {"my room": scene.digest}
    assert detail.scenes == [
        schemas.SceneInfo(name="my room", width=12, height=8, reference=detail.scenes[0].reference)
    ]
    page = answer(rendered.client.get(f"/api/experiments/{found.id}/cells"), schemas.Cells)
    assert {cell.state for cell in page.cells} == {"done"}
    assert all(cell.metrics for cell in page.cells if cell.role == "cell")


@pytest.mark.parametrize("name", [" ", "two\nlines", "a" * 201, "\x00"])
def test_a_name_that_cannot_be_shown_is_refused(house: House, name: str) -> None:
    refusal(upload(house, packed({"scene.xml": SCENE}), name=name), 422)


@pytest.mark.parametrize("name", ["raum süd", "部屋/scene.xml", "<script>alert(1)</script>", "a" * 200])
def test_any_name_that_can_be_shown_is_one(house: House, name: str) -> None:
    assert answer(upload(house, packed({"scene.xml": SCENE}), name=name), schemas.Scene).name == name
