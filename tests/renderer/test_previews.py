"""Pictures as browsers get them: smaller without getting darker, in known colours, with nothing hidden."""

from __future__ import annotations

import io

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from PIL import Image

from renderer import metrics
from renderer.errors import BadParameter, UnknownName
from renderer.metrics import METRICS, Reference
from renderer.previews import INFERNO, LARGEST_HALF, MAGENTA, TONES, error_png, preview_png, shrink, to_half


def pixels(png: bytes) -> np.ndarray:
    """(H, W, 3) bytes of a PNG."""
    picture = Image.open(io.BytesIO(png))
    assert (picture.format, picture.mode) == ("PNG", "RGB")
    return np.asarray(picture)


def grey(*values: float) -> np.ndarray:
    """One row of grey pixels."""
    return np.repeat(np.array([values], np.float32)[:, :, None], 3, axis=2)


def radiance(height: int, width: int, seed: int = 1) -> np.ndarray:
    return np.random.default_rng(seed).gamma(2.0, 0.25, (height, width, 3)).astype(np.float32)


@given(parts=st.tuples(st.integers(1, 40), st.integers(1, 40)), times=st.integers(1, 9), seed=st.integers(0, 2**32 - 1))
@settings(deadline=None, derandomize=True)
def test_where_the_size_divides_the_mean_stays_exactly(parts, times, seed):
    """Every pixel of the small picture is the mean of ``times`` × ``times`` pixels."""
    height, width = parts
    picture = np.random.default_rng(seed).integers(0, 1000, (height * times, width * times, 3)).astype(np.float32)
    small = shrink(picture, max(parts))
    assert small.shape == (height, width, 3)
    blocks = picture.reshape(height, times, width, times, 3).astype(np.float64).mean(axis=(1, 3))
    np.testing.assert_array_equal(small, blocks.astype(np.float32))


@given(height=st.integers(1, 200), width=st.integers(1, 200), side=st.integers(1, 256), seed=st.integers(0, 2**32 - 1))
@settings(deadline=None, derandomize=True)
def test_no_side_is_longer_than_asked_and_no_light_is_lost(height, width, side, seed):
    """The longer side has at most ``side`` pixels; weighed by the pixels in it, the mean is the same."""
    picture = radiance(height, width, seed)
    small = shrink(picture, side)
    rows, columns = small.shape[:2]
    assert max(rows, columns) == min(side, max(height, width))
    assert min(rows, columns) >= 1
    scale = max(rows, columns) / max(height, width)
    assert abs(rows - height * scale) <= 1 and abs(columns - width * scale) <= 1
    weights = np.diff(np.arange(rows + 1) * height // rows)[:, None] * np.diff(
        np.arange(columns + 1) * width // columns
    )
    assert weights.sum() == height * width
    whole = (small.astype(np.float64) * weights[:, :, None]).sum(axis=(0, 1)) / (height * width)
    np.testing.assert_allclose(whole, picture.astype(np.float64).mean(axis=(0, 1)), rtol=1e-6)


def test_a_picture_that_fits_is_left_alone():
    picture = radiance(3, 5)
    assert shrink(picture, 5) is picture


def test_a_nan_makes_its_pixel_nan_and_no_other():
    picture = radiance(8, 8)
    picture[1, 6, 0] = np.nan
    small = shrink(picture, 4)
    assert [tuple(place) for place in np.argwhere(~np.isfinite(small))] == [(0, 3, 0)]


def test_srgb_has_the_bytes_of_the_standard():
    """IEC 61966-2-1: black, the end of the straight part, 18 % grey, half, white, and what is beyond."""
    values = (0.0, 0.0031308, 0.18, 0.2158605, 0.5, 1.0, 7.0, -1.0)
    assert [int(row[0]) for row in pixels(preview_png(grey(*values)))[0]] == [0, 10, 118, 128, 188, 255, 255, 0]


def test_channels_keep_their_order():
    picture = np.array([[[1.0, 0.0, 0.0], [0.0, 0.5, 0.0], [0.0, 0.0, 0.0031308]]], np.float32)
    assert pixels(preview_png(picture)).tolist() == [[[255, 0, 0], [0, 188, 0], [0, 0, 10]]]


def test_gamma_is_2_2():
    assert [int(row[0]) for row in pixels(preview_png(grey(0.0, 0.5, 1.0), tone="gamma22"))[0]] == [0, 186, 255]


@pytest.mark.parametrize("tone", TONES)
@pytest.mark.parametrize("ev", [-20, -1.5, 0, 3, 20])
def test_exposure_is_a_factor_of_two_a_stop(tone, ev):
    picture = radiance(6, 7) * np.float32(0.3)
    np.testing.assert_array_equal(
        pixels(preview_png(picture, ev=ev, tone=tone)),
        pixels(preview_png(picture.astype(np.float64) * 2.0**ev, tone=tone)),
    )


def test_rows_come_from_the_top():
    picture = np.zeros((2, 3, 3), np.float32)
    picture[0] = 1.0
    assert pixels(preview_png(picture))[:, 0, 0].tolist() == [255, 0]


@pytest.mark.parametrize("tone", TONES)
@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
def test_what_is_no_number_is_magenta(tone, value):
    """In any channel, under any exposure, and in no other pixel."""
    picture = grey(0.25, 0.25, 0.25)
    picture[0, 1, 2] = value
    shown = pixels(preview_png(picture, tone=tone, ev=2))[0]
    assert tuple(shown[1]) == MAGENTA
    assert tuple(shown[0]) == tuple(shown[2]) != MAGENTA
    assert tuple(pixels(error_png(picture, 1.0))[0, 1]) == MAGENTA


