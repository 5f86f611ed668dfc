"""The exporter: torch, ONNX Runtime and the reference's files agree."""

import json
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import onnx
import onnxruntime
import pytest
import torch
import yaml
from hypothesis import given, settings
from hypothesis import strategies as st

from vm_embedded.errors import InputError, ModelError
from vm_embedded.manifest import EDGES, LAYOUTS, Manifest, ObjectClass
from vm_embedded.mesh_models import MESH_MODELS
from vm_embedded.onnx_file import read_model
from vm_embedded.session import Session
from vm_embedded.settings import Settings as RuntimeSettings
from vm_export import onnx_graph
from vm_export.checkpoint import Checkpoint
from vm_export.neighborhood import Neighborhood
from vm_export.network import GraphConvolution, Network
from vm_export.network_shape import ACTIVATIONS, HEADS, Layer, NetworkShape
from vm_export.reference import Overrides, read_reference, write_reference

COMMAND = Path(sys.executable).parent / "vm-export"

MESHES = {"plain": "ring6", "runs": "ring6", "lattice": "xmgrid6"}
"""A mesh for each layout."""

in_all_layouts = pytest.mark.parametrize("layout", LAYOUTS)


def manifest(classes=("ball", "environment"), mesh="ring6", **changes):
    facts = {
        "shape": "sphere",
        "radius": 0.095,
        "object_radius": 0.075,
        "intersections": 4.0,
        "mesh": mesh,
        "max_distance": 10.0,
        "edge": "hard",
        "classes": tuple(ObjectClass(name, "object" if name == "ball" else "background") for name in classes),
    }
    return Manifest(**(facts | changes))


def checkpoint(seed=0, shape=None, mesh="ring6"):
    torch.manual_seed(seed)
    shape = shape or NetworkShape.uniform(3, 4, 2, neighbors=MESH_MODELS[mesh].neighbors)
    return Checkpoint(Network(shape).eval(), manifest([f"class{i}" for i in range(shape.classes)], mesh))


layers = st.lists(
    st.builds(
        Layer,
        kind=st.sampled_from(["convolution", "separable", "dense"]),
        width=st.integers(1, 8),
        activation=st.sampled_from(sorted(ACTIVATIONS)),
    ),
    max_size=4,
)


@st.composite
def network_shapes(draw):
    inner = draw(layers)
    first = Layer(draw(st.sampled_from(["convolution", "separable"])), draw(st.integers(1, 8)), "selu")
    last = Layer(draw(st.sampled_from(["convolution", "dense"])), draw(st.integers(1, 5)), draw(st.sampled_from(HEADS)))
    return NetworkShape((first, *inner, last), draw(st.sampled_from([4, 6, 8])))


@in_all_layouts
@given(shape=network_shapes(), seed=st.integers(0, 1000))
@settings(max_examples=25)
def test_every_network_gives_the_same_answers_in_onnx_runtime(layout, shape, seed):
    mesh = f"{'xygrid' if layout == 'lattice' else 'ring'}{shape.neighbors}"
    made = checkpoint(seed, shape, mesh)
    facts = replace(made.manifest, layout=layout)
    content = onnx_graph.build(made.network, facts)
    assert onnx_graph.largest_difference(content, made.network, facts) < 1e-4


def test_graph_convolution_is_the_matrix_product_of_the_convention():
    torch.manual_seed(1)
    layer = GraphConvolution(inputs=2, outputs=3, neighbors=4)
    x, neighbors = torch.randn(6, 2), torch.randint(0, 6, (6, 4))
    expected = np.empty((6, 3))
    for i in range(6):
        row = np.concatenate([x[i].numpy(), *(x[j].numpy() for j in neighbors[i])])
        expected[i] = row @ layer.linear.weight.detach().numpy().T + layer.linear.bias.detach().numpy()
    np.testing.assert_allclose(layer(x, Neighborhood(neighbors)).detach().numpy(), expected, atol=1e-5)


DOMAINS = {"plain": {""}, "runs": {"", "ai.onnx.ml"}, "lattice": {""}}
"""Where each layout's operators come from: the standard, and its part for machine learning on tables."""


