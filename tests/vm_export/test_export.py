"""The exporter: torch, ONNX Runtime and the reference's files agree."""

import numpy as np
import onnx
import onnxruntime
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.vm_export.checkpoints import checkpoint, manifest
from vm_embedded.errors import ModelError
from vm_embedded.network.model_file import read_model
from vm_export import export
from vm_export.canvas_shape import CanvasShape
from vm_export.network_shape import ACTIVATIONS, HEADS, Layer, NetworkShape

in_all_layouts = pytest.mark.parametrize("on_canvas", [False, True])


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


def any_checkpoint(draw, on_canvas, seed):
    """A checkpoint of any network on a canvas or on a graph."""
    if on_canvas:
        return checkpoint(seed, draw(canvas_shapes), "octaves")
    shape = draw(network_shapes())
    return checkpoint(seed, shape, f"ring{shape.neighbors}")


@in_all_layouts
@given(data=st.data(), seed=st.integers(0, 1000))
@settings(max_examples=25)
def test_every_network_gives_the_same_answers_in_onnx_runtime(on_canvas, data, seed):
    made = any_checkpoint(data.draw, on_canvas, seed)
    content = export.onnx_model(made.network, made.manifest)
    assert export.largest_difference(content, made.network, made.manifest) < 1e-4


MESHES = {False: "ring6", True: "octaves"}


@in_all_layouts
def test_the_file_describes_itself_and_is_one_file_of_stock_operators(on_canvas, tmp_path):
    made = checkpoint(mesh=MESHES[on_canvas])
    difference = export.export(made, tmp_path / "model.onnx")
    assert difference < 1e-4
    assert [path.name for path in tmp_path.iterdir()] == ["model.onnx"]
    graph = onnx.load(tmp_path / "model.onnx")
    assert {node.domain for node in graph.graph.node} == {""}
    assert {entry.domain for entry in graph.opset_import} == {""}
    read = read_model(tmp_path / "model.onnx").manifest
    assert read.classes == made.manifest.classes
    assert read.intersections == made.manifest.intersections
    assert read.self_test is not None


@in_all_layouts
def test_the_same_checkpoint_gives_the_same_bytes(on_canvas, tmp_path):
    for name in ("a", "b"):
        export.export(checkpoint(3, mesh=MESHES[on_canvas]), tmp_path / name)
    assert (tmp_path / "a").read_bytes() == (tmp_path / "b").read_bytes()


@pytest.mark.long
@in_all_layouts
def test_a_graph_that_differs_from_torch_is_not_written(on_canvas, tmp_path, monkeypatch):
    mesh = MESHES[on_canvas]
    other = export.onnx_model(checkpoint(5, mesh=mesh).network, manifest(("class0", "class1"), mesh))
    monkeypatch.setattr(export, "onnx_model", lambda network, manifest: other)
    (tmp_path / "model.onnx").write_text("the file of before")
    with pytest.raises(ModelError, match="differ by"):
        export.export(checkpoint(4, mesh=mesh), tmp_path / "model.onnx")
    assert (tmp_path / "model.onnx").read_text() == "the file of before"


def test_the_number_of_points_is_dynamic():
    made = checkpoint()
    session = onnxruntime.InferenceSession(export.onnx_model(made.network, made.manifest))
    for points in (0, 1, 17, 3000):
        colors = np.full((points + 1, 3), -1.0, dtype=np.float32)
        neighbors = np.full((points + 1, 6), points, dtype=np.int32)
        (answer,) = session.run(None, {"points": colors, "neighbors": neighbors})
        assert answer.shape == (points + 1, 2)
