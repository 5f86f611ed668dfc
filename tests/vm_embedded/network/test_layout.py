"""The layout of networks on graphs gives torch's answers, and holds what it says."""

import math
from pathlib import Path

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.manifests import ball_manifest
from vm_embedded.detection.projection import project
from vm_embedded.errors import ModelError
from vm_embedded.geometry.orientation import Orientation
from vm_embedded.geometry.radial_lenses import Equisolid, Rectilinear
from vm_embedded.geometry.shapes import Circle, Sphere
from vm_embedded.mesh.mesh import Mesh
from vm_embedded.mesh.models import MESH_MODELS, build_mesh
from vm_embedded.network.choose_layout import choose_layout
from vm_embedded.network.model_file import ModelFile
from vm_embedded.network.session import Session
from vm_export.export import onnx_model
from vm_export.network import Network
from vm_export.network_shape import ACTIVATIONS, Layer, NetworkShape

from ..strategies import SIZE, random_direction, reals, rotation, seeds

LARGEST_LOGIT = 2.0
"""Beyond it a probability has too few digits to tell its logit to 1e-5."""

MODELS = ["ring4", "ring6", "ring8", "cap6", "xygrid4", "xmgrid6", "xygrid8"]
"""Of every arrangement and number of neighbors one; those with equal neighbors are laid out alike."""

models = st.sampled_from(MODELS)
kinds = st.sampled_from(["convolution", "separable", "dense"])
activations = st.sampled_from(sorted(ACTIVATIONS))
heads = st.sampled_from(
    [(2, "softmax"), (3, "softmax"), (5, "softmax"), (1, "sigmoid"), (2, "sigmoid"), (3, "sigmoid")]
)


@st.composite
def network_shapes(draw, model):
    first = Layer(draw(st.sampled_from(["convolution", "separable"])), draw(st.integers(1, 8)), draw(activations))
    inner = draw(st.lists(st.builds(Layer, kinds, st.integers(1, 8), activations), max_size=4))
    return NetworkShape((first, *inner, Layer(draw(kinds), *draw(heads))), MESH_MODELS[model].neighbors)


def network_of(shape, seed):
    """A network whose every weight and bias counts."""
    torch.manual_seed(seed)
    network = Network(shape).eval()
    with torch.no_grad():
        for layer in network.typed_layers:
            layer.linear.bias.normal_(std=0.3)
    return network


def manifest_of(model, classes=2, **changes):
    names = (f"class{number}:object" for number in range(classes))
    return ball_manifest(*names, mesh=model, **changes)


