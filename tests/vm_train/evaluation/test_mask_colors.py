"""Every class of a network needs a color in masks."""

from dataclasses import replace
from pathlib import Path

import pytest

from vm_embedded.errors import InputError
from vm_embedded.network.manifest import ObjectClass
from vm_train.evaluation.mask_colors import classes_with_colors, default_colors

from .test_evaluation import MANIFEST

COLORS = default_colors(Path("model.onnx"), None)


def test_classes_without_colors_are_asked_for():
    grass = ObjectClass("grass", "area")
    manifest = replace(MANIFEST, classes=(*MANIFEST.classes[:3], grass))
    with pytest.raises(InputError, match=r"--color grass=R,G,B"):
        classes_with_colors(manifest, COLORS, [])
    assert classes_with_colors(manifest, COLORS, [("grass", (1, 2, 3))]).colors["grass"] == ((1, 2, 3),)
    with pytest.raises(InputError, match="did you mean 'ball'"):
        classes_with_colors(MANIFEST, COLORS, [("bal", (1, 2, 3))])
    with pytest.raises(InputError, match="share the color"):
        classes_with_colors(MANIFEST, COLORS, [("environment", (255, 0, 0))])


def test_the_classes_of_a_training_by_an_earlier_release_are_read(tmp_path):
    own = '[classes]\npuck = { kind = "object", colors = [[9, 9, 9]] }\nice = { kind = "area", colors = [[1, 1, 1]] }\n'
    (tmp_path / "train.toml").write_text(own + "[training]\nan_entry_that_is_gone = 0\n")
    colors = {"puck": ((9, 9, 9),), "ice": ((1, 1, 1),)}
    assert default_colors(tmp_path / "model.pt", None) == colors
    (tmp_path / "train.toml").write_text(own.replace("object", "thing"))
    with pytest.raises(InputError, match=r"train\.toml: puck: kind must be one of"):
        default_colors(tmp_path / "model.pt", None)


def test_a_background_class_without_a_color_gets_those_of_the_classes_that_the_network_lacks():
    classes = (ObjectClass("ball", "object"), ObjectClass("other", "background"))
    known = classes_with_colors(replace(MANIFEST, classes=classes), COLORS, [("ball", (255, 255, 0))]).colors
    assert known["ball"] == ((255, 0, 0), (255, 255, 0))
    assert sorted(known["other"]) == [(0, 0, 0), (0, 0, 255), (0, 255, 0), (255, 255, 255)]
