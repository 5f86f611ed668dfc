"""vm-ros through the real rclpy: another process sends pictures, lens and pose, and receives what was found."""

import asyncio
import math
import os
import re
import shlex
import shutil
import signal
import sys
import threading
import time
import xml.etree.ElementTree as ElementTree
from array import array
from contextlib import suppress
from pathlib import Path
from types import SimpleNamespace

import cv2
import numpy as np
import pytest
from hypothesis import given, settings

from tests.programs import run_program
from tests.vm_embedded.cli.commands import lines, run
from tests.vm_embedded.output.features import DEMO, demo_frame
from vm_embedded import Orientation, read_lens_file
from vm_embedded.cameras.camera import Shot
from vm_embedded.cameras.ros.bag_types import bag_types
from vm_embedded.cameras.ros.lens import camera_info_message, lens_of
from vm_embedded.cameras.ros.message_fields import FIELDS, short_name
from vm_embedded.cameras.ros.settings import DRAWN
from vm_embedded.cameras.ros.stamps import seconds_of, stamp_of
from vm_embedded.cameras.ros.transforms import transform_message
from vm_embedded.geometry.lens_files import format_lens_file
from vm_embedded.output.ros.topics import TOPICS
from vm_ros import node as node_module
from vm_ros.cli import configuration, parser

from .loopback import COMMAND, own_domain, running
from .test_messages import DDS, contents, made, plain

rclpy = pytest.importorskip("rclpy", reason="rclpy has wheels for Python 3.11 on Linux for x86-64 only")

from rclpy.context import Context  # noqa: E402
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor  # noqa: E402
from rclpy.qos import qos_profile_sensor_data  # noqa: E402
from rclpy.serialization import deserialize_message, serialize_message  # noqa: E402

from vm_ros.cli import connect  # noqa: E402
from vm_ros.rclpy_middleware import message_classes  # noqa: E402

from .generated_messages import generate  # noqa: E402

LAUNCH = Path(__file__).parents[2] / "deploy" / "ros"
PICTURE, INFO, POSE, TF = "/eye/image_raw/compressed", "/eye/camera_info", "/eye/pose", "/tf"
SENT = {PICTURE: "CompressedImage", INFO: "CameraInfo", POSE: "PoseStamped", TF: "TFMessage"}
ALL = {**{name: kind for name, (kind, _) in TOPICS.items()}, **dict.fromkeys(DRAWN, "CompressedImage")}
"""The message of each topic that vm-ros publishes, but for the diagnostics."""

RATE = 30.0


@pytest.mark.long
def test_a_topic_without_its_package_is_named(tmp_path, peer_of):
    """Before the fixture `types` makes the packages that are missing."""
    missing = message_classes()[1]
    with running(tmp_path, "--ros-middleware", "rclpy", "--camera", "synthetic") as node:
        node.wait(lambda: "ready" in [each["event"] for each in node.events])
        node.stop()
    (remark,) = [each["remark"] for each in node.events if each["event"] == "ros"]
    assert all(each in remark for each in missing)
    done = run_program(COMMAND, "--ros-middleware", "rclpy", "--ros-args", "-r", "nonsense", code=78)
    assert "ROS rejects what stands behind --ros-args" in done.stderr


@pytest.fixture(scope="module")
def types(tmp_path_factory):
    """The classes of all messages: of wheels, and of packages that the generators of ROS make."""
    if shutil.which("gcc") is None:
        pytest.skip("no compiler")
    folder = tmp_path_factory.mktemp("messages")
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("AMENT_PREFIX_PATH", sys.prefix)  # where the generators have their templates
        generate(folder, message_classes()[1])
        patch.syspath_prepend(folder)
        patch.setenv("PYTHONPATH", f"{folder}:{os.environ.get('PYTHONPATH', '')}")
        found, missing = message_classes()
        assert not missing
        yield SimpleNamespace(**found, octets=lambda content: array("B", content), doubles=list)


