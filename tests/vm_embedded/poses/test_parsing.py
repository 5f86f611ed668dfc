"""Lines that robots send, and lines that no robot should."""

import json
import math
import time

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from vm_embedded.errors import InputError, VisualMeshError
from vm_embedded.geometry.orientation import OPTICAL_TO_CAMERA, Orientation
from vm_embedded.poses.buffer import PoseBuffer
from vm_embedded.poses.settings import PoseSettings
from vm_embedded.poses.stream import MAX_LINE_BYTES, parse_pose_line

ANGLES = st.floats(-math.pi, math.pi)
ORIENTATIONS = st.builds(
    Orientation.from_roll_pitch, st.floats(0.3, 2.0), st.floats(-1.0, 1.0), st.floats(-1.0, 1.5), ANGLES
)


def quaternion(orientation):
    """(w, x, y, z), by the largest of the four."""
    r = orientation.rotation
    squares = np.array([1 + np.trace(r), *(1 + 2 * np.diag(r) - np.trace(r))]) / 4.0
    at = int(np.argmax(squares))
    products = np.array(
        [
            [squares[0], (r[2, 1] - r[1, 2]) / 4, (r[0, 2] - r[2, 0]) / 4, (r[1, 0] - r[0, 1]) / 4],
            [(r[2, 1] - r[1, 2]) / 4, squares[1], (r[0, 1] + r[1, 0]) / 4, (r[0, 2] + r[2, 0]) / 4],
            [(r[0, 2] - r[2, 0]) / 4, (r[0, 1] + r[1, 0]) / 4, squares[2], (r[1, 2] + r[2, 1]) / 4],
            [(r[1, 0] - r[0, 1]) / 4, (r[0, 2] + r[2, 0]) / 4, (r[1, 2] + r[2, 1]) / 4, squares[3]],
        ]
    )
    return (products[at] / math.sqrt(squares[at])).tolist()


@given(ORIENTATIONS, st.floats(0.0, 1e6), st.booleans())
def test_a_line_says_what_it_was_made_from(orientation, at, optical):
    turned = orientation
    if optical:
        turned = Orientation(orientation.height, orientation.rotation @ OPTICAL_TO_CAMERA)
    hoc = np.eye(4)
    hoc[:3, :3], hoc[2, 3] = turned.rotation, turned.height
    for pose in ({"height": turned.height, "quaternion": quaternion(turned)}, {"Hoc": hoc.tolist()}):
        found = parse_pose_line(json.dumps({"t": at, **pose}).encode(), optical)
        assert found.time == at
        assert found.orientation.height == orientation.height
        assert np.abs(found.orientation.rotation - orientation.rotation).max() < 1e-9


WRONG = {
    "no JSON": (b"{", "not valid JSON"),
    "a list": (b"[1, 2]", "must be like"),
    "another key": (b'{"t": 1, "hight": 1, "quaternion": [1, 0, 0, 0]}', "did you mean 'height'"),
    "no height": (b'{"t": 1, "quaternion": [1, 0, 0, 0]}', "lacks height"),
    "long quaternion": (b'{"t": 1, "height": 1, "quaternion": [2, 0, 0, 0]}', "length 1"),
    "NaN": (b'{"t": 1, "height": NaN, "quaternion": [1, 0, 0, 0]}', "height must be a finite number, not nan"),
    "NaN within": (b'{"t": 1, "height": 1, "quaternion": [NaN, 0, 0, 0]}', "quaternion must be a finite number"),
    "time in words": (b'{"t": "now", "height": 1, "quaternion": [1, 0, 0, 0]}', "t must be"),
    "below the ground": (b'{"t": 1, "height": -1, "quaternion": [1, 0, 0, 0]}', "height"),
    "many digits": (b'{"t": 1, "height": ' + b"9" * 400 + b', "quaternion": [1, 0, 0, 0]}', "height"),
    "half a matrix": (b'{"t": 1, "Hoc": [[1, 0, 0, 0]]}', "Hoc must be a list of 4 values"),
    "a mirror": (b'{"Hoc": [[1,0,0,0],[0,1,0,0],[0,0,-1,1],[0,0,0,1]]}', "mirrors"),
    "both": (b'{"height": 1, "Hoc": []}', "not both"),
    "long": (b" " * (MAX_LINE_BYTES + 1), "more than"),
    "deep": (b"[" * 4000, "pose"),
    "bytes": (bytes(range(128, 256)), "JSON"),
}


@pytest.mark.parametrize(("line", "says"), WRONG.values(), ids=WRONG)
def test_what_is_wrong_with_a_line_is_said(line, says):
    with pytest.raises(InputError, match=says):
        parse_pose_line(line)


VALUES = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=5),
    lambda inner: st.lists(inner, max_size=5) | st.dictionaries(st.text(max_size=4), inner, max_size=3),
    max_leaves=20,
)
LINES = (
    st.binary(max_size=200)
    | VALUES.map(lambda each: json.dumps(each).encode())
    | st.fixed_dictionaries(
        {},
        optional={
            "t": VALUES,
            "height": VALUES | st.floats(0.1, 3.0),
            "quaternion": VALUES | st.lists(st.floats(), min_size=4, max_size=4) | st.just([1, 0, 0, 0]),
            "Hoc": VALUES | st.lists(st.lists(st.floats(), min_size=4, max_size=4), min_size=4, max_size=4),
        },
    ).map(lambda each: json.dumps(each).encode())
)


@pytest.mark.long
@settings(max_examples=2000)
@given(st.lists(LINES, min_size=5, max_size=5))
def test_ten_thousand_lines_of_anything_are_read_or_refused(lines):
    poses, refusals = PoseBuffer(PoseSettings()), []
    for line in lines:
        try:
            poses.add(time.monotonic(), parse_pose_line(line).orientation)
        except VisualMeshError as error:
            refusals.append(str(error))
    assert len(poses) + len(refusals) == len(lines)
    assert all("\n" not in each and len(each) < 400 for each in refusals)


@pytest.mark.parametrize("t", [r"a\nb", r"\u001b[31m", r"\ud800"])
def test_a_message_about_a_pose_is_one_line_whatever_the_pose_holds(t):
    with pytest.raises(InputError) as refused:
        parse_pose_line(b'{"height": 1, "quaternion": [1, 0, 0, 0], "t": "%s"}' % t.encode())
    assert str(refused.value).isprintable()
