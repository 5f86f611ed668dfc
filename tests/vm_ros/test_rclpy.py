"""vm-ros through the real rclpy: another process sends pictures, lens and pose, and receives what was found."""

import shutil
import signal
import threading
import time
from contextlib import suppress

import cv2
import numpy as np
import pytest
from hypothesis import given, settings

from tests.programs import run_program
from tests.vm_embedded.cli.commands import lines, run
from tests.vm_embedded.output.features import DEMO
from vm_embedded import read_lens_file
from vm_embedded.cameras.ros.bag_types import bag_types
from vm_embedded.cameras.ros.lens import camera_info_message, lens_of
from vm_embedded.cameras.ros.message_fields import FIELDS, short_name
from vm_embedded.cameras.ros.stamps import seconds_of, stamp_of
from vm_embedded.cameras.ros.transforms import transform_message
from vm_embedded.geometry.lens_files import format_lens_file

from .loopback import COMMAND, own_domain, running
from .test_messages import DDS, contents, made, plain

rclpy = pytest.importorskip("rclpy", reason="rclpy has wheels for Python 3.11 on Linux for x86-64 only")

from rclpy.context import Context  # noqa: E402
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor  # noqa: E402
from rclpy.qos import qos_profile_sensor_data  # noqa: E402
from rclpy.serialization import deserialize_message, serialize_message  # noqa: E402

from vm_ros.rclpy_middleware import message_classes  # noqa: E402

TYPES, MISSING = message_classes()
PICTURE, INFO, POSE = "/eye/image_raw/compressed", "/eye/camera_info", "/eye/pose"
PATIENT = ("--pose-wait-ms", "1000", "--camera-max-age-ms", "10000", "--pose-frame", "optical")
"""Options with which a busy machine answers, too, only later; and the axes of the poses."""


class Peer:
    """A node of rclpy in a context of its own. received: the messages of each topic, in order."""

    def __init__(self, topics):
        self._context = Context()
        rclpy.init(context=self._context)
        self._node = rclpy.create_node("peer", context=self._context)
        kinds = {PICTURE: "CompressedImage", INFO: "CameraInfo", POSE: "PoseStamped"}
        self._publishers = {
            topic: self._node.create_publisher(getattr(TYPES, kind), topic, qos_profile_sensor_data)
            for topic, kind in kinds.items()
        }
        self.received = {topic: [] for topic in topics}
        for topic, kind in topics.items():
            self._node.create_subscription(getattr(TYPES, kind), topic, self.received[topic].append, 100)
        self._executor = SingleThreadedExecutor(context=self._context)
        self._executor.add_node(self._node)
        self._thread = threading.Thread(target=self._spin, daemon=True)
        self._thread.start()

    def _spin(self):
        with suppress(ExternalShutdownException):
            self._executor.spin()

    def connected(self):
        return all(each.get_subscription_count() for each in self._publishers.values())

    def send(self, picture, lens, orientation):
        """Publish a picture with its lens and pose, and return the seconds of its stamp."""
        now = round(time.time(), 6)
        header = TYPES.Header(stamp=stamp_of(TYPES, now), frame_id="eye")
        seen = transform_message(TYPES, header, "eye", orientation).transform
        place = TYPES.Point(x=0.0, y=0.0, z=seen.translation.z)
        pose = TYPES.Pose(position=place, orientation=seen.rotation)
        self._publishers[POSE].publish(TYPES.PoseStamped(header=header, pose=pose))
        self._publishers[INFO].publish(camera_info_message(TYPES, header, lens, lens.size))
        data = TYPES.octets(picture.read_bytes())
        self._publishers[PICTURE].publish(TYPES.CompressedImage(header=header, format="jpeg", data=data))
        return now

    def close(self):
        rclpy.shutdown(context=self._context)
        self._thread.join(10.0)


@pytest.fixture
def peer_of(monkeypatch):
    """Makes a peer in a domain of its own."""
    peers = []
    with own_domain(monkeypatch):
        monkeypatch.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
        yield lambda topics: peers.append(Peer(topics)) or peers[-1]
        for each in peers:
            each.close()


