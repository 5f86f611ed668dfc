"""What all programs share, as a user meets it: --version, mistyped options, and a reader that leaves."""

import json
import os
import re
import shlex
import subprocess
import sys
from pathlib import Path

import pytest

import vm_embedded
from tests.preloaded import run_preloaded
from vm_embedded.cli.program import program
from vm_embedded.config.toml_reader import parse_toml

TOP = Path(__file__).parents[3]
BIN = Path(sys.executable).parent
DEMO = TOP / "tests" / "fixtures" / "demo"
PROGRAMS = sorted(parse_toml((TOP / "pyproject.toml").read_text())["project"]["scripts"])


def run(program, *arguments, **more):
    return run_preloaded([BIN / program, *arguments], **more)


@pytest.mark.parametrize("program", PROGRAMS)
def test_a_program_prints_its_version(program):
    done = subprocess.run([BIN / program, "--version"], capture_output=True, text=True, timeout=120, check=False)
    assert (done.returncode, done.stdout, done.stderr) == (0, f"{program} {vm_embedded.__version__}\n", "")


@pytest.mark.parametrize(
    ("command", "mistyped", "meant"),
    [
        ("vm-detect", "--treads=2", "--threads"),
        ("vm-doctor", "--jsn", "--json"),
        ("vm-bench", "--lense", "--lens"),
        ("vm-export model.pt", "--lok", "--look"),
        ("vm-train data", "--ouput", "--output"),
        ("vm-train check data", "--jsom", "--json"),
        ("vm-evaluate model.pt", "--outptu", "--output"),
        ("vm-mesh show", "--veiw", "--view"),
        ("vm-label boxes", "--wirte", "--write"),
        ("vm-synth out", "--cuont", "--count"),
        ("vm-synth check out", "--jsom", "--json"),
        ("vm-calibrate lens clip.avi", "--ouput", "--output"),
        ("vm-ros", "--ros-imge", "--ros-image"),
    ],
)
def test_a_mistyped_option_is_one_line_with_the_nearest(command, mistyped, meant):
    """Even if something else is missing, too: the mistyped option is the reason."""
    done = run(*command.split(), mistyped, "1")
    assert done.returncode == 2
    (line,) = done.stderr.splitlines()
    assert f"unknown option {mistyped.partition('=')[0]}: did you mean {meant}?" in line
    suggested = re.search(r"; (vm-.*) --help lists the options", line)[1]
    assert run(*suggested.split(), "--help").returncode == 0


def test_an_option_with_one_dash_is_named_with_two():
    done = run("vm-detect", "-model", "ball")
    assert done.returncode == 2
    assert done.stderr.startswith("vm-detect: unknown option -model: did you mean --model?")


@pytest.mark.parametrize(
    ("command", "status", "told"),
    [
        ("vm-detect x.jpg --lens=", 2, "argument --lens: the path is empty"),
        ("vm-detect x.jpg --model=", 1, "unknown network ''"),
        ("vm-doctor --config=", 2, "argument --config: the path is empty"),
        ("vm-export ''", 2, "argument model: the path is empty"),
    ],
)
def test_an_empty_path_is_not_the_current_folder(command, status, told, tmp_path):
    done = run(*shlex.split(command), cwd=tmp_path)
    assert done.returncode == status
    (line,) = done.stderr.splitlines()
    assert told in line


@pytest.mark.parametrize(
    ("command", "told"),
    [
        ("vm-mesh show --model cap7", "argument --model: unknown value 'cap7'; did you mean 'cap6'? (allowed: ring4, "),
        ("vm-calibrate lens film.mp4 --lens fishey", "did you mean 'fisheye'? (allowed: auto, pinhole, fisheye, "),
        ("vm-export model.pt --edge round", "argument --edge: unknown value 'round' (allowed: hard, same)"),
        ("vm-train data -o run --device cud", "unknown value 'cud'; did you mean 'cuda'? (allowed: auto, cpu, cuda)"),
        ("vm-export model.pt --radius wide", "argument --radius: must be a number, not 'wide'"),
        ("vm-bench --frames 1.5", "argument --frames: must be a whole number, not '1.5'"),
    ],
)
def test_a_wrong_value_is_one_line_with_what_is_allowed(command, told):
    done = run(*command.split())
    assert (done.returncode, done.stdout) == (2, "")
    (line,) = done.stderr.splitlines()
    assert told in line


