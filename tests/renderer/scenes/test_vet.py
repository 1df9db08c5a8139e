"""
Nothing but shipped plugins and the scene's own files gets past the vetting.

Each attack is a real file. Where Mitsuba would read the file at all, its own reading is refused a second time by
``load.check_nodes``, as if the vetting of the XML had missed it.
"""

from __future__ import annotations

import itertools
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from renderer.scenes import allowed, vet, xmlfile
from renderer.scenes.allowed import PLUGINS
from renderer.scenes.vet import examine
from tests.renderer.scenes.conftest import Write
from tests.renderer.scenes.samples import MESH, SPECTRUM, SPHERE, TRIANGLE, xml

# name: (what stands in the scene, what the reason must say)
ATTACKS = {
    "code by type": ('<integrator type="../../../tmp/evil"/>', "unknown plugin type '../../../tmp/evil'"),
    "code by absolute type": ('<bsdf type="/tmp/evil"/>', "unknown plugin type"),
    "code by path": ('<path value="/tmp"/>', "<path> is not allowed"),
    "code by path below": ('<shape type="sphere"><path value="."/></shape>', "<path> is not allowed"),
    "type from parts": ('<default name="a" value="../evil"/><bsdf type="$a"/>', "unknown plugin type"),
    "type of a scene": ('<scene type="../evil"/>', "unknown element <scene>"),
    "type misspelt": ('<bsdf type="difuse"/>', "did you mean 'diffuse'?"),
    "type missing": ("<bsdf/>", "unknown plugin type"),
    "a sky that no kernel can hold": ('<emitter type="timed_sunsky"/>', "'timed_sunsky' is refused: no variant"),
    "memory by blender": ('<shape type="blender"/>', "unknown plugin type 'blender'"),
    "leak by spectrum": (
        '<bsdf type="diffuse"><spectrum name="reflectance" filename="/etc/passwd"/></bsdf>',
        "leads out of the scene's folder",
    ),
    "leak by texture": (
        '<texture type="bitmap"><string name="filename" value="/etc/secret.png"/></texture>',
        "leads out of the scene's folder",
    ),
    "leak by measured": (
        '<bsdf type="measured"><string name="filename" value="../secret.bsdf"/></bsdf>',
        "leads out of the scene's folder",
    ),
    "climb in the middle": (MESH.format("a/../../x.ply"), "leads out of the scene's folder"),
    "home": (MESH.format("~/x.ply"), "leads out of the scene's folder"),
    "drive": (MESH.format("C:x.ply"), "leads out of the scene's folder"),
    "backslashes": (MESH.format("..\\x.ply"), "is not a file name"),
    "line feed": (MESH.format("a&#10;.ply"), "is not a file name"),
    "empty": (MESH.format(""), "is not a file name"),
    "dollar": ('<default name="d" value=".."/>' + MESH.format("$d/x.ply"), "write the file name out"),
    "dollar in the name": (
        '<default name="n" value="filename"/><shape type="ply"><string name="$n" value="../x.ply"/></shape>',
        "leads out of the scene's folder",
    ),
    "plugins folder": (MESH.format("plugins/x.ply"), "a folder named 'plugins'"),
    "plugins in capitals": (MESH.format("a/PlugIns/x.ply"), "a folder named 'plugins'"),
    "missing": (MESH.format("nowhere.ply"), "'nowhere.ply' does not exist"),
    "a folder": (MESH.format("folder.ply"), "'folder.ply' is not a file"),
    "library": (MESH.format("evil.so"), "is of a kind that is not read there"),
    "no ending": (MESH.format("id_rsa"), "is of a kind that is not read there"),
    "too long": (MESH.format("x" * 5000 + ".ply"), "does not exist"),
    "link out": (MESH.format("out.ply"), "link that leads out"),
    "linked folder out": (MESH.format("outside/secret.ply"), "link that leads out"),
    "include out": ('<include filename="../other.xml"/>', "leads out of the scene's folder"),
    "include a mesh": ('<include filename="mesh.ply"/>', "is of a kind that is not read there"),
    "include itself": ('<include filename="scene.xml"/>', "scene.xml includes itself"),
    "include each other": ('<include filename="a.xml"/>', "b.xml, line 2: a.xml includes itself"),
    "include a property": ('<include filename="property.xml"/>', "holds neither a <scene> nor one object"),
    "include an attack": ('<include filename="evil.xml"/>', "evil.xml, line 2: unknown plugin type 'evil'"),
    "include with a dollar": ('<default name="x" value="a.xml"/><include filename="$x"/>', "write the file name out"),
    "path in a word": (
        '<bsdf type="conductor"><string name="material" value="../../etc/x"/></bsdf>',
        "looks like a path",
    ),
    "path in a word from parts": (
        '<default name="a" value="."/><bsdf type="conductor"><string name="material" value="$a$a"/></bsdf>',
        "looks like a path",
    ),
    "old file name": ('<shape type="ply"><string name="fileName" value="/etc/x.ply"/></shape>', "looks like a path"),
    "capital element": ('<Include filename="a.xml"/>', "unknown element <Include>"),
    "capital attribute": ('<shape Type="evil"/>', "unknown attribute 'Type'"),
    "unknown element": ("<script/>", "unknown element <script>"),
    "unknown attribute": ('<float name="a" value="1" file="x"/>', "unknown attribute 'file'"),
    "namespace": ('<x:shape xmlns:x="y" type="sphere"/>', "unknown element <x:shape>"),
    "undefined parameter": ('<shape type="$nothing"/>', "unknown parameter '$nothing'"),
    "escaped parameter": ('<string name="a" value="\\$x"/>', "mixes '$' and a backslash"),
    "growing parameters": (
        '<default name="a0" value="aaaaaaaa"/>'
        + "".join(f'<default name="b{i}" value="$b{i - 1}$b{i - 1}"/>' for i in range(1, 40)).replace("$b0", "$a0"),
        "grows beyond",
    ),
}
FILES = {
    "mesh.ply": TRIANGLE,
    "evil.so": b"\x7fELF",
    "a.xml": xml('<include filename="b.xml"/>'),
    "b.xml": xml('<include filename="a.xml"/>'),
    "property.xml": '<string version="3.0.0" name="a" value="b"/>',
    "evil.xml": xml('<bsdf type="evil"/>'),
    "folder.ply/inside.txt": "",
}


