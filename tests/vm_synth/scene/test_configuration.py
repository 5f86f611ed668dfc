"""scene.toml: what is written is what is read, and what is wrong is said by file, section and entry."""

import math
import re
import tomllib
from dataclasses import fields
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import vm_synth
from vm_embedded.config.sections import read_sections
from vm_embedded.config.toml_writer import to_commented_toml
from vm_embedded.errors import InputError
from vm_synth.bodies.solids import LABELS
from vm_synth.scene.configuration import CLASSES, SceneConfiguration
from vm_synth.scene.maps import MapRanges

DEFAULT = SceneConfiguration()
ENTRIES = {
    f"{section.name}.{entry.name}": (section.name, entry)
    for section in fields(DEFAULT)
    for entry in fields(getattr(DEFAULT, section.name))
}


def kind_of(entry):
    """What an entry is, by its default."""
    if "check" not in entry.metadata:
        return None
    if isinstance(entry.default, tuple):
        return "names" if "allowed" in entry.metadata else "range"
    if isinstance(entry.default, str):
        return "name" if "allowed" in entry.metadata else "text"
    return "number"


RANGES, NUMBERS, NAMES = (
    [(section, entry) for section, entry in ENTRIES.values() if kind_of(entry) == kind]
    for kind in ("range", "number", "names")
)


@pytest.fixture(scope="module")
def write(tmp_path_factory):
    path = tmp_path_factory.mktemp("scene") / "scene.toml"

    def written(text):
        path.write_text(text, encoding="utf-8")
        return path

    return written


def whole(entry):
    return isinstance(entry.default, int)


def between(entry):
    """Numbers that an entry may be, or may span."""
    low, high = entry.metadata["limits"]
    return st.integers(low, high) if whole(entry) else st.floats(low, high)


LENSES = st.fixed_dictionaries(
    {"projection": st.just("equisolid"), "focal_length": st.floats(50.0, 1000.0), "fov": st.floats(0.5, 3.0)},
    optional={"center": st.lists(st.floats(-50.0, 50.0), min_size=2, max_size=2)},
)


def values_of(entry):
    metadata = entry.metadata
    if entry.name == "held_out":
        return st.lists(st.text(st.characters(exclude_categories=["Cs"]), max_size=8), max_size=3).map(tuple)
    if entry.name == "floors":
        return st.dictionaries(st.text(st.characters(exclude_categories=["Cs"]), max_size=8), st.floats(1.0, 80.0))
    if entry.name == "lens":
        return st.just({}) | LENSES
    if kind_of(entry) == "range":
        return st.tuples(between(entry), between(entry)).map(lambda ends: tuple(float(each) for each in sorted(ends)))
    if kind_of(entry) == "number":
        return between(entry)
    if entry.name == "solid":
        return st.sampled_from([each for each in metadata["allowed"] if each != "file"])
    if kind_of(entry) == "name":
        return st.sampled_from(metadata["allowed"])
    if kind_of(entry) == "text":
        return st.just("") if entry.name == "file" else st.sampled_from(["a", "cup_2", "Ball"])
    return st.lists(st.sampled_from(metadata["allowed"]), min_size=1, unique=True).map(tuple)


@st.composite
def configurations(draw):
    """Two sections of any values, the others as they are."""
    chosen = draw(st.lists(st.sampled_from(fields(SceneConfiguration)), min_size=1, max_size=2, unique=True))
    sections = {}
    for section in chosen:
        kind = section.default_factory
        sections[section.name] = kind(**{entry.name: draw(values_of(entry)) for entry in fields(kind)})
    return SceneConfiguration(**sections)


def test_the_documented_defaults_are_read_as_the_defaults(write):
    assert read_sections(SceneConfiguration, write(to_commented_toml(DEFAULT))) == DEFAULT
    assert read_sections(SceneConfiguration, None) == DEFAULT
    assert read_sections(SceneConfiguration, write("")) == DEFAULT


@given(configurations())
@settings(max_examples=30)
def test_a_documented_configuration_is_read_as_it_was(write, configuration):
    """To the last digit, whatever the maps are called."""
    assert read_sections(SceneConfiguration, write(to_commented_toml(configuration))) == configuration


def test_every_entry_is_documented_by_a_line_of_its_own():
    lines = to_commented_toml(DEFAULT).split("\n")
    for section in fields(DEFAULT):
        after = lines[lines.index(f"[{section.name}]") + 1 :]
        own = after[: after.index("")]
        assert [line.split(" = ")[0] for line in own[1::2]] == [each.name for each in fields(section.default_factory)]
        assert all(line.startswith("# ") and len(line) > 4 for line in own[::2])


