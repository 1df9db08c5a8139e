"""Point files: what was written is read back, and whatever else a file holds is refused in one sentence."""

from __future__ import annotations

import io
import struct
import zipfile

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from renderer.errors import BadParameter, EnvironmentProblem
from renderer.samplers import pointfile

POINTS = np.random.default_rng(7).random((3, 16, 2))


def saved(path, **arrays):
    np.savez(path, **arrays)
    return path


def zipped(path, files: dict[str, bytes], compression: int = zipfile.ZIP_DEFLATED):
    with zipfile.ZipFile(path, "w", compression) as archive:
        for name, content in files.items():
            archive.writestr(name, content)
    return path


def array_bytes(array, version: tuple[int, int] | None = None) -> bytes:
    file = io.BytesIO()
    np.lib.format.write_array(file, array, version=version)
    return file.getvalue()


def header_bytes(text: str) -> bytes:
    """The beginning of a .npy file that claims whatever is said."""
    padded = text.ljust(117) + "\n"
    return b"\x93NUMPY\x01\x00" + struct.pack("<H", len(padded)) + padded.encode()


def test_what_was_written_is_read_back(tmp_path):
    path = tmp_path / "my.npz"
    pointfile.write(path, POINTS, sampler="poissondisk", spp=16)
    found = pointfile.read(path)
    assert found.points.dtype == np.float64 and np.array_equal(found.points, POINTS)
    assert str(np.load(path)["sampler"]) == "poissondisk"
    assert list(tmp_path.iterdir()) == [path], "nothing half-written is left"


@pytest.mark.parametrize(
    "store",
    [
        lambda path: np.savez(path, points=POINTS),
        lambda path: np.savez_compressed(path, other=np.arange(3), points=POINTS),
        lambda path: np.savez(path, points=np.asfortranarray(POINTS)),
        lambda path: np.savez(path, points=POINTS.astype(">f8")),
        lambda path: zipped(path, {"points.npy": array_bytes(POINTS, (2, 0))}),
    ],
)
def test_the_same_points_have_one_digest_however_they_are_stored(tmp_path, store):
    store(tmp_path / "my.npz")
    assert pointfile.read(tmp_path / "my.npz").digest == pointfile.digest_of(POINTS)


def test_another_value_another_shape_or_another_order_is_another_digest():
    changed = POINTS.copy()
    changed[2, 5, 1] = np.nextafter(changed[2, 5, 1], 1)
    others = [changed, POINTS[::-1], POINTS.reshape(1, 48, 2), POINTS[:, :8]]
    assert len({pointfile.digest_of(points) for points in [POINTS, *others]}) == 5


def test_one_set_may_stand_alone_and_minus_zero_is_zero(tmp_path):
    found = pointfile.read(saved(tmp_path / "one.npz", points=np.array([[-0.0, 0.5], [0.25, 0.0]])))
    assert found.points.shape == (1, 2, 2)
    assert found.digest == pointfile.digest_of(np.array([[[0.0, 0.5], [0.25, 0.0]]]))


def test_single_precision_is_taken_as_it_is(tmp_path):
    found = pointfile.read(saved(tmp_path / "f.npz", points=POINTS.astype(np.float32)))
    assert np.array_equal(found.points, POINTS.astype(np.float32).astype(np.float64))


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda path: None, ["there is no point file 'my.npz'", "dartboard points"]),
        (lambda path: path.mkdir(), ["is a folder", "name the point file itself"]),
        (lambda path: path.write_bytes(b""), ["cannot be read", "numpy.savez"]),
        (lambda path: path.write_bytes(b"0.1 0.2\n0.3 0.4\n"), ["cannot be read", "numpy.savez"]),
        (lambda path: path.write_bytes(array_bytes(POINTS)), ["cannot be read", "numpy.savez"]),
        (lambda path: saved(path, samples=POINTS, more=POINTS), ["holds samples, more", "no array named points"]),
        (lambda path: zipped(path, {}), ["holds nothing", "no array named points"]),
        (lambda path: zipped(path, {"points.npy": b"no array"}), ["cannot be read"]),
        (lambda path: zipped(path, {"points.npy": array_bytes(POINTS)[:-8]}), ["cannot be read"]),
        (lambda path: zipped(path, {"points.npy": header_bytes("{'descr': '<f8'}")}), ["cannot be read"]),
        (lambda path: saved(path, points=POINTS[..., :1]), ["shape (3, 16, 1)", "(K, N, 2)"]),
        (lambda path: saved(path, points=POINTS[0, 0]), ["shape (2,)", "(K, N, 2)"]),
        (lambda path: saved(path, points=POINTS[:, :0]), ["shape (3, 0, 2)", "(K, N, 2)"]),
        (lambda path: saved(path, points=np.float64(0.5)), ["shape ()", "(K, N, 2)"]),
        (lambda path: saved(path, points=np.ones((4, 2), int)), ["of type int64", "floating-point numbers"]),
        (lambda path: saved(path, points=np.ones((4, 2), complex)), ["of type complex128", "floating-point"]),
        (lambda path: saved(path, points=np.array([["a", "b"]])), ["of type <U1", "floating-point"]),
        (lambda path: saved(path, points=np.array([[0.5, 1.0]])), ["outside [0, 1)", "1.0 at [0, 0, 1]", "scale"]),
        (lambda path: saved(path, points=np.array([[0.5, -1e-9]])), ["outside [0, 1)", "-1e-09"]),
        (lambda path: saved(path, points=np.array([[np.nan, np.inf]])), ["2 coordinates", "nan at [0, 0, 0]"]),
    ],
)
def test_what_is_no_point_file_is_refused_in_one_sentence(tmp_path, make, words):
    path = tmp_path / "my.npz"
    make(path)
    with pytest.raises(BadParameter) as refused:
        pointfile.read(path)
    assert all(word in str(refused.value) for word in words), refused.value
    assert "\n" not in str(refused.value) and len(str(refused.value)) < 400