def test_a_mistyped_command_is_one_line_with_the_nearest():
    done = run("vm-train", "resum", "runs/ball")
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr == ("vm-train: unknown command resum: did you mean resume?; vm-train --help lists the options\n")
    for command, reason in (
        ("vm-synth configs --count x", "'x' is not a whole number"),
        ("vm-evaluate calibrated.onnx data", "-o/--output"),
    ):
        said = run(*command.split()).stderr
        assert reason in said
        assert "unknown command" not in said


def completed(line, folder):
    """What bash offers at the end of a line, after what a user has in ~/.bashrc. Empty: it completes names of files."""
    words = shlex.split(line) + ([""] if line.endswith(" ") else [])
    script = f"""
    eval "$(vm-detect --completion)"
    COMP_WORDS=({shlex.join(words)}) COMP_CWORD={len(words) - 1}
    handler=$(complete -p {words[0]} | sed 's/.*-F \\([^ ]*\\) .*/\\1/')
    $handler {words[0]}
    printf '%s\\n' "${{COMPREPLY[@]}}"
    """
    environment = {**os.environ, "PATH": f"{BIN}{os.pathsep}{os.environ['PATH']}"}
    command = ["bash", "--norc", "-c", script]
    done = subprocess.run(command, cwd=folder, env=environment, capture_output=True, text=True, check=True, timeout=60)
    assert done.stderr == ""
    return done.stdout.split()


@pytest.mark.long
@pytest.mark.parametrize(
    ("line", "offered"),
    [
        ("vm-detect --save-v", ["--save-video"]),
        ("vm-detect photo.jpg --form", ["--format"]),
        ("vm-detect --output-unix-format ", ["lines", "binary"]),
        ("vm-detect pho", []),
        ("vm-doctor --js", ["--json"]),
        ("vm-mesh sh", ["show"]),
        ("vm-mesh show --vi", ["--view"]),
        ("vm-synth pre", ["preview"]),
        ("vm-train tu", ["tune"]),
        ("vm-calibrate l", ["lens"]),
    ],
)
def test_bash_completes_options_values_and_commands(line, offered, tmp_path):
    assert completed(line, tmp_path) == offered


def test_the_help_of_vm_train_and_its_completions_fit_on_a_screen(tmp_path):
    done = run("vm-train", "--help", env=os.environ | {"COLUMNS": "80"})
    text = done.stdout.splitlines()
    assert len(text) <= 53
    assert max(map(len, text)) <= 80
    options, commands = completed("vm-train --", tmp_path), completed("vm-train ", tmp_path)
    assert all(each in done.stdout for each in options)
    assert all(f"vm-train {each}" in done.stdout for each in commands)
    assert len(commands) == 10
    assert len(options) < 25


def test_an_option_like_no_other_is_named():
    done = run("vm-detect", "--camera", "x", "--xyzzy")
    assert done.returncode == 2
    assert done.stderr == "vm-detect: unknown option --xyzzy; vm-detect --help lists the options\n"


@pytest.mark.long
@pytest.mark.parametrize(
    "command",
    [
        *("vm-train config", "vm-train config look", "vm-train --help", "vm-detect --print-config"),
        *("vm-evaluate --help", "vm-export --help", "vm-mesh quality", "vm-bench --help", "vm-doctor"),
    ],
)
def test_a_reader_that_leaves_ends_a_program_quietly(command):
    program, *arguments = command.split()
    streams = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE}
    with subprocess.Popen([BIN / program, *arguments], text=True, **streams) as process:
        process.stdout.close()
        assert process.stderr.read() == ""
        assert process.wait(120) in (0, 1)  # 1: vm-doctor may have found a problem


def test_a_full_disk_is_one_line():
    with Path("/dev/full").open("w") as full:
        done = subprocess.run([BIN / "vm-train", "config"], stdout=full, stderr=subprocess.PIPE, text=True, check=False)
    assert done.returncode == 1
    assert done.stderr == "can't write standard output: No space left on device\n"


IMAGE = f"vm-detect {DEMO / 'image0000002.jpg'}"
CLOSED, READ_ONLY, FULL = ">&-", "</dev/null >&0", ">/dev/full"


