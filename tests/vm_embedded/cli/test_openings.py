"""What can't be opened at the start is found before: by vm-detect --check-config and by vm-doctor."""

import json
import os
import socket

import pytest

from tests.preloaded import run_preloaded
from tests.programs import BIN
from tests.vm_embedded.live.running import arguments, running
from vm_embedded.cli.finding import BAD, GOOD, WARNING
from vm_embedded.cli.openings import check_openings
from vm_embedded.live.configuration import Configuration, StatusSettings
from vm_embedded.output.channels import OutputSettings
from vm_embedded.output.recorder import RecorderSettings
from vm_embedded.poses.settings import PoseSettings

CAMERA = ("--camera", "http://127.0.0.1:9/", "--fov", "70deg", "--height", 0.8)


def run(*command):
    return run_preloaded([*map(str, command)])


def doctor(tmp_path, *options):
    """The findings of vm-doctor by what they are about."""
    done = run(BIN / "vm-doctor", "--json", "--status-socket", tmp_path / "control", *options)
    assert not done.stderr, done.stderr
    return {each["about"]: each for each in map(json.loads, done.stdout.splitlines())}


def openings(tmp_path, **sections):
    """State and text of each finding, with a status socket in the folder of the test."""
    sections.setdefault("status", StatusSettings(socket=str(tmp_path / "control")))
    return {each.about: (each.state, each.seen) for each in check_openings(Configuration(**sections))}


@pytest.fixture
def port():
    """A port of this machine that another program uses, for TCP and UDP."""
    with socket.create_server(("127.0.0.1", 0)) as server, socket.socket(type=socket.SOCK_DGRAM) as datagrams:
        datagrams.bind(server.getsockname())
        yield server.getsockname()[1]


@pytest.mark.parametrize(
    ("options", "says"),
    [
        (("--output-file", "/nowhere/x.jsonl"), "can't write /nowhere/x.jsonl: there is no folder /nowhere"),
        (("--output-file", "/"), "can't write /: this is a folder"),
        (("--output-unix", "/nowhere/x.sock"), "can't listen at /nowhere/x.sock: there is no folder /nowhere"),
        (("--output-unix", "/dev/null"), "can't listen at /dev/null: this file exists and is not a socket"),
        (("--pose-source", "unix:/nowhere/x.sock"), "can't listen at /nowhere/x.sock: there is no folder /nowhere"),
        (("--pose-source", "udp:127.0.0.1:{port}"), "can't listen at 127.0.0.1:{port}: Address already in use"),
        (("--pose-source", "tf"), "pose source tf works only with vm-ros and bags"),
        (("--status-page", "127.0.0.1:{port}"), "can't listen at 127.0.0.1:{port}: Address already in use"),
        (("--status-metrics", "unix:/nowhere/x.sock"), "can't listen at /nowhere/x.sock: there is no folder /nowhere"),
        (("--status-socket", "/nowhere/x.sock"), "can't listen at /nowhere/x.sock: there is no folder /nowhere"),
        (("--recorder-folder", "/dev/null/kept"), "recorder: can't write to /dev/null"),
        (("--recorder-trigger-class", "ball"), "trigger_class 'ball' has no effect: set [recorder] folder, too"),
    ],
)
def test_check_config_refuses_it(tmp_path, port, options, says):
    done = run(*arguments(tmp_path, *CAMERA, "--check-config", *(each.format(port=port) for each in options)))
    assert (done.returncode, done.stdout) == (1, "")
    (line,) = done.stderr.splitlines()
    assert says.format(port=port) in line


@pytest.mark.long
def test_vm_doctor_finds_all_of_it(tmp_path, port):
    bad = ("--output-file", "/nowhere/x.jsonl", "--output-unix", "/nowhere/x.sock", "--pose-source", "tf")
    bad += (
        "--status-page",
        f"127.0.0.1:{port}",
        "--status-metrics",
        "192.0.2.1:80",
        "--recorder-trigger-class",
        "ball",
    )
    found = doctor(tmp_path, *CAMERA, *bad)
    for about in ("output file", "output socket", "status page", "recorder"):
        assert found[about]["state"] == BAD, found[about]
        assert found[about]["mend"]
    assert found["pose"]["state"] == WARNING
    assert found["metrics"]["state"] == WARNING  # the network may get the address later
    assert found["status socket"]["state"] == GOOD


@pytest.mark.long
def test_what_a_running_detector_uses_is_no_fault(tmp_path):
    with socket.create_server(("127.0.0.1", 0)) as free:
        address = "{}:{}".format(*free.getsockname())
    used = ("--status-page", address, "--pose-source", f"udp:{address}", "--output-unix", tmp_path / "lines")
    with running(tmp_path, "--camera", "synthetic", *used) as found:
        found.wait(lambda: found.states)
        seen = doctor(tmp_path, "--camera", "synthetic", *used)
        assert {seen[each]["state"] for each in ("status page", "pose port", "output socket", "status socket")} == {
            GOOD
        }
        assert "a detector is running" in seen["status page"]["seen"]
        checked = run(*arguments(tmp_path, "--camera", "synthetic", "--check-config", *used))
        found.stop()
    assert checked.returncode == 0, checked.stderr


def test_nothing_is_left_behind(tmp_path):
    found = openings(
        tmp_path,
        output=OutputSettings(file=str(tmp_path / "lines.jsonl"), unix=str(tmp_path / "lines.sock")),
        pose=PoseSettings(source=f"unix:{tmp_path / 'poses.sock'}"),
        recorder=RecorderSettings(folder=str(tmp_path / "kept" / "here")),
    )
    assert {state for state, _ in found.values()} == {GOOD}
    assert list(found) == ["status socket", "output file", "output socket", "pose socket", "recorder"]
    assert not list(tmp_path.iterdir())


def test_a_socket_that_was_left_behind_is_no_fault(tmp_path):
    with socket.socket(socket.AF_UNIX) as left:
        left.bind(str(tmp_path / "lines.sock"))
    found = openings(tmp_path, output=OutputSettings(unix=str(tmp_path / "lines.sock")))
    assert found["output socket"][0] == GOOD
    assert (tmp_path / "lines.sock").exists()


def test_folders_that_systemd_creates_are_no_fault(tmp_path):
    output = OutputSettings(file="/var/lib/vm-detect/lines.jsonl", unix="/run/vm-detect/lines.sock")
    found = openings(tmp_path, output=output, recorder=RecorderSettings(folder="/var/lib/vm-detect/kept"))
    for about in ("output file", "output socket", "recorder"):
        assert found[about][0] == GOOD
        assert "systemd creates its folder" in found[about][1]


def test_what_this_user_may_not_write_is_a_fault(tmp_path, monkeypatch):
    (tmp_path / "lines.jsonl").touch()
    monkeypatch.setattr(os, "access", lambda path, mode: mode == os.F_OK)  # root may write everything
    output = OutputSettings(file=str(tmp_path / "lines.jsonl"), unix=str(tmp_path / "lines.sock"))
    found = openings(tmp_path, output=output)
    assert [found[each][0] for each in ("status socket", "output file", "output socket")] == [BAD] * 3