def lay(write: Write, body: str) -> Path:
    """A scene folder with all that the attacks refer to, beside secrets that they try to reach."""
    folder = write(body, FILES)
    for name in ("x.ply", "secret.ply", "secret.bsdf", "other.xml"):
        (folder.parent / name).write_text(TRIANGLE)
    (folder / "out.ply").symlink_to("../secret.ply")
    (folder / "outside").symlink_to("..")
    return folder


@pytest.mark.parametrize("attack", ATTACKS)
def test_refuses(write: Write, attack: str) -> None:
    """Each attack is refused, in a sentence that names the file and the value."""
    body, reason = ATTACKS[attack]
    reasons = vet.vet(lay(write, body), "scene.xml")
    assert any(reason in text for text in reasons), reasons
    assert all("\n" not in text and len(text) < 500 for text in reasons)


# Attacks that Mitsuba's parser takes without complaint; the others it cannot read, or they need no parser to be caught.
PARSED = [
    "code by type",
    "code by absolute type",
    "type from parts",
    "type of a scene",
    "memory by blender",
    "leak by texture",
    "leak by measured",
    "climb in the middle",
    "dollar",
    "dollar in the name",
    "link out",
    "linked folder out",
    "include an attack",
    "path in a word",
    "path in a word from parts",
    "old file name",
]


@pytest.mark.parametrize("attack", PARSED)
def test_mitsuba_s_own_reading_is_refused_too(llvm: None, write: Write, attack: str) -> None:
    """An attack that slips past the XML is caught among Mitsuba's nodes, before anything is instantiated."""
    import mitsuba as mi

    from renderer.scenes.load import check_nodes

    folder = lay(write, ATTACKS[attack][0]).resolve()
    state = mi.parser.parse_file(mi.parser.ParserConfig("llvm_ad_rgb"), str(folder / "scene.xml"))
    assert check_nodes(state, folder)


