"""vm-export with a close look, as a user types it."""

import pytest

from tests.looks import random_patches, upright
from tests.vm_export.checkpoints import peak_checkpoint
from tests.vm_export.looks import look_checkpoint
from tests.vm_export.test_cli import names_in, run
from tests.vm_export.test_reference import reference_file
from vm_embedded.network.model_file import read_model
from vm_embedded.network.session import CloseLook
from vm_export.checkpoint import Checkpoint
from vm_export.cli import main
from vm_export.export import export


@pytest.fixture
def folder(tmp_path):
    """A folder with a checkpoint and a close look."""
    peak_checkpoint().save(tmp_path / "model.pt")
    look_checkpoint().save(tmp_path / "look.pt")
    return tmp_path


def has_look(path):
    """Whether a model file has a close look that runs and passes its self-test."""
    look = CloseLook.of(read_model(path))
    return look is not None and len(look.run(random_patches(2))) == 2


def test_command_attaches_a_look(folder):
    done = run(folder / "model.pt", "--look", folder / "look.pt")
    assert names_in(folder) == ["look.pt", "model.onnx", "model.pt"]
    assert has_look(folder / "model.onnx")
    assert "close look at ball (8 x 8, channels 4, 5, 6)" in done.stdout
    assert "largest difference" in done.stdout


def test_command_attaches_no_look_to_a_network_without_peaks(folder):
    reference_file(folder / "model.yaml")
    options = ("--look", folder / "look.pt", "--classes", "ball:object,field:area")
    assert "the close look judges ball, but " in run(folder / "model.yaml", *options, code=1).stderr


def test_command_takes_the_look_of_another_model_file(folder):
    run(folder / "model.pt", "--look", folder / "look.pt")
    done = run(folder / "model.pt", "--look", folder / "model.onnx", "-o", folder / "other.onnx")
    assert "close look at ball" in done.stdout
    assert has_look(folder / "other.onnx")


def test_command_leaves_out_classes_without_peaks(folder):
    look_checkpoint(classes=(upright("goal"), "ball", upright("robot"))).save(folder / "several.pt")
    peak_checkpoint(classes=("ball", "goal:upright")).save(folder / "field.pt")
    done = run(folder / "field.pt", "--look", folder / "several.pt")
    assert "close look at goal, ball (8 x 8, channels 4, 5, 6)" in done.stdout
    done = run(folder / "model.pt", "--look", folder / "field.onnx")
    assert "close look at ball (8 x 8, channels 4, 5, 6)" in done.stdout
    assert has_look(folder / "model.onnx")


@pytest.mark.long
def test_command_attaches_a_look_to_a_model_file_and_removes_it(folder):
    run(folder / "model.pt")
    before = (folder / "model.onnx").read_bytes()
    done = run(folder / "model.onnx", "--look", folder / "look.pt", "-o", folder / "new.onnx")
    assert has_look(folder / "new.onnx")
    assert "close look at ball" in done.stdout
    run(folder / "new.onnx", "--no-look", "-o", folder / "old.onnx")
    assert not has_look(folder / "old.onnx")
    assert (folder / "old.onnx").read_bytes() == (folder / "model.onnx").read_bytes() == before
    assert names_in(folder) == ["look.pt", "model.onnx", "model.pt", "new.onnx", "old.onnx"]


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("model.pt", "--look", "missing.pt"), "can't read"),
        (("model.pt", "--look", "model.pt"), "model.pt is not a close look, which vm-train look writes"),
        (("look.pt",), "is a close look; attach it to a network: vm-export MODEL --look"),
        (("model.pt", "--look", "look.pt", "--to-yaml"), "--look is for ONNX files"),
        (("model.pt", "--look", "look.pt", "-o", "look.pt"), "would be overwritten"),
        (("model.pt", "--no-look"), "--no-look is for model files (.onnx)"),
        (("model.pt", "--look", "look.pt", "--classes", "goal:object,other:background"), "peaks 'ball'"),
        (("given.onnx",), "is a model file already"),
        (("damaged.onnx",), "damaged.onnx: not an ONNX file"),
        (("given.onnx", "--look", "look.pt"), "would be overwritten"),
        (("given.onnx", "--no-look", "-o", "new.onnx"), "has no close look to remove"),
        (("given.onnx", "--look", "look.pt", "-o", "new.onnx", "--radius", "0"), "--radius can't change"),
        (("given.onnx", "--to-yaml", "--edge", "same", "--max-distance", "9"), "--to-yaml, --max-distance, --edge"),
        (("missing.onnx", "--look", "look.pt", "-o", "new.onnx"), "No such file"),
        (("model.pt", "--look", "given.onnx"), "given.onnx has no close look"),
        (("model.pt", "--look", "missing.onnx"), "No such file"),
        (("damaged.onnx", "--look", "look.pt", "-o", "new.onnx"), "damaged.onnx: not an ONNX file"),
        (("given.onnx", "--look", "look.pt", "-o", "no/such/new.onnx"), "can't write"),
    ],
)
def test_command_says_in_one_line_what_is_wrong(folder, capsys, arguments, message):
    export(Checkpoint.load(folder / "model.pt"), folder / "given.onnx")
    (folder / "damaged.onnx").write_bytes((folder / "given.onnx").read_bytes()[:-9])
    before = {path: path.read_bytes() for path in folder.iterdir()}
    given = [str(folder / each) if each.endswith((".pt", ".onnx")) else each for each in arguments]
    assert main(given) == 1
    said = capsys.readouterr().err
    assert message in said
    assert said.startswith("vm-export: ")
    assert len(said.splitlines()) == 1
    assert {path: path.read_bytes() for path in folder.iterdir()} == before


def test_command_takes_one_of_the_two_options(folder):
    assert "not allowed with" in run(folder / "model.pt", "--look", folder / "look.pt", "--no-look", code=2).stderr
