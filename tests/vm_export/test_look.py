"""Look networks: torch and ONNX Runtime agree, and checkpoints keep them."""

from dataclasses import replace

import numpy as np
import onnx
import onnxruntime
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.looks import random_patches, upright
from tests.vm_export.checkpoints import checkpoint
from tests.vm_export.looks import SHAPE, look_checkpoint, look_network, torch_answers
from vm_embedded.borders.text import MOST_NAME
from vm_embedded.errors import InputError, ModelError
from vm_export.checkpoint import Checkpoint
from vm_export.eight_bits import round_kernels
from vm_export.look_checkpoint import LookCheckpoint
from vm_export.look_graph import look_model
from vm_export.look_network import LookNetwork, LookShape, normalized

from ..vm_embedded.strategies import seeds


def onnx_answers(content, patches):
    return onnxruntime.InferenceSession(content).run(["answers"], {"patches": patches})[0]


widths = st.integers(1, 20)
shapes = st.builds(
    LookShape,
    size=st.integers(8, 40),
    channels=st.tuples(widths, widths, widths),
    hidden=st.integers(0, 20),
    classes=st.integers(1, 5),
)
SEVERAL = ("ball", upright("goal"), upright("robot"))


@given(shape=shapes, seed=st.integers(0, 1000), count=st.integers(0, 9))
@settings(max_examples=25)
def test_every_look_gives_the_same_answers_in_onnx_runtime(shape, seed, count):
    network = look_network(seed, shape)
    patches = random_patches(count, shape.size, seed)
    answers = onnx_answers(look_model(network), patches)
    assert answers.shape == (count, shape.classes, 4)
    np.testing.assert_allclose(answers, torch_answers(network, patches), atol=1e-5)


@pytest.mark.parametrize("count", [0, 1, 2, 40, 300])
def test_one_graph_takes_any_number_of_patches(count):
    network, patches = look_network(), random_patches(count)
    np.testing.assert_allclose(onnx_answers(look_model(network), patches), torch_answers(network, patches), atol=1e-5)


def test_the_graph_has_standard_operators_only_and_is_the_same_each_time():
    content = look_model(look_network())
    model = onnx.load_from_string(content)
    assert {node.domain for node in model.graph.node} == {""}
    assert look_model(look_network()) == content


@pytest.mark.parametrize("rounded", [False, True])
def test_onnx_runtime_joins_convolutions_and_activations(tmp_path, rounded):
    options = onnxruntime.SessionOptions()
    options.optimized_model_filepath = str(tmp_path / "optimized.onnx")
    options.log_severity_level = 4
    network = look_network(shape=LookShape())
    if rounded:
        round_kernels(network)
    onnxruntime.InferenceSession(look_model(network), options)
    operators = [node.op_type for node in onnx.load(tmp_path / "optimized.onnx").graph.node]
    assert "Relu" not in operators
    assert sum("Conv" in each for each in operators) == 6
    # Those of the patch's colors; the integers of the kernels are multiplied with their steps already.
    assert (operators.count("Cast"), operators.count("Mul")) == (1, 1)


def test_rounded_kernels_need_a_quarter_of_the_room_and_give_the_same_answers():
    network = look_network(shape=LookShape())
    whole = look_model(network)
    round_kernels(network)
    small, patches = look_model(network), random_patches(9, size=LookShape().size)
    assert len(small) < 0.3 * len(whole)
    np.testing.assert_allclose(onnx_answers(small, patches), torch_answers(network, patches), atol=1e-5)


@given(seeds, st.integers(-100, 100))
@settings(max_examples=20)
def test_brightness_does_not_matter(seed, change):
    network = look_network()
    patches = np.random.default_rng(seed).integers(100, 156, (2, 8, 8, 3), dtype=np.uint8)
    brighter = (patches + np.int16(change)).astype(np.uint8)
    np.testing.assert_allclose(torch_answers(network, brighter), torch_answers(network, patches), atol=1e-4)
    content = look_model(network)
    np.testing.assert_allclose(onnx_answers(content, brighter), onnx_answers(content, patches), atol=1e-4)


