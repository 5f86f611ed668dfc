"""Everything that cameras do wrong, over and over: the detector says so, reports nothing stale, and is well again."""

import os
import threading

import pytest

from tests.soak.failing_camera import KINDS, Fault
from tests.soak.faults import QUICK, SMALL, is_fresh
from tests.vm_embedded.live.running import running

STATES = {
    "unplug": "camera_lost",
    "hang": "camera_lost",
    "frozen": "camera_lost",
    "truncated": "camera_lost",
    "ahead": "camera_lost",
    "slow": "camera_lost",
    "burst": "camera_lost",
    "empty": "camera_lost",
    "blank": "camera_lost",
    "resize": "degraded",
    "depth": "degraded",
    "behind": "degraded",
}
"""What state each fault leads to, if it lasts longer than a camera may be silent."""


def check_frames(found):
    """No frame that was reported is stale."""
    for each in found.frames:
        assert is_fresh(each), each


@pytest.mark.long
@pytest.mark.parametrize("kind", KINDS)
def test_each_fault_is_seen_and_got_over(tmp_path, kind):
    with running(tmp_path, *QUICK, *SMALL, faults=[Fault(kind, at=2.5, seconds=1.2)]) as found:
        found.wait_for_state("ok")
        found.wait_for_state(STATES[kind])
        found.wait_for_state("ok")
        found.stop()
    check_frames(found)


@pytest.mark.long
def test_threads_that_hang_too_often_end_it_with_a_status_that_asks_for_a_new_start(tmp_path):
    faults = [Fault("hang", 2.0 + 0.5 * at, seconds=60.0) for at in range(30)]
    with running(tmp_path, *QUICK, *SMALL, faults=faults) as found:
        assert found.process.wait(60.0) == 75
        assert threading.active_count() < 50


SLOW = """
import sys

if sys.orig_argv[1].endswith("failing_camera.py"):
    import time
    from vm_embedded.detection.detector import Detector

    detect = Detector.detect

    def detect_slowly(*given):
        time.sleep(0.2)
        return detect(*given)

    Detector.detect = detect_slowly
"""
"""A module that Python imports at its start."""


@pytest.mark.long
def test_no_frame_says_that_there_is_no_camera(tmp_path):
    """The camera is lost while its last frame is processed."""
    (tmp_path / "sitecustomize.py").write_text(SLOW)
    path = os.pathsep.join([str(tmp_path), os.environ.get("PYTHONPATH", "")])
    faults = [Fault("hang", at, seconds=0.5) for at in (1.0, 3.0, 5.0)]
    options = ("--camera-lost-ms", 60, "--camera-retry-ms", 20, "--camera-max-age-ms", 2000)
    with running(tmp_path, *options, faults=faults, env={"PYTHONPATH": path}) as found:
        for _ in range(3):
            found.wait_for_state("camera_lost")
        found.stop()
    assert found.frames
    assert {each["state"] for each in found.frames} <= {"starting", "ok", "degraded"}
