"""Numbers as people read them, text that cannot end its element, and pictures that fit."""

from __future__ import annotations

import base64
import io
import json
import re
from functools import partial

import pytest
from hypothesis import given
from hypothesis import strategies as st
from PIL import Image

from service.report import figures, inline
from service.report.panels import sections
from service.report.reading import read
from service.report.thumbnails import SIDES, thumbnails
from tests.service.report.conftest import finished, page_of


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (0.000487123, "4.87e-4"), (0.0999, "9.99e-2"), (0.1, "0.100"), (1.2345, "1.23"), (12.345, "12.3"),
        (1234.5, "1234"), (123456.0, "1.23e5"), (0.0, "0.00"), (-0.5, "-0.500"), (None, "–"), (float("inf"), "∞"),
        (0.99996, "1.00"),
    ],
)  # fmt: skip
def test_a_number_has_three_digits(value, text):
    assert figures.number(value) == text


@pytest.mark.parametrize(
    ("value", "text"), [(0.0937, "0.0937"), (0.333333, "0.333"), (1.0, "1.00"), (24.51, "24.5"), (1e-7, "1.00e-7")]
)
def test_a_factor_is_no_power_of_ten_where_people_can_read_it(value, text):
    assert figures.factor(value) == text


@pytest.mark.parametrize(
    ("mean", "error", "shown"),
    [
        (0.99988, 0.00012, ("0.99988", "0.00012")), (1.003688, 0.001132, ("1.0037", "0.0011")),
        (1.2, 0.3, ("1.20", "0.30")), (1.0, None, ("1.0000", "")),
    ],
)  # fmt: skip
def test_a_ratio_has_the_decimals_that_its_spread_allows(mean, error, shown):
    assert figures.ratio(mean, error) == shown


@pytest.mark.parametrize(
    ("seconds", "text"),
    [
        (None, "–"), (0.0001, "0 s"), (0.0074, "7.4 ms"), (0.626, "626 ms"), (1.1, "1.1 s"), (59.6, "1 min"),
        (109, "1 min 49 s"), (7500, "2 h 5 min"), (86400 * 3 + 3600 * 4, "3 d 4 h"),
    ],
)  # fmt: skip
def test_a_duration_has_the_two_units_that_matter(seconds, text):
    assert figures.duration(seconds) == text


json_values = st.recursive(
    st.none() | st.booleans() | st.floats(allow_nan=False, allow_infinity=False) | st.text(),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(), inner, max_size=3),
    max_leaves=8,
)


@given(json_values | st.sampled_from(["</script>", "<!--<script>", "]]>", "&lt;"]))
def test_json_in_a_page_reads_back_and_is_no_markup(value):
    text = str(inline.data(value))
    assert "<" not in text
    assert json.loads(text) == value


def test_a_script_cannot_end_its_element(tmp_path):
    file = tmp_path / "a.js"
    file.write_text(
        'import { b } from "./b.js";\n'
        'export const A = "</script><!-- <SCRIPT>";\nexport function f() {\n  return A < 1;\n}\n'
    )
    text = str(inline.script(file))
    assert not re.search(r"<(/?script|!--)", text, re.IGNORECASE)
    assert "import" not in text and "export" not in text and "return A < 1" in text


def test_thumbnails_shrink_to_the_budget_and_then_grow_fewer(store, artifacts):
    experiment = finished(store, artifacts, resolution=[96, 64], spp=[1, 2, 3, 4, 5])
    panels = [panel for section in sections(read(store, artifacts, experiment.id)) for panel in section.panels]

    def made(budget: int):
        found = thumbnails(panels, artifacts, budget)
        sides = {max(_image(uri).size) for uri in found.uris.values()}
        assert len(sides) <= 1 and all(side <= found.side for side in sides)
        return found, sum(map(len, found.uris.values())), sides

    free, size, sides = made(10**7)
    assert sides == {96} and not free.reduced and len(free.uris) == 9 and free.spp == {"panel-0-0": [1, 2, 3, 4, 5]}
    half, less, sides = made(size * 6 // 10)
    assert less <= size * 6 // 10 and sides == {64} and half.reduced and len(half.uris) == 9
    few, least, _ = made(9000)
    assert few.side == SIDES[-1] and few.left_out(panels[0]) and few.spp["panel-0-0"][-1] == 5
    assert 1 < len(few.uris) < 9 and least <= 9000
    none, _, _ = made(10)
    assert none.spp == {"panel-0-0": []} and len(none.uris) <= 1


def test_the_page_says_when_pictures_were_left_out(store, artifacts, monkeypatch):
    experiment = finished(store, artifacts, resolution=[96, 64], spp=[1, 2, 3, 4, 5])
    monkeypatch.setattr("service.report.thumbnails", partial(thumbnails, budget=9000))
    page, _ = page_of(store, artifacts, experiment)
    assert "of 5 values of spp" in page.text and "made smaller, to 32 pixels" in page.text


def _image(uri: str) -> Image.Image:
    return Image.open(io.BytesIO(base64.b64decode(uri.partition(",")[2])))
