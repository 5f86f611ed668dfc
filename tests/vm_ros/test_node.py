"""vm-ros as a robot uses it: another process sends images and poses over DDS, and receives detections and states."""

import asyncio
import threading
import time
from types import SimpleNamespace

import cv2
import numpy as np
import pytest

from tests.vm_embedded.cameras.ros.rolling_ball import LENS, OFFSET, SIZE
from tests.vm_embedded.output.features import demo_frame
from tests.waiting import wait
from vm_embedded import Detector, Settings
from vm_embedded.cameras.camera import Shot
from vm_embedded.cameras.ros.message_fields import FIELDS, short_name
from vm_embedded.cameras.ros.stamps import seconds_of, stamp_of
from vm_embedded.cameras.ros.transforms import transform_message
from vm_embedded.geometry.orientation import OPTICAL_TO_CAMERA, Orientation
from vm_ros import node as node_module
from vm_ros.cli import configuration, parser
from vm_ros.middleware import FIXED_TRANSFORMS
from vm_ros.node import Node
from vm_ros.plain_messages import plain_classes

from .loopback import running
from .robot import Robot

ON_PLANE, IN_IMAGE, STATES = "/vm_ros/detections_3d", "/vm_ros/detections_2d", "/diagnostics"
PATIENT = ("--pose-wait-ms", "1000", "--camera-max-age-ms", "5000")
"""Options with which a busy machine gives the same numbers, only later."""

DRAWN = "/vm_ros/debug_image/compressed"


def vector(message):
    return np.array([message.x, message.y, message.z])


def states(peer):
    """States and reasons as they came, with the times of their stamps [s]."""
    found = []
    for message in peer.received(STATES):
        (status,) = message.status
        values = {each.key: each.value for each in status.values}
        found.append((seconds_of(message.header.stamp), values["state"], values["reason"], status.level))
    return found


@pytest.mark.long
@pytest.mark.parametrize("poses", ["tf", "topic:/camera_pose"])
def test_another_process_decodes_the_same_numbers(tmp_path, peer, poses):
    peer.listen(ON_PLANE, "Detection3DArray")
    peer.listen(IN_IMAGE, "Detection2DArray")
    peer.listen(STATES, "DiagnosticArray")
    peer.middleware.start()
    with Robot(peer, poses) as robot, running(tmp_path, "--pose-source", poses, *PATIENT) as node:
        node.wait(lambda: sum(bool(each.detections) for each in peer.received(ON_PLANE)) > 20)
        node.wait(lambda: "ok" in [state for _, state, *_ in states(peer)])
        status, _ = node.stop()
    assert status == 0
    detector = Detector.from_file("ball", Settings(max_distance=6.0))
    offset = np.append(OFFSET if poses == "tf" else np.zeros(2), 0.0)
    in_image = {seconds_of(each.header.stamp): each for each in peer.received(IN_IMAGE)}
    errors = []
    for on_plane in peer.received(ON_PLANE):
        assert on_plane.header.frame_id == "base_footprint"
        time = min(robot.shown, key=lambda each: abs(each - seconds_of(on_plane.header.stamp)))
        assert abs(time - seconds_of(on_plane.header.stamp)) < 1e-6
        orientation = robot.orientation(time)
        expected = detector.detect(robot.shown[time], orientation, LENS)
        array = in_image[seconds_of(on_plane.header.stamp)]
        assert array.header.frame_id == "camera_optical"
        assert len(on_plane.detections) == len(array.detections)
        if len(expected) != len(array.detections):
            continue  # at the edge of the picture, a pose that is interpolated can decide
        for each, place, box in zip(expected, on_plane.detections, array.detections, strict=True):
            assert place.results[0].hypothesis.class_id == box.results[0].hypothesis.class_id == each.class_name
            position = vector(place.results[0].pose.pose.position)
            assert (vector(place.bbox.center.position) == position).all()
            assert (vector(place.bbox.size) == 2.0 * detector.manifest.object_radius).all()
            from_camera = orientation.rotation @ OPTICAL_TO_CAMERA @ vector(box.results[0].pose.pose.position)
            errors.append(
                [
                    np.abs(position - offset - each.position).max() / each.distance,
                    np.abs(from_camera - each.distance * each.bearing).max() / each.distance,
                    abs(box.bbox.center.position.x - each.center[0]) / SIZE[0],
                    abs(box.bbox.size_x - np.ptp(each.outline[:, 0])) / SIZE[0],
                    abs(box.results[0].hypothesis.score - each.confidence),
                ]
            )
    assert len(errors) > 15
    # A busy machine sends some poses late, and then the pose of a frame comes from poses that are far apart.
    assert (np.median(errors, axis=0) < 0.002).all(), np.median(errors, axis=0)