@in_all_layouts
def test_the_file_describes_itself_and_is_one_file_of_stock_operators(layout, tmp_path):
    made = checkpoint(mesh=MESHES[layout])
    difference = onnx_graph.export(made, tmp_path / "model.onnx", layout)
    assert difference < 1e-4
    assert [path.name for path in tmp_path.iterdir()] == ["model.onnx"]
    graph = onnx.load(tmp_path / "model.onnx")
    assert {node.domain for node in graph.graph.node} == DOMAINS[layout]
    assert {entry.domain for entry in graph.opset_import} == DOMAINS[layout]
    read = read_model(tmp_path / "model.onnx").manifest
    assert read.classes == made.manifest.classes
    assert read.intersections == made.manifest.intersections
    assert read.layout == layout
    assert read.self_test is not None


def test_the_fastest_layout_is_the_one_that_is_written(tmp_path):
    for kind, width, layout in (
        ("convolution", 4, "runs"),
        ("convolution", 64, "runs"),
        ("convolution", 65, "plain"),
        ("separable", 32, "runs"),
        ("separable", 33, "plain"),
    ):
        network = Network(NetworkShape.uniform(3, width, 2, kind=kind))
        assert onnx_graph.fastest_layout(Checkpoint(network, manifest(("class0", "class1")))) == layout
    for edge, layout in (("hard", "runs"), ("same", "plain")):
        made = Checkpoint(checkpoint().network, manifest(edge=edge))
        onnx_graph.export(made, tmp_path / "model.onnx")
        assert read_model(tmp_path / "model.onnx").manifest.layout == layout


def test_a_layout_that_there_is_not_is_refused(tmp_path):
    with pytest.raises(ModelError, match=r"layout .*'run'.*'runs'"):
        onnx_graph.export(checkpoint(), tmp_path / "model.onnx", "run")
    with pytest.raises(ModelError, match="runs needs edge hard"):
        onnx_graph.export(Checkpoint(checkpoint().network, manifest(edge="same")), tmp_path / "model.onnx", "runs")
    assert not list(tmp_path.iterdir())


@in_all_layouts
def test_the_same_checkpoint_gives_the_same_bytes(layout, tmp_path):
    for name in ("a", "b"):
        onnx_graph.export(checkpoint(3, mesh=MESHES[layout]), tmp_path / name, layout)
    assert (tmp_path / "a").read_bytes() == (tmp_path / "b").read_bytes()


@in_all_layouts
def test_a_graph_that_differs_from_torch_is_not_written(layout, tmp_path, monkeypatch):
    other = onnx_graph.build(checkpoint(5).network, manifest(("class0", "class1"), MESHES[layout], layout=layout))
    monkeypatch.setattr(onnx_graph, "build", lambda network, manifest: other)
    (tmp_path / "model.onnx").write_text("the file of before")
    with pytest.raises(ModelError, match="differ by"):
        onnx_graph.export(checkpoint(4, mesh=MESHES[layout]), tmp_path / "model.onnx", layout)
    assert (tmp_path / "model.onnx").read_text() == "the file of before"


def test_the_number_of_points_is_dynamic():
    made = checkpoint()
    session = onnxruntime.InferenceSession(onnx_graph.build(made.network, made.manifest))
    for points in (0, 1, 17, 3000):
        colors = np.full((points + 1, 3), -1.0, dtype=np.float32)
        neighbors = np.full((points + 1, 6), points, dtype=np.int32)
        (answer,) = session.run(None, {"points": colors, "neighbors": neighbors})
        assert answer.shape == (points + 1, 2)


def test_checkpoints_are_plain_values_and_read_back(tmp_path):
    made = checkpoint(7)
    made.save(tmp_path / "model.pt")
    torch.load(tmp_path / "model.pt", weights_only=True)
    read = Checkpoint.load(tmp_path / "model.pt")
    assert read.network.shape == made.network.shape
    assert read.manifest.as_json() == made.manifest.as_json()
    for name, value in made.network.state_dict().items():
        assert torch.equal(read.network.state_dict()[name], value)