def test_an_include_outside_is_seen_in_mitsuba_s_list_of_files(llvm: None, write: Write) -> None:
    """The files that Mitsuba has read are checked by their place, not by their name."""
    import mitsuba as mi

    from renderer.scenes.load import check_nodes

    folder = write('<include filename="link.xml"/>').resolve()
    (folder.parent / "other.xml").write_text(xml(SPHERE))
    (folder / "link.xml").symlink_to("../other.xml")
    state = mi.parser.parse_file(mi.parser.ParserConfig("llvm_ad_rgb"), str(folder / "scene.xml"))
    assert check_nodes(state, folder) == ["an included file lies outside the scene's folder"]


DOCUMENTS = {
    "doctype": ('<!DOCTYPE scene [<!ENTITY a SYSTEM "/etc/passwd">]><scene version="3.0.0"/>', "<!DOCTYPE scene>"),
    "bomb": ('<!DOCTYPE s [<!ENTITY a "aa"><!ENTITY b "&a;&a;">]><scene version="3.0.0">&b;</scene>', "<!DOCTYPE s>"),
    "utf-16": (xml(SPHERE).encode("utf-16"), "is not UTF-8"),
    "utf-16 unmarked": (xml(SPHERE).encode("utf-16-le"), "zero bytes"),
    "utf-32": (xml(SPHERE).encode("utf-32-be"), "zero bytes"),
    "latin-1": ('<?xml version="1.0" encoding="latin1"?>' + xml(SPHERE), "declares the encoding 'latin1'"),
    "utf-7": ('<?xml version="1.0" encoding="utf-7"?>' + xml(SPHERE), "encoding"),
    "not UTF-8": (b'<scene version="3.0.0"><!-- \xe9 --></scene>', "is not UTF-8 (byte 28)"),
    "zero byte": (xml(SPHERE) + "\0<evil/>", "zero bytes"),
    "two roots": (xml("") + xml('<bsdf type="evil"/>'), "junk after document element"),
    "twice the same attribute": (xml('<shape type="sphere" type="evil"/>'), "duplicate attribute"),
    "not XML": ("hello", "is not well-formed XML: syntax error in line 1"),
    "cut short": ('<scene version="3.0.0"><shape', "is not well-formed XML"),
    "empty": ("", "is empty"),
    "blank": ("\ufeff \n", "is empty"),
    "another root": ('<bsdf version="3.0.0" type="diffuse"/>', "starts with <bsdf>"),
    "web page": ("<html><body/></html>", "starts with <html>"),
    "no version": ("<scene/>", 'has no version; start it with <scene version="3.0.0">'),
    "a type of its own": ('<scene version="3.0.0" type="../evil"/>', "unknown attribute 'type' of <scene>"),
    "deep": (xml("<bsdf>" * 10_000 + "</bsdf>" * 10_000), "nests elements deeper than 32"),
}


@pytest.mark.parametrize("document", DOCUMENTS)
def test_refuses_what_two_readers_could_take_differently(tmp_path: Path, document: str) -> None:
    """Documents that are not one plain UTF-8 <scene>."""
    content, reason = DOCUMENTS[document]
    (tmp_path / "scene.xml").write_bytes(content if isinstance(content, bytes) else content.encode())
    reasons = vet.vet(tmp_path, "scene.xml")
    assert any(reason in text for text in reasons), reasons


def test_refuses_a_plugins_folder_beside_the_scene(write: Write) -> None:
    """Mitsuba looks there for code, under the names of its own plugins."""
    folder = write(SPHERE, {"plugins/sphere.so": b"\x7fELF"})
    assert "folder named 'plugins'" in vet.vet(folder, "scene.xml")[0]


@pytest.mark.parametrize("main", ["../scene.xml", "/etc/x.xml", "", "a\nb.xml", "nowhere.xml"])
def test_refuses_a_main_file_elsewhere(write: Write, main: str) -> None:
    """The main file itself is a file of the folder."""
    assert vet.vet(write(SPHERE), main)


def test_refuses_too_many_elements(write: Write, monkeypatch: pytest.MonkeyPatch) -> None:
    """Memory for the tree has a limit that holds while the file is read."""
    monkeypatch.setattr(xmlfile, "ELEMENTS_MAX", 100)
    assert "more than 100 elements (line 2)" in vet.vet(write(SPHERE * 101), "scene.xml")[0]