def test_the_numbers_are_those_of_the_lines_of_json(tmp_path, peer):
    """A camera with its own poses: nothing is interpolated, so that the numbers are equal."""
    peer.listen(ON_PLANE, "Detection3DArray")
    peer.listen(IN_IMAGE, "Detection2DArray")
    peer.middleware.start()
    with running(tmp_path, "--camera", "synthetic", "--track") as node:
        node.wait(lambda: sum(bool(each.detections) for each in peer.received(ON_PLANE)) > 20)
        node.stop()
    lines = {round(each["wall"], 4): each["detections"] for each in node.frames}
    compared = 0
    for array in peer.received(ON_PLANE):
        found = lines.get(round(seconds_of(array.header.stamp), 4))
        for each, place in zip(found or [], array.detections, strict=bool(found)):
            position = vector(place.results[0].pose.pose.position)
            assert np.abs(position - each["position"]).max() <= 0.00051
            assert abs(place.results[0].hypothesis.score - each["confidence"]) <= 0.00051
            assert place.id == str(each["track"]["id"])
            compared += 1
    assert compared > 15


@pytest.mark.long
def test_a_lost_camera_is_a_status_within_a_second_and_never_an_empty_array(tmp_path, peer):
    peer.listen(ON_PLANE, "Detection3DArray")
    peer.listen(IN_IMAGE, "Detection2DArray")
    peer.listen(STATES, "DiagnosticArray")
    peer.middleware.start()
    delays = []
    with Robot(peer) as robot, running(tmp_path) as node:
        for _ in range(3):  # a busy machine may hold up a process for a while
            robot.has_camera.set()
            started = len(states(peer))
            node.wait(lambda: "ok" in [state for _, state, *_ in states(peer)[started:]])  # noqa: B023
            robot.has_camera.clear()
            last = max(robot.shown)
            node.wait(lambda: [each for each in states(peer) if each[0] > last and each[1] == "camera_lost"])  # noqa: B023
            lost = [each for each in states(peer) if each[0] > last and each[1] == "camera_lost"]
            delays.append(lost[0][0] - max(robot.shown))
            assert lost[0][2].startswith("no image on /camera/image_raw for")
            assert lost[0][3] == 2  # ERROR
            node.wait(lambda: len([each for each in states(peer) if each[0] > last]) > 3)  # noqa: B023
        node.stop()
    assert min(delays) < 1.0, delays
    print(f"status after {min(delays):.2f} to {max(delays):.2f} s")
    stamps = {round(time, 5) for time in robot.shown}
    for topic in (ON_PLANE, IN_IMAGE):
        arrays = peer.received(topic)
        assert arrays
        assert {round(seconds_of(each.header.stamp), 5) for each in arrays} <= stamps
        assert any(each.detections for each in arrays)


@pytest.mark.long
def test_a_bag_that_is_played_has_a_clock_of_its_own(tmp_path, peer):
    peer.listen(ON_PLANE, "Detection3DArray")
    peer.listen(STATES, "DiagnosticArray")
    peer.middleware.start()
    with Robot(peer, behind=1e6) as robot:
        with running(tmp_path) as node:
            advice = "stamp of the image is 1000000 s before now; if its clock is that of a bag or a simulation, give "
            node.wait(lambda: any(f"{advice}--ros-clock arrival" in reason for _, _, reason, _ in states(peer)))
            node.stop()
        assert not peer.received(ON_PLANE)
        with running(tmp_path, "--ros-clock", "arrival") as node:
            node.wait(lambda: sum(bool(each.detections) for each in peer.received(ON_PLANE)) > 5)
            node.stop()
    assert seconds_of(peer.received(ON_PLANE)[-1].header.stamp) <= max(robot.shown)


@pytest.mark.long
def test_another_camera_may_be_fixed_in_tf(tmp_path, peer):
    peer.listen(ON_PLANE, "Detection3DArray")
    fixed = peer.middleware.publisher("/tf_static", "TFMessage", FIXED_TRANSFORMS)
    peer.middleware.start()
    pose = Orientation.from_roll_pitch(height=0.8, pitch=0.4)
    header = peer.types.Header(stamp=stamp_of(peer.types, 0.0), frame_id="base_footprint")
    link = transform_message(peer.types, header, "eye", pose)
    link.transform.translation.x = 3.0
    fixed.publish(peer.types.TFMessage(transforms=[link]))
    options = ("--camera", "synthetic:0", "--pose-source", "tf", "--ros-camera-frame", "eye")
    with running(tmp_path, *options, *PATIENT) as node:
        node.wait(lambda: sum(bool(each.detections) for each in peer.received(ON_PLANE)) > 5)
        node.stop()
    for array in peer.received(ON_PLANE):
        for each in array.detections:
            position = vector(each.results[0].pose.pose.position)
            assert 4.0 < position[0] < 6.5  # the ball rolls 1.3 to 2.7 m before the camera
            assert abs(position[1]) < 2.0


def test_a_relative_topic_is_the_same_topic(peer):
    peer.listen("camera/tf", "TFMessage")
    peer.middleware.start()
    publisher = peer.middleware.publisher("/camera/tf", "TFMessage")
    publisher.publish(peer.types.TFMessage(transforms=[]))
    wait(lambda: peer.received("camera/tf"))