def test_a_pickle_is_never_opened(tmp_path):
    opened = tmp_path / "opened"

    class Trap:
        def __reduce__(self):
            return (open, (str(opened), "w"))

    np.savez(tmp_path / "my.npz", points=np.array([Trap()], object), allow_pickle=True)
    with pytest.raises(BadParameter, match="of type object"):
        pointfile.read(tmp_path / "my.npz")
    assert not opened.exists()


@pytest.mark.parametrize(
    "make",
    [
        lambda path: saved(path, points=POINTS, ballast=np.zeros(2**23 + 1)),
        lambda path: zipped(path, {"points.npy": header_bytes(str({"descr": "<f8", "fortran_order": False,
                                                                   "shape": (10**9, 16, 2)}))}),
        lambda path: path.write_bytes(b"PK" + bytes(pointfile.MAX_BYTES)),
        lambda path: zipped(path, {f"{number}.npy": b"" for number in range(40_000)}),
    ],
    ids=["unpacks to too much", "claims too much", "is too long", "lists too many files"],
)  # fmt: skip
def test_what_is_too_large_is_refused_before_it_is_unpacked(tmp_path, make):
    make(tmp_path / "my.npz")
    with pytest.raises(BadParameter, match="more than 64 MiB; give fewer sets"):
        pointfile.read(tmp_path / "my.npz")


def test_a_bomb_that_lies_about_its_size_unpacks_to_no_more_than_it_says(tmp_path):
    path = zipped(tmp_path / "my.npz", {"points.npy": array_bytes(POINTS) + bytes(2**28)})
    content = bytearray(path.read_bytes())
    for signature, offset in ((b"PK\x03\x04", 22), (b"PK\x01\x02", 24)):
        at = content.index(signature) + offset
        content[at : at + 4] = struct.pack("<I", 1000)
    path.write_bytes(content)
    with pytest.raises(BadParameter, match="cannot be read"):
        pointfile.read(path)


@settings(max_examples=200, deadline=None, derandomize=True)
@given(at=st.integers(0, 10**4), value=st.integers(0, 255), cut=st.integers(0, 10**4))
def test_a_damaged_file_is_refused_or_read_and_nothing_else(tmp_path_factory, at, value, cut):
    path = tmp_path_factory.getbasetemp() / "damaged.npz"
    content = io.BytesIO()
    np.savez(content, points=POINTS)
    damaged = bytearray(content.getvalue())
    damaged[at % len(damaged)] = value
    path.write_bytes(damaged[: len(damaged) - cut % 300])
    try:
        found = pointfile.read(path)
    except BadParameter:
        return
    assert ((found.points >= 0) & (found.points < 1)).all() and found.points.shape[2] == 2


def test_a_snapshot_is_named_by_its_content_and_made_once(tmp_path):
    source = pointfile.find("my.npz", saved(tmp_path / "my.npz", points=POINTS).parent)
    assert (source.name, source.sets, source.count) == ("my.npz", 3, 16)
    kept = pointfile.snapshot(source, tmp_path / "data" / "points")
    assert kept.name == f"{source.digest}.npz" and pointfile.read(kept).digest == source.digest
    before = kept.stat().st_mtime_ns
    (tmp_path / "my.npz").unlink()
    assert pointfile.snapshot(source, tmp_path / "data" / "points") == kept
    assert kept.stat().st_mtime_ns == before and list(kept.parent.iterdir()) == [kept]


def test_a_file_that_changed_since_it_was_read_is_not_taken_for_what_it_was(tmp_path):
    source = pointfile.find("my.npz", saved(tmp_path / "my.npz", points=POINTS).parent)
    saved(tmp_path / "my.npz", points=POINTS[:, ::-1])
    with pytest.raises(BadParameter, match="was changed while it was copied; submit again"):
        pointfile.snapshot(source, tmp_path / "points")
    assert not (tmp_path / "points").exists()


def test_a_folder_that_cannot_be_made_is_told(tmp_path):
    source = pointfile.find("my.npz", saved(tmp_path / "my.npz", points=POINTS).parent)
    (tmp_path / "points").write_text("in the way")
    with pytest.raises(EnvironmentProblem, match=r"cannot copy the point file 'my\.npz'"):
        pointfile.snapshot(source, tmp_path / "points")
