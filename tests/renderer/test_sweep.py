"""
Sweeping a loaded scene: what is set is what a file would say, nothing is left behind, and nothing is compiled anew.
"""

from __future__ import annotations

import json
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from renderer.errors import BadParameter
from renderer.scenes.builtin import BUILTIN
from renderer.spec import CellSpec
from tests.renderer.conftest import make_cell

ROOT = Path(__file__).resolve().parent.parent.parent
GREEN = (0.1, 0.9, 0.2)
SCENE = Path(__file__).parent / "swept"  # a folder; its scene.xml says what SWEEP replaces
SWEEP = (("near_sphere.reflectance", GREEN), ("white_sphere.bsdf.alpha", 0.05))


def cell(*sweep: tuple[str, Any], sampler: str = "independent") -> CellSpec:
    """A cell of SCENE with something set in it."""
    spec = make_cell("cornell_box", sampler)
    return replace(spec, estimand=replace(spec.estimand, sweep=tuple(sorted(sweep))))


def picture(spec: CellSpec, loaded: Any) -> np.ndarray:
    from renderer.render import render

    return next(render(spec, loaded, [7])).picture


def fresh() -> Any:
    from renderer.scenes.load import load

    return load(SCENE, "scene.xml", width=32, height=24)


@pytest.fixture
def loaded(variant: str) -> Any:
    return fresh()


def edited(folder: Path, variant: str = "") -> Any:
    """The scene with the values of SWEEP written into its file by hand."""
    from renderer.scenes.load import load

    text = (SCENE / "scene.xml").read_text("utf-8")
    for old, new in (
        ('<float name="alpha" value="0.25"/>', '<float name="alpha" value="0.05"/>'),
        ("0.85 0.36 0.08", " ".join(map(str, GREEN))),
    ):
        assert text.count(old) == 1
        text = text.replace(old, new)
    (folder / "scene.xml").write_text(text, "utf-8")
    return load(folder, "scene.xml", width=32, height=24)


def test_what_is_set_is_what_the_file_would_say(loaded: Any, tmp_path: Path) -> None:
    swept = picture(cell(*SWEEP), loaded)
    assert np.abs(swept - picture(cell(), edited(tmp_path))).max() <= 1e-6
    plain = picture(cell(), loaded)
    changed = np.abs(swept - plain).max(axis=2) > 1e-3
    assert 0.02 < changed.mean() < 0.9, "two spheres of the picture, not all of it"