@pytest.fixture
def frames(tmp_path):
    """Pictures of the demo with the lens that a CameraInfo gives them, and their poses; also as files for vm-detect."""
    found, types = [], bag_types()
    header = types.Header(stamp=stamp_of(types, 0.0), frame_id="eye")
    (tmp_path / "frames").mkdir()
    for number in (0, 2, 5):
        picture, file = DEMO / f"image{number:07d}.jpg", read_lens_file(DEMO / f"lens{number:07d}.yaml")
        size = cv2.imread(str(picture)).shape[1::-1]
        lens = lens_of(camera_info_message(types, header, file.lens, size))
        shutil.copy(picture, tmp_path / "frames")
        (tmp_path / "frames" / f"lens{number:07d}.yaml").write_text(format_lens_file(lens, file.orientation))
        found.append((picture, lens, file.orientation))
    return found


def numbers(points):
    return [[each.x, each.y, each.z] for each in points]


def by_stamp(messages, stamp):
    """The message with a stamp [s]; of a MarkerArray, that of its markers."""
    return next((each for each in messages if abs(seconds_of(stamped(each)) - stamp) < 1e-6), None)


def stamped(message):
    return (message.markers[0] if hasattr(message, "markers") else message).header.stamp


def check_markers(message, line):
    """The markers of a frame are those of its line of JSON, with its rounded numbers."""
    shown, field = {}, line["field"]
    for each in message.markers:
        assert each.header.frame_id == "base_footprint"
        shown.setdefault(each.ns, []).append(each)

    def points(name):
        return np.array([place for each in shown.get(name, []) for place in numbers(each.points)]).reshape(-1, 3)

    def places(name):
        return np.array(numbers(each.pose.position for each in shown.get(name, []))).reshape(-1, 3)

    def same(one, other, width=2):
        return np.allclose(one[:, :width], np.reshape(other, (-1, width)), rtol=0.0, atol=0.00051)

    assert same(points("objects"), [each["position"] for each in line["detections"]], 3)
    assert same(places("posts"), [each["position"] for each in field["posts"]])
    assert same(places("robots"), [each["position"] for each in field["robots"]])
    assert same(points("lines"), [each["ends"] for each in field["lines"]])
    assert same(places("crossings"), [each["position"] for each in field["crossings"]])
    assert [each.text for each in shown.get("crossings", [])] == [each["kind"] for each in field["crossings"]]
    assert same(points("border"), field["border"]["points"] if field["border"] else [])
    if field["circle"]:
        middle = points("circle")[:-1].mean(axis=0, keepdims=True)
        assert same(middle, field["circle"]["center"])
    assert ("circle" in shown) == (field["circle"] is not None)


@pytest.mark.long
def test_pictures_of_another_process_give_the_numbers_of_vm_detect(tmp_path, peer_of, frames):
    """With parameters and remapping; then the camera vanishes, and Ctrl-C ends it."""
    peer = peer_of(
        {
            "/seen": "MarkerArray",
            "/vm_ros/goalpost_poses": "PoseArray",
            "/vm_ros/robot_poses": "PoseArray",
            "/vm_ros/map/compressed": "CompressedImage",
            "/diagnostics": "DiagnosticArray",
        }
    )
    words = ["-p", "model:=soccer", "-p", f"ros_image:={PICTURE}", "-p", "camera_lost_ms:=8000"]
    words += ["-p", "pose_source:=topic:/pose", "-r", f"/pose:={POSE}", "-r", "/vm_ros/markers:=/seen"]

    expected = lines(run(tmp_path / "frames", "--model", "soccer", "--max-distance", "6"))
    with running(tmp_path, *PATIENT, "--ros-middleware", "rclpy", "--ros-args", *words) as node:
        node.wait(peer.connected)
        for frame, line in zip(frames, expected, strict=True):
            stamp = peer.send(*frame)
            markers = node.wait(lambda: by_stamp(peer.received["/seen"], stamp))  # noqa: B023
            check_markers(markers, line)
            for name, key in (("goalpost", "posts"), ("robot", "robots")):
                poses = node.wait(lambda: by_stamp(peer.received[f"/vm_ros/{name}_poses"], stamp)).poses  # noqa: B023
                found = np.reshape(numbers(each.position for each in poses), (-1, 3))[:, :2]
                assert np.allclose(
                    found, np.reshape([each["position"] for each in line["field"][key]], (-1, 2)), atol=6e-4
                )
        drawn = node.wait(lambda: peer.received["/vm_ros/map/compressed"])[-1]
        assert cv2.imdecode(np.frombuffer(drawn.data, np.uint8), cv2.IMREAD_COLOR).ndim == 3
        node.wait(lambda: "camera_lost" in [values(each)["state"] for each in peer.received["/diagnostics"]])
        assert node.stop(signal.SIGINT)[0] == 0


