"""vm-detect --save-mcap: what it writes is read back by rosbags, and by vm-detect itself."""

import signal
import subprocess
from collections import Counter
from functools import partial

import cv2
import numpy as np
import pytest
from rosbags.highlevel import AnyReader

from tests.programs import limit_files
from tests.vm_embedded.cameras.ros.rolling_ball import Scene
from tests.vm_embedded.cli.commands import COMMAND, lines, one_complaint, run
from tests.vm_embedded.output.features import DEMO
from vm_embedded import read_lens_file
from vm_embedded.cameras.ros.bags import BagReading, open_bag
from vm_embedded.output.ros.topics import TOPICS


def messages_of(path):
    """All messages of a file by topic."""
    found = {}
    with AnyReader([path]) as reader:
        for connection, _, data in reader.messages():
            found.setdefault(connection.topic, []).append(reader.deserialize(data, connection.msgtype))
    return found


@pytest.fixture
def scene_folder(tmp_path):
    Scene(count=5).write_frames(tmp_path / "frames")
    return tmp_path / "frames"


def test_pictures_detections_and_states_are_in_the_file(tmp_path, scene_folder):
    path = tmp_path / "out.mcap"
    (scene_folder / "image002.png").write_bytes(b"no image")
    done = run(scene_folder, "--save-mcap", path)
    one_complaint(done, "image002.png")
    printed = lines(done)
    found = messages_of(path)
    assert sorted(path.parent.iterdir()) == [scene_folder, path]
    assert len(printed) == 4
    arrays = found["/vm_ros/detections_3d"]
    for line, array, boxes, drawn in zip(
        printed, arrays, found["/vm_ros/detections_2d"], found["/vm_ros/annotations"], strict=True
    ):
        assert array.header.frame_id == "base_footprint"
        expected = line["detections"]
        assert len(array.detections) == len(boxes.detections) == len(drawn.points) == len(drawn.texts) == len(expected)
        for each, place, box in zip(expected, array.detections, boxes.detections, strict=True):
            position = place.results[0].pose.pose.position
            assert np.abs(np.array([position.x, position.y, position.z]) - each["position"]).max() <= 0.00051
            assert abs(box.bbox.center.position.x - each["center"][0]) < 1.0
    pictures = [cv2.imdecode(each.data, cv2.IMREAD_COLOR) for each in found["/camera/image/compressed"]]
    assert [each.shape for each in pictures] == [(512, 640, 3)] * 4
    states = [{each.key: each.value for each in message.status[0].values} for message in found["/diagnostics"]]
    assert [each["state"] for each in states] == ["ok", "ok", "degraded", "ok", "ok"]
    assert "image002.png" in states[2]["reason"]
    assert [message.status[0].level for message in found["/diagnostics"]] == [0, 0, 1, 0, 0]


@pytest.mark.long
def test_pictures_of_bayer_patterns_have_colors_in_the_file(tmp_path, scene_folder):
    for path in scene_folder.glob("image*"):
        colors = cv2.imread(str(path))
        mosaic = colors[:, :, 1].copy()
        mosaic[::2, ::2], mosaic[1::2, 1::2] = colors[::2, ::2, 2], colors[1::2, 1::2, 0]
        cv2.imwrite(str(path), mosaic)
    run(scene_folder, "--save-mcap", tmp_path / "out.mcap", "--format", "bayer_rggb")
    picture = cv2.imdecode(messages_of(tmp_path / "out.mcap")["/camera/image/compressed"][-1].data, cv2.IMREAD_COLOR)
    assert np.abs(picture.astype(float) - colors).mean() < 10.0


@pytest.mark.long
def test_the_file_is_a_bag_with_lens_and_poses(tmp_path, scene_folder):
    path = tmp_path / "out.mcap"
    first = lines(run(scene_folder, "--save-mcap", path))
    again = lines(run(path))
    assert [len(each["detections"]) for each in again] == [len(each["detections"]) for each in first]
    for one, other in zip(first, again, strict=True):
        for each, found in zip(one["detections"], other["detections"], strict=True):
            assert np.abs(np.subtract(each["position"], found["position"])).max() < 0.02  # the pictures are JPEG


