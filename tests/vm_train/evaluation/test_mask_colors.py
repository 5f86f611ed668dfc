"""Every class of a network needs a color in masks."""

from dataclasses import replace
from pathlib import Path

import pytest

from vm_embedded.errors import InputError
from vm_train.evaluation.mask_colors import classes_with_colors, default_colors

from .test_evaluation import MANIFEST

COLORS = default_colors(Path("model.onnx"), None)


def test_classes_without_colors_are_asked_for():
    manifest = replace(MANIFEST, classes=(*MANIFEST.classes[:3], replace(MANIFEST.classes[3], name="grass")))
    with pytest.raises(InputError, match=r"--color grass=R,G,B"):
        classes_with_colors(manifest, COLORS, [])
    assert classes_with_colors(manifest, COLORS, [("grass", (1, 2, 3))]).colors["grass"] == ((1, 2, 3),)
    with pytest.raises(InputError, match="did you mean 'ball'"):
        classes_with_colors(MANIFEST, COLORS, [("bal", (1, 2, 3))])
    with pytest.raises(InputError, match="share the color"):
        classes_with_colors(MANIFEST, COLORS, [("environment", (255, 0, 0))])
