import math

import cv2
import numpy as np
import pytest
import yaml
from hypothesis import example, given
from hypothesis import strategies as st

from vm_embedded.config.yaml_reader import read_yaml
from vm_embedded.errors import InputError

from ..strategies import attempt


def is_text(value):
    """Not what YAML 1.2 takes for a number and PyYAML, which is at 1.1, for text, such as 1e5."""
    try:
        float(value)
    except ValueError:
        return True
    return False


LETTERS = "abcXYZ"
names = st.text(LETTERS + "019_", min_size=1, max_size=10).filter(lambda name: name[0] in LETTERS)
words = st.text(LETTERS + "019_-./", max_size=15).filter(is_text)
sentences = st.text(LETTERS + "019 _-./", max_size=15).filter(is_text)
numbers = st.one_of(
    st.integers(-(10**15), 10**15), st.floats(allow_nan=False), st.floats(-1e4, 1e4), st.sampled_from([0.0, -0.0, 1e-9])
)
scalars = st.one_of(st.none(), st.booleans(), numbers)
flow_styles = st.sampled_from([None, False, True])


def nested(values, keys, leaves=20):
    return st.recursive(
        values,
        lambda inner: st.one_of(st.lists(inner, max_size=5), st.dictionaries(keys, inner, max_size=5)),
        max_leaves=leaves,
    )


def same(found, expected):
    """Equal, and of the same types: True is not 1, and 1 is not 1.0."""
    if isinstance(expected, dict):
        return (
            isinstance(found, dict)
            and found.keys() == expected.keys()
            and all(same(found[key], value) for key, value in expected.items())
        )
    if isinstance(expected, list):
        return isinstance(found, list) and len(found) == len(expected) and all(map(same, found, expected))
    return type(found) is type(expected) and found == expected


@st.composite
def documents(draw):
    """Data, and the text that PyYAML writes for it."""
    # A text with spaces may be broken where a line is full, so there lines are never full.
    texts, width = draw(st.sampled_from([(words, 40), (words, 80), (sentences, 10**6)]))
    data = draw(nested(st.one_of(scalars, texts), names))
    style, indent = draw(flow_styles), draw(st.integers(2, 6))
    return data, yaml.safe_dump(data, default_flow_style=style, indent=indent, width=width)


@given(documents())
def test_what_pyyaml_writes_reads_back_equal(document):
    data, text = document
    assert same(read_yaml(text), data), text


@given(documents())
def test_headers_and_line_ends_make_no_difference(document):
    data, text = document
    headed = "%YAML 1.1\n# written by a test\n---\n" + text
    for variant in (headed, text.replace("\n", "\r\n"), "\n\n" + text + "\n\n# the end\n"):
        assert same(read_yaml(variant), data), variant


anything = st.one_of(st.text(max_size=12), st.text("ab 1'\"\\:#-[]{},&*!|>%@?=~.\n\t", max_size=12)).filter(is_text)


@given(nested(anything, anything, leaves=8), flow_styles, st.booleans())
@example({"a": "it's"}, False, False)
@example({"a": "two\nlines"}, False, False)
@example({"a": 'a "word": here'}, False, False)
@example({"a": "ä"}, False, False)
@example({"it's a key: really": "1"}, False, False)
@example({'"': "1"}, False, False)
@example({"": ""}, None, False)
@example(["\n"], None, False)
@example({"a": ": [", "b": ": ]"}, False, False)
def test_any_text_is_read_right_or_refused(data, flow_style, unicode):
    """Never read as something else: a misread calibration is worse than none."""
    text = yaml.safe_dump(data, default_flow_style=flow_style, allow_unicode=unicode)
    found = attempt(InputError, read_yaml, text)
    assert isinstance(found, InputError) or same(found, data), text


@given(
    st.one_of(
        st.text(),
        st.text(" \t\n-:[]{}'\"#,a1.!&*|>%~?\xa0\x85\u2028", max_size=40),
        st.lists(
            st.sampled_from(["- ", "a: ", "  ", "\n", "[", "]", "{", "}", "1", ", ", "'", '"', "\t", "\xa0", "#"])
        ).map("".join),
    )
)
@example("a: [1,\t]")
@example("[\xa0]")
def test_no_text_raises_anything_but_input_error(text):
    found = attempt(InputError, read_yaml, text)
    if isinstance(found, InputError):
        assert str(found).startswith("line ")
        assert "\n" not in str(found)


@given(documents(), st.integers(0, 400), st.sampled_from(list("[]{}:,'\"#-\n\t !&*|%")))
def test_a_damaged_file_raises_nothing_but_input_error(document, position, character):
    text = document[1]
    position = position % (len(text) + 1)
    before, after = text[:position], text[position:]
    for damaged in (before, before + character + after, before + after[1:]):
        found = attempt(InputError, read_yaml, damaged)
        assert not isinstance(found, InputError) or str(found).startswith("line ")


