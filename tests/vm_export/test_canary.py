"""vm-export --canary: a picture that the detector must find again at each start."""

import subprocess
import sys
from pathlib import Path

import pytest
import torch

from tests.vm_export.looks import look_checkpoint
from vm_embedded.live.proof import prove
from vm_embedded.network.bundled import model_path
from vm_embedded.network.canary import PACKAGE_PICTURE
from vm_embedded.network.model_file import read_model

pytest.importorskip("onnxruntime")

TOP = Path(__file__).parents[2]
DEMO = TOP / "tests/fixtures/demo"
LENS = TOP / "export/networks/canary.yaml"


def vm_export(*arguments):
    command = [str(Path(sys.executable).with_name("vm-export")), *map(str, arguments)]
    return subprocess.run(command, capture_output=True, text=True, check=False, timeout=300)


def refused(*arguments):
    done = vm_export(*arguments)
    assert done.returncode == 1
    assert "Traceback" not in done.stderr
    return done.stderr


@pytest.mark.long
def test_a_model_file_gets_a_picture_of_the_user(tmp_path):
    output = tmp_path / "mine.onnx"
    done = vm_export("ball", "--canary", DEMO / "image0000001.jpg", DEMO / "lens0000001.yaml", "-o", output)
    assert done.returncode == 0, done.stderr
    made = read_model(output)
    assert made.canary.picture == (DEMO / "image0000001.jpg").read_bytes()
    assert prove(made).startswith("self-test passed, canary found (1 ball, ")


@pytest.mark.long
def test_the_networks_of_the_package_are_what_the_command_writes(tmp_path):
    output = tmp_path / "again.onnx"
    done = vm_export("ball", "--canary", PACKAGE_PICTURE, LENS, "-o", output)
    assert done.returncode == 0, done.stderr
    again, shipped = read_model(output), read_model(model_path("ball"))
    assert again.look == shipped.look
    assert again.canary == shipped.canary


@pytest.mark.long
def test_pictures_that_can_not_be_a_canary_are_refused(tmp_path):
    output = tmp_path / "new.onnx"
    empty = DEMO / "image0000005.jpg", DEMO / "lens0000005.yaml"
    assert "find no ball in it" in refused("ball", "--canary", *empty, "-o", output)
    assert "can't read" in refused("ball", "--canary", tmp_path / "no.jpg", LENS, "-o", output)
    (tmp_path / "text.jpg").write_text("no picture")
    assert "can't be a canary" in refused("ball", "--canary", tmp_path / "text.jpg", LENS, "-o", output)
    (tmp_path / "lens.yaml").write_text(LENS.read_text().partition("Hoc")[0])
    assert "Hoc" in refused("ball", "--canary", PACKAGE_PICTURE, tmp_path / "lens.yaml", "-o", output)
    both = refused("ball", "--canary", PACKAGE_PICTURE, LENS, "--no-look", "-o", output)
    assert "another close look or another canary" in both
    assert not output.exists()


@pytest.mark.long
def test_a_look_that_finds_no_canary_gives_a_file_without_one_and_a_warning(tmp_path):
    look = look_checkpoint()
    with torch.no_grad():
        look.network.calibration[:, 1] = -20.0  # no patch shows a ball to it
    look.save(tmp_path / "look.pt")
    output = tmp_path / "new.onnx"
    done = vm_export("ball", "--look", tmp_path / "look.pt", "-o", output)
    assert done.returncode == 0, done.stderr
    advice = f"give it another picture with vm-export {output} --canary IMAGE LENS\n"
    assert done.stderr.startswith(f"vm-export: {output} has no canary, because ")
    assert done.stderr.endswith(advice)
    made = read_model(output)
    assert made.canary is None
    assert prove(made).startswith("self-test passed")