class Peer:
    """A node of rclpy in a context of its own. received: the messages of each topic, in order."""

    def __init__(self, types, topics):
        self._types, self._context = types, Context()
        rclpy.init(context=self._context)
        self._node = rclpy.create_node("peer", context=self._context)
        self._publishers = {
            topic: self._node.create_publisher(
                getattr(types, kind), topic, qos_profile_sensor_data if topic != TF else 10
            )
            for topic, kind in SENT.items()
        }
        self.received = {topic: [] for topic in topics}
        for topic, kind in topics.items():
            self._node.create_subscription(getattr(types, kind), topic, self.received[topic].append, 100)
        self._executor = SingleThreadedExecutor(context=self._context)
        self._executor.add_node(self._node)
        self._thread = threading.Thread(target=self._spin, daemon=True)
        self._thread.start()

    def _spin(self):
        with suppress(ExternalShutdownException):
            self._executor.spin()

    def send(self, encoded, lens, orientation):
        """Publish a JPEG with its lens and pose, and return the seconds of its stamp."""
        types, now = self._types, round(time.time(), 6)
        header = types.Header(stamp=stamp_of(types, now), frame_id="eye")
        on_plane = types.Header(stamp=header.stamp, frame_id="base_footprint")
        seen = transform_message(types, on_plane, "eye", orientation)
        place = types.Point(x=0.0, y=0.0, z=seen.transform.translation.z)
        pose = types.Pose(position=place, orientation=seen.transform.rotation)
        publish = {topic: each.publish for topic, each in self._publishers.items()}
        publish[TF](types.TFMessage(transforms=[seen]))
        publish[POSE](types.PoseStamped(header=on_plane, pose=pose))
        publish[INFO](camera_info_message(types, header, lens, lens.size))
        publish[PICTURE](types.CompressedImage(header=header, format="jpeg", data=types.octets(encoded)))
        return now

    def close(self):
        if self._context.ok():
            self._executor.shutdown()
            self._thread.join(10.0)
            self._node.destroy_node()
            rclpy.shutdown(context=self._context)


@pytest.fixture
def peer_of(monkeypatch):
    """Makes a peer in a domain of its own."""
    peers = []
    with own_domain(monkeypatch):
        monkeypatch.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
        yield lambda *given: peers.append(Peer(*given)) or peers[-1]
        for each in peers:
            each.close()


@pytest.fixture(scope="module")
def pictures(tmp_path_factory):
    """JPEGs with lens, pose and their line of vm-detect: three of the demo, each with ten small differences.

    A camera that repeats an image counts as lost.
    """
    folder, found, types = tmp_path_factory.mktemp("pictures"), [], bag_types()
    header = types.Header(stamp=stamp_of(types, 0.0), frame_id="eye")
    for number in (0, 2, 5):
        image, file = cv2.imread(str(DEMO / f"image{number:07d}.jpg")), read_lens_file(DEMO / f"lens{number:07d}.yaml")
        lens = lens_of(camera_info_message(types, header, file.lens, image.shape[1::-1]))
        for variant in range(10):
            name = f"{number}{variant:06d}"
            drawn = cv2.circle(image.copy(), (20 * variant + 10, 10), 5, (0, 0, 0), cv2.FILLED)
            cv2.imwrite(str(folder / f"image{name}.jpg"), drawn)
            (folder / f"lens{name}.yaml").write_text(format_lens_file(lens, file.orientation))
            found.append(((folder / f"image{name}.jpg").read_bytes(), lens, file.orientation))
    return list(zip(found, lines(run(folder, "--model", "soccer", "--max-distance", "3")), strict=True))


def launched(**arguments):
    """The command that `ros2 launch` runs for the launch file with arguments."""
    launch = ElementTree.parse(LAUNCH / "launch" / "vm_ros.launch.xml").getroot()
    given = {each.get("name"): each.get("default") for each in launch.findall("arg")} | arguments
    (node,) = launch.findall("node")
    words = shlex.split(re.sub(r"\$\(var (\w+)\)", lambda found: given[found[1]], node.get("args")))
    return [sys.executable, LAUNCH / node.get("exec"), *words, "--ros-args", "-r", f"__node:={node.get('name')}"]