@st.composite
def random_meshes(draw, width):
    """Any graphs: links in one direction, to a point itself, twice to the same one, and to none at all."""
    random = np.random.default_rng(draw(seeds))
    count = draw(st.one_of(st.sampled_from([0, 1, 2]), st.integers(3, 80)))
    neighbors = random.integers(0, count + 1, (count + 1, width))
    in_rows = random.random(count) < draw(reals(0.0, 1.0))  # some follow each other, as they do in rings
    neighbors[:count][in_rows, width // 2] = (np.flatnonzero(in_rows) + 1) % max(count, 1)
    back = in_rows & (random.random(count) < 0.8)
    neighbors[:count][back, 0] = (np.flatnonzero(back) - 1) % max(count, 1)
    neighbors[random.random(neighbors.shape) < draw(reals(0.0, 1.0)) ** 2] = count
    neighbors[count] = count
    rays = random.normal(size=(count, 3))
    rays = np.asfortranarray(rays / np.linalg.norm(rays, axis=1, keepdims=True))
    return Mesh(rays, neighbors.astype(np.int32))


VIEWS = {"down": (0.5 * math.pi, 0.0), "ahead": (0.35, 0.0), "tilted": (0.6, 0.7), "over the horizon": (0.0, -0.2)}
"""Pitch and roll [rad]."""


@st.composite
def ring_meshes(draw, model):
    """A mesh and which of its points some camera sees: of the whole mesh, or of what a bucket holds."""
    random = np.random.default_rng(draw(seeds))
    shape, height = draw(st.sampled_from([Sphere(0.1), Circle(0.1)])), draw(reals(0.4, 1.2))
    mesh = build_mesh(shape, height, draw(reals(0.5, 2.5)), draw(reals(0.3, 2.5)), model)
    pitch, roll = draw(st.sampled_from(sorted(VIEWS.values())))
    focal = draw(reals(120.0, 500.0))
    lens = draw(st.sampled_from([Equisolid(focal_length=focal, fov=2.6), Rectilinear(focal_length=focal, fov=2.0)]))
    turn = Orientation.from_roll_pitch(height, roll, pitch).rotation
    if draw(st.booleans()):
        kept = np.flatnonzero(project(mesh, turn @ rotation(0.1 * random_direction(random)), lens, SIZE).on_screen)
        mesh = mesh.part(kept)
    return mesh, project(mesh, turn, lens, SIZE).on_screen


@st.composite
def masks(draw, count, seen=None):
    """Which of so many points are on screen: what a camera sees, any of them, none, or all."""
    kind = draw(st.sampled_from(["seen", "random", "none", "all"] if seen is not None else ["random", "none", "all"]))
    if kind == "seen":
        return seen
    share = {"random": draw(reals(0.0, 1.0)), "none": -1.0, "all": 2.0}[kind]
    return np.random.default_rng(draw(seeds)).random(count) < share


def torch_logits(network, mesh, colors, on_screen):
    """Logits (n, C) of the points on screen, from torch and the mesh of just those."""
    kept = np.flatnonzero(on_screen)
    points = np.vstack([colors[kept], np.full((1, 3), -1.0)]).astype(np.float32)
    with torch.inference_mode():
        logits = network.logits(torch.from_numpy(points), torch.from_numpy(mesh.part(kept).neighbors.copy()))
    return logits[:-1].double().numpy()


def tamed(network, logits):
    """These logits, after making the network's last layer small enough that none of its answers saturates."""
    factor = min(1.0, LARGEST_LOGIT / max(float(np.abs(logits).max(initial=0.0)), 1e-9))
    with torch.no_grad():
        network.typed_layers[-1].linear.weight.mul_(factor)
        network.typed_layers[-1].linear.bias.mul_(factor)
    return factor * logits


def answers(session, mesh, colors, on_screen):
    """Probabilities (k, C) of the points on screen. What is off screen gets no color at all."""
    layout = choose_layout(mesh, session.model.manifest)
    shown = np.where(on_screen, colors.T, np.nan).astype(np.float32)
    return session.run(layout, shown, on_screen, np.flatnonzero(on_screen))


def session_of(network, model, **changes):
    manifest = manifest_of(model, network.shape.classes, **changes)
    return Session(ModelFile(Path("model.onnx"), onnx_model(network, manifest), manifest, ""))


def logits_of(probabilities, head):
    """Logits (n, C), those of softmax up to a constant for each point."""
    p = probabilities.astype(np.float64)
    return np.log(p) - np.log(1.0 - p) if head == "sigmoid" else _centered(np.log(p))


def _centered(logits):
    return logits - logits.mean(axis=1, keepdims=True)


def assert_same_answers(network, model, mesh, on_screen, seed):
    """ONNX Runtime and torch agree on the logits of every point on screen."""
    head = network.shape.layers[-1].activation
    colors = np.random.default_rng(seed).random((len(mesh), 3))
    expected = tamed(network, torch_logits(network, mesh, colors, on_screen))
    probabilities = answers(session_of(network, model), mesh, colors, on_screen)
    assert probabilities.shape == (on_screen.sum(), network.shape.classes)
    found = logits_of(probabilities, head)
    assert np.isfinite(found).all()
    np.testing.assert_allclose(found, expected if head == "sigmoid" else _centered(expected), rtol=0, atol=1e-5)


@given(st.data(), models, seeds)
def test_the_graph_gives_torch_s_answers_on_any_graph(data, model, seed):
    network = network_of(data.draw(network_shapes(model)), seed)
    mesh = data.draw(random_meshes(MESH_MODELS[model].neighbors))
    assert_same_answers(network, model, mesh, data.draw(masks(len(mesh))), seed)


@given(st.data(), models, seeds)
def test_the_graph_gives_torch_s_answers_on_ring_meshes(data, model, seed):
    network = network_of(data.draw(network_shapes(model)), seed)
    mesh, seen = data.draw(ring_meshes(model))
    assert_same_answers(network, model, mesh, data.draw(masks(len(mesh), seen)), seed)


WHOLE = {model: build_mesh(Sphere(0.1), 0.8, 1.5, 2.0, model) for model in MODELS}
for_all_models = pytest.mark.parametrize("model", MODELS)


@pytest.mark.parametrize("head", [(2, "softmax"), (3, "softmax"), (5, "softmax"), (2, "sigmoid")], ids=str)
@pytest.mark.parametrize("activation", sorted(ACTIVATIONS))
@for_all_models
def test_the_graph_gives_torch_s_answers_with_every_activation_and_head(model, activation, head):
    layers = (
        Layer("convolution", 6, activation),
        Layer("separable", 5, activation),
        Layer("dense", 4, activation),
        Layer("convolution", *head),
    )
    network = network_of(NetworkShape(layers, MESH_MODELS[model].neighbors), 3)
    mesh = WHOLE[model]
    assert_same_answers(network, model, mesh, np.random.default_rng(1).random(len(mesh)) < 0.9, 1)


@for_all_models
@pytest.mark.parametrize("count", [0, 1])
@pytest.mark.parametrize("shown", [False, True])
def test_the_graph_takes_a_mesh_of_no_point_or_of_one(model, count, shown):
    network = network_of(NetworkShape.uniform(3, 4, 3, neighbors=MESH_MODELS[model].neighbors), 0)
    mesh = WHOLE[model].part(np.arange(count))
    assert_same_answers(network, model, mesh, np.full(count, shown), 0)


@for_all_models
def test_the_graph_takes_a_frame_in_which_nothing_is_on_screen(model):
    network = network_of(NetworkShape.uniform(3, 4, 2, neighbors=MESH_MODELS[model].neighbors), 0)
    assert_same_answers(network, model, WHOLE[model], np.zeros(len(WHOLE[model]), dtype=bool), 0)


@given(st.data(), models, seeds)
@settings(max_examples=20)
def test_a_layout_is_used_for_one_frame_after_the_other(data, model, seed):
    """No frame leaves anything behind for the next one."""
    network = network_of(data.draw(network_shapes(model)), seed)
    mesh, seen = data.draw(ring_meshes(model))
    colors = np.random.default_rng(seed).random((2, len(mesh), 3)).astype(np.float32)
    shown = [data.draw(masks(len(mesh), seen)) for _ in range(2)]
    session = session_of(network, model)
    arranged = choose_layout(mesh, session.model.manifest)
    for each, on_screen in zip(colors, shown, strict=True):
        again = session.run(arranged, each.T, on_screen, np.flatnonzero(on_screen))
        np.testing.assert_array_equal(again, answers(session, mesh, each, on_screen))


@given(st.data(), models, seeds)
def test_the_edge_policy_same_links_what_is_off_screen_to_the_point_itself(data, model, seed):
    network = network_of(data.draw(network_shapes(model)), seed)
    mesh = data.draw(random_meshes(MESH_MODELS[model].neighbors))
    on_screen = data.draw(masks(len(mesh)))
    colors = np.random.default_rng(seed).random((len(mesh), 3))
    kept = np.flatnonzero(on_screen)
    part = mesh.part(kept)
    itself = np.arange(len(kept) + 1, dtype=np.int32)[:, None]
    alone = Mesh(part.rays, np.where(part.neighbors == len(kept), itself, part.neighbors))
    expected = tamed(network, torch_logits(network, alone, colors[kept], np.ones(len(kept), dtype=bool)))
    probabilities = answers(session_of(network, model, edge="same"), mesh, colors, on_screen)
    head = network.shape.layers[-1].activation
    reference = expected if head == "sigmoid" else _centered(expected)
    found = logits_of(probabilities, head)
    np.testing.assert_allclose(found, reference, rtol=0, atol=1e-5)


@for_all_models
def test_rays_are_column_by_column_in_memory(model):
    """Each frame's projection goes through them by columns."""
    for mesh in (WHOLE[model], WHOLE[model].part(np.arange(50, 230))):
        assert mesh.rays.T.flags.c_contiguous


@for_all_models
def test_feeds_have_the_colors_on_screen_and_change_none_of_what_they_take(model):
    """The network's inputs are contiguous, of the types that its file asks for, and in range whatever is on screen."""
    random = np.random.default_rng(2)
    arranged = choose_layout(WHOLE[model], manifest_of(model))
    m = len(WHOLE[model])
    on_screen = random.random(m) < 0.7
    colors = random.random((3, m), dtype=np.float32)
    before = colors.copy()
    feeds = arranged.feeds(colors, on_screen)
    np.testing.assert_array_equal(colors, before)
    assert set(feeds) == {"points", "neighbors"}
    points, neighbors = feeds["points"], feeds["neighbors"]
    assert (points.dtype, points.flags.c_contiguous) == (np.float32, True)
    np.testing.assert_array_equal(points[:-1].T[:, on_screen], colors[:, on_screen])
    np.testing.assert_array_equal(points[-1], [-1.0] * 3)
    assert (neighbors.dtype, neighbors.shape) == (np.int32, (m + 1, MESH_MODELS[model].neighbors))
    assert 0 <= neighbors.min() <= neighbors.max() <= m


def test_answers_that_are_not_finite_are_an_error():
    network = network_of(NetworkShape((Layer("convolution", 4, "elu"), Layer("convolution", 2, "softmax")), 6), 1)
    mesh = build_mesh(Sphere(0.1), 0.8, 2.0, 1.0, "xmgrid6")
    session = session_of(network, "xmgrid6")
    colors, on_screen = np.zeros((len(mesh), 3)), np.arange(len(mesh)) > 0
    answers(session, mesh, colors, on_screen)
    colors[1] = np.nan
    with pytest.raises(ModelError, match="its answers are NaN or infinite"):
        answers(session, mesh, colors, on_screen)
