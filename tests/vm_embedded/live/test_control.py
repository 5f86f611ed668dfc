"""The control socket of a real vm-detect."""

import re
import socket
import subprocess

from tests.messages import read_message
from tests.vm_embedded.live.running import COMMAND, arguments, running
from vm_embedded.live.control import ask


def test_a_socket_that_was_left_behind_is_replaced_and_one_in_use_is_not(tmp_path):
    left = socket.socket(socket.AF_UNIX)
    left.bind(str(tmp_path / "control"))
    left.close()
    with running(tmp_path, "--camera", "synthetic") as found:
        found.wait_for_state("ok")
        other = subprocess.run(
            arguments(tmp_path, "--camera", "synthetic"), capture_output=True, text=True, timeout=60, check=False
        )
        assert other.returncode == 78
        assert "another process already does; stop the other vm-detect, or give another path" in other.stderr
        (option,) = re.findall(r"give another path with (--[a-z-]+)", other.stderr)
        with running(tmp_path, "--camera", "synthetic", option, tmp_path / "second") as second:
            second.wait_for_state("ok")
            second.stop()
        assert read_message(ask(tmp_path / "control", "status"))["state"] == "ok"
        found.stop()


def test_a_client_that_says_nothing_is_let_go_of_at_the_end(tmp_path):
    with running(tmp_path, "--camera", "synthetic") as found:
        found.wait_for_state("ok")
        with socket.socket(socket.AF_UNIX) as silent:
            silent.connect(str(tmp_path / "control"))
            assert found.stop()[0] == 0


def test_asking_what_is_no_detector_ends(tmp_path):
    path = tmp_path / "other"
    with socket.socket(socket.AF_UNIX) as other:
        other.bind(str(path))
        other.listen()
        command = [COMMAND, "--status", "--status-socket", path]
        done = subprocess.run(command, capture_output=True, text=True, timeout=30, check=False)
    assert done.returncode == 1
    assert "no detector replies" in done.stderr