def test_every_entry_says_what_it_is():
    for _, entry in ENTRIES.values():
        text = entry.metadata["help"]
        assert len(text) > 4
        assert text == text.strip()
        assert not text.endswith(".")


UNITS = {
    "m": "camera.height ball.radius ball.distance ball.off_plane_height things.distance field.length field.line_width "
    "field.border field.goal_height field.goal_width bodies.clutter_size bodies.shoe_length bodies.furniture_size "
    "bodies.robot_height bodies.person_height bodies.distractor_radius object.radius object.height object.distance "
    "table.length table.texture_size",
    "deg": "camera.rectilinear_view camera.fisheye_view camera.pitch camera.steep_pitch camera.roll field.hue "
    "maps.floors",
    "px": "camera.picture_width camera.picture_height sensor.defocus sensor.motion sensor.fringe",
}


def test_lengths_and_angles_have_a_unit():
    units = {name: entry.metadata["unit"] for name, (_, entry) in ENTRIES.items() if "unit" in entry.metadata}
    for unit, names in UNITS.items():
        assert {name for name, its in units.items() if its == unit} == set(names.split())


def test_the_unit_and_the_limits_are_documented():
    lines = to_commented_toml(DEFAULT).split("\n")
    assert lines[lines.index("height = [0.3, 1.6]") - 1] == "# height above the plane [m]; 0.05 to 20"
    assert lines[lines.index("missing = 0.1") - 1] == "# share of pictures without a ball; 0 to 1"
    assert lines[lines.index('off_plane_label = "environment"') - 1].endswith(f"; allowed: {', '.join(CLASSES)}")


def test_defaults_are_within_finite_limits():
    for _, entry in RANGES + NUMBERS:
        low, high = entry.metadata["limits"]
        assert math.isfinite(low)
        assert math.isfinite(high)
        assert all(low <= each <= high for each in np.atleast_1d(entry.default))


def test_what_things_count_as_are_classes():
    assert set(LABELS) <= set(CLASSES)


def test_the_shipped_configuration_is_readable_and_says_only_what_is_known_of_maps():
    path = Path(vm_synth.__file__).parent / "polyhaven.toml"
    found = read_sections(SceneConfiguration, path)
    assert found.maps.held_out
    assert found.maps.floors
    assert found == SceneConfiguration(maps=found.maps)
    assert list(tomllib.loads(path.read_text())) == ["maps"]


@given(st.data())
def test_a_range_is_taken_anywhere_within_its_limits(write, data):
    section, entry = data.draw(st.sampled_from(RANGES))
    low, high = data.draw(values_of(entry))
    found = read_sections(SceneConfiguration, write(f"[{section}]\n{entry.name} = [{low!r}, {high!r}]\n"))
    assert getattr(getattr(found, section), entry.name) == (low, high)


def refused(write, section, name, value):
    """The message with which a value of an entry is refused, after the name of file and section."""
    path = write(f"[{section}]\n{name} = {value}\n")
    with pytest.raises(InputError) as caught:
        read_sections(SceneConfiguration, path)
    message = str(caught.value)
    start = f"configuration {path}, line 2: [{section}] "
    assert message.startswith(start)
    assert "\n" not in message
    return message[len(start) :]


BAD_RANGES = ["3", "true", '"0 to 1"', "[]", "[0.5]", "[0.5, 0.5, 0.5]", "{}", "[true, true]", '["a", "b"]']


def test_bad_ranges_are_refused_by_entry(write):
    for section, entry in RANGES:
        low, high = entry.metadata["limits"]
        for value in (*BAD_RANGES, f"[{low}, nan]", f"[nan, {high}]", f"[{low}, inf]", f"[-inf, {high}]"):
            assert refused(write, section, entry.name, value).startswith(f"{entry.name} must be ")
        for value in (f"[{low}, {high + 1}]", f"[{low - 1}, {high}]"):
            assert f"from {low:g} to {high:g}" in refused(write, section, entry.name, value)
        assert f"{high:g} is above {low:g}" in refused(write, section, entry.name, f"[{high}, {low}]")


