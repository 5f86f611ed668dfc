"""Labeled points on strips: mirror images, several pictures together, parts, and views that are kept."""

from dataclasses import replace

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.manifests import ball_manifest
from vm_embedded.detection.projection import project
from vm_embedded.geometry.lens_files import LensFile
from vm_embedded.geometry.orientation import Orientation
from vm_embedded.geometry.radial_lenses import Rectilinear
from vm_embedded.mesh.mesh import STRIDE
from vm_embedded.mesh.models import mesh_model
from vm_embedded.network.canvas_layout import place_on_canvas
from vm_embedded.network.choose_layout import choose_layout
from vm_export.canvas_network import CanvasNetwork
from vm_export.canvas_shape import CanvasShape
from vm_train.data.pictures import Picture, find_pictures
from vm_train.graphs.augmentation import Augmentation
from vm_train.graphs.graph_cache import GraphCache
from vm_train.graphs.graph_recipe import GraphRecipe, mirror_image, random_window
from vm_train.graphs.labeled_graph import CONTEXT, empty_graph, graph_of, join_graphs
from vm_train.graphs.loading import PictureGraphs
from vm_train.graphs.schedule import Item
from vm_train.learning.configuration import TrainConfiguration

from ..drawn import draw_set

SIZE = (161, 121)
OCTAVES = mesh_model("octaves")
ARRAYS = ("points", "neighbors", "labels", "distances", "pixels", "cells")


def manifest(**changes):
    entries = {"intersections": 3.0, "mesh": "octaves", "max_distance": 6.0} | changes
    return ball_manifest("ball", "other", **entries)


def picture(seed=3, turn=1, pitch=0.5, height=1.0):
    """A picture of noise, or with turn -1 its mirror image, seen by a level camera that looks straight ahead."""
    random = np.random.default_rng(seed)
    image = random.integers(0, 256, (SIZE[1], SIZE[0], 3), dtype=np.uint8)
    labels = random.integers(0, 2, (SIZE[1], SIZE[0]), dtype=np.int8)
    lens = Rectilinear(focal_length=110.0, fov=2.8, center=(0.5, 0.0))
    pose = LensFile(lens, Orientation.from_roll_pitch(height, 0.0, pitch))
    return Picture(image[:, ::turn], labels[:, ::turn], pose)


def graphs(count):
    return [
        graph_of(picture(seed, pitch=0.3 + 0.1 * seed, height=0.5 + 0.1 * seed), manifest()) for seed in range(count)
    ]


def by_strip(graph):
    """The points of each strip, by its number."""
    strip = graph.cells[:, 1] // STRIDE
    return {int(each): np.flatnonzero(strip == each) for each in np.unique(strip)}


def same(first, second):
    return all(np.array_equal(getattr(first, name), getattr(second, name)) for name in ARRAYS)


@pytest.fixture(scope="module")
def network():
    torch.manual_seed(1)
    return CanvasNetwork(CanvasShape(1, 8, 2)).eval()


def answers(network, graph):
    with torch.inference_mode():
        return network.probabilities(torch.from_numpy(graph.points), torch.from_numpy(graph.cells.copy())).numpy()[:-1]


def test_points_are_those_of_the_robot_and_only_the_margin_has_no_label():
    shown, facts = picture(), manifest()
    graph = graph_of(shown, facts)
    mesh = facts.model.build(facts.mesh_shape, 1.0, facts.intersections, facts.max_distance)
    seen = project(mesh, shown.orientation.level, shown.fitted_lens, SIZE).visible
    strips, margin = seen.graph.strips, seen.graph.margin
    placed = np.isin(strips, strips[~margin])
    assert not placed.all()  # of a strip, only context is on screen
    np.testing.assert_array_equal(graph.cells, seen.graph.cells[placed])
    np.testing.assert_array_equal(graph.pixels, seen.pixels[placed])
    np.testing.assert_array_equal(graph.labels == CONTEXT, margin[placed])
    np.testing.assert_array_equal(graph.counted, ~margin[placed])
    assert graph.neighbors.shape == (len(graph) + 1, 0)
    assert graph.around is graph.cells
    assert 0 < graph.counted.sum() < len(graph)


