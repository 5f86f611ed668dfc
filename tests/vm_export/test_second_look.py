"""A second look: the gate, the part of the mesh that passes it, and the same answers in torch and ONNX Runtime."""

import subprocess
import sys

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.vm_export.checkpoints import manifest
from vm_embedded.errors import InputError, ModelError
from vm_embedded.mesh.models import MESH_MODELS, build_mesh
from vm_embedded.network.choose_layout import choose_layout
from vm_embedded.network.model_file import ModelFile, read_model
from vm_embedded.network.session import Session
from vm_export import export
from vm_export.checkpoint import Checkpoint
from vm_export.network import Network
from vm_export.network_shape import NetworkShape
from vm_export.reference import write_reference
from vm_export.second_look import Gate, SecondLook


def network(depth, width, seed=0, neighbors=6, classes=2, **facts):
    torch.manual_seed(seed)
    return Network(NetworkShape.uniform(depth, width, classes, neighbors=neighbors, **facts)).eval()


def second_look(gate, seed=0, neighbors=6, classes=2, **facts):
    first = network(2, 3, seed, neighbors, classes, **facts)
    return SecondLook(first, network(3, 5, seed + 1, neighbors, classes, **facts), gate).eval()


def chain(n):
    """Neighbors (n + 1, 6) of points in a row; only the first two places are used."""
    places = np.full((n + 1, 6), n)
    places[:n, 0], places[1:n, 1] = np.arange(1, n + 1), np.arange(n - 1)
    return torch.from_numpy(places.astype(np.int32))


def test_what_passes_the_gate_is_what_is_above_it_and_so_many_steps_around():
    answers = torch.zeros((11, 3))
    answers[[0, 6], [1, 2]] = 0.4
    answers[10] = 1.0
    for rings, expected in ((0, [6]), (1, [5, 6, 7]), (3, [3, 4, 5, 6, 7, 8, 9]), (9, list(range(10)))):
        assert Gate(0.3, rings, (2,)).selected(answers, chain(10)).nonzero()[:, 0].tolist() == expected
    assert Gate(0.3, 1, (1, 2)).selected(answers, chain(10)).nonzero()[:, 0].tolist() == [0, 1, 5, 6, 7]
    assert not Gate(0.4, 9, (2,)).selected(answers, chain(10)).any()


def test_the_first_answers_where_the_second_does_not_and_the_second_sees_its_part_alone():
    whole = second_look(Gate(0.5, 1, (0,)), seed=4)
    random = np.random.default_rng(3)
    colors = torch.from_numpy(random.random((31, 3), dtype=np.float32))
    colors[-1] = -1.0
    first = whole.first(colors, chain(30))
    whole.gate = Gate(float(first.detach()[:-1, 0].topk(6).values.min()) - 1e-6, 1, (0,))
    answers = whole(colors, chain(30))
    kept = whole.gate.selected(first, chain(30)).nonzero()[:, 0]
    assert 0 < len(kept) < 30
    others = np.setdiff1d(np.arange(31), kept)
    assert torch.equal(answers[others], first[others])
    position = {int(old): new for new, old in enumerate(kept)}
    links = [[position.get(int(each), len(kept)) for each in chain(30)[old]] for old in (*kept, 30)]
    alone = whole.second(torch.cat([colors[kept], colors[-1:]]), torch.tensor(links, dtype=torch.int32))
    torch.testing.assert_close(answers[kept], alone[:-1])