@pytest.mark.parametrize(
    ("scalar", "value"),
    [
        ("12", 12),
        ("-7", -7),
        ("+3", 3),
        ("0", 0),
        ("1.5", 1.5),
        ("-1.5e-3", -1.5e-3),
        ("1e5", 1e5),
        ("5.", 5.0),
        (".5", 0.5),
        ("9.0e+00", 9.0),
        (".inf", math.inf),
        ("-.Inf", -math.inf),
        ("true", True),
        ("False", False),
        ("null", None),
        ("~", None),
        ("", None),
        ("plumb_bob", "plumb_bob"),
        ("two words", "two words"),
        ("'12'", "12"),
        ('"true"', "true"),
        ("''", ""),
        ("a#b", "a#b"),
        ("'a # b'", "a # b"),
        ("1.2.3", "1.2.3"),
        ("1 2", "1 2"),
        ("/dev/video0", "/dev/video0"),
        ("12:30", "12:30"),
        ("12 # a comment", 12),
    ],
)
def test_scalars(scalar, value):
    """At the top of a block, in a list and in a list in brackets."""
    assert same(read_yaml(f"key: {scalar}\n"), {"key": value})
    assert same(read_yaml(f"- {scalar}\n- 1\n"), [value, 1])
    if scalar and "#" not in scalar and ":" not in scalar:
        assert same(read_yaml(f"[{scalar}, 1]"), [value, 1])
        assert same(read_yaml(f"{{key: {scalar}, other: 1}}"), {"key": value, "other": 1})


@pytest.mark.parametrize("quote", list("'\""))
@given(st.text("[]{},:# ab", max_size=12))
@example("left [wide")
@example("]")
def test_quotes_may_hold_anything(quote, text):
    scalar = quote + text + quote
    assert read_yaml(f"key: {scalar}\nother: 1\n") == {"key": text, "other": 1}
    assert read_yaml(f"- {scalar}\n- 1\n") == [text, 1]
    assert read_yaml(f"key: [{scalar},\n  1]\n") == {"key": [text, 1]}


@pytest.mark.parametrize("text", [".nan", ".NaN"])
def test_not_a_number_is_a_float(text):
    assert math.isnan(read_yaml(text))


@pytest.mark.parametrize("text", ["", "\n\n", "# only a comment\n", "---\n", "%YAML:1.0\n---\n"])
def test_an_empty_file_is_nothing(text):
    assert read_yaml(text) is None


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("a:\n- 1\n- 2\nb: 3\n", {"a": [1, 2], "b": 3}),
        ("a:\n  - 1\n  - 2\nb: 3\n", {"a": [1, 2], "b": 3}),
        ("- a: 1\n  b: 2\n- c: 3\n", [{"a": 1, "b": 2}, {"c": 3}]),
        ("- - 1\n  - 2\n- - 3\n", [[1, 2], [3]]),
        ("a:\nb: 1\n", {"a": None, "b": 1}),
        ("a:\n  b:\n    c: 1\n  d: 2\n", {"a": {"b": {"c": 1}, "d": 2}}),
        ("a: [1, 2,\n    3, 4]\nb: 5\n", {"a": [1, 2, 3, 4], "b": 5}),
        ("a: {b: 1,\n  c: [2,\n3]}\n", {"a": {"b": 1, "c": [2, 3]}}),
        ("[]", []),
        ("{}", {}),
        ("a: []\nb: {}\n", {"a": [], "b": {}}),
        ("a: [[1, 2], [3]]\n", {"a": [[1, 2], [3]]}),
        ("a: !!opencv-matrix\n  rows: 1\n  data: [ 1., 2. ]\n", {"a": {"rows": 1, "data": [1.0, 2.0]}}),
        ("a: left! camera\nb: 'run!1/x.png'\n", {"a": "left! camera", "b": "run!1/x.png"}),
        ("a: 1\n...\nleft: out\n", {"a": 1}),
        ("# first\na: 1 # one\n\n  # indented\nb: 2\n", {"a": 1, "b": 2}),
        ("-\n  a: 1\n-\n  b: 2\n", [{"a": 1}, {"b": 2}]),
    ],
)
def test_layouts(text, value):
    assert same(read_yaml(text), value)
    if "!!" not in text and "..." not in text:
        assert same(yaml.safe_load(text), value)  # and it is YAML