@pytest.mark.long
def test_a_robot_that_starts_anew_is_used_again(tmp_path, peer):
    peer.listen(ON_PLANE, "Detection3DArray")
    peer.listen(STATES, "DiagnosticArray")
    peer.middleware.start()
    with running(tmp_path) as node:
        for _ in range(2):
            begun = len(peer.received(ON_PLANE))
            with Robot(peer) as robot:
                node.wait(lambda: len(peer.received(ON_PLANE)) > begun + 5)  # noqa: B023
            last = max(robot.shown)
            node.wait(lambda: [each for each in states(peer) if each[0] > last and each[1] == "camera_lost"])  # noqa: B023
        assert node.stop()[0] == 0


@pytest.mark.long
def test_the_debug_image_is_made_for_who_subscribes(tmp_path, peer):
    peer.listen(DRAWN, "CompressedImage")
    peer.middleware.start()
    with Robot(peer) as robot, running(tmp_path) as node:
        node.wait(lambda: len(peer.received(DRAWN)) > 2)
        node.stop()
    message = peer.received(DRAWN)[-1]
    drawn = cv2.imdecode(message.data, cv2.IMREAD_COLOR)
    time = min(robot.shown, key=lambda each: abs(each - seconds_of(message.header.stamp)))
    assert drawn.shape == (SIZE[1], SIZE[0], 3)
    difference = np.abs(drawn.astype(int) - robot.shown[time]).mean()
    assert 0.5 < difference < 30  # the image, with something drawn into it


@pytest.mark.long
def test_the_status_says_what_is_missing(tmp_path, peer):
    peer.listen(STATES, "DiagnosticArray")
    peer.middleware.start()
    with Robot(peer), running(tmp_path, "--ros-plane-frame", "base_footprnt") as node:
        node.wait(lambda: any("did you mean 'base_footprint'?" in reason for _, _, reason, _ in states(peer)))
        assert {state for _, state, *_ in states(peer)} <= {"starting", "pose_stale", "camera_lost", "degraded"}
        node.stop()
    with Robot(peer), running(tmp_path, "--ros-camera-info", "/nothing") as node:
        node.wait(lambda: any("no message on /nothing yet" in reason for _, _, reason, _ in states(peer)))
        node.stop()


class Gate:
    """A connection whose publishers wait until it opens. read: topics with readers. sent: what came, by topic."""

    types, parameters, remark = plain_classes(map(short_name, FIELDS)), {}, ""

    def __init__(self, *read):
        self._read, self.opened, self.sent = (STATES, *read), threading.Event(), {}

    def publisher(self, topic, message, kind=None):
        def publish(message):
            assert topic == STATES or self.opened.wait(60.0)
            self.sent.setdefault(topic, []).append(message)

        return SimpleNamespace(publish=publish, readers=1 if topic in self._read else 0)

    def close(self):
        pass


def test_a_slow_reader_delays_no_frame_but_the_one_after_the_next():
    gate = Gate(IN_IMAGE, ON_PLANE)
    node = Node(configuration(parser().parse_args(["--camera", "synthetic"])), gate)
    image, found = demo_frame()
    answers = [
        SimpleNamespace(shot=Shot(image, captured), detections=found, orientation=Orientation.from_roll_pitch(0.6))
        for captured in (1.0, 2.0)
    ]
    node.publish({"state": "ok"}, answers[0])
    assert list(gate.sent) == [STATES]
    second = threading.Thread(target=node.publish, args=({"state": "ok"}, answers[1]))
    second.start()
    second.join(0.1)
    assert second.is_alive()
    gate.opened.set()
    second.join(60.0)
    asyncio.run(node.close())
    for topic in (IN_IMAGE, ON_PLANE):
        first, last = (seconds_of(each.header.stamp) for each in gate.sent[topic])
        assert last - first == pytest.approx(1.0, abs=1e-3)


def test_a_drawing_begins_a_tenth_of_a_second_after_the_one_before(monkeypatch):
    """By the clock of the machine: stamps may jump back."""
    gate, now = Gate(DRAWN), [5.0]
    gate.opened.set()
    monkeypatch.setattr(node_module, "time", SimpleNamespace(monotonic=lambda: now[0], time=time.time))
    image, found = demo_frame()

    async def publish():
        node = Node(configuration(parser().parse_args(["--camera", "synthetic"])), gate)
        for captured, now[0] in ((9.0, 5.0), (9.05, 5.05), (1.0, 5.11), (1.05, 5.15), (1.1, 5.22)):
            shot, pose = Shot(image, captured), Orientation.from_roll_pitch(0.6)
            node.publish({"state": "ok"}, SimpleNamespace(shot=shot, detections=found, orientation=pose))
            if node._drawing is not None:
                await node._drawing
        await node.close()

    asyncio.run(publish())
    first, *others = (seconds_of(each.header.stamp) for each in gate.sent[DRAWN])
    assert [each - first for each in others] == pytest.approx([-8.0, -7.9], abs=1e-3)
