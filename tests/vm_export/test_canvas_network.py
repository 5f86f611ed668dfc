"""Networks on a canvas: their sizes, what they see, and what only the place of a strip changes."""

import functools
from pathlib import Path

import numpy as np
import onnx
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.vm_export.checkpoints import checkpoint
from vm_embedded.arrays import frozen
from vm_embedded.errors import InputError, ModelError
from vm_embedded.geometry.orientation import Orientation
from vm_embedded.geometry.radial_lenses import Equisolid
from vm_embedded.mesh.mesh import STRIDE
from vm_embedded.mesh.octaves import BLOCK
from vm_embedded.network.choose_layout import choose_layout
from vm_embedded.network.model_file import ModelFile, read_model
from vm_embedded.network.session import Session
from vm_export import export
from vm_export.canvas_shape import CanvasShape

SIZE = (320, 240)


@pytest.mark.parametrize(("width", "near"), [(0, 8), (1, 8), (7, 8), (12, 8), (20, 16), (63, 56), (-8, 8)])
def test_a_width_that_is_no_multiple_of_eight_names_one_that_is(width, near):
    with pytest.raises(InputError, match=rf"width .* multiple of 8, such as {near}, not {width}"):
        CanvasShape(1, width, 2)
    CanvasShape(1, near, 2)


@pytest.mark.parametrize("depth", [0, -1])
def test_a_depth_below_one_is_refused(depth):
    with pytest.raises(InputError, match=f"depth .* at least 1, not {depth}"):
        CanvasShape(depth, 8, 2)


@given(st.integers(1, 5), st.integers(1, 8), st.integers(1, 9))
def test_a_shape_round_trips_and_its_channels_are_multiples_of_eight(depth, eights, classes):
    shape = CanvasShape(depth, 8 * eights, classes)
    assert CanvasShape.from_dict(shape.as_dict()) == shape
    assert all(each % 8 == 0 for each in shape.widths)
    assert list(shape.widths) == sorted(shape.widths)
    assert shape.operations < CanvasShape(depth + 1, 8 * eights, classes).operations
    for entry in shape.as_dict():
        with pytest.raises(InputError, match="shape of a network"):
            CanvasShape.from_dict({name: each for name, each in shape.as_dict().items() if name != entry})


def counted(network, rows, columns):
    """Multiplications and additions of the network's convolutions on a canvas, from what they compute."""
    total = []

    def add(module, inputs, output):
        kernel = module.weight[0].numel()
        total.append(2 * kernel * output[0].numel())

    handles = [each.register_forward_hook(add) for each in network.modules() if isinstance(each, torch.nn.Conv2d)]
    with torch.inference_mode():
        network(torch.zeros(1, 3, rows, columns), torch.zeros(1, 1, rows, columns, dtype=torch.bool))
    for each in handles:
        each.remove()
    return sum(total)


@pytest.mark.parametrize("shape", [CanvasShape(1, 8, 2), CanvasShape(2, 16, 6, 3), CanvasShape(3, 24, 4)], ids=str)
def test_operations_are_those_of_its_convolutions(shape):
    network = checkpoint(0, shape, "octaves").network
    assert counted(network, 64, 80) / (64 * 80) == pytest.approx(shape.operations, rel=1e-3)


def test_the_file_has_operators_without_weights_that_a_frame_changes():
    """Each convolution has constant weights, without which ONNX Runtime does not choose its fast format."""
    made = checkpoint(1, CanvasShape(1, 8, 3, 1), "octaves")
    graph = onnx.load_from_string(export.onnx_model(made.network, made.manifest)).graph
    constants = {each.name for each in graph.initializer}
    convolutions = [node for node in graph.node if node.op_type == "Conv"]
    assert len(convolutions) == sum(isinstance(each, torch.nn.Conv2d) for each in made.network.modules())
    assert all(set(node.input[1:]) <= constants for node in convolutions)
    assert not {node.op_type for node in graph.node} & {"Pad", "BatchNormalization", "Gather"}


@functools.cache
def loaded():
    """A network, the session of its model file, and its manifest."""
    made = checkpoint(3, CanvasShape(1, 8, 3, 2), "octaves")
    model = ModelFile(Path("canvas.onnx"), export.onnx_model(made.network, made.manifest), made.manifest, "")
    return made.network, Session(model), made.manifest


