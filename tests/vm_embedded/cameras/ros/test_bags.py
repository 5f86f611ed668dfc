"""Bags of ROS 2: the same detections as their frames, and what happens to bags that are not as they should be."""

import json

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from rosbags.rosbag2 import StoragePlugin

from tests.vm_embedded.cli.commands import lines, one_complaint, run
from vm_embedded.cameras.ros.bags import BagReading, is_bag, open_bag
from vm_embedded.cameras.ros.images import jpeg_message
from vm_embedded.cameras.ros.settings import RosSettings
from vm_embedded.errors import InputError
from vm_embedded.poses.settings import PoseSettings

from .rolling_ball import LENS, OFFSET, TYPES, Scene, quaternion, stamp, write_messages

BOTH = pytest.mark.parametrize("storage", [StoragePlugin.MCAP, StoragePlugin.SQLITE3])


def detections(done):
    return [each["detections"] for each in lines(done)]


def frames(path, **reading):
    """Lens, orientation and stamp of each frame of a bag, and its image, or why it can't be used."""
    found = []
    for frame in open_bag(str(path), BagReading(**reading)).frames:
        try:
            found.append((frame.lens, frame.orientation, frame.stamp, frame.read()))
        except InputError as error:
            found.append((None, None, frame.stamp, str(error)))
    return found


@pytest.mark.long
@BOTH
def test_a_bag_gives_the_same_detections_as_its_frames(tmp_path, storage):
    scene = Scene(count=100)
    scene.write_frames(tmp_path / "frames")
    bag = scene.write_bag(tmp_path / "bag", storage)
    assert bag.suffix == {StoragePlugin.MCAP: ".mcap", StoragePlugin.SQLITE3: ".db3"}[storage]
    expected = detections(run(tmp_path / "frames"))
    assert len(expected) == 100
    assert sum(map(bool, expected)) > 90
    assert detections(run(bag)) == expected
    assert detections(run(tmp_path / "bag")) == expected  # the folder, as ros2 bag record makes it


@BOTH
def test_poses_are_those_of_the_stamps_also_between_two_transforms(tmp_path, storage):
    scene = Scene(count=6, shift=0.0043)
    found = frames(scene.write_bag(tmp_path / "bag", storage))
    assert len(found) == 6
    for (time, drawn), (lens, orientation, at, image) in zip(scene.images, found, strict=True):
        expected = scene.orientation(time)
        assert lens == LENS
        assert abs(at - stamp(time).sec - 1e-9 * stamp(time).nanosec) < 1e-6
        assert np.abs(orientation.rotation - expected.rotation).max() < 1e-4
        assert abs(orientation.height - expected.height) < 1e-4
        assert (image == drawn).all()


def test_a_topic_of_poses_replaces_tf(tmp_path):
    scene, messages = Scene(count=4), []
    for time in np.arange(0.0, 0.6, 0.01).round(6).tolist():
        pose = scene.orientation(time)
        place = TYPES.Point(x=OFFSET[0], y=OFFSET[1], z=pose.height)
        header = TYPES.Header(stamp=stamp(time), frame_id="odom")
        message = TYPES.PoseStamped(
            header=header, pose=TYPES.Pose(position=place, orientation=quaternion(pose.rotation))
        )
        messages.append((time, "/pose", "PoseStamped", message))
    messages += [each for each in scene.messages() if not each[1].startswith("/tf")]
    write_messages(tmp_path / "bag", sorted(messages, key=lambda each: each[0]))
    found = frames(tmp_path / "bag", pose=PoseSettings(source="topic:/pose"))
    assert len(found) == 4
    for (time, _), (_, orientation, *_) in zip(scene.images, found, strict=True):
        assert np.abs(orientation.rotation - scene.orientation(time).rotation).max() < 1e-9


def test_compressed_images_are_read(tmp_path):
    scene, messages = Scene(count=2), []
    for time, topic, kind, message in scene.messages():
        if kind == "Image":
            topic, kind = "/camera/image_raw/compressed", "CompressedImage"
            image = message.data.reshape(message.height, message.width, 3)
            message = jpeg_message(TYPES, message.header, image)
        messages.append((time, topic, kind, message))
    write_messages(tmp_path / "bag", messages)
    found = frames(tmp_path / "bag")
    assert len(found) == 2
    for (_, drawn), (lens, _, _, image) in zip(scene.images, found, strict=True):
        assert lens == LENS
        assert np.abs(image.astype(int) - drawn).mean() < 4


def test_what_is_missing_is_named_and_options_replace_it(tmp_path):
    scene = Scene(count=2)
    bag = scene.write_bag(tmp_path / "bag", without=("/tf", "/tf_static", "/camera/camera_info"))
    for *_, trouble in frames(bag):
        assert "no message on /camera/camera_info; give --lens or --fov" in trouble
    for *_, trouble in frames(bag, own_lens=LENS):
        assert "tf has sent no transform yet; give --height, or --pose-source topic:/NAME" in trouble
    fixed = scene.orientation(0.2)
    for lens, orientation, _, image in frames(bag, own_lens=LENS, orientation=fixed):
        assert (lens, orientation) == (None, fixed)
        assert image.shape == (512, 640, 3)