def test_refuses_too_much_xml_by_including_again_and_again(write: Write) -> None:
    """Two includes of two includes ... are 2^13 readings of one small file: counted each time."""
    twice = {f"{i}.xml": xml(f'<include filename="{i + 1}.xml"/>' * 2) for i in range(13)}
    folder = write('<include filename="0.xml"/>', {**twice, "13.xml": xml(f"<!--{' ' * 40_000}-->")})
    assert any("16 MiB" in text for text in vet.vet(folder, "scene.xml"))


def test_refuses_deep_includes_of_deep_elements_without_a_traceback(write: Write) -> None:
    """The longest chain of includes, each at the deepest element, stays far from Python's recursion limit."""
    opened, closed = '<shape type="sphere">' * 29, "</shape>" * 29
    files: dict[str, bytes | str] = {
        f"{i}.xml": xml(f'{opened}<include filename="{i + 1}.xml"/>{closed}') for i in range(20)
    }
    reasons = vet.vet(write('<include filename="0.xml"/>', files), "scene.xml")
    assert reasons == ["13.xml, line 2: includes nest deeper than 15"]


def test_refuses_too_many_or_too_large_files(write: Write, monkeypatch: pytest.MonkeyPatch) -> None:
    """Limits on what one scene may bring."""
    folder = write(MESH.format("a.ply") + MESH.format("b.ply"), {"a.ply": TRIANGLE, "b.ply": TRIANGLE})
    assert vet.vet(folder, "scene.xml") == []
    monkeypatch.setattr(vet, "FILES_MAX", 2)
    assert "more than 2 files" in vet.vet(folder, "scene.xml")[0]
    monkeypatch.setattr(vet, "SCENE_BYTES_MAX", 300)
    assert any("larger than" in text for text in vet.vet(folder, "scene.xml"))


def test_a_hostile_file_gives_few_reasons(write: Write) -> None:
    """A page of reasons helps; a million would be an attack on the log."""
    assert len(vet.vet(write("<evil/>\n" * 5000), "scene.xml")) == vet.REASONS_MAX


def test_accepts_what_scenes_need(write: Write) -> None:
    """Parameters, includes, aliases, references, tables and files in folders; each file is listed once."""
    body = f"""
        <?note a processing instruction?>
        <default name="kind" value="path"/><default name="kinds" value="direct"/><default name="depth" value="4"/>
        <integrator type="$kind"><integer name="max_depth" value="$depth"/></integrator>
        <bsdf type="conductor" id="gold"><string name="material" value="Au"/></bsdf>
        <alias id="gold" as="brass"/>
        <bsdf type="diffuse" id="grey"><spectrum name="reflectance" filename="./tables/grey.spd"/></bsdf>
        <shape type="sphere"><ref id="brass"/><vector name="v" value="1, 2, 3"/>
            <spectrum name="s" type="uniform"><string name="values" value="0.1, 0.2e-1"/></spectrum></shape>
        <!-- <bsdf type="evil"/> --><![CDATA[ <bsdf type="evil"/> ]]>
        <include filename="sub/part.xml"/>{MESH.format("mesh.ply")}"""
    files: dict[str, bytes | str] = {
        "tables/grey.spd": SPECTRUM,
        "sub/part.xml": '<shape version="2.1.0" type="ply"><string name="filename" value="mesh.ply"/></shape>',
        "mesh.ply": TRIANGLE,
        "README.md": "",
    }
    found = examine(write(body, files), "scene.xml")
    assert found.reasons == []
    assert sorted(found.files) == ["mesh.ply", "scene.xml", "sub/part.xml", "tables/grey.spd"]


def test_the_list_is_what_mitsuba_ships_less_five() -> None:
    """A new Mitsuba brings plugins that somebody has to look at; a vanished one is a name to take away."""
    import mitsuba

    shipped = {path.stem for path in (Path(mitsuba.__file__).parent / "plugins").glob("*.so")}
    assert shipped - PLUGINS == {"batch", "blender", "irradiancemeter", "radiancemeter", "timed_sunsky"}
    assert PLUGINS - shipped == set()