MALFORMED = [
    ("a: 1\nb: [1, 2\nc: 3\n", 2),
    ("a: 1\nb: {c: 1\n", 2),
    ("a: 1\nb: 2\na: 3\n", 3),
    ("a: {b: 1, b: 2}\n", 1),
    ("a: 1\nb: 'never closed\n", 2),
    ('a: 1\nb: "never closed\n', 2),
    ("a: ['never closed]\n", 1),
    ("a: 1\nb: 'x' 'y'\n", 2),
    ("a: 1\nb: 'x' y\n", 2),
    ("a:\n\tb: 1\n", 2),
    ("a: 1\n  b: 2\n", 2),
    ("a:\n    b: 1\n  c: 2\n", 3),
    ("a: 1\n- b\n", 2),
    ("- a\nb: 1\n", 2),
    ("a: 1\njust words\n", 2),
    ("a: 1\nb: c: d\n", 2),
    ("a: 1\nb: [1] 2\n", 2),
    ("a: 1\nb: [1, 2]]\n", 2),
    ("a: [1,, 2]\n", 1),
    ("a: [1 2\n", 1),
    ("a: {b 1}\n", 1),
    ("a: {b}\n", 1),
    ("a: [1}\n", 1),
    ("a: ]\n", 1),
    ("a: 1\nb: &anchor 2\n", 2),
    ("a: 1\nb: *alias\n", 2),
    ("a: 1\nb: |\n  text\n", 2),
    ("a: 1\nb: >\n  text\n", 2),
    ("a: 1\n---\nb: 2\n", 3),
    ("a: 1\nb: @x\n", 2),
    ("\n" + "[" * 40 + "]" * 40, 2),
    ("\n" + "- " * 40 + "1", 2),
]


@pytest.mark.parametrize(("text", "line"), MALFORMED, ids=[repr(text[:24]) for text, _ in MALFORMED])
def test_a_malformed_text_is_refused_by_its_line(text, line):
    with pytest.raises(InputError, match=rf"^line {line}:"):
        read_yaml(text)


@pytest.mark.parametrize("folder", ["reference", "real"])
def test_real_lens_files_are_read_as_pyyaml_reads_them(shared, folder):
    paths = sorted((shared / folder / "images").glob("lens*.yaml"))
    assert len(paths) in (15, 40)
    for path in paths:
        text = path.read_text()
        assert same(read_yaml(text), yaml.safe_load(text)), path.name


def test_the_beginning_of_the_reference_s_network_is_read_as_pyyaml_reads_it(shared):
    """A large file that others wrote, as far as its geometry."""
    text = (shared / "reference/model.yaml").read_text().split("\nnetwork:")[0]
    assert read_yaml(text) == yaml.safe_load(text)


CAMERA_INFO = """\
# from a calibration
image_width: 640
image_height: 480
camera_name: head_front
camera_matrix:
  rows: 3
  cols: 3
  data: [612.25, 0.0, 318.5, 0.0, 611.75, 241.25, 0.0, 0.0, 1.0]
distortion_model: plumb_bob
distortion_coefficients:
  rows: 1
  cols: 5
  data: [-0.35, 0.125, 0.0005,
         -2.5e-04, 0.0]
rectification_matrix:
  rows: 3
  cols: 3
  data: [1, 0, 0, 0, 1, 0, 0, 0, 1]
"""


def test_a_ros_camera_info_is_read():
    found = read_yaml(CAMERA_INFO)
    assert same(found, yaml.safe_load(CAMERA_INFO) | {"distortion_coefficients": found["distortion_coefficients"]})
    assert same(found["distortion_coefficients"]["data"], [-0.35, 0.125, 0.0005, -2.5e-4, 0.0])


@pytest.mark.parametrize("name", ["calibration.yml", "calibration.yaml"])
def test_what_opencv_writes_is_read(tmp_path, name):
    path = tmp_path / name
    random = np.random.default_rng(4)
    matrix = np.array([[612.25, 0.0, 318.5], [0.0, 611.75, 241.25], [0.0, 0.0, 1.0]])
    wide = random.normal(size=(4, 9)) * 10.0 ** random.integers(-12, 12, (4, 9))
    storage = cv2.FileStorage(str(path), cv2.FILE_STORAGE_WRITE)
    storage.write("image_width", 640)
    storage.write("camera_matrix", matrix)
    storage.write("wide", wide)
    storage.write("whole", np.arange(6, dtype=np.int32).reshape(2, 3))
    storage.write("rms", 0.3125)
    storage.write("name", "head front")
    storage.release()
    found = read_yaml(path.read_text())
    assert found["image_width"] == 640
    assert found["rms"] == 0.3125
    assert found["name"] == "head front"
    for key, expected in (("camera_matrix", matrix), ("wide", wide), ("whole", np.arange(6).reshape(2, 3))):
        rows, columns = found[key]["rows"], found[key]["cols"]
        np.testing.assert_allclose(np.reshape(found[key]["data"], (rows, columns)), expected, rtol=1e-14)
