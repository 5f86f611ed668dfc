"""Looks in model files: beside the mesh network, with their tests, for those classes that it has peaks for."""

from dataclasses import replace

import numpy as np
import onnx
import pytest
import torch

from tests.looks import random_patches, upright
from tests.vm_export.checkpoints import peak_checkpoint
from tests.vm_export.looks import look_checkpoint, look_network, torch_answers
from vm_embedded.errors import ModelError
from vm_embedded.network.look_contract import LOOK_KEY, JudgedClass
from vm_embedded.network.manifest import METADATA_KEY
from vm_embedded.network.model_file import SEAL_KEY, read_model, sealed
from vm_embedded.network.session import CloseLook, Session
from vm_export import attach_look, export
from vm_export.change_model import change_look
from vm_export.eight_bits import round_kernels
from vm_export.look_checkpoint import LookCheckpoint
from vm_export.look_graph import look_model
from vm_export.look_weights import look_of
from vm_export.metadata import with_metadata

SEVERAL = (JudgedClass(name="ball"), upright("goal"), upright("robot", 0.4))


def check_self_test(test, look):
    """It has the most and the least likely example of each class, and patches that are made of them, with torch's
    answers."""
    likely = torch_answers(look.network, look.examples)[..., 0]
    ends = sorted({*likely.argmax(axis=0).tolist(), *likely.argmin(axis=0).tolist()})
    np.testing.assert_array_equal(test.patches[: len(ends)], look.examples[ends])
    assert len(test.all_patches) == len(test.answers) > 50
    np.testing.assert_allclose(test.answers, torch_answers(look.network, test.all_patches), atol=1e-5)
    return test.patches[len(ends) :]


def sure(look, number):
    """The look after a calibration with which it is sure of all patches that show a class of this number."""
    p = torch_answers(look.network, look.examples)[:, number, 0].astype(float)
    logits = np.log(p / (1.0 - p))
    middle = (logits.min() + logits.max()) / 2.0
    return look.recalibrated(look.contract.names[number], 1e7, -1e7 * middle, "no picture")


def test_a_network_that_is_sure_of_all_patches_is_also_tested_with_a_mixture():
    look = sure(look_checkpoint(), 0)
    test = attach_look.tested_contract(look).self_test
    assert len(test.patches) == 3
    check_self_test(test, look)
    ends, mixture = test.patches[:2].astype(int), test.patches[2].astype(int)
    assert ((mixture >= ends.min(axis=0)) & (mixture <= ends.max(axis=0))).all()


@pytest.mark.parametrize("numbers", [(), (1,), (0, 2)], ids=str)
def test_for_each_class_that_a_network_is_sure_of_there_is_a_mixture_of_its_examples(numbers):
    look = look_checkpoint(classes=SEVERAL)
    for number in numbers:
        look = sure(look, number)
    mixtures = check_self_test(attach_look.tested_contract(look).self_test, look)
    assert len(mixtures) == len(numbers)
    likely = torch_answers(look.network, look.examples)[..., 0]
    for number, mixture in zip(numbers, mixtures.astype(int), strict=True):
        ends = look.examples[[likely[:, number].argmax(), likely[:, number].argmin()]].astype(int)
        assert ((mixture >= ends.min(axis=0)) & (mixture <= ends.max(axis=0))).all()


def test_a_model_file_holds_both_networks(tmp_path):
    mesh, look = peak_checkpoint(), look_checkpoint(provenance={"trained_by": "a test"})
    assert export.export(mesh, tmp_path / "model.onnx", look) < 1e-4
    read = read_model(tmp_path / "model.onnx")
    onnx.checker.check_model(onnx.load(tmp_path / "model.onnx"), full_check=True)
    example = export.random_example(mesh.network, 50, 1)
    np.testing.assert_allclose(Session(read).answer(example), example.probabilities[:-1], atol=1e-5)

    close = CloseLook.of(read)
    assert close.contract.provenance["trained_by"] == "a test"
    assert close.contract.provenance["exported_by"].startswith("vm-export")
    check_self_test(close.contract.self_test, look)
    patches = random_patches(20, seed=5)
    np.testing.assert_allclose(close.run(patches), torch_answers(look.network, patches), atol=1e-5)


def test_a_look_changes_nothing_but_the_metadata(tmp_path):
    export.export(peak_checkpoint(), tmp_path / "without.onnx")
    export.export(peak_checkpoint(), tmp_path / "with.onnx", look=look_checkpoint())
    assert change_look(tmp_path / "without.onnx", tmp_path / "attached.onnx", look_checkpoint()).difference < 1e-4
    assert (tmp_path / "attached.onnx").read_bytes() == (tmp_path / "with.onnx").read_bytes()
    assert change_look(tmp_path / "with.onnx", tmp_path / "removed.onnx", None).difference == 0.0
    assert (tmp_path / "removed.onnx").read_bytes() == (tmp_path / "without.onnx").read_bytes()
    graphs = [onnx.load(tmp_path / name).graph for name in ("without.onnx", "with.onnx")]
    assert graphs[0] == graphs[1]