@pytest.mark.parametrize("content", [b"", b"nothing", b"PK\x03\x04 broken"])
def test_broken_checkpoints_are_refused(tmp_path, content):
    (tmp_path / "model.pt").write_bytes(content)
    with pytest.raises(InputError, match="checkpoint"):
        Checkpoint.load(tmp_path / "model.pt")


def test_foreign_and_mismatched_checkpoints_are_refused(tmp_path):
    torch.save({"weights": torch.zeros(3)}, tmp_path / "foreign.pt")
    with pytest.raises(InputError, match="format"):
        Checkpoint.load(tmp_path / "foreign.pt")
    with pytest.raises(InputError, match="can't read"):
        Checkpoint.load(tmp_path / "missing.pt")
    with pytest.raises(ModelError, match="outputs"):
        Checkpoint(checkpoint().network, manifest(("ball", "line", "field")))


def test_reference_files_survive_a_round_trip(tmp_path):
    shape = NetworkShape(
        (
            Layer("convolution", 5, "selu"),
            Layer("dense", 4, "tanh"),
            Layer("separable", 3, "relu"),
            Layer("convolution", 2, "softmax"),
        )
    )
    made = Checkpoint(checkpoint(9, shape).network, manifest())
    write_reference(made, tmp_path / "model.yaml")
    stored = yaml.safe_load((tmp_path / "model.yaml").read_text())
    assert [len(group) for group in stored["network"]] == [2, 1, 1]
    assert len(stored["network"][0][0]["weights"]) == 4 * 7
    read = read_reference(tmp_path / "model.yaml", Overrides(object_radius=0.075))
    assert read.manifest.classes == made.manifest.classes
    test = onnx_graph._example(made.network, made.manifest, 50, 0)
    with torch.inference_mode():
        again = read.network(torch.from_numpy(test.points), torch.from_numpy(test.neighbors))
    np.testing.assert_allclose(again.numpy(), test.probabilities, atol=1e-5)


def test_the_authors_file_survives_a_round_trip(shared, tmp_path):
    source = shared / "reference/model.yaml"
    write_reference(read_reference(source, Overrides(intersections=6.0)), tmp_path / "again.yaml")
    before, after = (yaml.load(path.read_text(), yaml.CSafeLoader) for path in (source, tmp_path / "again.yaml"))
    assert after["mesh"] == before["mesh"]
    assert after["geometry"]["radius"] == before["geometry"]["radius"]
    for old, new in zip(before["network"], after["network"], strict=True):
        for a, b in zip(old, new, strict=True):
            assert a["activation"] == b["activation"]
            np.testing.assert_allclose(a["weights"], b["weights"], rtol=1e-6, atol=1e-6)
            np.testing.assert_allclose(a["biases"], b["biases"], rtol=1e-6)


def reference_file(path, **changes):
    made = Checkpoint(checkpoint(2).network, manifest())
    write_reference(made, path)
    data = yaml.safe_load(path.read_text())
    data.update(changes)
    path.write_text(yaml.safe_dump(data))
    return path


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"mesh": "RING7"}, "ring6"),
        ({"geometry": {"shape": "CUBE", "radius": 0.1, "intersections": 4}}, "sphere"),
        ({"geometry": {"shape": "SPHERE", "radius": 0.1, "intersections": 0.1}}, "--intersections"),
        ({"geometry": {"shape": "SPHERE"}}, "radius"),
        ({"network": []}, "convolution"),
        ({"network": [[{"weights": [[1.0]], "biases": [0.0], "activation": "softmax"}]]}, "channels"),
        ({"class_map": {"ball": 0, "field": 5}}, "--classes"),
        ({"class_map": {"ball": 0, "penguin": 1}}, "penguin"),
        ({"class_map": 3}, "--classes"),
    ],
)
def test_wrong_reference_files_are_refused_with_what_is_wrong(tmp_path, changes, message):
    with pytest.raises(InputError, match=message):
        read_reference(reference_file(tmp_path / "model.yaml", **changes), Overrides())


