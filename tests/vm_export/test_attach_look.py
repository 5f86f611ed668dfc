"""Looks in model files: beside the mesh network, with their tests, one for each class."""

import numpy as np
import onnx
import pytest
import torch

from tests.looks import random_patches
from tests.vm_export.checkpoints import peak_checkpoint
from tests.vm_export.looks import look_checkpoint, look_network, torch_answers
from vm_embedded.errors import ModelError
from vm_embedded.network.look_contract import look_key
from vm_embedded.network.model_file import SEAL_KEY, read_model, sealed
from vm_embedded.network.session import CloseLook, Session
from vm_export import attach_look, export
from vm_export.change_model import change_looks
from vm_export.eight_bits import round_kernels
from vm_export.look_checkpoint import LookCheckpoint
from vm_export.look_graph import look_model
from vm_export.look_weights import looks_of
from vm_export.metadata import with_metadata


def check_self_test(test, look):
    """It has the most and the least likely example, and patches that are made of them, with torch's answers."""
    likely = torch_answers(look.network, look.examples)[:, 0]
    ends = sorted({int(likely.argmax()), int(likely.argmin())})
    np.testing.assert_array_equal(test.patches, look.examples[ends])
    assert len(test.all_patches) == len(test.answers) > 50
    np.testing.assert_allclose(test.answers, torch_answers(look.network, test.all_patches), atol=1e-5)


def test_a_network_that_is_sure_of_all_patches_is_also_tested_with_a_mixture():
    look = look_checkpoint()
    p = torch_answers(look.network, look.examples)[:, 0].astype(float)
    logits = np.log(p / (1.0 - p))
    middle = (logits.min() + logits.max()) / 2.0
    look = look.recalibrated(1e7, -1e7 * middle, "no picture")
    test = attach_look.tested_contract(look).self_test
    assert len(test.patches) == 3
    np.testing.assert_allclose(test.answers, torch_answers(look.network, test.all_patches), atol=1e-5)
    ends, mixture = test.patches[:2].astype(int), test.patches[2].astype(int)
    assert ((mixture >= ends.min(axis=0)) & (mixture <= ends.max(axis=0))).all()


def test_a_calibration_changes_the_last_scale_and_offset_and_how_much_the_score_counts():
    look = look_checkpoint(mesh_weight=0.5)
    after = look.recalibrated(3.0, 1.0, "a test")
    scale, offset = look.network.calibration.tolist()
    assert after.network.calibration.tolist() == pytest.approx((3.0 * scale, 3.0 * offset + 1.0))
    assert (after.contract.mesh_weight, after.contract.provenance["calibrated_on"]) == (1.5, "a test")


def test_a_model_file_holds_both_networks(tmp_path):
    mesh, look = peak_checkpoint(), look_checkpoint(provenance={"trained_by": "a test"})
    assert export.export(mesh, tmp_path / "model.onnx", [look]) < 1e-4
    read = read_model(tmp_path / "model.onnx")
    onnx.checker.check_model(onnx.load(tmp_path / "model.onnx"), full_check=True)
    example = export.random_example(mesh.network, 50, 1)
    np.testing.assert_allclose(Session(read).answer(example), example.probabilities[:-1], atol=1e-5)

    close = CloseLook.of(read)["ball"]
    assert close.contract.provenance["trained_by"] == "a test"
    assert close.contract.provenance["exported_by"].startswith("vm-export")
    check_self_test(close.contract.self_test, look)
    patches = random_patches(20, seed=5)
    np.testing.assert_allclose(close.run(patches), torch_answers(look.network, patches), atol=1e-5)


def test_a_look_changes_nothing_but_the_metadata(tmp_path):
    export.export(peak_checkpoint(), tmp_path / "without.onnx")
    export.export(peak_checkpoint(), tmp_path / "with.onnx", looks=[look_checkpoint()])
    assert change_looks(tmp_path / "without.onnx", tmp_path / "attached.onnx", [look_checkpoint()]).difference < 1e-4
    assert (tmp_path / "attached.onnx").read_bytes() == (tmp_path / "with.onnx").read_bytes()
    assert change_looks(tmp_path / "with.onnx", tmp_path / "removed.onnx", []).difference == 0.0
    assert (tmp_path / "removed.onnx").read_bytes() == (tmp_path / "without.onnx").read_bytes()
    graphs = [onnx.load(tmp_path / name).graph for name in ("without.onnx", "with.onnx")]
    assert graphs[0] == graphs[1]


def test_a_look_replaces_the_one_before(tmp_path):
    export.export(peak_checkpoint(), tmp_path / "model.onnx", looks=[look_checkpoint(1)])
    change_looks(tmp_path / "model.onnx", tmp_path / "other.onnx", [look_checkpoint(2)])
    export.export(peak_checkpoint(), tmp_path / "expected.onnx", looks=[look_checkpoint(2)])
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
    export.export(peak_checkpoint(), tmp_path / "model.onnx", looks=[look])
    (again,) = looks_of(read_model(tmp_path / "model.onnx"))
    patches = random_patches(5)
    np.testing.assert_allclose(torch_answers(again.network, patches), torch_answers(look.network, patches), atol=1e-5)


