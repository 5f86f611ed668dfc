"""What vm-doctor finds on a good machine and on bad ones."""

import os
import re
from dataclasses import replace

import cv2
import numpy as np
import pytest

from tests.drawn_scenes import FOLDER
from tests.rooms import CHECKOUT
from tests.vm_embedded.cameras.mjpeg_server import Server
from vm_embedded.cameras.camera import CameraSettings, Shot
from vm_embedded.cli.camera_source import SourceFacts, check_source, samples_of
from vm_embedded.cli.checks import check_lens, check_pose, run_checks
from vm_embedded.cli.finding import BAD, GOOD, WARNING
from vm_embedded.cli.frame_trial import check_detection
from vm_embedded.cli.machine_checks import check_clock, check_opencv, check_threads
from vm_embedded.detection.settings import Settings
from vm_embedded.geometry.lens_files import LensFile, format_lens_file
from vm_embedded.geometry.radial_lenses import Equisolid, Rectilinear
from vm_embedded.live.configuration import Configuration, FixedPose, StatusSettings
from vm_embedded.network.bundled import model_path
from vm_embedded.network.model_file import read_model
from vm_embedded.poses.settings import PoseSettings

HEALTHY = Configuration(
    camera=CameraSettings(source="synthetic", width=640, height=512),
    lens=LensFile(Equisolid(focal_length=300.0, fov=2.0, size=(1280, 1024)), None),
)


@pytest.fixture
def root(tmp_path):
    """A machine on which everything is right."""
    for name, text in (
        ("proc/cpuinfo", "model name : A\nflags : avx2 fma\nmodel name : A\nflags : avx2 fma avx512f\n"),
        ("sys/devices/system/cpu/cpu0/cpufreq/scaling_governor", "performance\n"),
        ("sys/devices/system/clocksource/clocksource0/current_clocksource", "tsc\n"),
    ):
        path = tmp_path / name
        path.parent.mkdir(parents=True)
        path.write_text(text)
    (tmp_path / "dev").mkdir()
    return tmp_path


def found(configuration, root):
    return {each.about: each for each in run_checks(configuration, root)}


def test_a_machine_without_faults_has_none(root):
    assert {each.state for each in run_checks(HEALTHY, root)} == {GOOD}


def test_a_slow_processor_a_slow_governor_and_a_slow_clock_are_seen(root):
    (root / "proc/cpuinfo").write_text("model name : Old\nflags : sse2\n")
    (root / "sys/devices/system/cpu/cpu0/cpufreq/scaling_governor").write_text("powersave\n")
    (root / "sys/devices/system/clocksource/clocksource0/current_clocksource").write_text("hpet\n")
    seen = found(HEALTHY, root)
    assert [seen[name].state for name in ("processor", "governor", "clock")] == [WARNING] * 3
    assert "no avx2 and no fma" in seen["processor"].seen
    assert "scaling_governor" in seen["governor"].mend


@pytest.mark.long
def test_the_processor_of_a_jetson_or_a_raspberry_pi_is_known(root):
    (root / "proc/cpuinfo").write_text("processor : 0\nFeatures : fp asimd evtstrm\nCPU part : 0xd0b\n")
    assert (found(HEALTHY, root)["processor"].state, found(HEALTHY, root)["processor"].seen) == (GOOD, "ARM: asimd")
    (root / "proc/cpuinfo").write_text("processor : 0\nFeatures : fp\n")
    assert "no asimd" in found(HEALTHY, root)["processor"].seen


@pytest.mark.long
def test_the_password_of_a_camera_is_not_shown(root):
    for source in ("rtsp://user:s@cret@10.0.0.7/1", "http://user:s@cret@:0/"):
        camera = replace(HEALTHY.camera, source=source)
        assert "cret" not in found(replace(HEALTHY, camera=camera), root)["camera"].seen


def test_more_threads_than_cores_are_seen():
    assert check_threads(4, 2, 8).state == WARNING
    assert "--threads 2" in check_threads(4, 2, 8).mend
    assert check_threads(2, 2, 8).state == GOOD


