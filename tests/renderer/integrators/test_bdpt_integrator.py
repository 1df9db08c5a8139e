"""``bdpt`` for scripts of one's own: a picture by ``mi.render``, and one sentence for what is not offered."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from tests.renderer.integrators.rooms import lamps, room

pytestmark = pytest.mark.usefixtures("variant")


def integrator(**options: Any) -> Any:
    import mitsuba as mi

    return mi.load_dict({"type": "bdpt", **options})


def test_it_renders_a_scene_as_path_does() -> None:
    import mitsuba as mi

    scene = room(lamps()["rectangle"], {}).scene
    pictures = {
        name: np.array([np.array(mi.render(scene, integrator=how, spp=64, seed=seed))[..., :3] for seed in range(8)])
        for name, how in {
            "bdpt": integrator(max_depth=4),
            "path": mi.load_dict({"type": "path", "max_depth": 4}),
        }.items()
    }
    means = {name: picture.mean((1, 2, 3)) for name, picture in pictures.items()}
    error = np.hypot(*(mean.std(ddof=1) / np.sqrt(8) for mean in means.values()))
    assert pictures["bdpt"].shape == (8, 16, 16, 3)
    assert abs(means["bdpt"].mean() - means["path"].mean()) < 4.5 * error


def test_the_same_seed_is_the_same_picture() -> None:
    import mitsuba as mi

    scene = room(lamps()["several"], {}).scene
    one, two, other = (
        np.array(mi.render(scene, integrator=integrator(light_sampler="spatial"), spp=4, seed=seed))
        for seed in (1, 1, 2)
    )
    assert np.array_equal(one, two)
    assert not np.array_equal(one, other)


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"max_depth": 0}, "give 1 to 66 edges"),
        ({"max_depth": 1000}, "give 1 to 66 edges"),
        ({"light_sampler": "brightest"}, "one of uniform, power, spatial, bvh"),
        ({"heuristic": "max"}, "one of balance, power"),
        ({"debug_strategy": "1"}, "write s-t"),
    ],
)
def test_what_is_not_offered_is_said(options: dict[str, Any], words: str) -> None:
    with pytest.raises(RuntimeError, match=words):
        integrator(**options)