def values(message):
    return {each.key: each.value for each in message.status[0].values}


@pytest.mark.long
def test_no_stamp_of_a_minute_is_lost_or_reordered(tmp_path, peer_of, frames):
    """At 30 pictures a second, each frame that vm-ros has answered is in the topic, in order."""
    peer = peer_of({"/vm_ros/markers": "MarkerArray"})
    path, lens, orientation = frames[0]
    small = cv2.resize(cv2.imread(str(path)), (320, 256))
    pictures = []
    for number in range(30):  # a camera that repeats an image counts as lost
        pictures.append(tmp_path / f"{number}.jpg")
        cv2.imwrite(str(pictures[-1]), cv2.circle(small.copy(), (10 * number, 20), 5, (0, 0, 0), cv2.FILLED))
    options = ("--ros-image", PICTURE, "--pose-source", f"topic:{POSE}", *PATIENT)
    with running(tmp_path, *options, "--ros-middleware", "rclpy") as node:
        node.wait(lambda: peer.connected() and "ready" in [each["event"] for each in node.events])
        due = time.monotonic()
        for sent in range(1800):
            peer.send(pictures[sent % 30], lens.for_image((320, 256)), orientation)
            due += 1.0 / 30.0
            time.sleep(max(0.0, due - time.monotonic()))
        node.wait(lambda: len(peer.received["/vm_ros/markers"]) >= len(node.frames) > 0)
        node.stop()
    answered = [round(each["wall"], 3) for each in node.frames]
    assert [round(seconds_of(stamped(each)), 3) for each in peer.received["/vm_ros/markers"]] == answered
    print(f"{len(answered)} of 1800 pictures were answered")


def test_a_topic_without_its_package_is_named(tmp_path, peer_of):
    peer_of({})
    with running(tmp_path, "--ros-middleware", "rclpy", "--camera", "synthetic") as node:
        node.wait(lambda: node.events)
        node.wait(lambda: "ready" in [each["event"] for each in node.events])
        node.stop()
    (remark,) = [each["remark"] for each in node.events if each["event"] == "ros"]
    assert all(each in remark for each in MISSING)
    done = run_program(COMMAND, "--ros-middleware", "rclpy", "--ros-args", "-r", "nonsense", code=78)
    assert "ROS rejects what stands behind --ros-args" in done.stderr


@pytest.mark.parametrize("full", [each for each in FIELDS if each.split("/")[0] not in MISSING])
def test_each_message_has_the_same_bytes_through_cyclonedds(full):
    """But for the padding, which rclpy does not clear: each reads what the other writes."""
    kind, name = getattr(TYPES, short_name(full)), short_name(full)

    @settings(max_examples=30)
    @given(contents(full))
    def check(values):
        message, encoded = made(TYPES, full, values), made(DDS, full, values).serialize()
        written = serialize_message(message)
        assert deserialize_message(encoded, kind) == message
        assert plain(getattr(DDS, name).deserialize(written)) == values
        assert 0 <= len(written) - len(encoded) < 4
        assert all(one == other for one, other in zip(written, encoded, strict=False) if other)

    check()
