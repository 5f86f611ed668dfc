"""train.toml is read as it is documented, and what is wrong in it is said."""

import pytest

from vm_embedded.config.sections import parse_overrides, read_sections
from vm_embedded.config.toml_writer import to_commented_toml
from vm_embedded.errors import InputError
from vm_export.canvas_shape import CanvasShape
from vm_train.learning.configuration import Recipe, TrainConfiguration

DEFAULT = TrainConfiguration()


@pytest.fixture
def write(tmp_path):
    def written(text):
        path = tmp_path / "train.toml"
        path.write_text(text)
        return path

    return written


def test_the_documented_defaults_are_read_as_the_defaults(write):
    assert read_sections(TrainConfiguration, write(to_commented_toml(DEFAULT))) == DEFAULT
    assert read_sections(TrainConfiguration, None) == DEFAULT


def test_classes_come_in_their_order_with_their_colors(write):
    path = write(
        "[classes]\nfield = { kind = 'area', colors = [[0, 255, 0], [9, 9, 9]] }\n"
        "ball = { kind = 'object', colors = [[255, 0, 0]] }\n"
    )
    found = read_sections(TrainConfiguration, path)
    assert [(each.name, each.kind) for each in found.manifest.classes] == [("field", "area"), ("ball", "object")]
    assert found.classes.mask_classes().colors["field"] == ((0, 255, 0), (9, 9, 9))
    assert found.network_shape.classes == 2
    assert read_sections(TrainConfiguration, write(to_commented_toml(found))) == found


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("[traning]\n", "did you mean 'training'"),
        ("[training]\nepoch = 3\n", "did you mean 'epochs'"),
        ("[training]\nepochs = 0\n", "epochs must be a whole number from 1"),
        ("[training]\nselection = 'balance'\n", "did you mean 'balanced'"),
        ("[mesh]\nradius = 'big'\n", "radius must be a number"),
        ("[mesh]\ngrid = 'hexagonal'\nmodel = 'ring8'\n", "six neighbors"),
        ("[mesh]\nmodel = 'octaves'\n[network]\nwidth = 12\n", "multiple of 8, such as 8, not 12"),
        *(
            (
                f"[mesh]\nmodel = 'octaves'\n[network]\ndepth = 1\n{entry}\n",
                f"{entry.split()[0]} of .network. has no effect",
            )
            for entry in ("activation = 'relu'", "kind = 'separable'")
        ),
        ("[mesh]\nmodel = 'octaves'\ngrid = 'hexagonal'\n", "hexagonal grid needs a mesh.model with six neighbors"),
        ("[classes]\nball = 3\n", "ball must be like"),
        ("[classes]\nball = { kind = 'thing', colors = [[1, 2, 3]] }\n", "kind must be one of"),
        ("[classes]\nball = { kind = 'object', colors = [[1, 2]] }\n", r"a color is \[red, green, blue\]"),
        ("[classes]\nball = { kind = 'object', colors = [[1, 2, 256]] }\n", "from 0 to 255"),
        ("[classes]\nball = { kind = 'object', colors = [[1, 2, 3]] }\n", "at least two classes"),
        (
            "[classes]\nball = { kind = 'object', colors = [[1, 2, 3]] }\n"
            "line = { kind = 'area', colors = [[1, 2, 3]] }\n",
            "share the color",
        ),
    ],
)
def test_what_is_wrong_is_said(write, text, said):
    with pytest.raises(InputError, match=said):
        read_sections(TrainConfiguration, write(text))


def test_entries_can_be_overridden(write):
    path = write("[training]\nepochs = 3\nbatch = 2\n")
    given = parse_overrides(["training.epochs=7", "training.selection=balanced", "mesh.radius = 0.1"], "a.b=c")
    found = read_sections(TrainConfiguration, path, given)
    assert (found.training.epochs, found.training.batch) == (7, 2)
    assert (found.training.selection, found.mesh.radius) == ("balanced", 0.1)


def test_octaves_have_a_network_and_a_layout_of_their_own(write):
    found = read_sections(TrainConfiguration, write("[mesh]\nmodel = 'octaves'\n[network]\ndepth = 2\nwidth = 24\n"))
    assert found.network_shape == CanvasShape(2, 24, len(found.classes.colors), peaks=3)
    assert found.manifest.peaks == ("ball", "goal", "robot")
    assert found.manifest.on_canvas
    assert read_sections(TrainConfiguration, write(to_commented_toml(found))) == found


@pytest.mark.parametrize("text", ["epochs=7", "training.epochs", "training.=7", "=7"])
def test_an_override_that_is_none_is_refused(text):
    with pytest.raises(InputError, match=r"training\.epochs=5"):
        parse_overrides([text], "training.epochs=5")


def test_only_hard_selection_has_rounds():
    assert Recipe(selection="hard", rounds=3).trainings == 3
    assert Recipe(selection="balanced", rounds=3).trainings == 1
    assert [Recipe(selection="hard").selection_of(each) for each in (1, 2)] == ["balanced", "hard"]