def test_other_metadata_of_a_model_file_stays(tmp_path):
    export.export(peak_checkpoint(), tmp_path / "model.onnx")
    model = onnx.load(tmp_path / "model.onnx")
    assert model.metadata_props.pop().key == SEAL_KEY
    model.metadata_props.add(key="author", value="Zoë")
    (tmp_path / "model.onnx").write_bytes(sealed(model.SerializeToString()))
    change_looks(tmp_path / "model.onnx", tmp_path / "other.onnx", [look_checkpoint()])
    kept = {each.key: each.value for each in onnx.load(tmp_path / "other.onnx").metadata_props}
    assert sorted(kept) == ["author", "visual_mesh", "visual_mesh_look_ball", "visual_mesh_sha256"]
    assert kept["author"] == "Zoë"


def test_a_look_that_differs_from_torch_is_not_written(tmp_path, monkeypatch):
    other = look_model(look_network(5))
    monkeypatch.setattr(attach_look, "look_model", lambda network: other)
    export.export(peak_checkpoint(), tmp_path / "model.onnx")
    with pytest.raises(ModelError, match=r"answers of the close look .* differ by"):
        export.export(peak_checkpoint(), tmp_path / "new.onnx", looks=[look_checkpoint()])
    with pytest.raises(ModelError, match=r"answers of the close look .* differ by"):
        change_looks(tmp_path / "model.onnx", tmp_path / "new.onnx", [look_checkpoint()])
    assert [path.name for path in tmp_path.iterdir()] == ["model.onnx"]


def test_networks_whose_answers_are_not_numbers_are_not_written(tmp_path):
    look, mesh = look_checkpoint(), peak_checkpoint()
    with torch.no_grad():
        look.network.answers.bias[2] = torch.nan
        mesh.network.head.bias[0] = torch.nan
    with pytest.raises(ModelError, match="close look: its answers are NaN or infinite"):
        export.export(peak_checkpoint(), tmp_path / "model.onnx", looks=[look])
    with pytest.raises(ModelError, match="the new model: its answers are NaN or infinite"):
        export.export(mesh, tmp_path / "model.onnx")
    assert not list(tmp_path.iterdir())


def test_a_look_for_a_class_without_peaks_is_not_written(tmp_path):
    for name in ("goal", "environment"):
        with pytest.raises(ModelError, match=rf"looks at \['{name}'\].* peaks for \['ball'\]"):
            export.export(peak_checkpoint(), tmp_path / "model.onnx", looks=[look_checkpoint(object_class=name)])
    assert not list(tmp_path.iterdir())


def test_there_must_be_a_look_to_remove(tmp_path):
    export.export(peak_checkpoint(), tmp_path / "model.onnx")
    with pytest.raises(ModelError, match=r"model\.onnx has no close look to remove"):
        change_looks(tmp_path / "model.onnx", tmp_path / "other.onnx", [])


def upright(name, seed=0):
    return look_checkpoint(seed, object_class=name, upright_radius=0.3)


@pytest.fixture
def field(tmp_path):
    """A model file of a network with goals and robots."""
    path = tmp_path / "field.onnx"
    export.export(peak_checkpoint(classes=("ball", "goal:upright", "robot:upright")), path)
    return path


def attach(path, *looks):
    for each in looks:
        assert change_looks(path, path, [each]).difference < 1e-4
    return read_model(path)


def test_a_model_file_holds_a_look_for_each_upright_beside_that_of_the_object(field):
    ball, goal, robot = look_checkpoint(), upright("goal", 1), upright("robot", 2)
    read = attach(field, goal, ball, robot)
    looks = CloseLook.of(read)
    assert list(looks) == ["goal", "ball", "robot"]
    patches = random_patches(9, seed=5)
    for close, made in ((looks["ball"], ball), (looks["goal"], goal), (looks["robot"], robot)):
        np.testing.assert_allclose(close.run(patches), torch_answers(made.network, patches), atol=1e-5)
        check_self_test(close.contract.self_test, made)
        assert close.contract.upright_radius == made.contract.upright_radius


def test_a_look_at_an_upright_replaces_the_one_before_and_no_other(field):
    first = attach(field, upright("goal", 1), upright("robot", 2))
    second = attach(field, upright("goal", 3))
    assert first.looks[1] in second.looks
    assert first.looks[0] not in second.looks
    assert len(second.looks) == 2


def test_no_look_removes_all_of_them(field, tmp_path):
    before = field.read_bytes()
    attach(field, upright("goal"), look_checkpoint(), upright("robot"))
    assert change_looks(field, tmp_path / "bare.onnx", []).difference == 0.0
    assert (tmp_path / "bare.onnx").read_bytes() == before


@pytest.mark.parametrize(
    ("look", "message"),
    [
        (look_checkpoint(object_class="goal"), "upright_radius of at least 0.01 m, not 0 m"),
        (upright("ball"), "for a class of kind object it must be 0"),
        (upright("post"), "'post'"),
    ],
)
def test_a_look_for_another_kind_of_class_is_refused(field, tmp_path, look, message):
    with pytest.raises(ModelError, match=message):
        change_looks(field, tmp_path / "other.onnx", [look])


def test_a_file_whose_looks_are_not_those_of_its_manifest_is_refused(field, tmp_path):
    read = attach(field, upright("goal"))
    key = look_key("goal")
    (text,) = (each.value for each in onnx.load_from_string(read.content).metadata_props if each.key == key)
    for entries, message in (
        ({key: None}, "manifest has a close look at goal, its metadata has none"),
        ({"visual_mesh_look_robot": text}, "metadata has visual_mesh_look_robot, its manifest has no such close look"),
        ({key: "?"}, "a close look at goal can't be read"),
    ):
        (tmp_path / "changed.onnx").write_bytes(with_metadata(read.content, entries))
        with pytest.raises(ModelError, match=message):
            read_model(tmp_path / "changed.onnx")
