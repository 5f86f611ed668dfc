"""All layouts give the same answers, torch's, and hold what they say."""

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
from vm_embedded.mesh.mesh import SELF, Mesh
from vm_embedded.mesh.models import MESH_MODELS, build_mesh
from vm_embedded.network.choose_layout import PlainLayout, choose_layout
from vm_embedded.network.model_file import ModelFile
from vm_embedded.network.runs_layout import RunsLayout
from vm_embedded.network.session import Session
from vm_export.export import onnx_model
from vm_export.network import Network
from vm_export.network_shape import ACTIVATIONS, Layer, NetworkShape

from ..strategies import SIZE, random_direction, reals, rotation, seeds

LARGEST_LOGIT = 2.0
"""Beyond it a probability has too few digits to tell its logit to 1e-5."""

MODELS = ["ring4", "ring6", "ring8", "cap6", "xygrid4", "xmgrid6", "xygrid8"]
"""Of every arrangement and number of neighbors one; those with equal neighbors are laid out alike."""

LAYOUTS = ("plain", "runs")
"""Those of networks on graphs. Networks on a canvas have no other layout."""

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


def manifest_of(model, layout="plain", classes=2, **changes):
    names = (f"class{number}:object" for number in range(classes))
    return ball_manifest(*names, mesh=model, layout=layout, **changes)


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
    """Probabilities (m, C) of all slots, and their layout. What is off screen gets no color at all."""
    layout = choose_layout(mesh, session.model.manifest)
    shown = np.append(on_screen, False)[layout.slots]
    return session.run(layout, slot_colors(layout, colors, shown), shown), layout


def slot_colors(layout, colors, shown):
    """Colors (3, m) of a layout's slots, from those of points (n, 3); NaN for slots that are not shown (m,)."""
    padded = np.vstack([colors, np.zeros((1, 3))]).astype(np.float32)
    return np.where(shown, padded[layout.slots].T, np.float32(np.nan))


def session_of(network, model, layout, **changes):
    manifest = manifest_of(model, layout, network.shape.classes, **changes)
    return Session(ModelFile(Path(f"{layout}.onnx"), onnx_model(network, manifest), manifest, ""))


def logits_of(probabilities, head):
    """Logits (n, C), those of softmax up to a constant for each point."""
    p = probabilities.astype(np.float64)
    return np.log(p) - np.log(1.0 - p) if head == "sigmoid" else _centered(np.log(p))


def _centered(logits):
    return logits - logits.mean(axis=1, keepdims=True)


def assert_same_answers(network, model, mesh, on_screen, seed):
    """All layouts, and torch, agree on the logits of every point on screen."""
    head = network.shape.layers[-1].activation
    colors = np.random.default_rng(seed).random((len(mesh), 3))
    expected = tamed(network, torch_logits(network, mesh, colors, on_screen))
    found = {}
    for layout in LAYOUTS:
        probabilities, arranged = answers(session_of(network, model, layout), mesh, colors, on_screen)
        assert probabilities.shape == (len(arranged.slots), network.shape.classes)
        found[layout] = logits_of(probabilities[arranged.places][on_screen], head)
        assert np.isfinite(found[layout]).all()
        copies = probabilities[np.append(on_screen, False)[arranged.slots]]
        first = probabilities[arranged.places[arranged.slots[np.append(on_screen, False)[arranged.slots]]]]
        np.testing.assert_allclose(copies, first, atol=1e-6, err_msg="a copy of a point has another answer")
    np.testing.assert_allclose(found["runs"], found["plain"], rtol=0, atol=1e-5)
    reference = expected if head == "sigmoid" else _centered(expected)
    for layout in found:
        np.testing.assert_allclose(found[layout], reference, rtol=0, atol=1e-5, err_msg=layout)


@given(st.data(), models, seeds)
def test_all_layouts_give_the_same_answers_on_any_graph(data, model, seed):
    network = network_of(data.draw(network_shapes(model)), seed)
    mesh = data.draw(random_meshes(MESH_MODELS[model].neighbors))
    assert_same_answers(network, model, mesh, data.draw(masks(len(mesh))), seed)


@given(st.data(), models, seeds)
def test_all_layouts_give_the_same_answers_on_ring_meshes(data, model, seed):
    network = network_of(data.draw(network_shapes(model)), seed)
    mesh, seen = data.draw(ring_meshes(model))
    assert_same_answers(network, model, mesh, data.draw(masks(len(mesh), seen)), seed)


WHOLE = {model: build_mesh(Sphere(0.1), 0.8, 1.5, 2.0, model) for model in MODELS}
in_all_layouts = pytest.mark.parametrize("layout", LAYOUTS)
for_all_models = pytest.mark.parametrize("model", MODELS)


@pytest.mark.parametrize("head", [(2, "softmax"), (3, "softmax"), (5, "softmax"), (2, "sigmoid")], ids=str)
@pytest.mark.parametrize("activation", sorted(ACTIVATIONS))
@for_all_models
def test_all_layouts_give_the_same_answers_with_every_activation_and_head(model, activation, head):
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
def test_all_layouts_take_a_mesh_of_no_point_or_of_one(model, count, shown):
    network = network_of(NetworkShape.uniform(3, 4, 3, neighbors=MESH_MODELS[model].neighbors), 0)
    mesh = WHOLE[model].part(np.arange(count))
    assert_same_answers(network, model, mesh, np.full(count, shown), 0)