GOOD = st.sampled_from(["bsdf", "shape", "emitter", "texture", "medium", "sensor"])
BAD = st.sampled_from([body for body, _ in ATTACKS.values()])
INNOCENT = st.sampled_from(
    [
        '<float name="a" value="1"/>',
        "<!-- a -->",
        '<ref id="x"/>',
        '<transform name="t"><scale value="2"/></transform>',
        '<shape type="sphere"/>',
    ]
)


@given(
    chain=st.lists(GOOD, max_size=8),
    bad=BAD,
    before=st.lists(INNOCENT, max_size=5),
    after=st.lists(INNOCENT, max_size=5),
    included=st.booleans(),
)
@settings(max_examples=150, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_a_bad_reference_is_refused_wherever_it_stands(
    write: Write, chain: list[str], bad: str, before: list[str], after: list[str], included: bool
) -> None:
    """However deep, whatever stands around it, in the main file or an included one."""
    nested = "".join(f'<{tag} type="sphere">' for tag in chain) + "".join(before) + bad + "".join(after)
    nested += "".join(f"</{tag}>" for tag in reversed(chain))
    if included:
        assert vet.vet(write('<include filename="part.xml"/>', {**FILES, "part.xml": xml(nested)}), "scene.xml")
    else:
        assert vet.vet(write(nested, FILES), "scene.xml")


WORDS = st.sampled_from(["sphere", "sp", "here", "$a", "$ab", "$abc", "$b", "$", "&#36;a", "&#115;phere", "x", "&amp;"])
PARTS = st.one_of(
    st.builds('<default name="{}" value="{}"/>'.format, st.sampled_from(["a", "ab", "abc", "b", "filename"]), WORDS),
    st.builds(lambda words: f'<shape type="{"".join(words)}"/>', st.lists(WORDS, min_size=1, max_size=3)),
    st.builds(
        lambda i, words: f'<bsdf type="diffuse"><string name="n{i}" value="{"".join(words)}"/></bsdf>',
        st.integers(0, 3),
        st.lists(WORDS, max_size=4),
    ),
    st.sampled_from(
        [
            "<![CDATA[<shape type='evil'/>]]>",
            "<!-- <shape type='cube'/> -->",
            "<?pi <shape type='cube'/> ?>",
            "&lt;shape type='cube'/&gt;",
            '<include filename="part.xml"/>',
            '<include filename="object.xml"/>',
            "<shape\n\ttype\n=\n'sphere'\n></shape>",
        ]
    ),
)


@given(parts=st.lists(PARTS, min_size=1, max_size=8))
@settings(max_examples=200, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_mitsuba_reads_what_we_read(llvm: None, write: Write, parts: list[str]) -> None:
    """A file that passes has the same plugins and the same text values in Mitsuba's reading, in the same order."""
    import mitsuba as mi

    files: dict[str, bytes | str] = {
        "part.xml": xml('<default name="b" value="cube"/><shape type="cube"/>'),
        "object.xml": '<shape version="3.0.0" type="disk"/>',
    }
    folder = write("".join(parts), files)
    found = examine(folder, "scene.xml")
    if found.reasons:
        return
    assert found.root is not None
    state = mi.parser.parse_file(mi.parser.ParserConfig("llvm_ad_rgb"), str(folder / "scene.xml"))
    theirs = [
        (node.props.plugin_name(), [value for _, value in node.props.items() if isinstance(value, str)])
        for node in state.nodes
    ][1:]
    ours = [
        (element.attributes["type"], [child.attributes["value"] for child in element.children])
        for element in found.root.children
        if "type" in element.attributes
    ]
    assert ours == theirs


def test_lists_do_not_contradict_each_other() -> None:
    """Every object element may have a type; no kind of file is code."""
    assert all("type" in allowed.ATTRIBUTES[tag] for tag in allowed.OBJECTS)
    assert not allowed.EXTENSIONS & {".so", ".dll", ".dylib", ".py", ".xml", ""}
    assert all(a != b for a, b in itertools.combinations(sorted(allowed.PYTHON_PLUGINS | PLUGINS), 2))
