"""Everything that cameras do wrong, over and over: the detector says so, reports nothing stale, and is well again."""

import os
import threading
import time
from pathlib import Path

import numpy as np
import pytest

from tests.messages import read_message
from tests.vm_embedded.live.running import running
from vm_embedded.cameras.fault import KINDS, FaultScript
from vm_embedded.live.control import ask

QUICK = ("--camera-lost-ms", 250, "--camera-open-ms", 500, "--camera-retry-ms", 20, "--camera-longest-retry-ms", 80)
SMALL = ("--camera-width", 320, "--camera-height", 240, "--camera-max-age-ms", 200)

STATES = {
    "unplug": "camera_lost",
    "hang": "camera_lost",
    "frozen": "camera_lost",
    "truncated": "camera_lost",
    "ahead": "camera_lost",
    "slow": "camera_lost",
    "resize": "degraded",
    "behind": "degraded",
}
"""What state each fault leads to, if it lasts longer than a camera may be silent."""

HARMFUL = ("frozen", "truncated", "ahead", "behind")
"""Faults whose frames must never be reported."""


def script(path, text):
    path.write_text(text)
    return ("--camera", f"fault:{path}")


def open_things(pid):
    """Threads and descriptors of a process."""
    return len(list(Path(f"/proc/{pid}/task").iterdir())), len(list(Path(f"/proc/{pid}/fd").iterdir()))


def resident(pid):
    """Memory of a process [bytes]."""
    return int(Path(f"/proc/{pid}/statm").read_text().split()[1]) * os.sysconf("SC_PAGESIZE")


def check_frames(found):
    """No frame that was reported is stale."""
    for each in found.frames:
        fault = each.get("truth", {}).get("fault")
        assert each["age_ms"] <= 200.0 + 50.0, each
        assert fault not in HARMFUL, each


@pytest.mark.long
@pytest.mark.parametrize("kind", KINDS)
def test_each_fault_is_seen_and_got_over(tmp_path, kind):
    source = script(tmp_path / "script.toml", f'faults = [{{ kind = "{kind}", at = 2.5, seconds = 1.2 }}]\n')
    with running(tmp_path, *source, *QUICK, *SMALL) as found:
        found.wait_for_state("ok")
        found.wait_for_state(STATES[kind])
        found.wait_for_state("ok")
        found.stop()
    check_frames(found)


def well_between(found, faults):
    """After how many faults the state was ok before the next one began."""
    began = next(each["time"] for each in found.events if each["event"] == "ready")
    changes = [(each["time"] - began, each["state"]) for each in found.events if each["event"] == "state"]
    ends = [*(each.at for each in faults[1:]), faults[-1].at + 60.0]
    well = 0
    for fault, end in zip(faults, ends, strict=True):
        before = [state for at, state in changes if at < fault.at + fault.seconds]
        within = [state for at, state in changes if fault.at + fault.seconds <= at < end]
        well += before[-1] == "ok" or "ok" in within
    return well


@pytest.mark.long
def test_two_hundred_faults_in_any_order_leave_nothing_behind(tmp_path):
    text = "[random]\ncount = 200\nseed = 7\nfirst = 4.0\nshortest = 0.1\nlongest = 0.4\npause = 0.85\n"
    source = script(tmp_path / "script.toml", text)
    faults = FaultScript.read(tmp_path / "script.toml").faults
    assert len(faults) == 200
    assert {each.kind for each in faults} == set(KINDS)
    with running(tmp_path, *source, *QUICK, *SMALL, "--output-unix", tmp_path / "lines") as found:
        found.wait_for_state("ok")
        time.sleep(1.0)
        pid = found.process.pid
        before, memory = open_things(pid), []
        ends = time.monotonic() + faults[-1].at + faults[-1].seconds
        while time.monotonic() < ends:
            memory.append(resident(pid))
            time.sleep(1.0)
        found.wait_for_state("ok", 20.0)
        found.wait(lambda: open_things(pid) <= before, 20.0)
        counts = read_message(ask(tmp_path / "control", "status"))["counts"]
        status, seconds = found.stop()
    assert status == 0
    assert seconds < 1.0
    check_frames(found)
    # Every kind was met, and the detector was well in between.
    assert counts["reconnects"] >= 50
    assert min(counts[name] for name in ("broken", "frozen", "ahead", "late", "failed")) > 10
    well = well_between(found, faults)
    print(f"ok again before the next fault: {well} of {len(faults)}")
    assert well >= 190
    # Memory at the end is that of the first quarter, or less.
    quarter = len(memory) // 4
    assert np.median(memory[-quarter:]) < 1.03 * np.median(memory[quarter : 2 * quarter])


@pytest.mark.long
def test_threads_that_hang_too_often_end_it_with_a_status_that_asks_for_a_new_start(tmp_path):
    faults = ", ".join(f'{{ kind = "hang", at = {2 + 0.5 * at}, seconds = 60.0 }}' for at in range(30))
    source = script(tmp_path / "script.toml", f"faults = [{faults}]\n")
    with running(tmp_path, *source, *QUICK, *SMALL) as found:
        assert found.process.wait(60.0) == 75
        assert threading.active_count() < 50