def test_two_wheels_of_opencv_are_seen():
    finding = check_opencv({"opencv-python", "opencv-python-headless", "numpy"})
    assert finding.state == BAD
    assert "pip uninstall" in finding.mend


def test_a_wrong_clock_is_seen(tmp_path):
    assert "timedatectl" in check_clock(tmp_path / "none", 1e9).mend


@pytest.mark.long
def test_a_camera_that_is_not_there_or_may_move_is_seen(root):
    wanted = replace(HEALTHY, camera=CameraSettings(source="0"))
    assert found(wanted, root)["camera"].state == BAD
    (root / "dev" / "video0").write_text("")
    assert found(wanted, root)["camera"].state == WARNING
    by_id = replace(HEALTHY, camera=CameraSettings(source="/dev/v4l/by-id/usb-camera"))
    assert found(by_id, root)["camera"].state == BAD


def test_a_camera_that_may_not_be_opened_is_seen(root, monkeypatch):
    (root / "dev" / "video0").write_text("")
    monkeypatch.setattr(os, "access", lambda path, mode: "video" not in str(path))  # root may open everything
    node = found(HEALTHY, root)[str(root / "dev" / "video0")]
    assert node.state == BAD
    assert "usermod -aG video" in node.mend


def test_a_model_that_is_none_is_seen(root, tmp_path):
    (tmp_path / "model.onnx").write_text("no model")
    assert found(replace(HEALTHY, model=str(tmp_path / "model.onnx")), root)["model"].state == BAD


@pytest.mark.long
def test_a_lens_for_another_size_is_seen(root):
    other = replace(HEALTHY, camera=CameraSettings(source="synthetic", width=640, height=480))
    assert found(other, root)["lens"].state == BAD
    assert "other proportions" in found(other, root)["lens"].seen
    file = CameraSettings(source=str(root))
    assert found(replace(HEALTHY, lens=None, camera=file), root)["lens"].state == WARNING
    assert found(replace(HEALTHY, lens=None), root)["lens"].seen == "synthetic has its own"
    without = replace(HEALTHY, lens=LensFile(Equisolid(focal_length=300.0, fov=2.0), None))
    assert found(without, root)["lens"].state == WARNING
    assert "size: [width, height] in YAML" in found(without, root)["lens"].mend


@pytest.mark.long
def test_files_that_are_no_pictures_are_seen(root, tmp_path):
    (tmp_path / "note.txt").write_text("no picture")
    (tmp_path / "empty").mkdir()
    for name, says in (("note.txt", "neither an image"), ("empty", "no images"), ("none.mp4", "no such image")):
        camera = CameraSettings(source=str(tmp_path / name))
        seen = found(replace(HEALTHY, camera=camera), root)["camera"]
        assert (seen.state, says in seen.seen) == (BAD, True), seen


@pytest.mark.long
def test_a_topic_and_a_pattern_of_pictures_are_cameras(root, tmp_path):
    cv2.imwrite(str(tmp_path / "image.png"), np.zeros((512, 640, 3), dtype=np.uint8))
    for source in ("ros", str(tmp_path / "*.png")):
        seen = found(replace(HEALTHY, camera=CameraSettings(source=source)), root)
        assert (seen["camera"].state, seen["lens"].state) == (GOOD, GOOD), seen


@pytest.mark.long
def test_a_lens_for_other_pictures_is_seen(root, tmp_path):
    cv2.imwrite(str(tmp_path / "image.png"), np.zeros((480, 640, 3), dtype=np.uint8))
    lens = found(replace(HEALTHY, camera=CameraSettings(source=str(tmp_path / "image.png"))), root)["lens"]
    assert (lens.state, "the image has 640 x 480 px" in lens.seen) == (BAD, True), lens
    cv2.imwrite(str(tmp_path / "image.png"), np.zeros((512, 640, 3), dtype=np.uint8))
    lens = found(replace(HEALTHY, camera=CameraSettings(source=str(tmp_path / "image.png"))), root)["lens"]
    assert (lens.state, "fits the camera" in lens.seen) == (GOOD, True), lens


