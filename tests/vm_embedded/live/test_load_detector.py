"""What stops vm-detect at the start, and how it says so."""

import json
import shutil
import signal
import subprocess

import pytest

from tests.preloaded import run_preloaded
from tests.programs import run_program
from tests.vm_embedded.live.running import COMMAND, DEMO, arguments, running
from vm_embedded.live.configuration import read_configuration
from vm_embedded.network.bundled import model_path


@pytest.mark.long
def test_what_can_never_work_ends_it_at_the_start_with_a_status_of_its_own(tmp_path):
    for options, says in (
        (("--camera", "synthetic:fast"), "synthetic:TURN"),
        (("--camera", "synthetic", "--format", "gray"), "bgr"),
        (("--camera", "synthetic", "--recorder-trigger-class", "bal"), "[recorder] trigger_class: unknown class 'bal'"),
        (("--camera", "synthetic", "--explain"), "--explain works only with files"),
        (("--camera", "/dev/video-none"), "needs a lens"),
        (("--config", tmp_path / "none.toml"), "none.toml"),
        (("--camera", "http://"), "not a valid address"),
        (("--camera", "synthetic", "--output-unix", tmp_path / "no" / "folder"), "No such file"),
        (("--camera", "synthetic", "--output-file", tmp_path), "directory"),
        (("--camera", "synthetic", "--model", tmp_path / "none.onnx"), "none.onnx"),
        (("--camera", "synthetic", "--camera-pixel-format", "MJPEG", "--camera", "9"), "four letters"),
    ):
        check_refusal(tmp_path, options, 78, says)


@pytest.mark.long
def test_an_option_that_can_never_work_is_wrong_usage(tmp_path):
    for options, says in (
        (("--camera-fps", -1), "--camera-fps: fps must be a number"),
        (("--pose-source", "udp:nowhere"), "udp:0.0.0.0:5600, not 'udp:nowhere'"),
        (("--pose-source", "radio"), "radio"),
        (("--output-udp", "here"), "--output-udp: udp must be ADDRESS:PORT"),
        (("--status-page", "127.0.0.1:0"), "127.0.0.1:0"),
        (("--status-page", "127.0.0.1:80,127.0.0.1:81"), "must be ADDRESS:PORT"),
        (("--status-page", "8080"), "--status-page: page must be ADDRESS:PORT, as in 127.0.0.1:8080"),
        (("--height", "80cm"), "--height: height must be a number of meters"),
    ):
        check_refusal(tmp_path, ("--camera", "synthetic", *options), 2, says)


def check_refusal(folder, options, status, says):
    done = run_preloaded(arguments(folder, *options))
    assert done.returncode == status, (options, done.stderr)
    assert says in done.stderr
    assert "Traceback" not in done.stderr
    assert (folder / "control").exists() is False


@pytest.mark.long
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


def test_the_printed_configuration_can_be_put_into_any_folder(tmp_path):
    """Model and lens are then named by absolute paths; the lens keeps its distortion and pose."""
    shutil.copy(model_path("ball"), tmp_path / "own.onnx")
    lens = "camera_matrix: [500, 0, 320, 0, 500, 240, 0, 0, 1]\ndistortion_coefficients: [0.1, 0, 0, 0]\n"
    (tmp_path / "lens.yaml").write_text(f"{lens}Hoc: [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0.7], [0, 0, 0, 1]]\n")
    (tmp_path / "vm.toml").write_text('model = "own.onnx"\nlens = "lens.yaml"\n')
    command = [COMMAND, "--config", "vm.toml", "--print-config"]
    done = run_program(*command, cwd=tmp_path)
    (tmp_path / "elsewhere").mkdir()
    (tmp_path / "elsewhere" / "vm.toml").write_text(done.stdout)
    found, expected = (read_configuration(folder / "vm.toml") for folder in (tmp_path / "elsewhere", tmp_path))
    assert (found.model, found.lens.lens) == (expected.model, expected.lens.lens)
    assert found.fixed_orientation().height == 0.7
    alone = run_program(COMMAND, "--print-config").stdout
    (tmp_path / "vm.toml").write_text(alone)
    done = run_program(*command, cwd=tmp_path)
    assert done.stdout == alone


