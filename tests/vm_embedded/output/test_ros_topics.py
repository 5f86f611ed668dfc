"""The messages of ROS about a frame have the numbers of its line of JSON."""

import math
from dataclasses import replace

import numpy as np
import pytest

from tests.vm_embedded.output.features import demo_frame, scene
from vm_embedded import Orientation
from vm_embedded.cameras.ros.bag_types import bag_types, typestore
from vm_embedded.cameras.ros.message_fields import MESSAGES
from vm_embedded.cameras.ros.stamps import stamp_of
from vm_embedded.output.ros.detection_messages import FrameResults, header_of
from vm_embedded.output.ros.topics import TOPICS

TYPES, STORE = bag_types(), typestore()
OFFSET = np.array([0.4, -0.2])


@pytest.fixture(scope="module")
def frame():
    """Detections with features, and the messages that rosbags reads, by topic."""
    _, found = demo_frame()
    found = replace(found, field=scene(found.observation.view))
    headers = [header_of(TYPES, stamp_of(TYPES, 5.25), each) for each in ("eye", "ground")]
    results = FrameResults(TYPES, *headers, found, Orientation.from_roll_pitch(0.6, 0.0, 0.3), OFFSET)
    made = {}
    for name, (kind, make) in TOPICS.items():
        data = STORE.serialize_cdr(make(results), MESSAGES[kind])
        made[name] = STORE.deserialize_cdr(bytes(data), MESSAGES[kind])
    return found, made


def places(points, offset=OFFSET):
    return np.array([[each.x - offset[0], each.y - offset[1]] for each in points]).reshape(-1, 2)


def same(points, expected):
    return np.allclose(places(points), np.reshape(expected, (-1, 2)), atol=1e-9)


def test_all_features_are_in_soccer_vision(frame):
    found, made = frame
    field = found.field
    assert same([each.center for each in made["balls"].balls], [each.position[:2] for each in found])
    posts, robots = made["goalposts"].posts, made["robots"].robots
    for messages, things in ((posts, field.posts), (robots, field.robots)):
        assert same([each.bb.center.position for each in messages], [each.position for each in things])
        assert [each.bb.size.x for each in messages] == [each.width for each in things]
        assert np.allclose([each.confidence.confidence for each in messages], [each.confidence for each in things])
    assert [each.attributes.side for each in posts] == [1, 2]  # left, right
    marks = made["markings"]
    assert same(
        [point for each in marks.segments for point in (each.start, each.end)], [each.ends for each in field.lines]
    )
    (circle,) = marks.ellipses
    assert same([circle.center.position], field.circle.center)
    assert circle.diameter == 2.0 * field.circle.radius
    assert same([each.center for each in marks.intersections], [each.position for each in field.crossings])
    assert same(made["field_boundary"].points, field.border.points)
    assert made["field_boundary"].confidence.confidence == -1.0
    for name, things in (("goalpost_poses", field.posts), ("robot_poses", field.robots)):
        assert same([each.position for each in made[name].poses], [each.position for each in things])
    for message in (made["balls"], marks, made["field_boundary"], made["robot_poses"]):
        assert (message.header.frame_id, message.header.stamp.sec) == ("ground", 5)


def test_rays_of_crossings_are_their_lines(frame):
    found, made = frame
    for each, message in zip(found.field.crossings, made["markings"].intersections, strict=True):
        assert message.num_rays == len(message.rays) == {"L": 2, "T": 3, "X": 4}[each.kind]
        turned = [math.atan2(ray.y, ray.x) - each.heading for ray in message.rays]
        middle = np.exp(1j * np.array(turned)).sum()
        assert abs(middle.imag) < 1e-9  # the heading is their axis
        expected = {"L": math.sqrt(2.0), "T": 1.0, "X": 0.0}[each.kind]
        assert abs(middle.real - expected) < 1e-9


def test_markers_draw_each_thing_once(frame):
    found, made = frame
    markers, field = made["markers"].markers, found.field
    assert markers[0].action == 3  # all of the frame before go
    names = [each.ns for each in markers[1:]]
    expected = ["objects"] * bool(len(found)) + ["posts"] * 2 + ["robots"] * 2 + ["lines", "circle"]
    assert names == [*expected, *["crossings"] * 3, "border"]
    assert [each.id for each in markers] == list(range(len(markers)))
    by_name = dict(zip(names, markers[1:], strict=True))
    assert same(by_name["lines"].points, [each.ends for each in field.lines])
    assert same(by_name["border"].points, field.border.points)


def test_a_network_without_a_field_sends_no_empty_field():
    _, found = demo_frame()
    header = header_of(TYPES, stamp_of(TYPES, 0.0), "")
    results = FrameResults(TYPES, header, header, found, Orientation.from_roll_pitch(0.6, 0.0, 0.3), np.zeros(2))
    sent = {name for name, (_, make) in TOPICS.items() if make(results) is not None}
    assert sent == {"detections_2d", "detections_3d", "balls", "markers"}