def test_a_look_replaces_the_one_before(tmp_path):
    export.export(peak_checkpoint(), tmp_path / "model.onnx", look=look_checkpoint(1))
    change_look(tmp_path / "model.onnx", tmp_path / "other.onnx", look_checkpoint(2))
    export.export(peak_checkpoint(), tmp_path / "expected.onnx", look=look_checkpoint(2))
    assert (tmp_path / "other.onnx").read_bytes() == (tmp_path / "expected.onnx").read_bytes()


def test_a_look_comes_back_from_a_checkpoint_and_from_a_model_file(tmp_path):
    look = look_checkpoint()
    look.save(tmp_path / "look.pt")
    read = LookCheckpoint.load(tmp_path / "look.pt")
    assert read.contract == look.contract
    np.testing.assert_array_equal(read.examples, look.examples)
    for name, value in look.network.state_dict().items():
        assert torch.equal(read.network.state_dict()[name], value), name
    round_kernels(look.network)
    export.export(peak_checkpoint(), tmp_path / "model.onnx", look=look)
    again = look_of(read_model(tmp_path / "model.onnx"))
    patches = random_patches(5)
    np.testing.assert_allclose(torch_answers(again.network, patches), torch_answers(look.network, patches), atol=1e-5)


def test_other_metadata_of_a_model_file_stays(tmp_path):
    export.export(peak_checkpoint(), tmp_path / "model.onnx")
    model = onnx.load(tmp_path / "model.onnx")
    assert model.metadata_props.pop().key == SEAL_KEY
    model.metadata_props.add(key="author", value="Zoë")
    (tmp_path / "model.onnx").write_bytes(sealed(model.SerializeToString()))
    change_look(tmp_path / "model.onnx", tmp_path / "other.onnx", look_checkpoint())
    kept = {each.key: each.value for each in onnx.load(tmp_path / "other.onnx").metadata_props}
    assert sorted(kept) == ["author", "visual_mesh", "visual_mesh_look", "visual_mesh_sha256"]
    assert kept["author"] == "Zoë"


def test_a_look_that_differs_from_torch_is_not_written(tmp_path, monkeypatch):
    other = look_model(look_network(5))
    monkeypatch.setattr(attach_look, "look_model", lambda network: other)
    export.export(peak_checkpoint(), tmp_path / "model.onnx")
    with pytest.raises(ModelError, match=r"answers of the close look .* differ by"):
        export.export(peak_checkpoint(), tmp_path / "new.onnx", look=look_checkpoint())
    with pytest.raises(ModelError, match=r"answers of the close look .* differ by"):
        change_look(tmp_path / "model.onnx", tmp_path / "new.onnx", look_checkpoint())
    assert [path.name for path in tmp_path.iterdir()] == ["model.onnx"]


def test_networks_whose_answers_are_not_numbers_are_not_written(tmp_path):
    look, mesh = look_checkpoint(), peak_checkpoint()
    with torch.no_grad():
        look.network.answers.bias[2] = torch.nan
        mesh.network.head.bias[0] = torch.nan
    with pytest.raises(ModelError, match="close look: its answers are NaN or infinite"):
        export.export(peak_checkpoint(), tmp_path / "model.onnx", look=look)
    with pytest.raises(ModelError, match="the new model: its answers are NaN or infinite"):
        export.export(mesh, tmp_path / "model.onnx")
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("classes", [("goal",), ("environment",), ("goal", upright("robot"))], ids=str)
def test_a_look_at_classes_without_peaks_only_is_not_written(tmp_path, classes):
    export.export(peak_checkpoint(), tmp_path / "model.onnx")
    look = look_checkpoint(classes=classes)
    for write in (
        lambda: export.export(peak_checkpoint(), tmp_path / "new.onnx", look=look),
        lambda: change_look(tmp_path / "model.onnx", tmp_path / "new.onnx", look),
    ):
        with pytest.raises(ModelError, match=rf"judges {', '.join(look.contract.names)}, but"):
            write()
    assert [path.name for path in tmp_path.iterdir()] == ["model.onnx"]


def test_there_must_be_a_look_to_remove(tmp_path):
    export.export(peak_checkpoint(), tmp_path / "model.onnx")
    with pytest.raises(ModelError, match=r"model\.onnx has no close look to remove"):
        change_look(tmp_path / "model.onnx", tmp_path / "other.onnx", None)


@pytest.fixture
def field(tmp_path):
    """A model file of a network with goals and robots."""
    path = tmp_path / "field.onnx"
    export.export(peak_checkpoint(classes=("robot:upright", "ball", "goal:upright")), path)
    return path


