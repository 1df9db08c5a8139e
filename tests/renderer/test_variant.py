"""The one place that names variants."""

from __future__ import annotations

import pytest

from renderer import variant
from renderer.errors import BadParameter


def test_device_and_colour_mode_make_the_name() -> None:
    assert variant.name("llvm", "rgb") == "llvm_ad_rgb"
    assert variant.name("cuda", "spectral") == "cuda_ad_spectral"


@pytest.mark.parametrize("colour", ["spectral_polarized", "mono", ""])
def test_other_colour_modes_are_refused_in_a_sentence(colour: str) -> None:
    with pytest.raises(BadParameter, match="rgb, spectral"):
        variant.name("llvm", colour)