def test_in_spectral_colour_too(tmp_path: Path) -> None:
    """There a colour is the coefficients of a spectrum. In a process of its own: a variant is for good."""
    code = (
        "import sys\nfrom pathlib import Path\nfrom renderer.variant import use\nuse('llvm_ad_spectral')\n"
        "import numpy as np\nfrom renderer.errors import BadParameter\n"
        "from tests.renderer.test_sweep import SWEEP, cell, edited, fresh, picture\n"
        "loaded = fresh()\n"
        "swept = picture(cell(*SWEEP), loaded)\n"
        "assert np.abs(swept - picture(cell(), edited(Path(sys.argv[1])))).max() <= 1e-6\n"
        "assert np.abs(swept - picture(cell(), loaded)).max() > 0.01\n"
        "try:\n    picture(cell(('key_lamp.radiance', 5)), loaded)\n"
        "except BadParameter as error:\n    assert 'cannot be swept' in str(error), error\n"
        "else:\n    raise AssertionError('a lamp was swept')\n"
    )
    done = subprocess.run([sys.executable, "-c", code, tmp_path], cwd=ROOT, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr


def test_no_cell_leaves_anything_to_the_next(loaded: Any) -> None:
    """Whatever was set before, a cell's picture is that of a scene freshly loaded, to the last bit."""
    cells = [cell(), cell(SWEEP[0]), cell(SWEEP[1]), cell(*SWEEP), cell(("white_sphere.eta", 1.2)), cell()]
    alone = [picture(spec, fresh()) for spec in cells]
    for spec, expected in [*zip(cells, alone, strict=True), *zip(reversed(cells), reversed(alone), strict=True)]:
        np.testing.assert_array_equal(picture(spec, loaded), expected)
    assert len({expected.tobytes() for expected in alone}) == len(cells) - 1  # first and last are the same cell


def kernels_and_pictures(
    cells: list[CellSpec], loaded: Any, monkeypatch: pytest.MonkeyPatch
) -> tuple[list[set[str]], list[np.ndarray]]:
    """Of each cell: every kernel that was seen up to and with it, and its picture."""
    import drjit as dr

    import renderer.render as module

    seen: set[str] = set()

    def collect() -> float:
        seen.update(str(kernel["hash"]) for kernel in dr.kernel_history([dr.KernelType.JIT]))
        return 0.0

    monkeypatch.setattr(module, "_compile_seconds", collect)
    drawn = [(picture(spec, loaded), set(seen)) for spec in cells]
    return [kernels for _, kernels in drawn], [pixels for pixels, _ in drawn]


def test_a_whole_sweep_runs_the_kernels_of_its_first_cell(loaded: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    sweep = [
        cell(("white_sphere.alpha", alpha), ("near_sphere.reflectance", colour))
        for alpha in (0.05, 0.2, 0.4)
        for colour in (0.5, GREEN)
    ]
    kernels, _ = kernels_and_pictures(sweep, loaded, monkeypatch)
    assert kernels[0]
    assert kernels[-1] == kernels[0]


def test_so_does_one_of_the_exponents_of_anisophong(variant: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """nu × nv × rd on the sphere of the BRDF paper; a value that the plugin refuses comes with its own words."""
    from renderer.scenes.load import load

    loaded = load(BUILTIN["sphere_figure"].folder, "scene.xml", width=32, height=24)
    sweep = [
        cell(("sphere.bsdf.nu", nu), ("sphere.bsdf.nv", nv), ("sphere.bsdf.rd", rd))
        for nu in (10, 10000)
        for nv in (10, 10000)
        for rd in (0.1, GREEN)
    ]
    kernels, pictures = kernels_and_pictures(sweep, loaded, monkeypatch)
    assert kernels[-1] == kernels[0]
    assert len({pixels.tobytes() for pixels in pictures}) == len(sweep)
    with pytest.raises(BadParameter, match=r"sphere.bsdf.nu = -1: .*at least 0"):
        picture(cell(("sphere.bsdf.nu", -1)), loaded)
    np.testing.assert_array_equal(picture(sweep[0], loaded), pictures[0])


def test_a_lamp_and_a_lens_can_be_swept(loaded: Any) -> None:
    plain = picture(cell(), loaded)
    lamps = (("fill_lamp.radiance", (2, 2.7, 3.7)), ("key_lamp.emitter.radiance", (168, 142, 110)))
    np.testing.assert_allclose(picture(cell(*lamps), loaded), 2 * plain, rtol=1e-4, atol=1e-6)
    assert np.abs(picture(cell(("camera.aperture_radius", 0.4)), loaded) - plain).max() > 0.01


def test_what_a_scene_does_not_have_or_take_leaves_it_as_it_was(loaded: Any) -> None:
    plain = picture(cell(), loaded)
    for sweep, words in (
        ((("white_sphere.bsdf.alhpa", 0.1),), "did you mean 'white_sphere.bsdf.alpha'"),
        ((SWEEP[0], ("white_sphere.alpha", GREEN)), "is one number"),
        ((SWEEP[0], ("near_sphere.bsdf.reflectance", 0.1)), "one parameter"),
        ((("white_sphere.to_world", 3),), "neither a number nor a colour"),
    ):
        with pytest.raises(BadParameter, match=words):
            picture(cell(*sweep), loaded)
        np.testing.assert_array_equal(picture(cell(), loaded), plain)


def test_a_plugin_that_refuses_a_value_is_told_in_a_sentence(loaded: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    """And the scene is then as its file says: what was written before the refusal is taken back."""
    plain = picture(cell(), loaded)
    settings = loaded.settings
    settings.parameters()
    update = settings.traversed.update

    def refuse() -> None:
        monkeypatch.setattr(settings.traversed, "update", update)
        raise RuntimeError("alpha is too rough for me")

    monkeypatch.setattr(settings.traversed, "update", refuse)
    with pytest.raises(BadParameter, match=r"does not take .*white_sphere.bsdf.alpha = 0.05: alpha is too rough"):
        picture(cell(*SWEEP), loaded)
    np.testing.assert_array_equal(picture(cell(), loaded), plain)


def test_a_child_lists_the_parameters_of_a_scene() -> None:
    words = ["-m", "renderer.sweep", "llvm_ad_rgb", SCENE, "scene.xml"]
    done = subprocess.run([sys.executable, *words], cwd=ROOT, capture_output=True, text=True, check=True)
    told = {key: (kind, now) for key, kind, now in json.loads(done.stdout)["parameters"]}
    assert told["white_sphere.bsdf.alpha"] == ("number", 0.25)
    assert told["near_sphere.bsdf.reflectance.value"] == ("colour", [0.85, 0.36, 0.08])
    assert told["near_sphere.to_world"] == ("other", None)


def test_a_scene_that_does_not_load_is_told_in_a_sentence(tmp_path: Path) -> None:
    (tmp_path / "scene.xml").write_text('<scene version="3.0.0"><shape type="sphere"/></scene>')
    words = ["-m", "renderer.sweep", "llvm_ad_rgb", tmp_path, "scene.xml"]
    done = subprocess.run([sys.executable, *words], cwd=ROOT, capture_output=True, text=True, check=True)
    assert "has no camera" in json.loads(done.stdout)["error"]
