"""Recordings of a real vm-detect."""

import shutil
import signal
import time

import pytest

from tests.drawn_scenes import MODEL
from tests.messages import read_message
from tests.preloaded import run_preloaded
from tests.programs import run_program
from tests.soak.failing_camera import Fault
from tests.vm_embedded.live.running import COMMAND, arguments, running
from vm_embedded.files import locked_folder


@pytest.mark.long
def test_a_recording_is_detected_in_again_bit_by_bit(tmp_path):
    kept = tmp_path / "recordings"
    options = ("--camera", "synthetic", "--recorder-folder", kept, "--recorder-seconds", 0.5)
    with running(tmp_path, *options) as found:
        found.wait(lambda: len(found.frames) > 20)
        done = run_program(*arguments(tmp_path, "--record"))
        assert "frames to" in done.stdout
        found.wait(lambda: [each for each in found.events if each["event"] == "recorded"])
        found.stop()
    (folder,) = kept.iterdir()
    recorded = [read_message(line) for line in (folder / "recording.jsonl").read_text().splitlines()]
    assert len(recorded) > 3
    assert '\nmodel = "ball"\n' in (folder / "vm.toml").read_text()  # on another machine, it is elsewhere
    done = run_program(COMMAND, "--camera", folder)
    again = [read_message(line) for line in done.stdout.splitlines()]
    assert [each["detections"] for each in again] == [each["detections"] for each in recorded]
    assert any(each["detections"] for each in again)


@pytest.mark.long
def test_a_recording_with_an_own_network_is_read_on_another_machine(tmp_path):
    model, kept = tmp_path / "mine.onnx", tmp_path / "recordings"
    shutil.copy(MODEL, model)
    options = ("--camera", "synthetic", "--model", model, "--recorder-folder", kept, "--recorder-seconds", 0.3)
    with running(tmp_path, *options) as found:
        found.wait(lambda: len(found.frames) > 5)
        count_promised(ask_to_record(tmp_path))
        found.wait(lambda: [each for each in found.events if each["event"] == "recorded"])
        found.stop()
    model.unlink()
    (folder,) = kept.iterdir()
    assert count_found(folder.rename(tmp_path / "elsewhere")) > 1


def test_the_sight_of_a_class_and_a_signal_make_recordings(tmp_path):
    kept = tmp_path / "recordings"
    options = ("--recorder-folder", kept, "--recorder-trigger-class", "ball", "--recorder-seconds", 0.3)
    with running(tmp_path, "--camera", "synthetic", *options) as found:
        found.wait(lambda: [each for each in found.events if each["event"] == "recorded"])
        time.sleep(1.1)  # folders have the second in their name
        found.process.send_signal(signal.SIGUSR1)
        found.wait(lambda: len([each for each in found.events if each["event"] == "recorded"]) == 2)
        found.stop()
    assert len(list(kept.iterdir())) == 2


LARGE = ("--camera-width", 1280, "--camera-height", 960, "--recorder-seconds", 60)


def count_promised(done):
    """The number of frames in the reply of vm-detect --record."""
    assert done.returncode == 0, done.stderr
    return int(done.stdout.split()[1])


def ask_to_record(tmp_path):
    return run_preloaded(arguments(tmp_path, "--record"))


def count_found(folder):
    """The number of frames of a recording that vm-detect reads, each with detections like those in its messages."""
    recorded = [read_message(line) for line in (folder / "recording.jsonl").read_text().splitlines()]
    done = run_program(COMMAND, "--camera", folder)
    found = [read_message(line)["detections"] for line in done.stdout.splitlines()]
    assert found[: len(recorded)] == [each["detections"] for each in recorded]
    return len(recorded)


@pytest.mark.long
def test_a_detector_that_is_stopped_finishes_its_recording(tmp_path):
    """Also while reads of the camera hang."""
    kept = tmp_path / "recordings"
    retry = ("--camera-lost-ms", 500, "--camera-open-ms", 5000, "--camera-retry-ms", 10)
    hang = Fault("hang", at=8.0, seconds=100.0)
    with running(tmp_path, *LARGE[:4], "--recorder-folder", kept, *retry, faults=[hang]) as found:
        found.wait(lambda: len(found.frames) > 3)
        found.wait_for_state("camera_lost")
        promised = count_promised(ask_to_record(tmp_path))
        assert found.stop()[0] == 0
        assert [each["level"] for each in found.events if each["event"] == "recorded"] == ["info"]
    (folder,) = kept.iterdir()
    assert count_found(folder) == promised