def test_a_height_in_other_units_is_seen(root):
    pose = found(replace(HEALTHY, orientation=FixedPose(height=1289.0)), root)["pose"]
    assert (pose.state, pose.mend) == (WARNING, "heights are in meters")


def test_a_lens_center_that_is_a_position_is_seen(root):
    lens = replace(HEALTHY.lens.lens, center=(650.0, 500.0))
    finding = found(replace(HEALTHY, lens=LensFile(lens, None)), root)["lens"]
    assert finding.state == WARNING
    assert "center [650.0, 500.0] px is far from the middle" in finding.seen


def test_a_lens_in_other_units_is_seen():
    millimeters = Rectilinear(focal_length=3.6, fov=1.66, size=(1280, 1024))
    for lens in (millimeters, replace(millimeters, size=None)):
        finding = check_lens(replace(HEALTHY, lens=LensFile(lens, None)), SourceFacts((640, 512)))
        assert (finding.state, "a circle of 7.8" in finding.seen, "not in mm" in finding.mend) == (WARNING, True, True)


def test_pictures_with_lens_files_bring_lens_and_pose(root):
    seen = found(Configuration(camera=CameraSettings(source=str(FOLDER))), root)
    assert [seen[name].state for name in ("camera", "lens", "pose")] == [GOOD, GOOD, GOOD]
    assert "lens0000000.yaml belongs to the first image" in seen["lens"].seen
    assert seen["pose"].seen.startswith("height 0.")


def test_lens_files_without_a_pose_need_one(root, tmp_path):
    cv2.imwrite(str(tmp_path / "image7.png"), np.zeros((512, 640, 3), dtype=np.uint8))
    (tmp_path / "lens7.yaml").write_text(format_lens_file(HEALTHY.lens.lens, None))
    given = Configuration(camera=CameraSettings(source=str(tmp_path)))
    source = check_source(given)
    assert (check_lens(given, source).state, check_pose(given, source, None).state) == (GOOD, WARNING)
    assert check_pose(replace(given, orientation=FixedPose(height=0.6)), source, None).state == GOOD
    (tmp_path / "lens7.yaml").write_text("projection: EQUISOLDI\n")
    assert "lens7.yaml" in found(given, root)["camera"].seen


def test_a_bag_brings_lens_and_pose(tmp_path):
    (tmp_path / "game.mcap").touch()
    given = Configuration(camera=CameraSettings(source=str(tmp_path / "game.mcap")))
    source = check_source(given)
    assert (check_lens(given, source).state, check_pose(given, source, None).state) == (GOOD, GOOD)


@pytest.mark.parametrize(("height", "radius"), [(0.9, 7.5), (0.075, 0.6), (0.15, None)])
def test_an_object_that_is_too_large_for_the_height_of_the_camera_is_seen(height, radius):
    given = replace(HEALTHY, orientation=FixedPose(height=height), detector=Settings(object_radius=radius))
    model = read_model(model_path(given.model))
    pose = check_pose(given, SourceFacts(), model)
    assert (pose.state, "camera height must be above the ball's diameter" in pose.seen) == (BAD, True)
    for allowed in (
        replace(given, pose=PoseSettings(source="udp:0.0.0.0:5600")),
        replace(given, orientation=FixedPose(height=16.0)),
    ):
        assert check_pose(allowed, SourceFacts(), model).state == GOOD


