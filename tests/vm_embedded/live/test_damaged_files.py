"""Configurations and models with random damage: they work, or are refused in one line, and nothing grows."""

import random
import subprocess
import time

import pytest

from tests.soak.detectors import resident_memory
from tests.vm_embedded.live.running import COMMAND
from tests.vm_export.looks import look_checkpoint
from vm_embedded.config.toml_writer import to_commented_toml
from vm_embedded.detection.detector import Detector
from vm_embedded.errors import VisualMeshError
from vm_embedded.live.configuration import Configuration, read_configuration
from vm_embedded.network.bundled import model_path
from vm_export.change_model import change_look

WORDS = ["nan", "inf", "-1", "1e400", "true", '"x"', "[]", "{}", "[1, 2]", "'''", "\\u0000", "9" * 400, "1979-05-27"]


def damaged(chance, content, most):
    """Some bytes changed, taken out, put in or repeated."""
    data = bytearray(content)
    for _ in range(chance.randrange(1, most)):
        at = chance.randrange(len(data) or 1)
        kind = chance.randrange(5)
        if kind == 0 and data:
            data[at] = chance.randrange(256)
        elif kind == 1:
            del data[at : at + chance.randrange(1, 20)]
        elif kind == 2:
            data[at:at] = chance.choice(WORDS).encode()
        elif kind == 3:
            data[at:at] = data[at : at + chance.randrange(1, 60)]
        elif data:
            data[at] ^= 1 << chance.randrange(8)
    return bytes(data)


def refused(work):
    """The one line with which something is refused, or None if it works."""
    try:
        work()
    except VisualMeshError as error:
        return str(error)
    return None


@pytest.mark.long
def test_ten_thousand_damaged_configurations_are_read_or_refused_in_a_line(tmp_path):
    chance = random.Random(1)
    path = tmp_path / "vm.toml"
    whole = "\n".join(
        line for line in to_commented_toml(Configuration()).splitlines() if not line.startswith("#")
    ).encode()
    outcomes = []
    for at in range(10000):
        path.write_bytes(damaged(chance, whole, 3))
        outcomes.append(refused(lambda: read_configuration(path)))
        if at == 2000:
            before = resident_memory("self")
    assert all(each is None or ("\n" not in each and "vm.toml" in each) for each in outcomes)
    assert 100 < sum(each is None for each in outcomes) < 9900
    assert resident_memory("self") - before < 32 * 2**20


@pytest.mark.long
def test_ten_thousand_damaged_models_are_loaded_or_refused_in_a_line(tmp_path):
    chance = random.Random(2)
    path = tmp_path / "damaged.onnx"
    change_look(model_path("ball"), path, look_checkpoint())  # a small look, so that damage hits all parts
    whole = path.read_bytes()
    outcomes = []
    started = time.monotonic()
    for at in range(10000):
        path.write_bytes(damaged(chance, whole, 4))
        outcomes.append(refused(lambda: Detector.from_file(path)))
        if at == 2000:
            before = resident_memory("self")
    assert all(each is None or ("\n" not in each and len(each) < 600) for each in outcomes)
    assert sum(each is not None for each in outcomes) > 5000
    assert resident_memory("self") - before < 64 * 2**20
    assert time.monotonic() - started < 300


@pytest.mark.long
def test_a_damaged_configuration_ends_the_command_with_a_line_and_no_traceback(tmp_path):
    path = tmp_path / "vm.toml"
    chance = random.Random(3)
    for _ in range(5):
        path.write_bytes(damaged(chance, b'model = "ball"\n[camera]\nsource = 3\n', 4))
        command = [COMMAND, "--config", path, "--check-config"]
        done = subprocess.run(command, capture_output=True, text=True, timeout=60, check=False)
        assert done.returncode == 1
        assert done.stderr.count("\n") == 1
        assert "Traceback" not in done.stderr