@pytest.mark.long
def test_each_lens_and_pose_of_the_demo_is_read_back(tmp_path):
    """Of all projections, with and without distortion, also where a jump of one camera would be impossible."""
    done = run(DEMO, "--save-mcap", tmp_path / "out.mcap")
    frames = list(open_bag(str(tmp_path / "out.mcap"), BagReading()).frames)
    assert len(frames) == len(lines(done)) == 12
    for path, frame in zip(sorted(DEMO.glob("lens*.yaml")), frames, strict=True):
        file, image = read_lens_file(path), frame.read()
        size = image.shape[1::-1]
        pixels = np.random.default_rng(1).uniform(0.0, np.array(size) - 1.0, (200, 2))
        rays = file.lens.unproject(pixels, size)
        seen = np.isfinite(rays).all(axis=1)
        seen[seen] = file.lens.sees(rays[seen])
        assert np.abs(frame.lens.project(rays[seen], size) - pixels[seen]).max() < 0.1
        assert np.allclose(frame.orientation.rotation, file.orientation.rotation, atol=1e-9)
        assert np.isclose(frame.orientation.height, file.orientation.height)


def test_all_features_are_in_the_file(tmp_path):
    """rosbags reads as many of each as the lines of JSON have."""
    done = run(DEMO, "--model", "soccer", "--save-mcap", tmp_path / "out.mcap", "--save-map", tmp_path / "maps")
    found = messages_of(tmp_path / "out.mcap")
    assert {f"/vm_ros/{name}" for name in TOPICS} <= found.keys()
    count = Counter()
    for number, line in enumerate(lines(done)):
        field = line["field"]
        balls, posts, robots, marks, border, drawn = (
            found[f"/vm_ros/{name}"][number]
            for name in ("balls", "goalposts", "robots", "markings", "field_boundary", "map/compressed")
        )
        things = (
            *((balls.balls, line["detections"]), (posts.posts, field["posts"]), (robots.robots, field["robots"])),
            *((marks.segments, field["lines"]), (marks.intersections, field["crossings"])),
            *((marks.ellipses, [field["circle"]] * bool(field["circle"])),),
            (border.points, field["border"]["points"] if field["border"] else []),
        )
        for kind, (one, other) in enumerate(things):
            assert len(one) == len(other)
            count[kind] += len(one)
        picture = cv2.imdecode(drawn.data, cv2.IMREAD_COLOR)
        assert picture.shape == cv2.imread(str(tmp_path / "maps" / f"image{number:07d}-map.png")).shape
    assert all(count[kind] for kind in range(7)), count


@pytest.mark.long
def test_the_stamps_of_a_bag_stay(tmp_path):
    bag = Scene(count=3).write_bag(tmp_path / "bag")
    run(bag, "--save-mcap", tmp_path / "out.mcap")
    with AnyReader([bag]) as one, AnyReader([tmp_path / "out.mcap"]) as other:
        stamps = [
            [
                (stamp.sec, round(stamp.nanosec, -3))
                for connection, _, data in reader.messages()
                if connection.topic in ("/camera/image_raw", "/vm_ros/detections_2d")
                for stamp in [reader.deserialize(data, connection.msgtype).header.stamp]
            ]
            for reader in (one, other)
        ]
    assert stamps[0] == stamps[1]
    assert len(stamps[0]) == 3


@pytest.mark.long
def test_frames_before_an_interrupt_are_in_the_file(tmp_path):
    Scene(count=40).write_frames(tmp_path / "frames")
    path = tmp_path / "out.mcap"
    # The pipe has room for a few lines, so that the command can't end before the interrupt. A shell that starts the
    # tests in the background lets them ignore interrupts.
    process = subprocess.Popen(
        [COMMAND, tmp_path / "frames", "--save-mcap", path],
        bufsize=0,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        pipesize=4096,
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
    )
    try:
        for _ in range(3):
            assert process.stdout.readline()
        process.send_signal(signal.SIGINT)
        rest, errors = process.communicate(timeout=60)
    finally:
        process.kill()
    assert process.returncode == 130, errors
    count = 3 + len(rest.splitlines())
    assert count < 40
    assert count <= len(messages_of(path)["/vm_ros/detections_3d"]) <= count + 1