@pytest.mark.parametrize(
    ("command", "stream", "unbuffered"),
    [
        *((IMAGE, stream, "") for stream in (CLOSED, READ_ONLY, FULL)),
        *(("vm-train config", CLOSED, ""), ("vm-detect --version", FULL, "1"), ("vm-detect --version", READ_ONLY, "")),
        *(
            pytest.param(command, stream, "1", marks=pytest.mark.long)
            for command in (
                *(IMAGE, "vm-detect --completion", "vm-detect --print-config", "vm-mesh quality", "vm-doctor"),
                *(f"{program} --help" for program in PROGRAMS),
            )
            for stream in (CLOSED, FULL)
        ),
    ],
)
def test_output_that_is_lost_is_a_failure_of_one_line(command, stream, unbuffered):
    shell = ["sh", "-c", f"{BIN / command} {stream}"]
    environment = os.environ | {"PYTHONUNBUFFERED": unbuffered}
    done = subprocess.run(shell, stderr=subprocess.PIPE, text=True, timeout=120, check=False, env=environment)
    assert (done.returncode, len(done.stderr.splitlines())) == (1, 1), done.stderr
    assert "can't write standard output: " in done.stderr


def test_without_standard_output_and_error_lost_output_is_still_a_failure():
    done = subprocess.run(["sh", "-c", f"{BIN / 'vm-train'} config >&- 2>&- <&-"], timeout=120, check=False)
    assert done.returncode == 1


@pytest.mark.long
def test_a_daemon_that_writes_elsewhere_needs_no_standard_output(tmp_path):
    shell = f"{BIN / 'vm-detect'} --live {DEMO} --no-output-stdout --output-file {tmp_path / 'lines'} >&-"
    done = subprocess.run(["sh", "-c", shell], stderr=subprocess.PIPE, text=True, timeout=120, check=False)
    assert done.returncode == 0, done.stderr
    assert any(json.loads(line)["type"] == "frame" for line in (tmp_path / "lines").read_text().splitlines())


@pytest.mark.parametrize("command", ["vm-detect none.jpg", "vm-bench --image none.jpg", "vm-train check none"])
def test_errors_are_not_printed_on_standard_output(command):
    shell = ["sh", "-c", f"{BIN / command} 2>&-"]
    done = subprocess.run(shell, stdout=subprocess.PIPE, timeout=120, check=False)
    assert (done.returncode, done.stdout) == (1, b"")


def test_without_standard_error_no_other_file_takes_its_place():
    code = "import os; from vm_embedded.cli.program import program; print(program(lambda: os.open('/', os.O_RDONLY))())"
    shell = ["sh", "-c", f"{sys.executable} -c {shlex.quote(code)} 2>&-"]
    done = subprocess.run(shell, stdout=subprocess.PIPE, timeout=120, check=False)
    assert int(done.stdout) > 2


def test_without_standard_output_no_other_file_takes_its_place():
    code = (
        "import os, sys; from vm_embedded.cli.program import program; "
        "print(program(lambda: os.open('/', os.O_RDONLY))(), file=sys.stderr)"
    )
    shell = ["sh", "-c", f"{sys.executable} -c {shlex.quote(code)} >&-"]
    done = subprocess.run(shell, stderr=subprocess.PIPE, timeout=120, check=False)
    assert int(done.stderr) > 2


@pytest.mark.parametrize("command", ["vm-bench --image", "vm-train check --boxes", "vm-label"])
def test_a_name_that_is_too_long_is_one_line(command):
    program, *options = command.split()
    done = run(program, *options, "x" * 300)
    assert done.returncode == 1
    assert len((done.stdout + done.stderr).splitlines()) == 1
    assert "File name too long" in done.stderr


def test_vm_doctor_reports_a_name_that_is_too_long():
    done = run("vm-doctor", "--camera", "x" * 300)
    assert (done.returncode, done.stderr) == (1, "")
    assert "failure   camera: can't read xxx" in done.stdout


def test_a_pipeline_may_be_longer_than_a_file_name():
    pipeline = f"gstreamer:videotestsrc ! {' ! '.join(['identity'] * 40)} ! appsink"
    done = run("vm-doctor", "--camera", pipeline)
    assert "Traceback" not in done.stderr
    assert "this OpenCV was built without GStreamer" in done.stdout


def test_an_interrupt_that_a_program_leaves_to_others_has_a_status_of_its_own(capsys):
    @program
    def main():
        raise KeyboardInterrupt

    assert main() == 130
    assert capsys.readouterr() == ("", "")


@pytest.mark.parametrize("program", ["vm-detect", "vm-ros", "vm-doctor"])
def test_help_is_short_and_help_all_has_every_option(program):
    usual, all_of_them = (run(program, option).stdout for option in ("--help", "--help-all"))
    assert 20 <= len(re.findall(r"^  +-", usual, re.MULTILINE)) <= 34  # 30, --help, --help-all, --version, --completion
    for hidden in ("--camera-max-age-ms", "--min-inside"):
        assert hidden not in usual
        assert hidden in all_of_them