@for_all_models
def test_all_layouts_take_a_frame_in_which_nothing_is_on_screen(model):
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
    for layout in LAYOUTS:
        session = session_of(network, model, layout)
        arranged = choose_layout(mesh, session.model.manifest)
        for each, on_screen in zip(colors, shown, strict=True):
            fresh, _ = answers(session, mesh, each, on_screen)
            everywhere = np.vstack([each, np.full((1, 3), 7.0, dtype=np.float32)])[arranged.slots].T
            again = session.run(arranged, everywhere, np.append(on_screen, False)[arranged.slots])
            where = arranged.places[on_screen]
            np.testing.assert_array_equal(again[where], fresh[where])


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
    probabilities, layout = answers(session_of(network, model, "plain", edge="same"), mesh, colors, on_screen)
    head = network.shape.layers[-1].activation
    reference = expected if head == "sigmoid" else _centered(expected)
    found = logits_of(probabilities[layout.places][on_screen], head)
    np.testing.assert_allclose(found, reference, rtol=0, atol=1e-5)


def arrays_of(layout):
    links = layout.columns if isinstance(layout, RunsLayout) else layout._neighbors
    return [layout.slots, layout.places, layout.original, layout.rays, links]


@in_all_layouts
@for_all_models
def test_what_a_layout_holds_is_read_only_and_counted(layout, model):
    arranged = choose_layout(WHOLE[model], manifest_of(model, layout))
    for array in arrays_of(arranged):
        assert not array.flags.writeable
        with pytest.raises(ValueError, match="read-only"):
            array[:1] = 0
    assert arranged.nbytes == sum(array.nbytes for array in arrays_of(arranged))
    held = sum(each.nbytes for each in vars(arranged).values() if isinstance(each, np.ndarray | Mesh))
    assert 0 <= held - arranged.nbytes <= 100  # a number for each group is too little to count


@in_all_layouts
@for_all_models
def test_rays_are_column_by_column_in_memory(layout, model):
    """As of every mesh; each frame's projection goes through them by columns."""
    for mesh in (WHOLE[model], WHOLE[model].part(np.arange(50, 230))):
        assert choose_layout(mesh, manifest_of(model, layout)).rays.T.flags.c_contiguous


@for_all_models
def test_plain_is_the_mesh_as_it_is(model):
    layout = choose_layout(WHOLE[model], manifest_of(model))
    assert isinstance(layout, PlainLayout)
    assert layout.rays is WHOLE[model].rays
    np.testing.assert_array_equal(layout.links(layout.places), WHOLE[model].neighbors[:-1])
    np.testing.assert_array_equal(layout.slots, np.arange(len(WHOLE[model])))
    np.testing.assert_array_equal(layout.places, layout.slots)
    assert layout.original.all()


@for_all_models
def test_every_neighbor_and_the_point_itself_are_in_exactly_one_group(model):
    together = sorted(each for group in MESH_MODELS[model].groups for each in group)
    assert together == [SELF, *range(MESH_MODELS[model].neighbors)]
    assert MESH_MODELS[model].groups[0][1] == SELF
    assert all(1 <= len(group) <= 3 for group in MESH_MODELS[model].groups)


@for_all_models
def test_feeds_have_the_colors_on_screen_and_change_none_of_what_they_take(model):
    """The network's inputs are contiguous, of the types that its file asks for, and in range whatever is on screen."""
    random = np.random.default_rng(2)
    for layout in LAYOUTS:
        arranged = choose_layout(WHOLE[model], manifest_of(model, layout))
        m = len(arranged.slots)
        on_screen = np.append(random.random(len(WHOLE[model])) < 0.7, False)[arranged.slots]
        colors = random.random((3, m), dtype=np.float32)
        before = colors.copy()
        feeds = arranged.feeds(colors, on_screen)
        np.testing.assert_array_equal(colors, before)
        points = feeds["points"]
        assert (points.dtype, points.flags.c_contiguous) == (np.float32, True)
        found = points[:-1].T if layout == "plain" else points
        np.testing.assert_array_equal(found[:, on_screen], colors[:, on_screen])
        if layout == "plain":
            assert set(feeds) == {"points", "neighbors"}
            assert feeds["neighbors"].dtype == np.int32
            assert feeds["neighbors"].shape == (m + 1, MESH_MODELS[model].neighbors)
            assert 0 <= feeds["neighbors"].min() <= feeds["neighbors"].max() <= m
            np.testing.assert_array_equal(points[-1], [-1.0] * 3)
            continue
        np.testing.assert_array_equal(points[:, ~on_screen], -1.0)
        assert set(feeds) == {"points", "columns"}
        assert feeds["columns"].dtype == np.int64
        assert feeds["columns"].shape == (len(MESH_MODELS[model].groups), m)
        assert 0 <= feeds["columns"].min() <= feeds["columns"].max() < len(MESH_MODELS[model].groups) * (m - 1)


@in_all_layouts
def test_answers_that_are_not_finite_are_an_error(layout):
    network = network_of(NetworkShape((Layer("convolution", 4, "elu"), Layer("convolution", 2, "softmax")), 6), 1)
    mesh = build_mesh(Sphere(0.1), 0.8, 2.0, 1.0, "xmgrid6")
    session = session_of(network, "xmgrid6", layout)
    colors, on_screen = np.zeros((len(mesh), 3)), np.arange(len(mesh)) > 0
    answers(session, mesh, colors, on_screen)
    colors[1] = np.nan
    with pytest.raises(ModelError, match="its answers are NaN or infinite"):
        answers(session, mesh, colors, on_screen)