@pytest.mark.long
@pytest.mark.parametrize("share", [0.0, 0.5, 0.999])
def test_a_full_disk_is_named_and_the_old_file_stays(share, tmp_path, scene_folder):
    """At the start, in a frame, and at the end, when the index is written."""
    path = tmp_path / "out.mcap"
    run(scene_folder, "--save-mcap", path)
    before = path.read_bytes()
    limit = partial(limit_files, int(share * len(before)))
    done = run(scene_folder, "--save-mcap", path, code=1, preexec_fn=limit)
    one_complaint(done, f"can't write {path}: File too large")
    assert sorted(tmp_path.iterdir()) == [scene_folder, path]
    assert path.read_bytes() == before


def test_without_a_frame_the_old_file_stays(tmp_path, scene_folder):
    path, boxes = tmp_path / "out.mcap", tmp_path / "boxes"
    path.write_bytes(b"old")
    boxes.mkdir()
    (boxes / "image.txt").write_text("")
    one_complaint(run(scene_folder, "--save-mcap", path, "--save-boxes", boxes, code=1), "is not empty")
    assert path.read_bytes() == b"old"
    assert sorted(tmp_path.iterdir()) == [boxes, scene_folder, path]


@pytest.mark.parametrize(
    ("name", "reason"),
    [("out.bag", "must end in .mcap, not 'out.bag'"), ("missing/out.mcap", "there is no folder")],
)
def test_a_name_that_can_not_be_written_is_one_line(tmp_path, scene_folder, name, reason):
    one_complaint(run(scene_folder, "--save-mcap", tmp_path / name, code=1), reason)


def test_other_things_beside_the_file_stay_and_do_not_matter(tmp_path, scene_folder):
    """Also of a name that is as long as names can be, and if the file is a link."""
    path, link = tmp_path / ("m" * 250 + ".mcap"), tmp_path / "out.mcap"
    (tmp_path / "out.mcap.part").mkdir()
    (tmp_path / "out.mcap.part" / "own.txt").write_text("mine")
    link.symlink_to(path)
    run(scene_folder, "--save-mcap", link)
    assert len(messages_of(path)["/vm_ros/detections_3d"]) == 5
    assert link.is_symlink()
    assert (tmp_path / "out.mcap.part" / "own.txt").read_text() == "mine"
    assert sorted(tmp_path.iterdir()) == [scene_folder, path, link, tmp_path / "out.mcap.part"]


@pytest.mark.long
def test_a_killed_run_does_not_block_the_next(tmp_path, scene_folder):
    path = tmp_path / "out.mcap"
    process = subprocess.Popen(
        [COMMAND, scene_folder, "--save-mcap", path], stdout=subprocess.PIPE, stderr=subprocess.DEVNULL
    )
    try:
        assert process.stdout.readline()
    finally:
        process.kill()
        process.communicate()
    left = {each.name for each in tmp_path.iterdir()} - {"frames", "out.mcap"}
    run(scene_folder, "--save-mcap", path)
    assert len(messages_of(path)["/vm_ros/detections_3d"]) == 5
    assert all(name.startswith(".out.mcap.") and name.endswith(".part") for name in left)
    assert {each.name for each in tmp_path.iterdir()} == {"frames", "out.mcap", *left}


@pytest.mark.long
def test_of_two_runs_into_one_file_each_is_whole(tmp_path, scene_folder):
    path = tmp_path / "out.mcap"
    command = [COMMAND, scene_folder, "--save-mcap", path]
    started = [subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE) for _ in range(2)]
    assert [(each.communicate(timeout=120)[1], each.returncode) for each in started] == [(b"", 0)] * 2
    assert len(messages_of(path)["/vm_ros/detections_3d"]) == 5
    assert sorted(tmp_path.iterdir()) == [scene_folder, path]
