"""``dartboard points`` as people type it: a real child draws, files are whole, and bad input is one sentence."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from renderer.errors import DartboardError
from renderer.samplers import pointfile
from renderer.samplers.analysis import summary
from service.pointing import points_of, show
from tests.renderer.samplers.patterns import hammersley
from tests.service.test_cli import dartboard, refused


@pytest.fixture(scope="module")
def stratified(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, dict[str, object]]:
    """15 asked, 16 rendered, in 8 sets; with a figure. The folder, and what was said."""
    folder = tmp_path_factory.mktemp("points")
    words = ("points", "stratified", "--spp", 15, "--sets", 8, "-o", folder / "a.npz", "--plot", folder / "a.png")
    done = dartboard(*words, "--json")
    assert done.returncode == 0, done.stderr
    return folder, json.loads(done.stdout)


def test_points_are_what_the_plugin_draws(stratified: tuple[Path, dict[str, object]]) -> None:
    """(K, N, 2) float64 in [0, 1) at the spp that is rendered, one in each stratum; the file says what they are."""
    folder, told = stratified
    with np.load(folder / "a.npz") as file:
        points = file["points"]
        assert (str(file["sampler"]), int(file["spp"]), int(file["seed"])) == ("stratified", 16, 0)
    assert points.shape == (8, 16, 2) and points.dtype == np.float64
    assert ((points >= 0) & (points < 1)).all()
    assert (np.sort((points * 4).astype(int) @ [1, 4], axis=1) == np.arange(16)).all()
    assert len(np.unique(points.reshape(-1, 2), axis=0)) == 8 * 16
    assert (told["spp"], told["spp_actual"], told["sets"], told["replay"]) == (15, 16, 8, False)
    assert told["numbers"]["intervals"]["4×4"] == 0  # type: ignore[index]


def test_the_figure_is_a_picture_and_nothing_else_is_left(stratified: tuple[Path, dict[str, object]]) -> None:
    folder, _ = stratified
    assert sorted(file.name for file in folder.iterdir()) == ["a.npz", "a.png"]
    with Image.open(folder / "a.png") as picture:
        assert picture.format == "PNG"


def test_a_seed_gives_the_same_points_again_and_another_gives_others(
    stratified: tuple[Path, dict[str, object]], tmp_path: Path
) -> None:
    again, other = tmp_path / "again.npz", tmp_path / "other.npz"
    for file, seed in ((again, 0), (other, 1)):
        done = dartboard("points", "stratified", "--spp", 15, "--sets", 8, "--seed", seed, "-o", file)
        assert done.returncode == 0, done.stderr
        assert "8 sets of 16 points (15 asked) of stratified" in done.stdout
    first = pointfile.read(stratified[0] / "a.npz")
    assert pointfile.read(again).digest == first.digest
    assert not (pointfile.read(other).points == first.points).any()


def test_people_read_which_grids_are_full(capsys: pytest.CaptureFixture[str]) -> None:
    numbers = summary(np.repeat(hammersley(3), 2, axis=0))
    show(
        {
            "output": "a.npz",
            "sampler": "mine",
            "spp": 8,
            "spp_actual": 8,
            "sets": 5,
            "replay": True,
            "maximal": None,
            "numbers": numbers,
        }
    )
    told = " ".join(capsys.readouterr().out.split())
    for words in (
        "1×8, 2×4, 4×2, 8×1 (all there are)",
        "the first 2 of the sets",
        "hexagonal bound",
        "a published mistake",
    ):
        assert words in told


def test_its_file_is_a_point_set_of_one_s_own(stratified: tuple[Path, dict[str, object]], tmp_path: Path) -> None:
    """What was written is read again: as it is, the sets are those of the file."""
    folder, _ = stratified
    words = ("pointset:file=a.npz,scramble=none", "--spp", 9, "--sets", 4, "-o", tmp_path / "b.npz", "--json")
    done = dartboard("points", *words, cwd=folder)
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout)["replay"] is True
    brought, taken = (pointfile.read(file).points for file in (folder / "a.npz", tmp_path / "b.npz"))
    assert taken.shape == (4, 9, 2)
    for points in taken:
        distances = np.abs(points[:, None, None] - brought).max(axis=-1)  # (9, K, N)
        assert (distances.min(axis=-1).max(axis=0).min()) < 1e-6, "these points are not of one set"


@pytest.mark.parametrize(
    ("sampler", "options", "said"),
    [
        ("poisondisk", {}, ("'poisondisk'", "did you mean 'poissondisk'")),
        ("stratified:jitter=2", {}, ("jitter = 2", "true or false")),
        ("sobol", {"spp": 0}, ("--spp: 0", "1 to 10000000")),
        ("sobol", {"spp": 1_000_000, "sets": 64}, ("64 sets of 1000000 points", "4000000")),
        ("pmj02bn", {"spp": 20_000}, ("16384", "sobol")),
        ("poissondisk:min_dist=0.5", {"spp": 64}, ("min_dist = 0.5",)),
        ("pointset:file=none.npz", {}, ("'none.npz'",)),
        ("sobol", {"device": "tpu"}, ("'tpu'",)),
        ("sobol", {"output": "a.txt"}, ("a.txt", ".npz")),
        ("sobol", {"output": "none/a.npz"}, ("none", "make it first")),
        ("sobol", {"plot": "a.jpg"}, ("a.jpg", ".png")),
        ("sobol", {"plot": "none/a.png"}, ("none", "make it first")),
    ],
)
def test_bad_options_are_refused_before_anything_is_drawn(
    tmp_path: Path, sampler: str, options: dict[str, Any], said: tuple[str, ...]
) -> None:
    asked = {"output": "a.npz", "spp": 16, "sets": 4, "seed": 0, "plot": None, "device": "auto", **options}
    for name in ("output", "plot"):
        asked[name] = asked[name] and tmp_path / asked[name]
    with pytest.raises(DartboardError) as refusal:
        points_of(sampler, **asked)
    for word in said:
        assert word in str(refusal.value)
    assert refusal.value.exit_code == 2
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("words", [("nosuch",), ("sobol", "--sets", 0), ("sobol", "--seed", -1)])
def test_bad_words_are_one_sentence(tmp_path: Path, words: tuple[object, ...]) -> None:
    refused(dartboard("points", *words, "--spp", 16, "-o", tmp_path / "a.npz"), 2, str(words[-2:][0]))
    assert list(tmp_path.iterdir()) == []


def test_darts_at_a_distance_are_said_to_leave_room(tmp_path: Path) -> None:
    """A set that is not maximal is labelled so; one without ``min_dist`` is maximal."""
    told = {}
    for name, sampler in (("given", "poissondisk:min_dist=0.1"), ("largest", "poissondisk")):
        done = dartboard("points", sampler, "--spp", 16, "--sets", 2, "-o", tmp_path / f"{name}.npz")
        assert done.returncode == 0, done.stderr
        told[name] = "not maximal" in done.stdout
    assert told == {"given": True, "largest": False}
