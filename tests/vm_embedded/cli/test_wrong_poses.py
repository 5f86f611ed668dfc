"""Users who give a wrong pose hear of it: vm-detect and vm-doctor name a better one. Real frames of one camera."""

import json
import math
import re
import shutil
import sys
from pathlib import Path

import pytest

from tests.preloaded import run_preloaded
from vm_embedded.geometry.lens_files import read_lens_file

from .commands import run

RADIUS = ("--object-radius", "0.11")
WRONG = [("--height", "1.5", "--pitch", "0deg"), ("--height", "0.77", "--pitch=-20deg"), ("--height", "0.4")]


@pytest.fixture(scope="module")
def camera(shared, tmp_path_factory):
    """Frames of one camera in a folder, its lens file without a pose, and its pose."""
    folder = tmp_path_factory.mktemp("camera")
    (folder / "frames").mkdir()
    kept = None
    for path in sorted((shared / "real" / "images").glob("*.yaml")):
        kept = kept or path.read_text()
        if path.read_text() == kept:
            image = path.with_name(path.name.replace("lens", "image")).with_suffix(".jpg")
            shutil.copy(image, folder / "frames")
    (folder / "lens.yaml").write_text(kept.split("Hoc")[0])
    (folder / "known.yaml").write_text(kept)
    return folder / "frames", folder / "lens.yaml", read_lens_file(folder / "known.yaml").orientation


def degrees(angle):
    return f"{math.degrees(angle):.2f}deg"


def right(pose):
    return "--height", f"{pose.height:.3f}", f"--pitch={degrees(pose.pitch)}", f"--roll={degrees(pose.roll)}"


@pytest.mark.parametrize("model", ["ball", "soccer"])
def test_the_right_pose_is_not_doubted(camera, model):
    frames, lens, pose = camera
    done = run(frames, "--lens", lens, *right(pose), *RADIUS, "--model", model)
    assert "pose" not in done.stderr
    assert all(json.loads(line)["pose"]["verdict"] in ("unknown", "consistent") for line in done.stdout.splitlines())


@pytest.mark.parametrize("given", WRONG)
def test_a_wrong_pose_is_named_and_a_better_one_advised(camera, given):
    frames, lens, pose = camera
    given = (*given, *(f"--pitch={degrees(pose.pitch)}",)) if len(given) == 2 else given
    remark = run(frames, "--lens", lens, *given, *RADIUS).stderr
    assert "vm-detect: the pose is wrong: the camera seems to" in remark
    words = " ".join(given).replace("=", " ") + " " + remark[remark.index("try ") :]
    height = float(re.findall(r"--height ([\d.]+)", words)[-1])
    pitch = float(re.findall(r"--pitch (-?[\d.]+)deg", words)[-1])
    assert height == pytest.approx(pose.height, rel=0.2)
    assert pitch == pytest.approx(math.degrees(pose.pitch), abs=5.0)


@pytest.mark.long
def test_vm_doctor_looks_at_the_users_frames(camera, tmp_path):
    frames, lens, _ = camera
    command = [Path(sys.executable).parent / "vm-doctor", "--json", "--status-socket", tmp_path / "socket"]
    given = ["--camera", frames, "--lens", lens, "--height", "0.77", "--pitch=-20deg", *RADIUS]
    done = run_preloaded([*map(str, command), *map(str, given)])
    seen = {each["about"]: each for each in map(json.loads, done.stdout.splitlines())}["detection"]
    assert (seen["state"], "the pose is wrong" in seen["mend"]) == ("warning", True), seen