def test_a_network_that_reads_alpha_is_refused(tmp_path):
    path = reference_file(tmp_path / "model.yaml")
    data = yaml.safe_load(path.read_text())
    data["network"][0][0]["weights"][3][0] = 0.5
    path.write_text(yaml.safe_dump(data))
    with pytest.raises(InputError, match="fourth input channel"):
        read_reference(path, Overrides())


@given(st.text(max_size=200))
def test_random_text_is_no_reference_file(tmp_path_factory, text):
    path = tmp_path_factory.mktemp("fuzz") / "model.yaml"
    path.write_text(text)
    with pytest.raises(InputError):
        read_reference(path, Overrides())


def run(*arguments, code=0):
    done = subprocess.run([str(COMMAND), *map(str, arguments)], capture_output=True, text=True)
    assert done.returncode == code, done.stderr
    assert "Traceback" not in done.stderr
    return done


def test_command_exports_a_checkpoint_and_prints_the_difference(tmp_path):
    checkpoint().save(tmp_path / "model.pt")
    done = run(tmp_path / "model.pt", "-o", tmp_path / "model.onnx", "--object-radius", 0.05, "--edge", "same")
    assert "largest difference" in done.stdout
    read = read_model(tmp_path / "model.onnx").manifest
    assert read.object_radius == 0.05
    assert read.edge == "same"


def test_command_names_its_output_after_the_model(tmp_path):
    checkpoint().save(tmp_path / "model.pt")
    run(tmp_path / "model.pt")
    run(tmp_path / "model.pt", "--to-yaml")
    assert (tmp_path / "model.onnx").exists()
    assert yaml.safe_load((tmp_path / "model.yaml").read_text())["mesh"] == "RING6"


def names_in(folder):
    return sorted(path.name for path in folder.iterdir())


def test_command_writes_the_fastest_layout_and_the_portable_one_beside_it(tmp_path):
    made = checkpoint()
    made.save(tmp_path / "model.pt")
    done = run(tmp_path / "model.pt")
    assert names_in(tmp_path) == ["model.onnx", "model.plain.onnx", "model.pt"]
    both = [read_model(tmp_path / name) for name in ("model.onnx", "model.plain.onnx")]
    assert [each.manifest.layout for each in both] == ["runs", "plain"]
    assert replace(both[0].manifest, layout="plain").as_json() == both[1].manifest.as_json()
    test = onnx_graph._example(made.network, made.manifest, 300, 1)
    for each in both:
        answer = Session(each, RuntimeSettings()).answer(test)
        np.testing.assert_allclose(answer, test.probabilities[:-1], atol=1e-5)
        (line,) = [line for line in done.stdout.splitlines() if line.startswith(f"{each.path}:")]
        assert f"layout {each.manifest.layout}" in line
        assert "largest difference" in line


def test_command_names_the_portable_file_after_the_output(tmp_path):
    checkpoint().save(tmp_path / "model.pt")
    run(tmp_path / "model.pt", "-o", tmp_path / "ball.v2.onnx")
    assert names_in(tmp_path) == ["ball.v2.onnx", "ball.v2.plain.onnx", "model.pt"]
    assert read_model(tmp_path / "ball.v2.onnx").manifest.layout == "runs"
    assert read_model(tmp_path / "ball.v2.plain.onnx").manifest.layout == "plain"


def test_command_writes_one_file_where_the_portable_layout_is_the_fastest(tmp_path):
    checkpoint().save(tmp_path / "model.pt")
    run(tmp_path / "model.pt", "--edge", "same")
    assert names_in(tmp_path) == ["model.onnx", "model.pt"]
    assert read_model(tmp_path / "model.onnx").manifest.layout == "plain"