def test_false_colour_goes_from_end_to_end_of_its_scale():
    """Luminance 0 is the first colour, the maximum and all above the last, the middle is the middle."""
    first, last = (tuple(bytes.fromhex(INFERNO[place])) for place in (0, -1))
    shown = [
        tuple(map(int, row)) for row in pixels(preview_png(grey(0, 2, 1, 5, -1), tone="falsecolour", maximum=2))[0]
    ]
    assert shown[0] == shown[4] == first
    assert shown[1] == shown[3] == last
    middle = np.mean([list(bytes.fromhex(INFERNO[place])) for place in (4, 5)], axis=0)
    assert np.abs(np.array(shown[2]) - middle).max() <= 0.5


def test_false_colour_shows_luminance():
    """Rec. 709: pure green is brighter than pure red, red brighter than blue."""
    picture = np.eye(3, dtype=np.float32)[None]
    weights = [0.2126, 0.7152, 0.0722]
    shown = pixels(preview_png(picture, tone="falsecolour"))[0]
    expected = pixels(preview_png(grey(*weights), tone="falsecolour"))[0]
    assert np.abs(shown.astype(int) - expected.astype(int)).max() <= 1


def test_the_colours_of_the_scale_get_brighter_all_the_way():
    steps = pixels(error_png(grey(*np.linspace(0, 1, 500)), 1.0))[0].astype(float) @ [0.2126, 0.7152, 0.0722]
    assert np.all(np.diff(steps) > -1.0)  # rounding to bytes
    assert np.all(np.diff(steps[::20]) > 0)


@pytest.mark.parametrize("name", METRICS)
def test_an_error_map_agrees_with_its_metric(name):
    """What is seen is what is measured: the mean of the map is the metric, and so is the mean of its small copy."""
    picture, reference = radiance(16, 24, 1), Reference(radiance(16, 24, 2), radiance(16, 24, 3))
    error = METRICS[name].error_map(picture, reference)
    value = metrics.measure(picture, reference)[name]
    assert float(error.mean()) == pytest.approx(value, rel=1e-12)
    assert float(shrink(error, 12).astype(float).mean()) == pytest.approx(value, rel=1e-6)


def test_an_error_is_shown_by_the_mean_of_its_channels():
    """The same colour as grey of that mean; what is negative is shown as nothing."""
    error = np.array([[[0.3, 0.6, 0.0], [-1.0, -1.0, -1.0], [5.0, 5.0, 5.0]]])
    np.testing.assert_array_equal(pixels(error_png(error, 1.0)), pixels(error_png(grey(0.3, 0.0, 1.0), 1.0)))


@pytest.mark.parametrize("dtype", [np.float16, np.float32, np.float64])
@pytest.mark.parametrize("maximum", [5e-324, 1e-300, 1e-40, 1.0, 1e300, 1.7e308])
def test_no_scale_is_too_small_or_too_large(dtype, maximum):
    """Nothing overflows into a number that is no colour: zero is the first one, what is larger the last."""
    picture = grey(0.0, 3.0).astype(dtype)
    first, last = (tuple(bytes.fromhex(INFERNO[place])) for place in (0, -1))
    ends = {first, last} if maximum < 1 else {first}
    with np.errstate(all="raise", under="ignore"):
        for png in (error_png(picture, maximum), preview_png(picture, tone="falsecolour", maximum=maximum)):
            shown = [tuple(map(int, row)) for row in pixels(png)[0]]
            assert shown[0] == first
            if maximum != 1.0:
                assert set(shown) == ends


@pytest.mark.parametrize("tone", TONES)
def test_no_radiance_is_too_large(tone):
    """The largest float32, of both signs, twenty stops up: the ends of the scale, and no warning on the way."""
    largest = float(np.finfo(np.float32).max)
    picture = np.array([[[largest, -largest, largest], [largest] * 3, [-largest] * 3]], np.float32)
    with np.errstate(all="raise", under="ignore"):
        shown = pixels(preview_png(picture, tone=tone, ev=20))[0]
    assert shown.shape == (3, 3)
    assert tuple(shown[1]) == (tuple(bytes.fromhex(INFERNO[-1])) if tone == "falsecolour" else (255, 255, 255))


@pytest.mark.parametrize("maximum", [0.0, -1.0, np.nan, np.inf])
def test_a_scale_without_an_end_is_refused(maximum):
    with pytest.raises(BadParameter, match="max = .* is not allowed; give a positive number"):
        error_png(grey(1.0), maximum)
    with pytest.raises(BadParameter, match="max"):
        preview_png(grey(1.0), tone="falsecolour", maximum=maximum)


@pytest.mark.parametrize("ev", [20.5, -21, np.nan, np.inf])
def test_an_exposure_beyond_reason_is_refused(ev):
    with pytest.raises(BadParameter, match="ev = .* is not allowed; give a number from -20 to 20"):
        preview_png(grey(1.0), ev=ev)


def test_an_unknown_tone_map_is_told_with_those_that_are_known():
    with pytest.raises(UnknownName, match="unknown tone 'filmic'; known: falsecolour, gamma22, srgb"):
        preview_png(grey(1.0), tone="filmic")


def test_half_floats_keep_what_they_can():
    """Little-endian; what is too large is the largest, NaN stays NaN, and small numbers keep three digits."""
    picture = np.array([[[1e9, -1e9, np.nan], [0.1, 65504.0, np.inf], [1e-3, 0.0, 2.0]]], np.float32)
    half = to_half(picture)
    assert half.dtype == np.dtype("<f2")
    assert half[0, 0, :2].tolist() == [LARGEST_HALF, -LARGEST_HALF]
    assert np.isnan(half[0, 0, 2])
    assert half[0, 1, 1:].tolist() == [LARGEST_HALF, LARGEST_HALF]
    np.testing.assert_allclose(half[0, 2].astype(float), picture[0, 2], rtol=1e-3)
