"""vm-detect as a user types it: options, exit statuses, signals and what it writes where."""

import os
import pty
import re
import shutil
import signal
import subprocess
from dataclasses import fields
from pathlib import Path

import pytest

from tests.drawn_scenes import IMAGES, MODEL
from tests.programs import heed_interrupts
from vm_embedded.cli.detect import parser
from vm_embedded.detection.settings import Settings

from .commands import COMMAND, detect, lines, one_complaint, run


def test_an_unknown_key_in_the_configuration_is_named_with_the_nearest(tmp_path):
    (tmp_path / "vm.toml").write_text("[detector]\ntreads = 2\n")
    done = run("--camera", IMAGES[0], "--config", tmp_path / "vm.toml", code=1)
    one_complaint(done, "vm.toml", "'treads'", "did you mean 'threads'")


def test_models_that_are_none_are_refused(tmp_path):
    (tmp_path / "model.onnx").write_bytes(os.urandom(5000))
    for model in (tmp_path / "model.onnx", tmp_path / "missing.onnx", IMAGES[0]):
        one_complaint(run("--camera", IMAGES[0], "--model", model, code=1), model.name)
    unknown = run("--camera", IMAGES[0], "--model", "baller", code=1)
    one_complaint(unknown, "'baller'", "did you mean 'ball'")


@pytest.mark.parametrize("name", ["image.jpg", "lens.yaml", "model.onnx", "vm.toml"])
def test_a_file_that_may_never_end_is_refused(name, tmp_path):
    path = tmp_path / name
    os.mkfifo(path)
    pose = ("--height", 0.6, "--fov", "70deg")
    commands = {
        "image.jpg": (tmp_path, *pose),
        "lens.yaml": (IMAGES[0], "--lens", path),
        "model.onnx": (IMAGES[0], "--model", path, *pose),
        "vm.toml": (IMAGES[0], "--config", path),
    }
    one_complaint(run(*commands[name], code=1, timeout=60), f"{path}: not a regular file")


@pytest.mark.parametrize("arguments", [(), ("--camera",), ("--camera", "x", "--threads", "many"), ("--format", "no")])
def test_wrong_usage_exits_with_2(arguments):
    one_complaint(run(*arguments, code=2), "vm-detect: ", "; vm-detect --help lists the options")


def test_settings_out_of_range_are_named():
    one_complaint(detect(IMAGES[0], "--threads", 0, code=2), "--threads", "from 1 to 256, not 0")
    one_complaint(detect(IMAGES[0], "--threads", "two", code=2), "--threads", "whole number from 1 to 256, not 'two'")
    one_complaint(detect(IMAGES[0], "--threshold", "nan", code=2), "--threshold", "from 0 to 1, not nan")
    one_complaint(detect(IMAGES[0], "--object-radius", "7.5cm", code=2), "--object-radius", "10 m, not '7.5cm'")
    one_complaint(detect(IMAGES[0], "--format", "RGB", code=2), "--format", "did you mean 'rgb'?", "bayer_rggb")


@pytest.mark.parametrize(
    ("camera", "end"),
    [
        ((), "is good, but names no camera: set [camera] source, or give --camera"),
        (("--camera", "synthetic"), "the configuration is good"),
    ],
)
def test_a_good_configuration_without_a_camera_says_so(camera, end, tmp_path):
    (tmp_path / "vm.toml").write_text("")
    assert run("--config", tmp_path / "vm.toml", *camera, "--check-config").stdout.endswith(end + "\n")


def test_every_setting_is_in_the_file_and_those_of_a_call_are_options():
    options = {option for action in parser()._actions for option in action.option_strings}
    settings = {each.name for each in fields(Settings)}
    of_a_robot = {"spinning", "pitch_step", "roll_step", "cache_mib", "max_around", "max_widths", "min_visible"}
    assert settings <= set(re.findall(r"^(?:# )?(\w+) =", run("--print-config").stdout, re.MULTILINE))
    assert {"--" + name.replace("_", "-") for name in settings - of_a_robot} <= options


def test_more_threads_than_cores_give_the_same_answer():
    one, many = (lines(detect(IMAGES[0], "--threads", threads))[0] for threads in (1, 64))
    assert one["detections"] == many["detections"]


def test_a_reader_that_closes_early_ends_it_quietly(folder):
    for number in range(20, 60):
        shutil.copy(IMAGES[0], folder / f"image{number}.jpg")
        shutil.copy(folder / "lens0000000.yaml", folder / f"lens{number}.yaml")
    command = [str(COMMAND), "--camera", str(folder), "--model", str(MODEL)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
        assert process.stdout.readline()
        process.stdout.close()
        assert process.stderr.read() == ""
    assert process.returncode == 0


def test_a_full_disk_behind_standard_output_is_one_line(folder):
    command = [str(COMMAND), "--camera", str(folder), "--model", str(MODEL)]
    with Path("/dev/full").open("w") as full:
        done = subprocess.run(command, stdout=full, stderr=subprocess.PIPE, text=True)
    assert done.returncode == 1
    assert done.stderr == "vm-detect: can't write standard output: No space left on device\n"


def test_an_interrupt_ends_it_with_130(folder):
    for number in range(20, 80):
        shutil.copy(IMAGES[0], folder / f"image{number}.jpg")
        shutil.copy(folder / "lens0000000.yaml", folder / f"lens{number}.yaml")
    command = [str(COMMAND), "--camera", str(folder), "--model", str(MODEL)]

    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True}
    with subprocess.Popen(command, preexec_fn=heed_interrupts, **pipes) as process:
        assert process.stdout.readline()
        process.send_signal(signal.SIGINT)
        assert "Traceback" not in process.stderr.read()
    assert process.returncode == 130


def test_progress_is_shown_on_a_terminal_and_nowhere_else(folder):
    assert detect(folder).stderr == ""
    command = [str(COMMAND), "--camera", str(folder), "--model", str(MODEL)]
    master, slave = pty.openpty()
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=slave, text=True) as process:
        os.close(slave)
        seen = b""
        try:
            while chunk := os.read(master, 1000):
                seen += chunk
        except OSError:  # how Linux says that the other end has closed
            pass
        assert len(process.stdout.read().splitlines()) == 2
    os.close(master)
    assert b"1/2" in seen
    assert b"2/2" in seen