@given(seeds, st.integers(0, 7))
@settings(max_examples=20)
def test_each_patch_is_judged_by_itself(seed, chosen):
    patches, content = random_patches(8, seed=seed), look_model(look_network())
    alone = onnx_answers(content, patches[chosen : chosen + 1])
    np.testing.assert_allclose(alone, onnx_answers(content, patches)[chosen : chosen + 1], atol=1e-5)


def test_noise_on_a_plain_surface_is_not_amplified():
    patches = torch.full((3, 8, 8, 3), 100.0)
    patches[1, :4] += 2.0
    patches[2, :4] += 100.0
    plain, faint, strong = normalized(patches).std(dim=(1, 2, 3), correction=0).tolist()
    assert plain == 0.0
    assert faint == pytest.approx(1 / 5)
    assert strong == pytest.approx(50 / 54)


def test_colors_as_floats_are_those_as_bytes():
    network, patches = look_network(), random_patches(4)
    np.testing.assert_array_equal(torch_answers(network, patches.astype(np.float32)), torch_answers(network, patches))


def test_calibration_changes_probabilities_of_its_class_only():
    network, patches = look_network(shape=replace(SHAPE, classes=2)), torch.from_numpy(random_patches(5))
    with torch.inference_mode():
        logits = network.logits(patches)
        network.calibration.copy_(torch.tensor([[1.0, 0.0], [1.0, 0.0]]))
        plain = network(patches)
        network.calibration[1] = torch.tensor([0.5, 1.0])
        calibrated = network(patches)
    torch.testing.assert_close(plain[..., 0], torch.sigmoid(logits[..., 0]))
    torch.testing.assert_close(calibrated[:, 0], plain[:, 0])
    torch.testing.assert_close(calibrated[:, 1, 0], torch.sigmoid(0.5 * logits[:, 1, 0] + 1.0))
    for answers in (plain, calibrated):
        torch.testing.assert_close(answers[..., 1:], logits[..., 1:])


def test_a_new_network_is_not_calibrated():
    assert LookNetwork(LookShape()).calibration.tolist() == [[1.0, 0.0]]
    assert LookNetwork(LookShape(classes=2)).calibration.tolist() == [[1.0, 0.0], [1.0, 0.0]]


def test_hidden_units_default_to_the_last_channels():
    assert LookNetwork(LookShape(channels=(4, 5, 6))).hidden.out_features == 6
    assert LookNetwork(LookShape(channels=(4, 5, 6), hidden=9)).hidden.out_features == 9


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"size": 7}, "size .* from 8 to 128, not 7"),
        ({"size": 129}, "not 129"),
        ({"channels": (4, 5)}, r"channels .* three numbers .*not \[4, 5\]"),
        ({"channels": (4, 0, 5)}, r"not \[4, 0, 5\]"),
        ({"channels": (4, 5, 1025)}, "1 to 1024"),
        ({"hidden": -1}, "hidden .*not -1"),
        ({"classes": 0}, "classes .* from 1 to 127, not 0"),
        ({"classes": 128}, "not 128"),
    ],
)
def test_a_shape_out_of_range_is_refused(changes, message):
    with pytest.raises(InputError, match=message):
        LookShape(**changes)


@given(shapes)
def test_a_shape_is_read_back_as_it_was_written(shape):
    assert LookShape.from_dict(shape.as_dict()) == shape


@pytest.mark.parametrize(
    "data",
    [
        {},
        {"size": 8, "channels": 3, "hidden": 0, "classes": 1},
        {"size": 8, "channels": [1, 2]},
        {"size": 8, "channels": [1, 2, 3], "hidden": 0},
    ],
)
def test_a_shape_that_is_not_complete_is_refused(data):
    with pytest.raises(InputError, match="can't read the shape"):
        LookShape.from_dict(data)


