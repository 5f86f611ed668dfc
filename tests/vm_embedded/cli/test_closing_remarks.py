"""What vm-detect says after the last frame about a lens, pose or size that is probably wrong."""

import shutil

import pytest

from tests.drawn_scenes import IMAGES

from .commands import one_complaint, run
from .test_detect_files import DEMO

PICTURES = sorted(DEMO.parent.glob("image*.jpg"))
NOTHING = ("--model", "ball", "--min-confidence", 1)
"""Every proposal is rejected."""


def test_frames_without_any_object_are_remarked():
    done = run(DEMO.parent, *NOTHING)
    one_complaint(done, "objects were found in 0 of 12 frames", "a radius, not a diameter; it is 0.095", "--explain")


def test_a_few_frames_say_nothing():
    assert run(*PICTURES[:4], *NOTHING).stderr == ""


@pytest.mark.long
def test_features_of_the_field_show_that_lens_and_pose_are_right():
    found = run(*PICTURES[:6], "--model", "soccer", "--min-confidence", 1)
    assert found.stderr == ""
    one_complaint(run(*PICTURES[:6], "--model", "soccer", "--min-confidence", 1, "--object-radius", 0.1), "0 of 6")


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("projection: RECTILINEAR\nfocal_length: 3.6\nfov: 1.66\n", "a circle of 7.86 px in a picture of 640 x 512 px"),
        ("camera_matrix: [0.42, 0, 0.5, 0, 0.42, 0.5, 0, 0, 1]\n", "the optical center (0.5, 0.5) px is far"),
        ("camera_matrix: [420, 0, 3195, 0, 420, 256, 0, 0, 1]\n", "the optical center (3195, 256) px is far"),
    ],
)
def test_a_lens_in_other_units_is_named_once(text, says, tmp_path):
    (tmp_path / "lens.yaml").write_text(text)
    for name in ("a.jpg", "b.jpg"):
        shutil.copy(IMAGES[0], tmp_path / name)
    done = run(tmp_path, "--lens", tmp_path / "lens.yaml", "--height", 0.8, "--pitch", "20deg")
    assert done.stderr.count(says) == 1
    assert "vm-detect: a.jpg: " in done.stderr
