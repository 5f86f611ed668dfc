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


def test_the_same_features_are_in_the_image(frame):
    found, made = frame
    field, view = found.field, found.observation.view

    def pixels(points):
        return np.array([[each.x, each.y] for each in points])

    assert np.allclose(pixels(each.center for each in made["balls_in_image"].balls), [each.center for each in found])
    for name, things in (("goalposts", field.posts), ("robots", field.robots)):
        array = made[f"{name}_in_image"]
        messages = array.posts if name == "goalposts" else array.robots
        assert np.allclose(pixels(each.bb.center.position for each in messages), [each.pixel for each in things])
        for each, thing in zip(messages, things, strict=True):
            toward = thing.position / np.linalg.norm(thing.position)
            sides = thing.position + 0.5 * thing.width * np.array([(-toward[1], toward[0]), (toward[1], -toward[0])])
            assert math.isclose(each.bb.size_x, np.linalg.norm(np.diff(view.plane_pixels(sides), axis=0)))
    assert [each.attributes.side for each in made["goalposts_in_image"].posts] == [1, 2]
    marks = made["markings_in_image"]
    ends = [[[each.start.x, each.start.y], [each.end.x, each.end.y]] for each in marks.segments]
    assert np.allclose(ends, [each.pixels for each in field.lines])
    (circle,), (center,) = marks.ellipses, view.plane_pixels(field.circle.center[None])
    assert np.allclose([circle.center.x, circle.center.y], center)
    assert circle.bb.size_x > circle.bb.size_y > 0.0
    for each, message in zip(field.crossings, marks.intersections, strict=True):
        assert np.allclose(pixels([message.center]), view.plane_pixels(each.position[None]))
        assert message.num_rays == len(message.heading_rays) == {"L": 2, "T": 3, "X": 4}[each.kind]
        assert sorted(message.heading_rays) == list(message.heading_rays)
        assert 0.0 <= min(message.heading_rays) <= max(message.heading_rays) < math.tau
    boundary = made["field_boundary_in_image"]
    assert np.allclose(pixels(boundary.points), field.border.pixels)
    assert boundary.header.frame_id == marks.header.frame_id == "eye"


def test_a_line_with_an_end_outside_of_the_image_is_not_in_it():
    _, found = demo_frame()
    field = scene(found.observation.view)
    outside = replace(field.lines[0], pixels=np.array([[10.0, 20.0], [np.nan, np.nan]]))
    found = replace(found, field=replace(field, lines=(outside, *field.lines)))
    headers = [header_of(TYPES, stamp_of(TYPES, 5.25), each) for each in ("eye", "ground")]
    results = FrameResults(TYPES, *headers, found, Orientation.from_roll_pitch(0.6, 0.0, 0.3), OFFSET)
    counts = {name: len(TOPICS[name][1](results).segments) for name in ("markings", "markings_in_image")}
    assert counts == {"markings": len(field.lines) + 1, "markings_in_image": len(field.lines)}


def test_markers_draw_each_thing_once(frame):
    found, made = frame
    markers, field = made["markers"].markers, found.field
    assert markers[0].action == 3  # all of the frame before go
    by_name = {each.ns: each for each in markers[1:]}
    expected = ["objects"] * bool(len(found)) + ["posts", "robots", "lines", "circle", "crossings", "border"]
    assert [each.ns for each in markers[1:]] == expected
    assert same(by_name["posts"].points[::2], [each.position for each in field.posts])
    assert same(by_name["robots"].points, [each.position for each in field.robots])
    assert same(by_name["lines"].points, [each.ends for each in field.lines])
    starts = [each.position for each in field.crossings for _ in range({"L": 2, "T": 3, "X": 4}[each.kind])]
    assert same(by_name["crossings"].points[::2], starts)
    assert same(by_name["border"].points, field.border.points)


def test_a_network_without_a_field_sends_no_empty_field():
    _, found = demo_frame()
    header = header_of(TYPES, stamp_of(TYPES, 0.0), "")
    results = FrameResults(TYPES, header, header, found, Orientation.from_roll_pitch(0.6, 0.0, 0.3), np.zeros(2))
    sent = {name for name, (_, make) in TOPICS.items() if make(results) is not None}
    assert sent == {"detections_2d", "detections_3d", "balls", "balls_in_image", "markers"}
