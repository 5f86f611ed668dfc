"""The soaks on small numbers; `make soak` runs them for an hour."""

import subprocess
import sys

import pytest

from .calls import CallsReport, soak_calls
from .connections import SOCKETS, soak_connections
from .failing_camera import KINDS, Fault
from .faults import growth, is_fresh, recovered, soak_faults


@pytest.mark.long
def test_faults_of_every_kind_leave_no_stale_frame_and_the_detector_well(tmp_path):
    report = soak_faults(tmp_path, detectors=2, count=5 * len(KINDS), first=15.0)
    assert report.unexpected == []
    assert report.recovered == report.faults == dict.fromkeys(KINDS, 10)
    assert min(report.rejected.values()) > 10
    assert report.left == 0
    assert report.growth(settled=0.4, parts=3) <= 5.0  # caches take a minute to fill
    assert "stale frames and unexpected lines: 0" in str(report)


@pytest.mark.long
def test_memory_is_flat_over_many_calls():
    report = soak_calls(30000)
    assert len(report.memory) == 1000
    assert report.change <= 0.02
    assert report.detections > 0


@pytest.mark.long
def test_connections_to_no_socket_stop_the_frames(tmp_path):
    reports = soak_connections(tmp_path, 1000, 4.0)
    assert [each.socket for each in reports] == list(SOCKETS)
    for each in reports:
        assert each.connections == 1000
        assert each.unexpected == []
        assert each.lines < 100
        assert each.during > 0.5 * each.before  # `make soak` asks for nine tenths, with nothing else on the machine


def test_growth_ignores_the_start_and_finds_a_leak():
    assert growth([10**9] * 10 + [5] * 90) == 0
    assert growth(list(range(100))) == 80
    assert growth(list(range(100)), settled=0.5) < 50
    assert growth(list(range(90)), settled=0.0, parts=3) == 60


def test_memory_that_is_given_back_for_some_seconds_is_no_growth():
    gives_back = ([127] * 10 + [121] * 20) * 10
    assert growth(gives_back, parts=3) == 0
    assert growth([*gives_back[:200], *(each + 6 for each in gives_back[200:])], parts=3) == 6


def test_a_change_of_memory_is_seen():
    assert CallsReport(100, memory=[10] * 5 + [100] * 94 + [103]).change == pytest.approx(0.03)


class Said:
    """A detector that has said this."""

    ready = 100.0

    def __init__(self, *states):
        self.states = [(100.0 + at, state) for at, state in states]


def test_only_a_detector_that_is_well_before_the_next_fault_has_recovered():
    faults = [Fault("hang", 1.0, 0.5), Fault("slow", 3.0, 0.5), Fault("blank", 5.0, 0.5)]
    unnoticed = Said((0.1, "ok"))
    assert recovered(unnoticed, faults) == ["hang", "slow", "blank"]
    late = Said((0.1, "ok"), (1.2, "camera_lost"), (3.1, "ok"), (3.2, "degraded"), (4.0, "ok"), (5.1, "camera_lost"))
    assert recovered(late, faults) == ["slow"]


def test_frames_that_must_not_be_reported():
    good = {"age_ms": 20.0, "detections": [{}], "truth": {}}
    assert is_fresh(good)
    assert not is_fresh(good | {"age_ms": 201.0})
    assert not is_fresh(good | {"truth": {"fault": "frozen"}})
    assert not is_fresh(good | {"truth": {"fault": "blank"}})
    assert is_fresh(good | {"truth": {"fault": "blank"}, "detections": []})
    assert is_fresh(good | {"truth": {"fault": "burst"}})


def test_an_unknown_soak_is_refused(tmp_path):
    command = [sys.executable, "-m", "tests.soak.run", "fault", "-o", str(tmp_path)]
    result = subprocess.run(command, capture_output=True, text=True, check=False)
    assert result.returncode == 2
    assert "unknown soak fault; choose from faults, calls, connections" in result.stderr