def attach(path, look):
    assert change_look(path, path, look).difference < 1e-4
    return read_model(path)


def test_one_look_in_a_model_file_judges_the_object_and_uprights(field):
    look = look_checkpoint(classes=SEVERAL)
    read = attach(field, look)
    close = CloseLook.of(read)
    assert close.contract.classes == SEVERAL
    assert read.manifest.searched_class == "ball"
    patches = random_patches(9, seed=5)
    np.testing.assert_allclose(close.run(patches), torch_answers(look.network, patches), atol=1e-5)
    check_self_test(close.contract.self_test, look)


def test_classes_without_peaks_are_left_out(tmp_path):
    look, path = look_checkpoint(classes=SEVERAL), tmp_path / "model.onnx"
    export.export(peak_checkpoint(classes=("ball", "robot:upright", "line:area")), path, look)
    close = CloseLook.of(read_model(path))
    assert close.contract.names == ("ball", "robot")
    patches = random_patches(9, seed=5)
    np.testing.assert_allclose(close.run(patches), torch_answers(look.network, patches)[:, [0, 2]], atol=1e-5)
    check_self_test(close.contract.self_test, look.part(("ball", "robot")))
    export.export(peak_checkpoint(classes=("ball", "robot:upright", "line:area")), tmp_path / "without.onnx")
    change_look(tmp_path / "without.onnx", tmp_path / "other.onnx", look)
    assert (tmp_path / "other.onnx").read_bytes() == path.read_bytes()


def test_a_look_at_other_classes_replaces_the_one_before(field):
    attach(field, look_checkpoint(1, classes=SEVERAL))
    first = read_model(field)
    second = attach(field, look_checkpoint(3, classes=SEVERAL[1:2]))
    assert second.look != first.look
    assert second.manifest.look.names == ("goal",)
    assert second.manifest.searched_class is None


def test_no_look_removes_it(field, tmp_path):
    before = field.read_bytes()
    attach(field, look_checkpoint(classes=SEVERAL))
    assert change_look(field, tmp_path / "bare.onnx", None).difference == 0.0
    assert (tmp_path / "bare.onnx").read_bytes() == before


def test_a_look_at_several_classes_comes_back_from_a_model_file(field, tmp_path):
    """Its calibration is part of the weights of its answers."""
    look = look_checkpoint(classes=SEVERAL)
    again = look_of(attach(field, look))
    assert again.contract.classes == look.contract.classes
    assert again.network.calibration.tolist() == [[1.0, 0.0]] * 3
    patches = random_patches(5)
    np.testing.assert_allclose(torch_answers(again.network, patches), torch_answers(look.network, patches), atol=1e-5)
    changed = again.recalibrated("robot", 0.5, 1.0, "a test")
    close = CloseLook.of(attach(field, changed))
    np.testing.assert_allclose(close.run(patches), torch_answers(changed.network, patches), atol=1e-5)


@pytest.mark.parametrize(
    ("classes", "message"),
    [
        (("ball", "goal"), "upright_radius of at least 0.01 m for 'goal', not 0 m"),
        ((upright("goal"), upright("ball")), "0.3 m for 'ball'; for a class of kind object it must be 0"),
        ((upright("post"),), "judges post, but"),
    ],
)
def test_a_look_at_another_kind_of_class_is_refused(field, tmp_path, classes, message):
    with pytest.raises(ModelError, match=message):
        change_look(field, tmp_path / "other.onnx", look_checkpoint(classes=classes))
    assert not (tmp_path / "other.onnx").exists()


def test_a_file_whose_look_is_not_that_of_its_manifest_is_refused(field, tmp_path):
    without = read_model(field)
    read = attach(field, look_checkpoint(classes=SEVERAL))
    (text,) = (each.value for each in onnx.load_from_string(read.content).metadata_props if each.key == LOOK_KEY)
    fewer = replace(read.manifest, look=replace(read.manifest.look, classes=SEVERAL[:2], self_test=None))
    for content, entries, message in (
        (read.content, {LOOK_KEY: None}, "its manifest has a close look, its metadata has none"),
        (without.content, {LOOK_KEY: text}, "its metadata has a close look, its manifest has none"),
        (without.content, {LOOK_KEY: ""}, "its metadata has a close look, its manifest has none"),
        (read.content, {METADATA_KEY: without.manifest.as_json()}, "its metadata has a close look, its manifest has"),
        (read.content, {LOOK_KEY: "?"}, "its close look can't be read"),
        (read.content, {METADATA_KEY: fewer.as_json()}, "changed.onnx, close look: its inputs and outputs are"),
    ):
        (tmp_path / "changed.onnx").write_bytes(with_metadata(content, entries))
        with pytest.raises(ModelError, match=message):
            CloseLook.of(read_model(tmp_path / "changed.onnx"))