@pytest.mark.parametrize(
    ("layout", "mesh"), [("plain", "ring4"), ("runs", "ring8"), ("lattice", "nmgrid8"), ("runs", "cap6")]
)
def test_command_writes_one_file_in_the_layout_that_it_is_told(layout, mesh, tmp_path):
    checkpoint(mesh=mesh).save(tmp_path / "model.pt")
    done = run(tmp_path / "model.pt", "--layout", layout)
    assert names_in(tmp_path) == ["model.onnx", "model.pt"]
    read = read_model(tmp_path / "model.onnx")
    assert (read.manifest.layout, read.manifest.mesh) == (layout, mesh)
    Session(read, RuntimeSettings())  # runs the self-test
    assert f"layout {layout}" in done.stdout


def test_command_takes_a_layout_for_networks_of_the_reference(tmp_path):
    path = reference_file(tmp_path / "model.yaml")
    run(path, "--layout", "runs")
    assert names_in(tmp_path) == ["model.onnx", "model.yaml"]
    assert read_model(tmp_path / "model.onnx").manifest.layout == "runs"


def test_command_never_writes_over_its_input(tmp_path):
    """Not by the portable file's name either, which nobody typed."""
    checkpoint().save(tmp_path / "model.plain.pt")
    before = (tmp_path / "model.plain.pt").read_bytes()
    assert "--output" in run(tmp_path / "model.plain.pt", "-o", tmp_path / "model.pt", code=1).stderr
    assert (tmp_path / "model.plain.pt").read_bytes() == before
    assert names_in(tmp_path) == ["model.plain.pt"]


def test_command_takes_class_names(tmp_path):
    path = reference_file(tmp_path / "model.yaml")
    run(path, "--classes", "penguin:object, nothing:background")
    classes = read_model(tmp_path / "model.onnx").manifest.classes
    assert classes == (ObjectClass("penguin", "object"), ObjectClass("nothing", "background"))
    assert "2 outputs" in run(path, "--classes", "ball", code=1).stderr
    assert "penguin" in run(path, "--classes", "penguin,field", code=1).stderr


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("missing.pt",), "missing.pt"),
        (("missing.yaml",), "missing.yaml"),
        (("model.txt",), "checkpoint"),
        (("model.pt", "-o", "model.pt"), "--output"),
        (("model.pt", "-o", "no/such/folder/model.onnx"), "can't write"),
        (("model.pt", "--intersections", "-1"), "intersections"),
        (("model.pt", "--object-radius", "nan"), "object_radius"),
        (("model.pt", "--layout", "runs", "--edge", "same"), "runs needs edge hard"),
    ],
)
def test_command_says_in_one_line_what_is_wrong(tmp_path, arguments, message):
    checkpoint().save(tmp_path / "model.pt")
    here = [tmp_path / each if each.endswith((".pt", ".yaml", ".txt", ".onnx")) else each for each in arguments]
    done = run(*here, code=1)
    assert message in done.stderr
    assert len(done.stderr.splitlines()) == 1
    assert sorted(path.name for path in tmp_path.iterdir()) == ["model.pt"]


@pytest.mark.parametrize("missing", ["torch", "onnx", "yaml"])
def test_command_without_its_extra_says_what_to_install(missing, tmp_path):
    program = f"import sys; sys.modules['{missing}'] = None; from vm_export.cli import main; sys.exit(main(['m.yaml']))"
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, cwd=tmp_path)
    assert done.returncode == 1
    assert done.stderr == f"vm-export: {missing} is not installed; run: pip install 'vm-embedded[export]'\n"


def test_edges_are_the_manifest_s():
    assert EDGES == ("hard", "same")
    assert json.loads(manifest(edge="same").as_json())["edge"] == "same"


def test_command_refuses_a_layout_for_the_reference_s_format(tmp_path):
    checkpoint().save(tmp_path / "model.pt")
    assert "--layout" in run(tmp_path / "model.pt", "--to-yaml", "--layout", "plain", code=1).stderr
    assert names_in(tmp_path) == ["model.pt"]


def test_a_portable_file_that_can_not_be_written_leaves_no_half_of_the_work(tmp_path):
    checkpoint().save(tmp_path / "model.pt")
    (tmp_path / "model.plain.onnx").mkdir()
    assert "model.plain.onnx" in run(tmp_path / "model.pt", code=1).stderr
    assert names_in(tmp_path) == ["model.plain.onnx", "model.pt"]