def test_bad_numbers_are_refused_by_entry(write):
    for section, entry in NUMBERS:
        low, high = entry.metadata["limits"]
        bad = ["true", "false", '"1"', "[1, 1]", "nan", "inf", "-inf", f"{low - 1}", f"{high + 1}", "9" * 400]
        for value in bad + ["100.0", "100.5"] * whole(entry):
            message = refused(write, section, entry.name, value)
            assert message.startswith(f"{entry.name} must be a {'whole ' if whole(entry) else ''}number from {low:g}")
            assert message.endswith(f"not {tomllib.loads(f'v = {value}')['v']!r}")


def test_bad_names_are_refused_by_entry(write):
    for section, entry in NAMES:
        first = entry.metadata["allowed"][0]
        for value in ("[]", f'"{first}"', "3", "true", "{}"):
            assert refused(write, section, entry.name, value).startswith(
                f"{entry.name} must be a list of some of {first}"
            )
        for value in ("[3]", "[true]", "[[]]"):
            assert refused(write, section, entry.name, value).startswith(f"unknown {entry.name} ")
        message = refused(write, section, entry.name, f'["{first}x"]')
        assert f"did you mean {first!r}?" in message or first.isupper()


MESSAGES = {
    "unknown section": ("[cammera]\n", r"unknown section 'cammera'; did you mean 'camera'\? .*allowed: maps, camera"),
    "unknown entry": ("[camera]\nhight = [1, 2]\n", r"entry in \[camera\] 'hight'; did you mean 'height'\?"),
    "entry of another section": ("[ball]\nturfs = ['felt']\n", r"unknown entry in \[ball\] 'turfs'"),
    "entry at the top": ("height = [1, 2]\n", "unknown key 'height'"),
    "section that is none": ("camera = 3\n", r"camera must be a section, \[camera\], not 3"),
    "list of sections": ("[[camera]]\nsteep = 1\n", r"camera must be a section, \[camera\]"),
    "one name of many": ("[ball]\noff_plane_label = 'rbot'\n", r"\[ball\] unknown off_plane_label 'rbot'.*'robot'"),
    "no name": ("[ball]\noff_plane_label = ['robot']\n", r"\[ball\] unknown off_plane_label \['robot'\]"),
    "held out by one name": ("[maps]\nheld_out = 'a'\n", r"\[maps\] held_out must be a list of map names, not 'a'"),
    "held out by number": ("[maps]\nheld_out = [1]\n", r"\[maps\] held_out .*not \[1\]"),
    "floors that are no table": (
        "[maps]\nfloors = 3\n",
        r"\[maps\] floors must be a table of map names and angles, not 3",
    ),
    "floor at the horizon": (
        "[maps.floors]\na = 0\n",
        r"\[maps\] the floor of map a must begin 1 to 80 deg below the horizon, not 0",
    ),
    "floor in words": ("[maps.floors]\na = 'low'\n", r"\[maps\] the floor of map a .*not 'low'"),
    "floor that is true": ("[maps.floors]\na = true\n", r"\[maps\] the floor of map a .*not True"),
    "floor that is NaN": ("[maps.floors]\na = nan\n", r"\[maps\] the floor of map a .*not nan"),
    "not TOML": ("[camera]\nheight = 1 to 2\n", "line 2"),
    "entry twice": ("[camera]\nsteep = 0\nsteep = 1\n", "line 3"),
}


@pytest.mark.parametrize(("text", "says"), MESSAGES.values(), ids=MESSAGES)
def test_what_is_wrong_is_said(write, text, says):
    with pytest.raises(InputError, match=rf"configuration .*scene\.toml(, line 1|, line 2)?: .*{says}"):
        read_sections(SceneConfiguration, write(text))


def test_what_is_no_file_is_named(tmp_path):
    with pytest.raises(InputError, match=r"none\.toml: No such file"):
        read_sections(SceneConfiguration, tmp_path / "none.toml")
    with pytest.raises(InputError, match=re.escape(tmp_path.name)):
        read_sections(SceneConfiguration, tmp_path)


def test_a_binary_file_is_refused(tmp_path):
    path = tmp_path / "scene.toml"
    path.write_bytes(bytes(range(256)))
    with pytest.raises(InputError, match=r"scene\.toml: it is not UTF-8 text"):
        read_sections(SceneConfiguration, path)


def test_floors_and_held_out_maps_are_read(write):
    found = read_sections(SceneConfiguration, write('[maps]\nheld_out = ["a"]\n[maps.floors]\nb = 7\n"c d.1" = 7.5\n'))
    assert found.maps == MapRanges(held_out=("a",), floors={"b": 7, "c d.1": 7.5})