def test_points_without_a_label_count_for_the_mean_color_and_context_does_not():
    """As on the robot, which knows no labels."""
    shown = picture()
    unlabeled = replace(shown, labels=np.full_like(shown.labels, -1))
    for colors in ("absolute", "relative"):
        one, other = (graph_of(each, manifest(colors=colors)) for each in (shown, unlabeled))
        np.testing.assert_array_equal(one.points, other.points)
        np.testing.assert_array_equal(one.counted, other.counted)
    means = other.points[:-1][other.counted].mean(axis=0)
    np.testing.assert_allclose(means, 0.0, atol=1e-5)
    assert np.abs(other.points[:-1][~other.counted].mean(axis=0)).max() > 1e-4


@pytest.mark.parametrize("colors", ["absolute", "relative"])
def test_the_network_of_a_training_answers_as_on_the_robot(network, colors):
    """With the margin's colors counted in none of both."""
    shown, facts = picture(), manifest(colors=colors)
    graph = graph_of(shown, facts)
    mesh = facts.model.build(facts.mesh_shape, 1.0, facts.intersections, facts.max_distance)
    seen = project(mesh, shown.orientation.level, shown.fitted_lens, SIZE)
    seen = seen.only(mesh.needed(seen.on_screen)).visible
    layout = choose_layout(seen.graph, facts)
    feeds = layout.feeds(np.stack([layout.spread(each) for each in graph.points[:-1].T]), seen.on_screen)
    with torch.inference_mode():
        logits = network.canvas_logits(*(torch.from_numpy(feeds[name]) for name in ("points", "shown")))
    found = layout.read(logits.softmax(dim=1).numpy(), seen.answered)
    np.testing.assert_allclose(found, answers(network, graph)[graph.counted], atol=1e-6)


def test_a_mirror_image_is_what_a_network_sees_of_a_picture_that_is_mirrored():
    plain, true = (graph_of(picture(turn=each), manifest()) for each in (1, -1))
    seen = mirror_image(plain, OCTAVES)
    turned = np.stack([SIZE[0] - 1.0 - seen.pixels[:, 0], seen.pixels[:, 1]], axis=1)
    assert len(seen) == len(true) > 1000
    ours, theirs = by_strip(seen), by_strip(true)
    assert ours.keys() == theirs.keys()
    for strip, points in ours.items():
        twins = theirs[strip]
        cells, others = (
            graph.cells[each] - graph.cells[each].min(axis=0) for graph, each in ((seen, points), (true, twins))
        )
        one, other = np.lexsort(cells.T), np.lexsort(others.T)
        np.testing.assert_array_equal(cells[one], others[other])
        np.testing.assert_allclose(turned[points][one], true.pixels[twins][other], atol=1e-6)
        np.testing.assert_allclose(seen.points[points][one], true.points[twins][other], atol=1e-6)
        np.testing.assert_array_equal(seen.labels[points][one], true.labels[twins][other])


def test_the_mirror_image_of_a_mirror_image_is_the_graph():
    """With its columns counted from the first one that is in view."""
    whole = graphs(1)[0]
    again = mirror_image(mirror_image(whole, OCTAVES), OCTAVES)
    shift = np.unique(whole.cells - again.cells, axis=0)
    assert shift.tolist() == [[whole.cells[:, 0].min(), 0]]
    assert same(replace(again, cells=whole.cells), whole)
    nothing = empty_graph(manifest())
    assert len(mirror_image(nothing, OCTAVES)) == 0


