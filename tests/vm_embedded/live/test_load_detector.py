"""What stops vm-detect at the start, and how it says so."""

import subprocess

import pytest

from tests.vm_embedded.live.running import COMMAND, arguments


@pytest.mark.long
def test_what_can_never_work_ends_it_at_the_start_with_a_status_of_its_own(tmp_path):
    for options, says in (
        (("--camera", "synthetic:fast"), "synthetic:TURN"),
        (("--camera", "synthetic", "--camera-fps", -1), "fps must be a number"),
        (("--camera", "synthetic", "--format", "gray"), "bgr"),
        (("--camera", "synthetic", "--recorder-trigger-class", "bal"), "'bal'"),
        (("--camera", "synthetic", "--explain"), "--explain works only with files"),
        (("--camera", "/dev/video-none"), "needs a lens"),
        (("--config", tmp_path / "none.toml"), "none.toml"),
        (("--camera", "fault:none.toml"), "can't read fault script none.toml"),
        (("--camera", "http://"), "not a valid address"),
        (("--camera", "synthetic", "--pose-source", "udp:nowhere"), "udp:0.0.0.0:5600, not 'udp:nowhere'"),
        (("--camera", "synthetic", "--pose-source", "radio"), "radio"),
        (("--camera", "synthetic", "--output-udp", "here"), "here"),
        (("--camera", "synthetic", "--output-unix", tmp_path / "no" / "folder"), "No such file"),
        (("--camera", "synthetic", "--output-file", tmp_path), "directory"),
        (("--camera", "synthetic", "--status-page", "127.0.0.1:0"), "127.0.0.1:0"),
        (
            ("--camera", "synthetic", "--status-page", "8080"),
            "[status] page must be ADDRESS:PORT, as in 127.0.0.1:8080",
        ),
        (("--camera", "synthetic", "--height", "80cm"), "[orientation] height must be a number of meters"),
        (("--camera", "synthetic", "--model", tmp_path / "none.onnx"), "none.onnx"),
        (("--camera", "synthetic", "--camera-pixel-format", "MJPEG", "--camera", "9"), "four letters"),
    ):
        done = subprocess.run(arguments(tmp_path, *options), capture_output=True, text=True, timeout=60, check=False)
        assert done.returncode == 78, (options, done.stderr)
        assert says in done.stderr
        assert "Traceback" not in done.stderr
        assert (tmp_path / "control").exists() is False


def test_what_can_not_be_read_or_written_is_said_without_a_traceback(tmp_path):
    command = arguments(tmp_path, "--camera", "synthetic")
    for more, says in (
        ("--pose-source stdin </dev/null", "stdin needs a pipe"),
        ("--pose-source stdin <&-", "stdin needs a pipe"),
        (">&-", "standard output is closed"),
    ):
        line = f"{' '.join(command)} {more}"
        done = subprocess.run(line, shell=True, capture_output=True, text=True, timeout=60, check=False)
        assert done.returncode == 78, (more, done.stderr)
        assert says in done.stderr
        assert "Traceback" not in done.stderr


def test_the_printed_configuration_is_one_and_says_what_the_defaults_are(tmp_path):
    path = tmp_path / "vm.toml"
    printed = subprocess.run([COMMAND, "--print-config"], capture_output=True, text=True, timeout=60, check=True).stdout
    path.write_text(printed)
    again = [COMMAND, "--config", path, "--print-config"]
    assert subprocess.run(again, capture_output=True, text=True, timeout=60, check=True).stdout.count(
        "\n"
    ) == printed.count("\n")
    checked = [COMMAND, "--config", path, "--check-config", "--camera", "synthetic"]
    assert "self-test passed" in subprocess.run(checked, capture_output=True, text=True, timeout=60, check=True).stdout