def test_a_checkpoint_is_read_back_as_it_was_written(tmp_path):
    made = look_checkpoint(3, classes=SEVERAL, provenance={"trained_by": "a test"})
    made.save(tmp_path / "look.pt")
    torch.load(tmp_path / "look.pt", weights_only=True)
    read = LookCheckpoint.load(tmp_path / "look.pt")
    assert read.network.shape == made.network.shape
    assert read.contract == made.contract
    np.testing.assert_array_equal(read.examples, made.examples)
    for name, value in made.network.state_dict().items():
        assert torch.equal(read.network.state_dict()[name], value)


@pytest.mark.parametrize("content", [b"", b"nothing", b"PK\x03\x04 broken"])
def test_a_broken_checkpoint_is_refused(tmp_path, content):
    (tmp_path / "look.pt").write_bytes(content)
    with pytest.raises(InputError, match=r"look\.pt is not a checkpoint of a look network"):
        LookCheckpoint.load(tmp_path / "look.pt")


def test_a_checkpoint_of_another_kind_is_refused(tmp_path):
    checkpoint().save(tmp_path / "model.pt")
    with pytest.raises(InputError, match=r"model\.pt is not .* 'vm-embedded look 5'.* 'vm-embedded checkpoint"):
        LookCheckpoint.load(tmp_path / "model.pt")
    look_checkpoint().save(tmp_path / "look.pt")
    with pytest.raises(InputError, match=r"look\.pt is a close look; attach it to a network: vm-export MODEL --look"):
        Checkpoint.load(tmp_path / "look.pt")
    with pytest.raises(InputError, match="can't read"):
        LookCheckpoint.load(tmp_path / "missing.pt")


@pytest.mark.parametrize(
    ("entry", "value"),
    [
        ("network", {}),
        ("network", {"size": 16, "channels": [4, 5, 6], "hidden": 0, "classes": 1}),
        ("network", {"size": 8, "channels": [4, 5, 6], "hidden": 0, "classes": 2}),
        ("contract", {}),
        ("examples", torch.zeros(3, 8, 8, 3)),
        ("examples", None),
        ("state", {}),
        ("state", None),
        ("state", ...),
    ],
)
def test_a_checkpoint_whose_parts_do_not_fit_is_refused_by_name(tmp_path, entry, value):
    look_checkpoint().save(tmp_path / "look.pt")
    content = torch.load(tmp_path / "look.pt", weights_only=True) | {entry: value}
    torch.save({key: each for key, each in content.items() if each is not ...}, tmp_path / "look.pt")
    with pytest.raises((InputError, ModelError), match=r"look\.pt") as caught:
        LookCheckpoint.load(tmp_path / "look.pt")
    assert len(str(caught.value).splitlines()) == 1


@pytest.mark.parametrize(
    "examples", [random_patches(0), random_patches(3, size=9), random_patches(3).astype(np.float32)]
)
def test_examples_that_do_not_fit_are_refused(examples):
    with pytest.raises(ModelError, match=r"examples .* uint8 patches of \(8, 8, 3\)"):
        replace(look_checkpoint(), examples=examples)


@pytest.mark.parametrize("changes", [{"size": 9}, {"channels": (4, 5, 7)}])
def test_a_contract_for_another_network_is_refused(changes):
    with pytest.raises(ModelError, match="its contract says"):
        look_checkpoint(**changes)


@pytest.mark.parametrize("count", [1, 3])
def test_a_contract_with_other_classes_than_the_network_has_is_refused(count):
    contract = look_checkpoint(classes=SEVERAL[:count]).contract
    with pytest.raises(ModelError, match=r"judges 2 classes, but its contract has \['ball'"):
        replace(look_checkpoint(classes=SEVERAL[:2]), contract=contract)