@given(st.integers(1, 5), st.integers(1, 9), st.integers(0, 1000))
@settings(max_examples=15)
def test_onnx_runtime_agrees_with_torch_on_any_canvas(rows, columns, seed):
    network, session, _ = loaded()
    random = np.random.default_rng(seed)
    shape = 8 * rows, 8 * columns
    shown = random.random((1, 1, *shape)) < 0.8
    points = np.where(shown, random.random((1, 3, *shape)), 0.0).astype(np.float32)
    found = session.onnx.run({"points": points, "shown": shown})
    with torch.inference_mode():
        expected = network(torch.from_numpy(points), torch.from_numpy(shown)).numpy()
    np.testing.assert_allclose(found, expected, atol=1e-4)


def strips(seed, count):
    """Colors (n, 3) and cells (n, 2) of random strips, some with holes, as a camera that looks askew sees them."""
    random = np.random.default_rng(seed)
    cells = []
    for strip in range(count):
        rows, columns = random.integers(3, 22), random.integers(8, 70)
        own = np.stack(np.meshgrid(np.arange(columns), np.arange(rows)), axis=-1).reshape(-1, 2)
        own = own[random.random(len(own)) < 0.95]
        cells.append(own + np.array([0, STRIDE * strip]))
    cells = np.concatenate(cells).astype(np.int32)
    points = np.concatenate([random.random((len(cells), 3)), [[-1.0] * 3]]).astype(np.float32)
    return points, cells


def answered(network, points, cells):
    with torch.inference_mode():
        return network.probabilities(torch.from_numpy(points), torch.from_numpy(cells)).numpy()[:-1]


@given(st.integers(0, 1000), st.integers(1, 4), st.integers(0, 9), st.integers(0, 9), st.integers(0, 3))
@settings(max_examples=15)
def test_strips_that_lie_whole_blocks_away_on_their_lattice_answer_alike(seed, count, right, up, apart):
    points, cells = strips(seed, count)
    moved = cells + np.array([BLOCK * right, BLOCK * up + STRIDE * apart], dtype=np.int32)
    network = loaded()[0]
    np.testing.assert_allclose(answered(network, points, moved), answered(network, points, cells), atol=1e-6)


@given(st.integers(0, 1000), st.integers(1, 4))
@settings(max_examples=15)
def test_the_order_of_the_points_changes_nothing(seed, count):
    points, cells = strips(seed, count)
    order = np.random.default_rng(seed).permutation(len(cells))
    network = loaded()[0]
    shuffled = answered(network, points[[*order, len(cells)]], np.ascontiguousarray(cells[order]))
    np.testing.assert_allclose(shuffled, answered(network, points, cells)[order], atol=1e-6)


def test_what_is_off_screen_is_as_if_it_were_not_in_the_mesh():
    """Colors of points off screen have no effect."""
    _, session, manifest = loaded()
    mesh = manifest.model.build(manifest.mesh_shape, 0.6, 2.0, 3.0)
    layout = choose_layout(mesh, manifest)
    random = np.random.default_rng(0)
    on_screen = random.random(len(mesh)) < 0.7
    shown = layout.spread(on_screen)
    one, other = (np.where(shown, 0.3, random.random((3, len(shown)))).astype(np.float32) for _ in range(2))
    answers = [session.run(layout, each, on_screen, np.flatnonzero(on_screen)) for each in (one, other)]
    np.testing.assert_array_equal(*answers)
    one[0, np.flatnonzero(shown)[0]] = np.nan
    with pytest.raises(ModelError, match="NaN or infinite"):
        session.run(layout, one, on_screen, np.flatnonzero(on_screen))


@pytest.mark.long
def test_an_exported_network_detects_with_the_whole_mesh(tmp_path):
    """From a file, through the detector's cache, every answered point on screen gets probabilities."""
    from vm_embedded import Detector

    export.export(checkpoint(2, mesh="octaves"), tmp_path / "model.onnx")
    model = read_model(tmp_path / "model.onnx")
    assert model.manifest.mesh == "octaves"
    assert model.manifest.operations == CanvasShape(1, 8, 2).operations
    image = frozen(np.random.default_rng(1).integers(0, 256, (SIZE[1], SIZE[0], 3), dtype=np.uint8))
    lens = Equisolid(focal_length=150.0, fov=2.4)
    found = Detector(model).detect(image, Orientation.from_roll_pitch(0.6, 0.1, 0.5), lens)
    assert len(found.rays) > 200
    assert (found.rays[:, 2] < 0.0).all()  # no point of the margin above the horizon is answered
    np.testing.assert_allclose(found.probabilities.sum(axis=1), 1.0, atol=1e-5)