@pytest.mark.long
@pytest.mark.parametrize(("source", "seconds"), [("tf", 60.0), ("topic:/pose", 5.0)])
def test_pictures_of_another_process_give_the_numbers_of_vm_detect(tmp_path, types, peer_of, pictures, source, seconds):
    """As launched, with parameters and remapping, at 30 pictures a second; then the camera vanishes, and Ctrl-C."""
    topics = {("/seen" if name == "markers" else f"/vm_ros/{name}"): kind for name, kind in ALL.items()}
    peer = peer_of(types, {**topics, "/diagnostics": "DiagnosticArray"})
    more = f"--status-socket {tmp_path}/control --output-stdout --max-distance 3 --pose-frame optical"
    command = launched(image=PICTURE, model="soccer", pose=source, more=f"{more} --ros-middleware rclpy")
    # A busy machine answers, too, only later.
    for name, value in (("camera_lost_ms", 8000), ("pose_wait_ms", 1000), ("camera_max_age_ms", 10000)):
        command += ["-p", f"{name}:={value}"]
    command += ["-r", f"/pose:={POSE}", "-r", "/vm_ros/markers:=/seen"]
    sent = {}

    def send(count):
        due = time.monotonic()
        for number in range(count):
            frame, line = pictures[10 * (3 * number // count) + number % 10]
            sent[peer.send(*frame)] = line
            due += 1.0 / RATE
            time.sleep(max(0.0, due - time.monotonic()))

    with running(tmp_path, command=command) as node:
        # Nodes need a while to find each other: until all topics have come.
        node.wait(lambda: send(3) or all(peer.received[topic] for topic in topics))
        time.sleep(0.2)  # a pose that jumps is rejected, but not after a pause: the first picture has another one
        started = time.time()
        send(round(RATE * seconds))
        node.wait(lambda: "camera_lost" in [values(each)["state"] for each in peer.received["/diagnostics"]])
        assert node.stop(signal.SIGINT)[0] == 0
    # The clock of the lines differs by microseconds.
    stamps = [min(sent, key=lambda stamp: abs(stamp - each["wall"])) for each in node.frames]
    answered = [each for each in stamps if each > started]
    assert answered
    assert sorted(set(answered)) == answered
    found = {}
    for topic, messages in peer.received.items():
        if topic in topics and not topic.endswith("/compressed"):
            stamped = [(round(seconds_of(header_of(each).stamp), 6), each) for each in messages]
            assert [stamp for stamp, _ in stamped if stamp > started] == answered, topic
            found[topic.rpartition("/")[2].replace("seen", "markers")] = dict(stamped)
    for stamp in answered:
        check(SimpleNamespace(**{name: messages[stamp] for name, messages in found.items()}), sent[stamp])
    for topic in DRAWN:
        drawn = np.frombuffer(peer.received[f"/vm_ros/{topic}"][-1].data, np.uint8)
        assert cv2.imdecode(drawn, cv2.IMREAD_COLOR).ndim == 3
    print(
        f"{source}: {len(answered)} of {RATE * seconds:.0f} pictures were answered, and each is in {len(found)} topics"
    )


def header_of(message):
    return (message.markers[0] if hasattr(message, "markers") else message).header


def values(message):
    return {each.key: each.value for each in message.status[0].values}


def same(found, expected, rounding=0.00051):
    """Whether numbers are those of a line, which rounds them."""
    expected = np.array(expected, dtype=float)
    return np.allclose(np.array(found, dtype=float).reshape(expected.shape), expected, rtol=0.0, atol=rounding)


def places(points, width=2):
    """x and y of points, and z for a width of 3."""
    return [[each.x, each.y, *([each.z] if width == 3 else [])] for each in points]


def of(things, key):
    return [each[key] for each in things]


def sure(messages):
    return [each.confidence.confidence for each in messages]


def check(seen, line):
    """The messages of a frame have the numbers of its line of JSON."""
    objects, field = line["detections"], line["field"]
    for name, message in vars(seen).items():
        in_image = name == "detections_2d" or name.endswith("_in_image")
        assert header_of(message).frame_id == ("eye" if in_image else "base_footprint")
    for boxes in (seen.detections_2d, seen.detections_3d):
        hypotheses = [each.results[0].hypothesis for each in boxes.detections]
        assert [each.class_id for each in hypotheses] == of(objects, "class")
        assert same([each.score for each in hypotheses], of(objects, "confidence"))
    for each, thing in zip(seen.detections_2d.detections, objects, strict=True):
        box, distance = each.bbox.center.position, places([each.results[0].pose.pose.position], 3)
        assert same(np.linalg.norm(distance), thing["distance"])
        assert same([box.x, box.y], thing["center"], 2.0)  # of the outline
    bodies = [each.results[0].pose.pose.position for each in seen.detections_3d.detections]
    assert same(places(bodies, 3), of(objects, "position"))
    balls = [each["position"] for each in objects if each["class"] == "ball"]
    assert same(places([each.center for each in seen.balls.balls], 3), balls)
    for messages, poses, key in (
        (seen.goalposts.posts, seen.goalpost_poses, "posts"),
        (seen.robots.robots, seen.robot_poses, "robots"),
    ):
        assert same(places([each.bb.center.position for each in messages]), of(field[key], "position"))
        assert same([each.bb.size.x for each in messages], of(field[key], "width"))
        assert same(sure(messages), of(field[key], "confidence"))
        assert same(places([each.position for each in poses.poses]), of(field[key], "position"))
    sides = {post: side for goal in field["goals"] for post, side in zip(goal, (1, 2), strict=True)}
    assert [each.attributes.side for each in seen.goalposts.posts] == [
        sides.get(i, 0) for i in range(len(field["posts"]))
    ]
    marks = seen.markings
    assert same([places([each.start, each.end]) for each in marks.segments], of(field["lines"], "ends"))
    assert same(sure(marks.segments), of(field["lines"], "confidence"))
    circles = [field["circle"]] if field["circle"] else []
    assert same(places([each.center.position for each in marks.ellipses]), of(circles, "center"))
    assert same([0.5 * each.diameter for each in marks.ellipses], of(circles, "radius"))
    assert same(sure(marks.ellipses), of(circles, "confidence"))
    crossings = field["crossings"]
    assert same(places([each.center for each in marks.intersections]), of(crossings, "position"))
    assert ["LTX"[each.num_rays - 2] for each in marks.intersections] == of(crossings, "kind")
    assert same(sure(marks.intersections), of(crossings, "confidence"))
    for each, crossing in zip(marks.intersections, crossings, strict=True):
        axis = complex(sum(ray.x for ray in each.rays), sum(ray.y for ray in each.rays))
        turned = math.remainder(np.angle(axis) - crossing["heading"], math.tau)
        assert crossing["kind"] == "X" or abs(turned) < 0.002
    border = field["border"]["points"] if field["border"] else []
    assert same(places(seen.field_boundary.points), border)
    check_markers(seen.markers, objects, field, border)
    check_image(
        seen,
        objects,
        field,
        [each for each in field["border"]["pixels"] if each[0] is not None] if field["border"] else [],
    )


def check_image(seen, objects, field, border):
    """The same in 2D. Pixels are rounded to one digit."""
    balls = [each["center"] for each in objects if each["class"] == "ball"]
    assert same(places([each.center for each in seen.balls_in_image.balls]), balls, 0.051)
    for messages, things in (
        (seen.goalposts_in_image.posts, field["posts"]),
        (seen.robots_in_image.robots, field["robots"]),
    ):
        assert same(places([each.bb.center.position for each in messages]), of(things, "pixel"), 0.051)
        assert same(sure(messages), of(things, "confidence"))
    marks = seen.markings_in_image
    ends = [each for each in of(field["lines"], "pixels") if None not in np.ravel(each)]
    assert same([places([each.start, each.end]) for each in marks.segments], ends, 0.051)
    assert ["LTX"[each.num_rays - 2] for each in marks.intersections] == of(field["crossings"], "kind")
    assert same(places(seen.field_boundary_in_image.points), border, 0.051)


def check_markers(message, objects, field, border):
    """In markers, of a thing with several points the first is its place."""
    shown = {each.ns: each.points for each in message.markers}

    def points(name, each=1, width=2):
        return places(shown.get(name, [])[::each], width)

    assert same(points("objects", width=3), of(objects, "position"))
    assert same(points("posts", 2), of(field["posts"], "position"))
    assert same(points("robots"), of(field["robots"], "position"))
    assert same(points("lines"), of(field["lines"], "ends"))
    rays = {"L": 2, "T": 3, "X": 4}
    starts = [each["position"] for each in field["crossings"] for _ in range(rays[each["kind"]])]
    assert same(points("crossings", 2), starts)
    assert same(points("border"), border)
    assert ("circle" in shown) == (field["circle"] is not None)
    if field["circle"]:
        assert same(np.mean(points("circle")[:-1], axis=0), field["circle"]["center"])


@pytest.mark.long
def test_arrays_are_made_only_while_something_subscribes(types, peer_of, monkeypatch):
    made = []

    def counted(name, make):
        return lambda frame: made.append(name) or make(frame)

    counting = {name: (kind, counted(name, make)) for name, (kind, make) in TOPICS.items()}
    monkeypatch.setattr(node_module, "TOPICS", counting)
    middleware = connect("vm_ros", (), "rclpy")
    node = node_module.Node(configuration(parser().parse_args(["--camera", "synthetic"])), middleware)
    image, found = demo_frame()
    pose = Orientation.from_roll_pitch(0.6, 0.0, 0.3)

    def publish_until(done):
        deadline = time.monotonic() + 60.0
        while not done():
            assert time.monotonic() < deadline
            made.clear()
            answer = SimpleNamespace(shot=Shot(image, time.monotonic()), detections=found, orientation=pose)
            node.publish({"state": "ok"}, answer)
            time.sleep(0.05)

    publish_until(lambda: True)
    assert not made
    peer = peer_of(types, {"/vm_ros/balls": "BallArray"})
    publish_until(lambda: peer.received["/vm_ros/balls"])
    assert made == ["balls"]
    peer.close()
    publish_until(lambda: not made)
    asyncio.run(node.close())


@pytest.mark.long
@pytest.mark.parametrize("full", FIELDS)
def test_each_message_has_the_same_bytes_through_cyclonedds(types, full):
    """But for the padding, which rclpy does not clear: each reads what the other writes."""
    kind, name = getattr(types, short_name(full)), short_name(full)

    @settings(max_examples=30)
    @given(contents(full))
    def check(values):
        message, encoded = made(types, full, values), made(DDS, full, values).serialize()
        written = serialize_message(message)
        assert deserialize_message(encoded, kind) == message
        assert plain(getattr(DDS, name).deserialize(written)) == values
        assert 0 <= len(written) - len(encoded) < 4
        assert all(one == other for one, other in zip(written, encoded, strict=False) if other)

    check()
