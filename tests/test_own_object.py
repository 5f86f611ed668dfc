"""The page docs/own-object.md, followed command by command with small numbers."""

import json
import os
import re
import shlex
import subprocess
import sys
import tomllib

import pytest

from vm_embedded.errors import InputError
from vm_embedded.network.model_file import read_model

from .test_docs import DOCS, TOP, shell_lines

PAGE = DOCS / "own-object.md"

PROGRAMS = tomllib.loads((TOP / "pyproject.toml").read_text())["project"]["scripts"]

SETTINGS = {
    "data/cups": ("training.epochs=2", "training.repeats=40", "network.depth=1", "network.width=8"),
    "look": (
        "training.epochs=2",
        "training.rounds=1",
        "training.batch=32",
        "patches.max_proposals=128",
        "data.validation=0.4",
    ),
}
"""Settings of small trainings, by the first argument of vm-train."""

LESS = {
    "vm-synth": {"data/cups": ["--count", "24"], "data/cups-test": ["--count", "6"]},
    "vm-train": {first: [word for each in given for word in ("--set", each)] for first, given in SETTINGS.items()},
}
"""Options to add to a command, by its program and its first argument."""


@pytest.fixture
def mitsuba():
    """Skips a test where Mitsuba or LLVM is missing."""
    from vm_synth.render.mitsuba import load_mitsuba

    try:
        load_mitsuba()
    except InputError as error:
        pytest.skip(str(error))


def run(words, folder):
    """Run a command of the project as a user types it; returns its standard output."""
    program, *arguments = words
    module, function = PROGRAMS[program].split(":")
    code = f"import sys; from {module} import {function}; sys.argv[0] = {program!r}; sys.exit({function}())"
    paths = os.pathsep.join([str(TOP), str(TOP / "export")])
    environment = {**os.environ, "PYTHONPATH": paths, "CUDA_VISIBLE_DEVICES": ""}
    done = subprocess.run(
        [sys.executable, "-c", code, *arguments],
        cwd=folder,
        capture_output=True,
        text=True,
        timeout=300,
        env=environment,
    )
    assert done.returncode == 0, f"{shlex.join(words)}\n{done.stderr}"
    assert "Traceback" not in done.stderr
    return done.stdout


@pytest.mark.long
def test_the_page_can_be_followed_command_by_command(tmp_path, mitsuba):
    followed = []
    for line in shell_lines(PAGE):
        words = shlex.split(line, comments=True)
        if not words or words[0] not in PROGRAMS:
            continue
        target = None
        if ">" in words:
            target = tmp_path / words[words.index(">") + 1]
            words = words[: words.index(">")]
        shown = run(words + LESS.get(words[0], {}).get(words[1], []), tmp_path)
        if target is not None:
            target.write_text(shown)
        followed.append(words[0])
    assert followed.count("vm-synth") >= 4
    assert {"vm-train", "vm-export", "vm-evaluate", "vm-detect"} <= set(followed)
    for path in re.findall(r"`((?:data|runs|report)/[\w./-]+)`", PAGE.read_text()):
        assert (tmp_path / path).exists(), f"no command of the page writes {path}"
    manifest = read_model(tmp_path / "runs/cup/model.onnx").manifest
    assert (manifest.shape, manifest.radius, manifest.object_height) == ("cylinder", 0.04, 0.1)
    assert manifest.look.names == ("cup",)
    scores = json.loads((tmp_path / "report/scores.json").read_text())
    assert "cup" in scores["objects"]
    assert len(list((tmp_path / "found").iterdir())) == 6
