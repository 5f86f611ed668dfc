"""vm-detect --track: on a live camera, on its recording, on a video and on images."""

import shutil
import subprocess

import cv2
import numpy as np
import pytest

from tests.messages import read_message
from tests.vm_embedded.cli.commands import COMMAND, lines, one_complaint, run
from tests.vm_embedded.live.running import DEMO, arguments, running
from vm_embedded.cameras.camera import CameraSettings
from vm_embedded.cameras.synthetic import Motion, SyntheticCamera


def tracks(messages):
    return [each["track"] for message in messages for each in message["detections"]]


@pytest.mark.long
def test_a_live_camera_and_its_recording_have_tracks(tmp_path):
    kept = tmp_path / "recordings"
    configuration = tmp_path / "vm.toml"
    configuration.write_text("[track]\non = true\nforget = 2\n")
    options = ("--config", configuration, "--recorder-folder", kept, "--recorder-seconds", 1)
    with running(tmp_path, "--camera", "synthetic", *options) as found:
        found.wait(lambda: sum(len(each["detections"]) for each in found.frames) > 40)
        subprocess.run(arguments(tmp_path, "--record"), capture_output=True, timeout=60, check=True)
        found.wait(lambda: [each for each in found.events if each["event"] == "recorded"])
        found.stop()
    assert all("track" in each["timing_ms"] for each in found.frames)
    off, speeds = [], []
    for each in found.frames:
        for ball in each["detections"]:
            truth = Motion()
            off.append(np.linalg.norm(truth.ball(each["t"]) - ball["track"]["position"]))
            moving = (truth.ball(each["t"] + 0.01) - truth.ball(each["t"] - 0.01)) / 0.02
            speeds.append(np.linalg.norm(moving[:2] - ball["track"]["velocity"]))
    assert len({each["id"] for each in tracks(found.frames)}) < 4  # a new ball only after a pause of the machine
    assert np.median(off) < 0.05
    assert np.median(speeds) < 0.5
    (folder,) = kept.iterdir()
    replayed = lines(run("--camera", folder))
    recorded = [read_message(line) for line in (folder / "recording.jsonl").read_text().splitlines()]
    times = [each["t"] - recorded[0]["t"] for each in recorded]
    assert [each["stamp"] for each in replayed] == pytest.approx(times, abs=2e-6)
    assert tracks(replayed)[0]["id"] == 1
    assert len(tracks(replayed)) == sum(len(each["detections"]) for each in recorded)


@pytest.fixture(scope="module")
def film(tmp_path_factory):
    """A folder with images of a rolling ball, as a camera sees it that stands still, and a video of them."""
    folder = tmp_path_factory.mktemp("film")
    camera = SyntheticCamera(CameraSettings(source="synthetic:0"))
    orientation = camera.motion.orientation(0.0)
    camera.motion = Still(orientation)
    writer = cv2.VideoWriter(str(folder / "film.avi"), cv2.VideoWriter.fourcc(*"MJPG"), 10.0, camera.size)
    (folder / "images").mkdir()
    for number in range(8):
        image = camera.draw(0.1 * number)
        writer.write(image)
        cv2.imwrite(str(folder / "images" / f"{number}.png"), image)
    writer.release()
    return folder


class Still(Motion):
    """The usual ball in front of a camera that does not move."""

    def __init__(self, orientation):
        super().__init__(0.0)
        object.__setattr__(self, "fixed", orientation)

    def orientation(self, time):
        return self.fixed


def pose(film):
    """The options for lens and pose of the film's camera."""
    lens = film / "lens.toml"
    lens.write_text('projection = "rectilinear"\nfocal_length = 448\nfov = 1.75\nsize = [640, 512]\n')
    orientation = Motion().orientation(0.0)
    return ("--lens", lens, "--height", orientation.height, "--pitch", orientation.pitch, "--roll", orientation.roll)


def test_a_video_has_times_and_images_need_their_rate(film):
    from_video = lines(run(film / "film.avi", "--track", *pose(film)))
    assert [each["stamp"] for each in from_video] == pytest.approx(0.1 * np.arange(8))
    from_images = lines(run(film / "images", "--track", "--camera-fps", 10, *pose(film)))
    for found in (from_video, from_images):
        assert {each["id"] for each in tracks(found)} == {1}
        assert len(tracks(found)) == 8
        velocity = (Motion(0.0).ball(0.7) - Motion(0.0).ball(0.5))[:2] / 0.2
        assert np.linalg.norm(tracks(found)[-1]["velocity"] - velocity) < 0.3
    one_complaint(run(film / "images", "--track", *pose(film), code=1), "--track", "--camera-fps", "--no-track")
    assert "track" not in lines(run(film / "images", *pose(film)))[0]["detections"][0]


def test_tracks_are_in_pictures(film, tmp_path):
    for options in ((), ("--track",)):
        run(film / "film.avi", "--save-overlay", tmp_path / str(len(options)), *options, *pose(film))
    plain, tracked = (cv2.imread(str(tmp_path / each / "film-000007.jpg")) for each in "01")
    assert np.count_nonzero(np.abs(plain.astype(int) - tracked).max(axis=2) > 60) > 100


def test_a_folder_of_a_recording_that_was_cut_off_has_the_times_that_were_written(tmp_path):
    for number in range(3):
        shutil.copy(DEMO / "image0000002.jpg", tmp_path / f"image{number:07d}.jpg")
        shutil.copy(DEMO / "lens0000002.yaml", tmp_path / f"lens{number:07d}.yaml")
    (tmp_path / "recording.jsonl").write_text('{"t": 100.5}\n{"t": 100.75}\n{"t": 10')
    done = run("--camera", tmp_path, "--track")
    assert [each["stamp"] for each in lines(done)] == [0.0, 0.25]
    one_complaint(done, "image0000002.jpg", "--camera-fps")


def test_bad_settings_are_named(tmp_path):
    (tmp_path / "vm.toml").write_text("[track]\ngate = 0.5\n")
    done = run(DEMO / "image0000002.jpg", "--track", "--config", tmp_path / "vm.toml", code=1)
    one_complaint(done, "vm.toml, line 2: [track] gate must be a", " from ", "not 0.5")


def test_the_help_has_the_switch():
    done = subprocess.run([COMMAND, "--help"], capture_output=True, text=True, check=True)
    assert "--track, --no-track" in done.stdout
