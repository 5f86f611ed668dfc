"""look.toml: entries, limits and what fits together."""

from itertools import pairwise

import numpy as np
import pytest

from vm_embedded.config.sections import parse_overrides, read_sections
from vm_embedded.config.toml_writer import to_commented_toml
from vm_embedded.detection.settings import Settings
from vm_embedded.errors import InputError
from vm_embedded.network.bundled import model_path
from vm_train.evaluation.answers import load_subject
from vm_train.look.configuration import LookConfiguration, LookRecipe
from vm_train.look.run import classes_to_judge
from vm_train.runs.configuration import header


def read(*entries):
    return read_sections(LookConfiguration, None, parse_overrides(entries, "training.epochs=5"))


def test_the_printed_file_is_the_default_configuration(tmp_path):
    path = tmp_path / "look.toml"
    path.write_text(to_commented_toml(LookConfiguration(), header("look")))
    assert read_sections(LookConfiguration, path) == LookConfiguration()
    lines = path.read_text().splitlines()
    assert all(before.startswith("#") for before, line in pairwise(lines) if " = " in line and "kind" not in line)


def test_the_shape_of_the_network_comes_from_two_sections():
    shape = read("patches.size=24", "network.channels=[4, 6, 8]", "network.hidden=5").shape(3)
    assert (shape.size, shape.channels, shape.hidden, shape.classes) == (24, (4, 6, 8), 5, 3)


@pytest.mark.parametrize(
    ("entry", "said"),
    [
        ("patches.size=4", "size must be a whole number from 8 to 128 px, not 4"),
        ("patches.sizee=16", "unknown entry in [patches] 'sizee'; did you mean 'size'?"),
        ("network.channels=[4, 8]", "channels must be three whole numbers from 1 to 1024, as [16, 32, 48], not [4, 8]"),
        ("network.channels=[4, 8, 0]", "channels must be three whole numbers"),
        ("network.channels=[4, 8, true]", "channels must be three whole numbers"),
        ("augmentation.blur=[2, 1]", "blur must be [low, high]; 2 is above 1"),
        ("classes.ball=1", 'ball must be like { kind = "object"'),
    ],
)
def test_a_wrong_entry_is_named_with_what_is_allowed(entry, said):
    with pytest.raises(InputError) as error:
        read(entry)
    assert said in str(error.value)


@pytest.fixture(scope="module")
def soccer():
    return load_subject(model_path("soccer"), Settings())


def test_a_look_judges_all_that_its_mesh_network_has_peaks_for(soccer):
    assert classes_to_judge(read(), soccer, "soccer") == ("ball", "goal", "robot")
    assert classes_to_judge(read(), load_subject(model_path("ball"), Settings()), "ball") == ("ball",)


@pytest.mark.parametrize(
    ("kinds", "said"),
    [
        ({"line": None, "field": None}, "the truth about a goal needs the classes line, field"),
        ({"robot": None}, "the truth about a goal needs the classes robot"),
        (
            {"robot": "area"},
            r"has class 'robot', but those of the kind upright in \[classes\] are goal: give the class",
        ),
        ({"ball": None}, r"has class 'ball', but those of the kind object in \[classes\] are none: give the class"),
    ],
)
def test_masks_need_all_classes_and_uprights_those_that_tell_where_they_stand(soccer, kinds, said):
    given = {"ball": "object", "goal": "upright", "line": "area", "field": "area", "robot": "upright"} | kinds
    masks = [
        f"classes.{name}={{ kind = '{kind}', colors = [[{number}, 0, 0]] }}"
        for number, (name, kind) in enumerate(given.items())
        if kind is not None
    ]
    configuration = read(*masks, "classes.other={ kind = 'background', colors = [[0, 0, 9]] }")
    with pytest.raises(InputError, match=said):
        classes_to_judge(configuration, soccer, "soccer")


@pytest.mark.parametrize(("epochs", "rounds"), [(12, 3), (7, 3), (5, 5), (4, 1), (1, 3)])
def test_rounds_share_the_epochs(epochs, rounds):
    recipe = LookRecipe(epochs=epochs, rounds=rounds)
    begins = [0, *(each for each in range(epochs) if recipe.begins_round(each)), epochs]
    assert len(begins) - 1 == min(rounds, epochs)
    counts = np.diff(begins)
    assert counts.max() - counts.min() <= 1