@given(
    mesh=st.sampled_from(["ring4", "ring6", "ring8", "cap6", "xmgrid8"]),
    height=st.floats(0.3, 1.5),
    shown=st.floats(0.1, 1.0),
    share=st.floats(0.0, 1.0),
    rings=st.integers(0, 4),
    classes=st.integers(2, 4),
    head=st.sampled_from(["softmax", "sigmoid"]),
    activation=st.sampled_from(["selu", "relu"]),
    seed=st.integers(0, 1000),
)
@settings(max_examples=40, deadline=None)
def test_onnx_runtime_gives_the_same_answers_on_real_meshes(
    mesh, height, shown, share, rings, classes, head, activation, seed
):
    """Whatever part of the picture is worth it, from none to all of it, and whatever part of the mesh is on screen."""
    facts = manifest([f"class{each}" for each in range(classes)], mesh, max_distance=3.0, layout="runs")
    points = build_mesh(facts.mesh_shape, height, 4.0, 3.0, mesh)
    random = np.random.default_rng(seed)
    on_screen = np.abs(points.rays[:, 1]) < shown
    part = points.part(np.flatnonzero(on_screen))
    colors = np.full((len(part) + 1, 3), -1.0, dtype=np.float32)
    colors[:-1] = random.random((len(part), 3))
    neighbors = torch.tensor(part.neighbors)

    shape = {"neighbors": MESH_MODELS[mesh].neighbors, "classes": classes, "head": head, "activation": activation}
    made = second_look(Gate(0.5, rings, (0, classes - 1)), seed, **shape)
    first = made.first(torch.from_numpy(colors), neighbors)[:-1, list(made.gate.classes)].detach().numpy()
    levels = np.sort(first.max(axis=1))  # a gate between two points' answers, so that no rounding decides
    at = int(share * (len(levels) - 1))
    gaps = np.diff(levels[at:])
    if len(gaps):
        made.gate = Gate(float(levels[at + int(np.argmax(gaps))] + gaps.max() / 2.0), rings, made.gate.classes)
    with torch.inference_mode():
        expected = made(torch.from_numpy(colors), neighbors)[:-1].numpy()

    content = export.onnx_model(made, facts)
    session = Session(ModelFile("model", content, facts, ""))
    layout = choose_layout(part, facts)
    given_points = layout.new_points()
    layout.colors_of(given_points)[:] = colors[layout.slots]
    answers = session.run(layout, given_points, layout.slots < len(part))[layout.places]
    np.testing.assert_allclose(answers, expected, atol=1e-4)


def test_a_picture_without_anything_worth_it_is_answered_by_the_first(tmp_path):
    whole = Checkpoint(second_look(Gate(0.99, 3, (0,))), manifest())
    export.export(whole, tmp_path / "both.onnx")
    export.export(Checkpoint(whole.network.first, manifest()), tmp_path / "first.onnx", "runs")
    example = read_model(tmp_path / "first.onnx").manifest.self_test
    both, first = (Session(read_model(tmp_path / name)) for name in ("both.onnx", "first.onnx"))
    np.testing.assert_array_equal(both.answer(example), first.answer(example))


def test_a_checkpoint_keeps_both_networks_and_the_gate(tmp_path):
    made = Checkpoint(second_look(Gate(0.2, 3, (0,))), manifest())
    made.save(tmp_path / "model.pt")
    read = Checkpoint.load(tmp_path / "model.pt")
    assert read.network.gate == made.network.gate
    assert read.last_network is read.network.second
    there, here = made.network.state_dict(), read.network.state_dict()
    assert there.keys() == here.keys()
    assert all(torch.equal(there[name], here[name]) for name in there)
    export.export(read, tmp_path / "model.onnx")
    found = read_model(tmp_path / "model.onnx").manifest
    assert found.layout == "runs"
    assert found.operations == made.network.first.shape.operations


def test_what_does_not_fit_is_refused(tmp_path):
    for above, rings, classes in ((1.0, 2, (0,)), (-0.1, 2, (0,)), (0.5, -1, (0,)), (0.5, 2, ())):
        with pytest.raises(ModelError, match="a second look needs"):
            Gate(above, rings, classes)
    with pytest.raises(
        ModelError, match="first network has 6 neighbors, the one for the second look 4; they must be equal"
    ):
        SecondLook(network(2, 2), network(2, 2, neighbors=4), Gate(0.5, 1, (0,)))
    made = Checkpoint(second_look(Gate(0.2, 3, (0,))), manifest())
    with pytest.raises(ModelError, match="has only layout runs, not plain"):
        export.export(made, tmp_path / "model.onnx", "plain")
    with pytest.raises(InputError, match="has a second look"):
        write_reference(made, tmp_path / "model.yaml")
    for facts in ({"sampling": "footprint"}, {"colors": "relative"}):
        with pytest.raises(InputError, match="this one takes"):
            write_reference(Checkpoint(made.network.first, manifest(**facts)), tmp_path / "model.yaml")
    assert not list(tmp_path.iterdir())


def test_the_command_writes_one_file_and_says_what_is_in_it(tmp_path):
    Checkpoint(second_look(Gate(0.2, 3, (0,))), manifest()).save(tmp_path / "model.pt")
    command = [sys.executable, "-m", "vm_export.cli", tmp_path / "model.pt"]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    assert "2 layers, 3 for a second look" in done.stdout
    assert sorted(path.name for path in tmp_path.iterdir()) == ["model.onnx", "model.pt"]