@pytest.mark.long
def test_the_printed_configuration_is_one_and_says_what_the_defaults_are(tmp_path):
    path = tmp_path / "vm.toml"
    printed = run_program(COMMAND, "--print-config").stdout
    path.write_text(printed)
    again = [COMMAND, "--config", path, "--print-config"]
    assert run_program(*again).stdout.count("\n") == printed.count("\n")
    checked = [COMMAND, "--config", path, "--check-config", "--camera", "synthetic"]
    assert "self-test passed" in run_program(*checked).stdout
    for camera, fault in (
        ("synthetik", "no such image"),
        ("rstp://a/b", "unknown protocol 'rstp'"),
        (tmp_path, "no images"),
    ):
        done = run_preloaded([*checked[:-1], str(camera)])
        assert (done.returncode, fault in done.stderr) == (1, True), done.stderr


@pytest.mark.parametrize(("more", "status"), [(["--check-config"], 1), ([], 78)])
def test_an_object_that_is_too_large_for_the_camera_s_height_is_refused(tmp_path, more, status):
    """Swapped, for example."""
    (tmp_path / "vm.toml").write_text("[orientation]\nheight = 0.075\n[detector]\nobject_radius = 0.6\n")
    options = ("--config", tmp_path / "vm.toml", "--camera", "http://127.0.0.1:9/", "--fov", "70deg", *more)
    check_refusal(tmp_path, options, status, "ball's diameter, 1.2 m, not 0.075 m: check the camera's height")


@pytest.mark.parametrize("format", ["rgb", "bgra", "rgba"])
def test_a_pixel_format_that_no_camera_delivers_is_refused(tmp_path, format):
    command = arguments(tmp_path, "--live", "--check-config", "--camera", DEMO, "--format", format)
    done = run_preloaded(command)
    assert done.returncode == 1
    assert f"--format {format} is only for frames passed in from Python; frames of files and cameras are bgr, gray" in (
        done.stderr
    )


@pytest.mark.long
def test_an_address_that_the_network_may_get_later_asks_for_a_restart(tmp_path):
    command = arguments(tmp_path, "--camera", "synthetic", "--status-page", "192.0.2.1:8080")
    done = run_preloaded(command)
    assert done.returncode == 75
    assert done.stderr.count("waiting for the network") == 1
    assert "can't start" in done.stderr


@pytest.mark.long
def test_a_signal_ends_the_wait_for_the_network_as_usual(tmp_path):
    command = arguments(tmp_path, "--camera", "synthetic", "--status-page", "192.0.2.1:8080")
    process = subprocess.Popen(command, stderr=subprocess.PIPE, text=True)
    try:
        seen = next(line for line in process.stderr if "waiting for the network" in line)
        assert "192.0.2.1" in seen
        process.send_signal(signal.SIGTERM)
        _, rest = process.communicate(timeout=10)
    finally:
        process.kill()
    assert process.returncode == 0
    assert "can't start" not in rest
    assert "signal" in rest.splitlines()[-1]


@pytest.mark.long
def test_a_running_detector_is_asked_although_its_vm_toml_has_got_an_error(tmp_path):
    (tmp_path / "vm.toml").write_text(f"[camera]\nfsp = 3\n[status]\nsocket = '{tmp_path / 'control'}'\n")
    with running(tmp_path, "--camera", "synthetic") as found:
        found.wait_for_state("ok")
        command = [COMMAND, "--config", tmp_path / "vm.toml", "--status"]
        done = run_preloaded(command)
    assert done.returncode == 0
    assert json.loads(done.stdout)["state"] == "ok"
    assert "did you mean 'fps'" in done.stderr