def test_a_wrong_frame_is_named_with_the_nearest(tmp_path):
    bag = Scene(count=1).write_bag(tmp_path / "bag")
    ((*_, trouble),) = frames(bag, ros=RosSettings(plane_frame="base_footprnt"))
    assert "unknown tf frame 'base_footprnt'; did you mean 'base_footprint'?" in trouble


def test_images_after_the_end_of_tf_have_no_pose(tmp_path):
    scene = Scene(count=30)
    late = [each for each in scene.messages() if each[1] != "/tf" or each[0] < 0.5]
    write_messages(tmp_path / "bag", late)
    found = frames(tmp_path / "bag")
    assert len(found) == 30
    assert [isinstance(image, str) for *_, image in found] == [time > 0.59 for time, _ in scene.images]
    assert "newest pose is" in found[-1][3]


@pytest.mark.long
def test_one_of_several_topics_must_be_chosen(tmp_path):
    left, right = Scene(count=2), Scene(count=3)
    messages = [
        *left.messages(),
        *((time, "/right/image_raw", kind, each) for time, _, kind, each in right.messages() if kind == "Image"),
    ]
    write_messages(tmp_path / "bag", sorted(messages, key=lambda each: each[0]))
    one_complaint(
        run(tmp_path / "bag", code=1),
        "has several topics of images; choose one: --ros-image /camera/image_raw or /right/image_raw",
    )
    one_complaint(run(tmp_path / "bag", "--ros-image", "/camera/image_rw", code=1), "did you mean '/camera/image_raw'?")
    assert len(lines(run(tmp_path / "bag", "--ros-image", "/camera/image_raw"))) == 2
    chosen = run(tmp_path / "bag", "--ros-image", "/right/image_raw", "--ros-camera-info", "/camera/camera_info")
    assert len(lines(chosen)) == 3


def test_a_bag_beside_other_sources_and_its_messages(tmp_path):
    scene = Scene(count=2)
    scene.write_frames(tmp_path / "frames")
    bag = scene.write_bag(tmp_path / "bag")
    both = lines(run(bag, tmp_path / "frames"))
    assert [each["frame"] for each in both] == [0, 1, 2, 3]
    assert [each["detections"] for each in both[:2]] == [each["detections"] for each in both[2:]]
    assert both[0]["source"].startswith("bag.mcap at 18000")


def test_a_bag_can_not_be_played_as_a_live_camera(tmp_path):
    bag = Scene(count=1).write_bag(tmp_path / "bag")
    done = run(bag, "--live", code=78)
    assert "a bag can't be played with --live" in json.loads(done.stderr.splitlines()[-1])["reason"]


@pytest.mark.parametrize(
    ("options", "reason"),
    [
        (["--pose-source", "topic:/pse"], "unknown topic '/pse'"),
        (["--ros-camera-info", "/camera/camera_inf"], "did you mean '/camera/camera_info'?"),
        (
            ["--pose-source", "topic:/tf"],
            "topic /tf must have messages of type geometry_msgs/msg/PoseStamped, not tf2_",
        ),
        (["--ros-camera-info", "/tf"], "topic /tf must have messages of type"),
    ],
)
def test_a_topic_that_is_missing_or_of_another_type_is_one_line(tmp_path, options, reason):
    bag = Scene(count=1).write_bag(tmp_path / "bag")
    one_complaint(run(bag, *options, code=1), reason)


@pytest.mark.parametrize("name", ["missing.mcap", "missing.db3"])
def test_a_bag_that_does_not_exist_is_one_line(tmp_path, name):
    one_complaint(run(tmp_path / name, code=1), f"no such bag: {tmp_path / name}")


def test_a_bag_without_images_names_its_topics(tmp_path):
    bag = Scene(count=1).write_bag(tmp_path / "bag", without=("/camera/image_raw",))
    one_complaint(run(bag, code=1), "has no images (its topics: /camera/camera_info, /tf, /tf_static)")


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """The contents of two bags by their suffix."""
    scene, folder = Scene(count=1), tmp_path_factory.mktemp("whole")
    bags = [scene.write_bag(folder / str(each), each) for each in (StoragePlugin.MCAP, StoragePlugin.SQLITE3)]
    return {each.suffix: each.read_bytes() for each in bags}


@pytest.mark.long
@settings(max_examples=150)
@given(data=st.data())
def test_damaged_bags_are_errors_of_one_line(whole, tmp_path_factory, data):
    suffix, content = data.draw(st.sampled_from(sorted(whole.items())))
    damaged = bytearray(content[: data.draw(st.integers(0, len(content))) if data.draw(st.booleans()) else None])
    edge = 3000  # most of a bag are pixels
    places = st.one_of(st.integers(0, edge), st.integers(len(content) - 2 * edge, len(content) - 1))
    for place, value in data.draw(st.lists(st.tuples(places, st.integers(0, 255)), max_size=6)):
        if place < len(damaged):
            damaged[place] = value
    path = tmp_path_factory.mktemp("damaged") / f"bag{suffix}"
    path.write_bytes(damaged)
    complaint = ""
    try:
        frames(path)
    except InputError as error:
        complaint = str(error)
    assert "\n" not in complaint
    assert len(complaint) < 500


def test_folders_and_files_of_bags_are_recognized(tmp_path):
    Scene(count=1).write_bag(tmp_path / "bag")
    assert is_bag(str(tmp_path / "bag"))
    assert is_bag("recording.MCAP")
    assert not is_bag(str(tmp_path))
    assert not is_bag("film.mp4")
