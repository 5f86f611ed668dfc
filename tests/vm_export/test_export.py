"""The exporter: torch, ONNX Runtime and the reference's files agree."""

from dataclasses import replace

import numpy as np
import onnx
import onnxruntime
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.manifests import MESHES
from tests.vm_export.checkpoints import checkpoint, manifest
from vm_embedded.errors import ModelError
from vm_embedded.geometry.shapes import Sphere
from vm_embedded.mesh.models import build_mesh
from vm_embedded.network.choose_layout import choose_layout
from vm_embedded.network.manifest import LAYOUTS
from vm_embedded.network.model_file import read_model
from vm_export import export
from vm_export.canvas_shape import CanvasShape
from vm_export.checkpoint import Checkpoint
from vm_export.network import Network
from vm_export.network_shape import ACTIVATIONS, HEADS, Layer, NetworkShape

in_all_layouts = pytest.mark.parametrize("layout", LAYOUTS)


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


canvas_shapes = st.builds(CanvasShape, st.integers(1, 3), st.sampled_from([8, 16, 24]), st.integers(1, 6))


def any_checkpoint(draw, layout, seed):
    """A checkpoint of any network that there is for this layout."""
    if layout == "canvas":
        return checkpoint(seed, draw(canvas_shapes), "octaves")
    shape = draw(network_shapes())
    return checkpoint(seed, shape, f"ring{shape.neighbors}")


@in_all_layouts
@given(data=st.data(), seed=st.integers(0, 1000))
@settings(max_examples=25)
def test_every_network_gives_the_same_answers_in_onnx_runtime(layout, data, seed):
    made = any_checkpoint(data.draw, layout, seed)
    facts = replace(made.manifest, layout=layout)
    content = export.onnx_model(made.network, facts)
    assert export.largest_difference(content, made.network, facts) < 1e-4


@pytest.mark.parametrize("activation", ["elu", "selu"])
def test_far_below_zero_no_layer_makes_numbers_that_slow_a_processor_down(activation):
    network = checkpoint(2, NetworkShape.uniform(3, 8, 2, activation=activation)).network
    with torch.no_grad():
        for layer in network.typed_layers[:-1]:
            layer.linear.bias -= torch.linspace(0, 110, 8)
    facts = manifest(("class0", "class1"), layout="runs")
    content = export.onnx_model(network, facts)
    assert export.largest_difference(content, network, facts) < 1e-4

    model = onnx.load_from_string(content)
    made = [node.output[0] for node in model.graph.node if node.op_type in ("MatMul", "Exp", "Add")]
    model.graph.output.extend(onnx.ValueInfoProto(name=name) for name in made)
    laid = choose_layout(build_mesh(Sphere(0.1), 0.5, 4.0, 10.0), facts)
    shown = np.ones(len(laid.slots), dtype=bool)
    colors = np.random.default_rng(1).random((3, len(shown)), dtype=np.float32)
    session = onnxruntime.InferenceSession(model.SerializeToString())
    for name, values in zip(made, session.run(made, laid.feeds(colors, shown)), strict=True):
        sizes = np.abs(values[values != 0])
        assert not (sizes < np.finfo(np.float32).tiny).any(), name


DOMAINS = {"plain": {""}, "runs": {"", "ai.onnx.ml"}, "canvas": {""}}
"""Where each layout's operators come from: the standard, and its part for machine learning on tables."""


@in_all_layouts
def test_the_file_describes_itself_and_is_one_file_of_stock_operators(layout, tmp_path):
    made = checkpoint(mesh=MESHES[layout])
    difference = export.export(made, tmp_path / "model.onnx", layout)
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
        assert export.fastest_layout(Checkpoint(network, manifest(("class0", "class1")))) == layout
    for edge, layout in (("hard", "runs"), ("same", "plain")):
        made = Checkpoint(checkpoint().network, manifest(edge=edge))
        export.export(made, tmp_path / "model.onnx")
        assert read_model(tmp_path / "model.onnx").manifest.layout == layout


def test_a_layout_that_there_is_not_is_refused(tmp_path):
    with pytest.raises(ModelError, match=r"layout .*'run'.*'runs'"):
        export.export(checkpoint(), tmp_path / "model.onnx", "run")
    with pytest.raises(ModelError, match="runs needs edge hard"):
        export.export(Checkpoint(checkpoint().network, manifest(edge="same")), tmp_path / "model.onnx", "runs")
    assert not list(tmp_path.iterdir())


@pytest.mark.long
@in_all_layouts
def test_the_same_checkpoint_gives_the_same_bytes(layout, tmp_path):
    for name in ("a", "b"):
        export.export(checkpoint(3, mesh=MESHES[layout]), tmp_path / name, layout)
    assert (tmp_path / "a").read_bytes() == (tmp_path / "b").read_bytes()


@pytest.mark.long
@in_all_layouts
def test_a_graph_that_differs_from_torch_is_not_written(layout, tmp_path, monkeypatch):
    mesh = MESHES[layout]
    other = export.onnx_model(checkpoint(5, mesh=mesh).network, manifest(("class0", "class1"), mesh, layout=layout))
    monkeypatch.setattr(export, "onnx_model", lambda network, manifest: other)
    (tmp_path / "model.onnx").write_text("the file of before")
    with pytest.raises(ModelError, match="differ by"):
        export.export(checkpoint(4, mesh=mesh), tmp_path / "model.onnx", layout)
    assert (tmp_path / "model.onnx").read_text() == "the file of before"


def test_the_number_of_points_is_dynamic():
    made = checkpoint()
    session = onnxruntime.InferenceSession(export.onnx_model(made.network, made.manifest))
    for points in (0, 1, 17, 3000):
        colors = np.full((points + 1, 3), -1.0, dtype=np.float32)
        neighbors = np.full((points + 1, 6), points, dtype=np.int32)
        (answer,) = session.run(None, {"points": colors, "neighbors": neighbors})
        assert answer.shape == (points + 1, 2)
