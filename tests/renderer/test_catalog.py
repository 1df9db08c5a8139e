"""The catalog against Mitsuba, and against what people type."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest
from hypothesis import given, reject
from hypothesis import strategies as st

from renderer import catalog, plugins
from renderer.errors import BadParameter, DartboardError, UnknownName
from renderer.spec import Choice

AXES = ("sampler", "integrator", "rfilter")
ENTRIES = [entry for axis in AXES for entry in catalog.entries(axis).values()]
PARAMETERS = [(entry, parameter) for entry in ENTRIES for parameter in entry.parameters]
SAMPLERS = [entry for entry in ENTRIES if entry.axis == "sampler"]
MITSUBAS = [entry for entry in SAMPLERS if entry.source.startswith("Mitsuba")]
TAKEN = [pair for pair in PARAMETERS if pair[1].name != "file"]  # the plugin is told the path of a snapshot instead
EXAMPLES = {"debug_strategy": ("0-2", "2-1", "60-7")}  # of parameters that have a form of their own
LARGE = [1000, 1023, 1024, 1025, 4095, 4096, 4097, 10_000, 65_536, 99_999, 10**6, 3 * 10**6, 9_998_244]


@pytest.fixture(scope="module")
def mi():
    mi = pytest.importorskip("mitsuba")
    mi.set_variant("llvm_ad_rgb")
    plugins.register_all()
    mi.set_log_level(mi.LogLevel.Error)  # samplers announce every rounding
    return mi


def named(items):
    """Entries and their parameters by name, for test ids."""
    return {
        "argvalues": items,
        "ids": [getattr(item, "name", "") or f"{item[0].name}.{item[1].name}" for item in items],
    }


def extremes(parameter):
    """Default, minimum, maximum and options of a parameter, those that there are, as its type."""
    examples = EXAMPLES.get(parameter.name, ())
    given = (parameter.default, parameter.minimum, parameter.maximum, *parameter.options, *examples)
    allowed = [value for value in given if value is not None and value not in parameter.banned]
    return [parameter.kind(value) for value in allowed] or [parameter.kind()]


def plugin(entry, parameter):
    """The plugin that takes the parameter: paths whose lamps are picked are traced by one of ours."""
    return "path_lights" if (entry.name, parameter.name) == ("path", "light_sampler") else entry.plugin


def spelled(entry):
    """The shortest way to write it."""
    needed = ",".join(f"{item.name}=my.npz" for item in entry.parameters if item.required)
    return entry.name + (f":{needed}" if needed else "")


@pytest.mark.parametrize("entry", **named(MITSUBAS))
def test_rounding_is_what_mitsuba_renders(mi, entry):
    """Small requests, where every rule has its exceptions, and some large ones."""
    for asked in [*range(1, 301), *LARGE]:
        rounded = entry.rounds(asked)
        if rounded <= catalog.MAX_SPP:
            rendered = mi.load_dict({"type": entry.plugin, "sample_count": asked}).sample_count()
            assert (asked, rounded) == (asked, rendered)


@pytest.mark.parametrize("entry", **named(SAMPLERS))
@given(first=st.integers(1, 10**5), second=st.integers(1, 10**5))
def test_rounding_goes_up_keeps_order_and_settles(entry, first, second):
    """A grid relies on it: the largest request shows whether any is rounded past the limit."""
    first, second = sorted((first, second))
    assert first <= entry.rounds(first) <= entry.rounds(second)
    assert entry.rounds(entry.rounds(first)) == entry.rounds(first)


@pytest.mark.parametrize("entry", **named([entry for entry in SAMPLERS if entry not in MITSUBAS]))
def test_our_samplers_render_every_spp_that_is_asked(mi, entry):
    for asked in (1, 2, 3, 16, 200, 1000, min(entry.limit or 10**6, 10**6)):
        choice = catalog.resolve("sampler", spelled(entry))
        assert catalog.rendered_spp(choice, asked) == asked
        assert mi.load_dict({"type": entry.plugin, "sample_count": asked}).sample_count() == asked


@pytest.mark.parametrize(("entry", "parameter"), **named(TAKEN))
def test_mitsuba_takes_every_parameter_over_its_whole_range(mi, entry, parameter):
    for value in extremes(parameter):
        mi.load_dict({"type": plugin(entry, parameter), parameter.name: value})


@pytest.mark.parametrize(("entry", "parameter"), **named(TAKEN))
def test_a_parameter_survives_the_digest_text(mi, entry, parameter):
    """Canonical text turns 1.0 into 1; Mitsuba takes that too."""
    for value in extremes(parameter):
        choice = Choice.of(json.loads(Choice(entry.name, 1, ((parameter.name, value),)).text))
        mi.load_dict({"type": plugin(entry, parameter), **dict(choice.parameters)})


@pytest.mark.parametrize("entry", **named(ENTRIES))
def test_the_default_of_the_catalog_is_the_one_of_mitsuba(mi, entry):
    """A plugin with our defaults prints the same as one with its own, so ``path`` means what people expect."""
    ours = dict(catalog.resolve(entry.axis, spelled(entry)).parameters)
    ours.pop("file", None)
    assert str(mi.load_dict({"type": entry.plugin, **ours})) == str(mi.load_dict({"type": entry.plugin}))


@pytest.mark.parametrize(
    ("axis", "spellings"),
    [
        ("sampler", ["independent", "random", {"type": "random"}]),
        ("sampler", ["stratified", {"type": "stratified", "jitter": True}, "stratified:jitter=true"]),
        ("sampler", ["multijitter:jitter=false", {"type": "multijitter", "jitter": "False"}]),
        ("integrator", ["path:max_depth=6", {"type": "path", "max_depth": 6.0}, "path:rr_depth=5,max_depth=6"]),
        ("integrator", [{"rr_depth": 3, "type": "path", "max_depth": 6}, " path:max_depth=6, rr_depth = 3"]),
        ("rfilter", ["tent", "tent:radius=1", {"type": "tent", "radius": 1.0}]),
    ],
)
def test_spellings_of_one_value_are_one_choice(axis, spellings):
    texts = {catalog.resolve(axis, spelling).text for spelling in spellings}
    assert len(texts) == 1, texts


@st.composite
def chosen(draw):
    """(axis, choice) with parameters anywhere in their ranges."""
    entry = draw(st.sampled_from(ENTRIES))
    values = {}
    for parameter in entry.parameters:
        bounds = {
            "min_value": parameter.minimum,
            "max_value": 100 if parameter.maximum is None else parameter.maximum,
        }
        kinds = {
            bool: st.booleans(),
            int: st.integers(**bounds).filter(lambda value, banned=parameter.banned: value not in banned),
            float: st.floats(**bounds).filter(lambda value, banned=parameter.banned: value not in banned),
            str: st.sampled_from(parameter.options or EXAMPLES.get(parameter.name) or ["my.npz", "a b=:é.npz"]),
        }
        if parameter.required or draw(st.booleans()):
            values[parameter.name] = draw(kinds[parameter.kind])
    try:
        return entry.axis, catalog.resolve(entry.axis, {"type": entry.name, **values})
    except BadParameter:
        reject()  # a replay that is relaxed as well


@given(chosen())
def test_a_label_reads_back_as_the_same_choice(pair):
    """What results and plots print can be typed into the next grid."""
    axis, choice = pair
    assert catalog.resolve(axis, catalog.label(axis, choice)) == choice


def test_the_points_of_a_file_are_no_part_of_a_label():
    """Nor can anybody write them: the digest comes from the file."""
    choice = catalog.resolve("sampler", "pointset:scramble=owen,file=my.npz")
    known = Choice.of({**json.loads(choice.text), catalog.POINTS: "0" * 64})
    assert catalog.label("sampler", known) == "pointset:file=my.npz,scramble=owen" and known.text != choice.text
    with pytest.raises(UnknownName, match="points"):
        catalog.resolve("sampler", "pointset:file=my.npz,points=0")


def test_a_label_shows_only_what_differs_from_the_default():
    assert catalog.label("sampler", catalog.resolve("sampler", "random")) == "independent"
    both = catalog.resolve("integrator", {"type": "path", "rr_depth": 5, "max_depth": 8, "hide_emitters": True})
    assert catalog.label("integrator", both) == "path:hide_emitters=true,max_depth=8"


@pytest.mark.parametrize(
    ("axis", "value", "words"),
    [
        ("sampler", "stratifed", ["stratifed", "grid.toml", "known: ", "did you mean 'stratified'"]),
        ("integrator", "bdpd", ["bdpd", "integrator", "known: bdpt, direct, path", "did you mean 'bdpt'"]),
        ("sampler", "stratified:jiter=true", ["jiter", "stratified", "known: jitter"]),
        ("sampler", "independent:jitter=true", ["jitter", "known: none"]),
        ("sampler", "poissondisk:distance=0.1", ["distance", "known: lloyd_iterations, min_dist, replay"]),
    ],
)
def test_unknown_names_come_with_the_known_ones(axis, value, words):
    with pytest.raises(UnknownName) as caught:
        catalog.resolve(axis, value, "grid.toml")
    assert all(word in str(caught.value) for word in words), caught.value


@pytest.mark.parametrize("value", [0, -2, 2.5, "six", True, None, [6], 10**7, 10**400, float("nan"), float("inf")])
def test_a_parameter_out_of_range_names_value_place_and_range(value):
    with pytest.raises(BadParameter) as caught:
        catalog.resolve("integrator", {"type": "path", "max_depth": value}, "grid.toml")
    assert "max_depth" in str(caught.value) and "grid.toml" in str(caught.value)
    assert "an integer from -1 to 1000000, not 0" in str(caught.value)


@pytest.mark.parametrize("value", [0.49, 17, 10**400, float("nan"), "wide", False])
def test_numbers_out_of_range_are_refused(value):
    with pytest.raises(BadParameter, match=r"a number from 0\.5 to 16"):
        catalog.resolve("rfilter", {"type": "tent", "radius": value})


@pytest.mark.parametrize("value", [None, 3, [], {}, {"type": 3}, "path:max_depth", "path:=3", "path:,"])
def test_what_is_no_axis_value_is_told_how_to_write_one(value):
    with pytest.raises(DartboardError, match="NAME"):
        catalog.resolve("integrator", value)


@pytest.mark.parametrize(
    ("sampler", "words"),
    [
        ("poissondisk:replay=flat", ["replay = 'flat'", "ignore_spp, zeros, truncated", "or left out"]),
        ("poissondisk:min_dist=0", ["min_dist = 0", "from 0 to 1, not 0"]),
        ("poissondisk:min_dist=1.5", ["min_dist = 1.5", "from 0 to 1, not 0"]),
        ("poissondisk:replay=zeros,min_dist=0.1", ["min_dist = 0.1", "replay = zeros", "leave out one"]),
        ("poissondisk:replay=four_dimensions,lloyd_iterations=2", ["lloyd_iterations = 2", "leave out one"]),
        ("relaxedpoissondisk:replay=zeros,lloyd_iterations=2", ["lloyd_iterations = 2", "leave out one"]),
        ("pointset", ["needs file", "pointset:file="]),
        ("pointset:scramble=shift", ["needs file"]),
        ("pointset:file=my.npz,scramble=rotate", ["scramble = 'rotate'", "one of shift, owen, none"]),
        ({"type": "pointset", "file": "a,b.npz"}, ["file = 'a,b.npz'", "without a comma"]),
        ({"type": "pointset", "file": " "}, ["file = ' '", "printable"]),
        ({"type": "pointset", "file": "a\nb"}, ["printable"]),
        ({"type": "pointset", "file": 3}, ["file = 3", "a text"]),
    ],
)
def test_parameters_that_make_no_sampler_are_refused_with_the_way_out(sampler, words):
    with pytest.raises(BadParameter) as caught:
        catalog.resolve("sampler", sampler, "grid.toml")
    assert all(word in str(caught.value) for word in [*words, "grid.toml"]), caught.value


def test_an_optional_parameter_may_be_absent():
    assert "min_dist" not in dict(catalog.resolve("sampler", "poissondisk").parameters)
    assert dict(catalog.resolve("sampler", "poissondisk:min_dist=0.1").parameters)["min_dist"] == 0.1
    catalog.resolve("sampler", "relaxedpoissondisk:min_dist=1,replay=zeros")  # where its distance begins


REPLAYS = ["ignore_spp", "zeros", "truncated", "random_fill", "four_dimensions"]


@pytest.mark.parametrize("name", ["poissondisk", "relaxedpoissondisk"])
@pytest.mark.parametrize("replay", REPLAYS)
def test_a_replay_is_known_by_its_choice_and_by_its_label(name, replay):
    choice = catalog.resolve("sampler", {"type": name, "replay": replay})
    label = catalog.label("sampler", choice)
    assert label == f"{name}:replay={replay}"
    assert catalog.is_replay(choice) and catalog.is_replay(label)
    assert catalog.mistake(choice) == catalog.mistake(label) != ""


@pytest.mark.parametrize("entry", **named(SAMPLERS))
def test_no_sampler_is_a_replay_unless_somebody_asks(entry):
    choice = catalog.resolve("sampler", spelled(entry))
    assert not catalog.is_replay(choice) and "replay" not in catalog.label("sampler", choice)


@pytest.mark.parametrize("text", ["", "stratifed", "poissondisk:replay=none", "nonsense:", "pointset", "path"])
def test_a_label_that_nobody_knows_is_no_replay(text):
    assert not catalog.is_replay(text)


def test_points_without_scrambling_are_a_replay():
    assert catalog.is_replay("pointset:file=my.npz,scramble=none") and not catalog.is_replay("pointset:file=my.npz")


@pytest.mark.parametrize("asked", [1, 16, 64, 10**6])
def test_ignore_spp_renders_what_pbrt_did(asked):
    assert catalog.rendered_spp(catalog.resolve("sampler", "poissondisk:replay=ignore_spp"), asked) == 16


@pytest.mark.parametrize(
    ("name", "most"),
    [("poissondisk", 65536), ("relaxedpoissondisk", 65536), ("eliminated", 65536), ("pmj02bn", 16384),
     ("halton", 69042)],
)  # fmt: skip
def test_a_sampler_that_has_only_so_many_points_says_so(name, most):
    choice = catalog.resolve("sampler", name)
    assert catalog.rendered_spp(choice, most) == most
    with pytest.raises(BadParameter, match=f"spp of grid.toml: {name} has at most {most} .* take sobol"):
        catalog.rendered_spp(choice, most + 1, "spp of grid.toml")
    for other in ("sobol", "zsobol"):
        assert catalog.rendered_spp(catalog.resolve("sampler", other), most + 1) == most + 1


def test_a_distance_for_which_there_is_no_room_is_refused():
    choice = catalog.resolve("sampler", "poissondisk:min_dist=0.1")
    assert catalog.rendered_spp(choice, 16) == 16
    with pytest.raises(BadParameter, match=r"spp of grid.toml.*min_dist|min_dist.*spp of grid.toml"):
        catalog.rendered_spp(choice, 200, "spp of grid.toml")
    assert catalog.rendered_spp(catalog.resolve("sampler", "relaxedpoissondisk:min_dist=0.1"), 200) == 200


@pytest.mark.parametrize("asked", [0, -1, 10**9, 2.5, "16", True, None])
def test_impossible_spp_are_refused(asked):
    with pytest.raises(BadParameter, match="from 1 to 10000000"):
        catalog.rendered_spp(catalog.resolve("sampler", "independent"), asked)


def test_rounding_past_the_limit_is_refused():
    with pytest.raises(BadParameter, match="ldsampler rounds 5000000 .* up to 16777216"):
        catalog.rendered_spp(catalog.resolve("sampler", "ldsampler"), 5 * 10**6)


def test_the_catalog_as_json_holds_everything():
    told = json.loads(json.dumps(catalog.as_json()))
    assert set(told) == {"samplers", "integrators", "rfilters", "scenes", "metrics"}
    assert {row["name"] for row in told["samplers"]} == set(catalog.entries("sampler"))
    assert {"cornell_box", "defocus"} <= {row["name"] for row in told["scenes"]}
    assert all(row["line"] for rows in told.values() for row in rows)


def test_the_catalog_needs_no_mitsuba():
    code = "import sys; from renderer import catalog; catalog.as_json(); print('mitsuba' in sys.modules)"
    root = Path(catalog.__file__).parents[1]
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, cwd=root)
    assert run.stdout.strip() == "False", run.stderr


@pytest.mark.parametrize("value", [[2, 1], (2, 1), "2-1", "2,1", " 2 - 1 "])
def test_a_strategy_may_be_written_in_many_ways(value):
    choice = catalog.resolve("integrator", {"type": "bdpt", "debug_strategy": value})
    assert dict(choice.parameters)["debug_strategy"] == "2-1"
    assert catalog.strategy(choice) == "2-1"
    assert catalog.label("integrator", choice) == "bdpt:debug_strategy=2-1"


@pytest.mark.parametrize("value", [[2, 0], [0, 1], "2", "2-1-1", [60, 8], [-1, 4], True, 3, "a-b", [2.5, 1]])
def test_what_is_no_strategy_is_told_how_to_write_one(value):
    with pytest.raises(BadParameter, match=r"debug_strategy = .* is not allowed; it is \[s, t\] or s-t"):
        catalog.resolve("integrator", {"type": "bdpt", "debug_strategy": value})


def test_only_a_debugged_integrator_has_a_strategy():
    assert catalog.strategy(catalog.resolve("integrator", "path")) == ""
    assert catalog.strategy(catalog.resolve("integrator", "bdpt:debug_weighted=false")) == ""
    alone = catalog.resolve("integrator", "bdpt:debug_strategy=3-2,debug_weighted=false")
    assert catalog.strategy(alone) == "3-2 alone"


def test_a_parameter_that_came_later_changes_no_old_choice():
    """Cells that were drawn before there was a choice of lamps keep their digest."""
    plain, spelled_out, other = (
        catalog.resolve("integrator", how) for how in ("path", "path:light_sampler=uniform", "path:light_sampler=power")
    )
    assert plain == spelled_out
    assert "light_sampler" not in plain.text
    assert catalog.label("integrator", other) == "path:light_sampler=power"


@pytest.mark.parametrize("depth", [-1, 67, 1000])
def test_depths_that_an_integrator_does_not_take_are_refused(depth):
    with pytest.raises(BadParameter, match="bdpt takes a max_depth from 1 to 66, and a scene has"):
        catalog.check_depth(catalog.resolve("integrator", "bdpt"), depth, "a scene")
    catalog.check_depth(catalog.resolve("integrator", "path"), depth, "a scene")