@pytest.mark.long
def test_a_killed_detector_leaves_a_recording_that_is_read(tmp_path):
    kept = tmp_path / "recordings"
    with running(tmp_path, "--camera", "synthetic", *LARGE, "--recorder-folder", kept) as found:
        found.wait(lambda: len(found.frames) > 20)
        promised = count_promised(ask_to_record(tmp_path))
        found.wait(lambda: len(list(kept.glob("*/lens*.yaml"))) > 2)
        found.stop(signal.SIGKILL)
    (folder,) = kept.iterdir()
    assert folder.suffix == ".part"
    assert 0 < count_found(folder) <= promised


@pytest.mark.long
def test_the_next_detector_finishes_recordings_of_a_killed_one_and_nothing_else(tmp_path):
    kept = tmp_path / "recordings"
    options = ("--camera", "synthetic", *LARGE, "--recorder-folder", kept)
    with running(tmp_path, *options) as found:
        found.wait(lambda: len(found.frames) > 20)
        count_promised(ask_to_record(tmp_path))
        found.wait(lambda: len(list(kept.glob("*/lens*.yaml"))) > 2)
        found.stop(signal.SIGKILL)
    (left,) = kept.iterdir()
    assert left.suffix == ".part"
    whole, empty = kept / "2026-01-01T00-00-00.000", kept / "2026-01-02T00-00-00.000.part"
    others = kept / "mine.part", kept / "2026-01-03T00-00-00.000.part"
    for each in (whole, empty, *others):
        each.mkdir()
        (each / "image0000000.png").write_bytes(bytes(5000))
    (whole / "recording.jsonl").write_bytes(b"{}\n")
    (others[0] / "recording.jsonl").write_bytes(b"{}\n")
    (kept / "2026-01-04T00-00-00.000.part").symlink_to(tmp_path)
    with locked_folder(others[1]), running(tmp_path, *options) as found:  # as if another detector wrote it
        found.wait_for_state("ok")
        told = [each["folder"] for each in found.events if each["event"] == "recorded"]
        found.stop()
    assert count_found(kept / left.stem) > 0
    assert [each.partition(": ")[2] for each in told] == [
        "removed, because it has no frames: the detector was killed",
        f"only {count_found(kept / left.stem)} frames: the detector was killed",
    ]
    assert {each.name for each in kept.iterdir()} == {
        *(whole.name, left.stem, "mine.part", "2026-01-03T00-00-00.000.part", "2026-01-04T00-00-00.000.part")
    }
    with running(tmp_path, *options, "--recorder-disk-mib", 1) as found:
        found.wait_for_state("ok")
        found.stop()
    assert not whole.exists()  # it is the oldest of more than 1 MiB
    assert (kept / left.stem).exists()


@pytest.mark.long
def test_a_recording_larger_than_its_limit_keeps_its_first_frames(tmp_path):
    kept = tmp_path / "recordings"
    with running(
        tmp_path, "--camera", "synthetic", *LARGE, "--recorder-folder", kept, "--recorder-disk-mib", 5
    ) as found:
        found.wait(lambda: len(found.frames) > 20)
        promised = count_promised(ask_to_record(tmp_path))
        (event,) = found.wait(lambda: [each for each in found.events if each["event"] == "recorded"])
        found.stop()
    (folder,) = kept.iterdir()
    written = count_found(folder)
    assert 0 < written < promised
    assert event["level"] == "warning"
    assert f"only {written} of {promised} frames: it is larger than [recorder] disk_mib, 5 MiB" in event["folder"]


@pytest.mark.long
def test_a_recording_that_can_not_be_written_is_refused(tmp_path):
    kept = tmp_path / "recordings"
    kept.touch()
    with running(tmp_path, "--camera", "synthetic", "--recorder-folder", kept) as found:
        found.wait(lambda: len(found.frames) > 3)
        done = ask_to_record(tmp_path)
        (event,) = found.wait(lambda: [each for each in found.events if each["event"] == "not recorded"])
        found.stop()
    assert event["level"] == "warning"
    assert (done.returncode, done.stdout) == (1, "")
    assert "Not a directory" in done.stderr


@pytest.mark.long
def test_a_recording_that_a_class_triggers_and_that_can_not_be_written_is_logged_once_per_pause(tmp_path):
    kept = tmp_path / "recordings"
    kept.touch()
    options = ("--recorder-folder", kept, "--recorder-trigger-class", "ball")
    with running(tmp_path, "--camera", "synthetic", *options) as found:
        found.wait(lambda: sum(len(each["detections"]) for each in found.frames) > 10)
        found.stop()
    (event,) = [each for each in found.events if each["event"] == "not recorded"]
    assert "Not a directory" in event["folder"]