@pytest.mark.long
def test_a_live_camera_without_lens_or_pose_is_a_failure_of_these_and_not_of_the_model(root):
    noise = np.random.default_rng(0).integers(0, 256, (9, 64, 80, 3)).astype(np.uint8)
    server = Server([cv2.imencode(".jpg", each)[1].tobytes() for each in noise])
    source = server.address
    seen = found(Configuration(camera=CameraSettings(source=source)), root)
    server.kill()
    assert [seen[name].state for name in ("model", "camera", "lens", "pose")] == [GOOD, GOOD, BAD, BAD]
    low = FixedPose(height=0.5, pitch=0.1)
    given = Configuration(camera=CameraSettings(source=source), orientation=low, fov=1.0)
    seen = found(given, root)
    assert "refused" in seen["camera"].seen
    assert [seen[name].state for name in ("camera", "lens", "pose")] == [BAD, GOOD, GOOD]
    assert seen["pose"].seen == "height 0.5 m, pitch 5.7 deg, roll 0 deg"


def detection(given, shots=()):
    """What vm-doctor says about the detection in frames."""
    return check_detection(read_model(model_path(given.model)), given.detector, samples_of(given, shots))


def test_what_the_detector_sees_in_the_frames_is_shown():
    demo = Configuration(camera=CameraSettings(source=str(CHECKOUT / "tests/fixtures/demo")))
    seen = detection(demo)
    assert seen.state == GOOD
    assert re.search(r"5 frames has \d+ to \d+ points, \d+ to \d+ proposals, (1|\d to \d) ball$", seen.seen), seen
    small = detection(replace(demo, detector=Settings(object_radius=0.3)))
    assert (small.state, "0 ball" in small.seen, "0.3" in small.mend) == (WARNING, True, True), small


def test_what_the_detector_sees_through_a_camera_is_shown():
    images = [cv2.imread(str(CHECKOUT / f"tests/fixtures/demo/image000000{each}.jpg")) for each in range(2)]
    shots = [Shot(each, 0.0) for each in images]
    given = Configuration(camera=CameraSettings(source="/dev/video0"), fov=1.2)
    assert samples_of(given, shots) == []
    posed = replace(given, orientation=FixedPose(height=0.66, pitch=0.39))
    assert len(samples_of(posed, shots)) == 2
    assert samples_of(replace(posed, pose=PoseSettings(source="udp:0.0.0.0:5600")), shots) == []
    up = detection(replace(posed, orientation=FixedPose(height=0.66, pitch=-1.5)), shots)
    assert (up.state, "2 frames has 0 points" in up.seen, "--pitch" in up.mend) == (WARNING, True, True), up


def test_frames_that_do_not_fit_the_lens_are_a_failure_of_the_detection():
    narrow = replace(HEALTHY.lens.lens, size=(1280, 960))
    given = Configuration(
        camera=CameraSettings(source="0"), lens=LensFile(narrow, None), orientation=FixedPose(height=0.6)
    )
    seen = detection(given, [Shot(np.zeros((512, 640, 3), dtype=np.uint8), 0.0)])
    assert (seen.state, "640 x 512" in seen.seen) == (BAD, True), seen


@pytest.mark.long
def test_where_poses_come_from_is_shown(root):
    seen = found(replace(HEALTHY, pose=PoseSettings(source="udp:0.0.0.0:5600")), root)["pose"]
    assert (seen.state, seen.seen) == (GOOD, "from udp:0.0.0.0:5600")
    seen = found(replace(HEALTHY, orientation=FixedPose(pitch=0.1)), root)["pose"]
    assert (seen.state, seen.seen) == (BAD, "pitch and roll need a height: give --height")


def test_a_folder_that_systemd_will_create_is_no_fault(root, monkeypatch):
    monkeypatch.setenv("RUNTIME_DIRECTORY", "/nowhere/at/all")
    status = found(HEALTHY, root)["status socket"]
    assert (status.state, status.seen) == (GOOD, "/nowhere/at/all/vm-detect.sock; systemd creates its folder")


def test_every_fault_has_a_command_that_mends_it(root):
    broken = Configuration(camera=CameraSettings(source="9"), status=StatusSettings(socket="/nowhere/at/all"))
    for each in run_checks(broken, root):
        assert each.state == GOOD or each.mend, each
