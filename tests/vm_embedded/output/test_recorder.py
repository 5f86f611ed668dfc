"""Recordings of a real vm-detect."""

import json
import signal
import subprocess
import time

from tests.vm_embedded.live.running import COMMAND, arguments, running


def test_a_recording_is_detected_in_again_bit_by_bit(tmp_path):
    kept = tmp_path / "recordings"
    options = ("--camera", "synthetic", "--recorder-folder", kept, "--recorder-seconds", 0.5)
    with running(tmp_path, *options) as found:
        found.wait(lambda: len(found.frames) > 20)
        done = subprocess.run(arguments(tmp_path, "--record"), capture_output=True, text=True, timeout=60, check=True)
        assert "frames to" in done.stdout
        found.wait(lambda: [each for each in found.events if each["event"] == "recorded"])
        found.stop()
    (folder,) = kept.iterdir()
    recorded = [json.loads(line) for line in (folder / "recording.jsonl").read_text().splitlines()]
    assert len(recorded) > 3
    done = subprocess.run([COMMAND, "--camera", folder], capture_output=True, text=True, timeout=60, check=True)
    again = [json.loads(line) for line in done.stdout.splitlines()]
    assert [each["detections"] for each in again] == [each["detections"] for each in recorded]
    assert any(each["detections"] for each in again)


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


def test_a_recording_that_is_being_written_and_reads_that_hang_do_not_delay_the_end(tmp_path):
    source, kept = tmp_path / "script.toml", tmp_path / "recordings"
    source.write_text('faults = [{ kind = "hang", at = 8.0, seconds = 100.0 }]\n')
    large = ("--camera-width", 1280, "--camera-height", 960, "--recorder-folder", kept)
    retry = ("--camera-lost-ms", 500, "--camera-open-ms", 5000, "--camera-retry-ms", 10)
    with running(tmp_path, "--camera", f"fault:{source}", *large, *retry) as found:
        found.wait(lambda: len(found.frames) > 3)
        found.wait_for_state("camera_lost")
        done = subprocess.run(arguments(tmp_path, "--record"), capture_output=True, text=True, timeout=60, check=False)
        found.process.send_signal(signal.SIGTERM)
        started = time.monotonic()
        found.process.wait(60)
        assert time.monotonic() - started < 1.5
    assert done.returncode == 0, done.stderr