@given(st.lists(st.integers(0, 4), min_size=1, max_size=4))
@settings(max_examples=20)
def test_graphs_together_keep_their_points_and_strips(chosen):
    made = [*graphs(4), empty_graph(manifest())]
    parts = [made[each] for each in chosen]
    joined, starts = join_graphs(parts)
    assert starts.tolist() == np.cumsum([0, *map(len, parts)]).tolist()
    taken = set()
    for part, start in zip(parts, starts, strict=False):
        own = np.arange(start, start + len(part))
        np.testing.assert_array_equal(joined.points[own], part.points[:-1])
        np.testing.assert_array_equal(joined.labels[own], part.labels)
        away = np.unique(joined.cells[own] - part.cells, axis=0)
        assert len(away) == min(len(part), 1)
        assert (away[:, 0] == 0).all()
        assert (away[:, 1] % STRIDE == 0).all()
        strips = set((joined.cells[own, 1] // STRIDE).tolist())
        assert not strips & taken
        taken |= strips
    assert joined.around is joined.cells


def test_graphs_together_answer_nearly_as_they_do_alone(network):
    """Their strips lie elsewhere on the canvas, and a network sees a little across gaps."""
    parts = graphs(4)
    joined, starts = join_graphs(parts)
    together = answers(network, joined)
    for part, start in zip(parts, starts, strict=False):
        alone = answers(network, part)
        core = part.counted
        difference = np.abs(together[start : start + len(part)] - alone)[core]
        assert difference.max() < 0.02
        assert difference.max() < 0.1 * np.ptp(alone[core], axis=0).max()


def test_a_strip_that_is_alone_on_its_canvas_answers_the_same_to_the_last_digit(network):
    """Whatever other pictures its strips are numbered after."""
    first, second = graphs(2)
    strip = max(by_strip(second).values(), key=len)
    alone = second.part(strip)
    joined, starts = join_graphs([first, second])
    assert starts[1] == len(first)
    np.testing.assert_array_equal(answers(network, joined.part(starts[1] + strip)), answers(network, alone))


@given(st.floats(0.1, 0.9), st.integers(0, 2**32 - 1))
@settings(max_examples=20)
def test_a_window_is_the_part_of_its_points(share, seed):
    whole = graphs(1)[0]
    part = random_window(whole, share, [0], np.random.default_rng(seed))
    kept = np.flatnonzero((whole.pixels[:, None] == part.pixels).all(axis=2).any(axis=1)) if len(part) else []
    np.testing.assert_array_equal(part.cells, whole.cells[kept] if len(part) else np.empty((0, 2)))
    np.testing.assert_array_equal(part.labels, whole.labels[kept] if len(part) else [])
    if len(part):
        pieces, shape, places = place_on_canvas(part.cells)
        assert len(np.unique(places)) == len(part)
        assert 0 <= places.min() <= places.max() < shape[0] * shape[1]
        assert len(pieces) == len(np.unique(part.cells[:, 1] // STRIDE))


def test_views_that_are_kept_are_those_that_were_made(tmp_path):
    pictures = find_pictures(draw_set(tmp_path / "pictures", 2))
    recipe = GraphRecipe(
        TrainConfiguration().classes.mask_classes(),
        replace(TrainConfiguration().manifest, mesh="octaves", max_distance=4.0, colors="relative"),
        augmentation=Augmentation(brightness=0.0, contrast=0.0, saturation=0.0, hue=0.0, gamma=0.0, noise=0.0),
    )

    def made():
        kept = PictureGraphs(pictures, recipe, None, GraphCache(tmp_path / "kept", 2, recipe))
        return [kept[Item(position, (1, seed))] for position in range(2) for seed in range(6)]

    first = made()
    files = sorted((tmp_path / "kept").rglob("*.raw"))
    times = [each.stat().st_mtime_ns for each in files]
    assert len(files) == 4
    assert all(same(*each) for each in zip(first, made(), strict=True))
    assert [each.stat().st_mtime_ns for each in sorted((tmp_path / "kept").rglob("*.raw"))] == times
    assert all(each.cells.dtype == np.int32 and len(each.cells) == len(each) > 100 for each in first)
    unkept = PictureGraphs(pictures, recipe, None, None)
    for position in range(2):
        whole, view = unkept[Item(position)], first[6 * position]
        assert whole.cells is not None
        assert view.neighbors.shape[1] == whole.neighbors.shape[1] == 0