@pytest.mark.parametrize(
    ("names", "kept"),
    [
        (("ball", "goal", "robot"), [0, 1, 2]),
        (["robot", "ball"], [0, 2]),
        ({"goal": 1, "post": 2}, [1]),
        ({"robot", "post"}, [2]),
    ],
    ids=str,
)
def test_a_part_of_a_look_gives_the_same_answers_for_its_classes(names, kept):
    whole, patches = look_checkpoint(2, classes=SEVERAL), random_patches(9)
    answers = torch_answers(whole.network, patches)
    part = whole.part(names)
    assert part.contract == replace(whole.contract, classes=tuple(whole.contract.classes[each] for each in kept))
    assert part.network.shape == replace(whole.network.shape, classes=len(kept))
    assert not part.network.training
    np.testing.assert_allclose(torch_answers(part.network, patches), answers[:, kept], atol=1e-6)
    np.testing.assert_allclose(onnx_answers(look_model(part.network), patches), answers[:, kept], atol=1e-5)
    np.testing.assert_array_equal(part.examples, whole.examples)
    with torch.no_grad():
        part.network.hidden.weight.zero_()  # it is a network of its own
    np.testing.assert_array_equal(torch_answers(whole.network, patches), answers)


@pytest.mark.parametrize("names", [(), ("post",), ["Ball", "goals"]], ids=str)
def test_a_part_of_a_look_has_a_class(names):
    with pytest.raises(ModelError, match=r"judges ball, goal, robot, but "):
        look_checkpoint(classes=SEVERAL).part(names)


def test_a_weight_of_the_peaks_counts_for_each_class():
    before = look_checkpoint(classes=("ball", upright("goal", mesh_weight=0.5)))
    after = before.weighted(0.25)
    assert [each.mesh_weight for each in after.contract.classes] == [0.25, 0.25]
    assert [each.mesh_weight for each in before.contract.classes] == [0.0, 0.5]
    assert after.weighted(0.0).contract == replace(
        before.contract, classes=tuple(replace(each, mesh_weight=0.0) for each in before.contract.classes)
    )
    assert after.network is before.network


def test_a_calibration_of_one_class_changes_its_probability_only():
    before, patches = look_checkpoint(1, classes=SEVERAL), random_patches(9)
    old = torch_answers(before.network, patches)
    after = before.recalibrated("goal", 2.0, -0.5, "a test")
    new = torch_answers(after.network, patches)
    logits = np.log(old[:, 1, 0] / (1.0 - old[:, 1, 0]))
    np.testing.assert_allclose(new[:, 1, 0], 1.0 / (1.0 + np.exp(0.5 - 2.0 * logits)), rtol=1e-4)
    np.testing.assert_array_equal(new[..., 1:], old[..., 1:])
    np.testing.assert_array_equal(new[:, [0, 2]], old[:, [0, 2]])
    np.testing.assert_array_equal(torch_answers(before.network, patches), old)


def test_a_calibration_scales_how_much_the_score_of_its_class_counts():
    """That the logit with the score in it gets the scale and the offset."""
    classes = tuple(upright(name, mesh_weight=0.5) for name in ("goal", "robot"))
    look = look_checkpoint(classes=classes, provenance={"trained_by": "a test"})
    after = look.recalibrated("robot", 3.0, 1.0, "pictures")
    (scale, offset), last = look.network.calibration.tolist()
    assert after.network.calibration[0].tolist() == [scale, offset]
    assert after.network.calibration[1].tolist() == pytest.approx([3.0 * last[0], 3.0 * last[1] + 1.0])
    assert [each.mesh_weight for each in after.contract.classes] == [0.5, 1.5]
    assert after.contract.provenance == {"trained_by": "a test"}
    assert [each.calibrated_on for each in after.contract.classes] == ["", "pictures"]
    again = after.recalibrated("goal", 2.0, 0.0, "others", weight=0.1)
    assert [each.mesh_weight for each in again.contract.classes] == [pytest.approx(0.2), 1.5]
    assert [each.calibrated_on for each in again.contract.classes] == ["others", "pictures"]


def test_a_class_with_the_longest_name_can_be_calibrated():
    name = "x" * MOST_NAME
    after = look_checkpoint(classes=(name,)).recalibrated(name, 2.0, 0.0, "a test")
    assert after.contract.classes[0].calibrated_on == "a test"


def test_a_look_of_the_usual_size_fits_its_sizes():
    made = look_checkpoint(shape=LookShape())
    assert made.network.shape != SHAPE
    np.testing.assert_allclose(
        onnx_answers(look_model(made.network), made.examples), torch_answers(made.network, made.examples), atol=1e-5
    )
