"""Ctrl-C while a program still imports its modules."""

import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from vm_embedded.config.toml_reader import parse_toml
from vm_programs.run import _run

SCRIPTS = parse_toml((Path(__file__).parents[2] / "pyproject.toml").read_text())["project"]["scripts"]

NUMPY = "import os, signal, sys\nos.kill(os.getpid(), signal.SIGINT)\nsys.exit(3)\n"
"""A module in the place of numpy, which all programs import: it interrupts its own process."""


@pytest.fixture(autouse=True)
def interrupts_arrive():
    """Tests that a shell runs in the background have interrupts ignored, and so would the programs that they start."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


def interrupted(program, folder, **more):
    """What a program says and ends with if it is interrupted during its imports."""
    (folder / "numpy.py").write_text(NUMPY)
    module, function = SCRIPTS[program].split(":")
    command = [sys.executable, "-c", f"import sys\nfrom {module} import {function}\nsys.exit({function}())"]
    path = os.pathsep.join([str(folder), os.environ.get("PYTHONPATH", "")])
    return subprocess.run(
        command, env={**os.environ, "PYTHONPATH": path}, capture_output=True, text=True, check=False, timeout=60, **more
    )


@pytest.mark.parametrize("program", SCRIPTS)
def test_an_interrupt_ends_a_program_quietly(program, tmp_path):
    done = interrupted(program, tmp_path)
    assert (done.returncode, done.stdout, done.stderr) == (-signal.SIGINT, "", "")


def test_an_interrupt_that_the_shell_ignores_is_ignored(tmp_path):
    ignore = {"preexec_fn": lambda: signal.signal(signal.SIGINT, signal.SIG_IGN)}
    assert interrupted("vm-detect", tmp_path, **ignore).returncode == 3


def test_after_the_imports_a_program_itself_handles_interrupts(tmp_path, monkeypatch):
    (tmp_path / "made.py").write_text("import signal\ndef main():\n    return signal.getsignal(signal.SIGINT)\n")
    monkeypatch.syspath_prepend(tmp_path)
    assert _run("made") is signal.getsignal(signal.SIGINT) is signal.default_int_handler
