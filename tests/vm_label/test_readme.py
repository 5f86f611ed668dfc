"""The README's way from a recording to a network that has learned from it, command by command."""

import json
import math
import shlex

import cv2
import pytest

from tests.test_docs import README
from tests.test_own_object import run
from vm_embedded.cameras.camera import CameraSettings
from vm_embedded.cameras.synthetic import SyntheticCamera
from vm_embedded.geometry.lens_files import format_lens_file
from vm_embedded.network.model_file import read_model
from vm_label.answers import AnswerFile
from vm_label.box_folder import read_box_folder

LESS = ("training.epochs=1", "training.steps=4", "training.batch=16", "data.validation=0.4")
"""Settings of a small fine-tuning."""


def write_recording(folder):
    """A video of a rolling ball, and the lens file of its camera, which does not move."""
    camera = SyntheticCamera(CameraSettings(source="synthetic:0"))
    film = cv2.VideoWriter(str(folder / "recording.mp4"), cv2.VideoWriter.fourcc(*"mp4v"), 5.0, camera.size)
    for at in range(12):
        moment = at * 4.0 * math.pi / 9.0  # the camera sways, and is back where it was
        film.write(camera.draw(moment))
    film.release()
    (folder / "my-lens.yaml").write_text(format_lens_file(camera.lens, camera.motion.orientation(0.0)))


@pytest.mark.long
def test_the_readme_leads_from_a_recording_to_a_tuned_network(tmp_path):
    write_recording(tmp_path)
    block = README.read_text().split("## Learn from your own frames")[1].split("```")[1]
    shown = {}
    commands = [shlex.split(line, comments=True) for line in block.splitlines()[1:] if line]
    assert [each[0] for each in commands] == ["vm-detect", "vm-label", "vm-label", "vm-train", "vm-evaluate"]
    for words in commands:
        if words == ["vm-label", "boxes"]:  # its page has tests of its own; here every answer is yes
            with AnswerFile(tmp_path / "boxes") as answers:
                for crop in read_box_folder(tmp_path / "boxes").crops:
                    answers.append(crop, "yes")
            continue
        less = [word for each in LESS for word in ("--set", each)] if words[0] == "vm-train" else []
        shown[words[0]] = run(words + less, tmp_path)
    assert len(list((tmp_path / "judged").glob("*.png"))) == 12
    assert "8 for training, 0 for validation, 4 for the test" in shown["vm-train"]  # a single recording
    assert "in 4 frames for the test, the look alone finds" in shown["vm-train"]
    assert "4 of 12 frames of judged" in shown["vm-evaluate"]
    assert "the whole detector" in shown["vm-evaluate"]
    networks = json.loads((tmp_path / "gain" / "scores.json").read_text())["networks"]
    assert [each["network"] for each in networks] == ["ball", "tuned/model.onnx"]
    assert networks[0]["scores"]["all"]["boxes"] == 4
    assert read_model(tmp_path / "tuned" / "model.onnx").manifest.look is not None
