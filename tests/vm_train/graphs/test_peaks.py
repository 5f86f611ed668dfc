"""Peaks as training targets: where objects are in cells, and which cells learn what."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.manifests import ball_manifest
from vm_embedded.errors import InputError
from vm_embedded.mesh.grids import STEPS
from vm_embedded.mesh.models import mesh_model
from vm_train.data.pictures import Picture
from vm_train.graphs.augmentation import Augmentation, with_camera_error
from vm_train.graphs.graph_cache import GraphCache, rounded
from vm_train.graphs.graph_recipe import GraphRecipe, mirror_image
from vm_train.graphs.labeled_graph import CONTEXT, graph_of
from vm_train.graphs.peak_targets import in_cells, peak_targets
from vm_train.graphs.true_places import TruePlace, true_places
from vm_train.learning.configuration import TrainConfiguration

from ..fields import CLASSES, picture, pixels_of, scene_table, write_scene

HEIGHT, RADIUS = 0.6, 0.1
MANIFEST = ball_manifest(
    *("ball", "goal:upright", "line", "field", "robot:upright", "environment"),
    intersections=3.0,
    mesh="octaves",
    max_distance=14.0,
    peaks=("ball", "robot"),
)
MESH = mesh_model("octaves").build(MANIFEST.mesh_shape, HEIGHT, 3.0, 14.0)
BALL, GOAL, ROBOT = (CLASSES.index(each) for each in ("ball", "goal", "robot"))
NUMBERS = (BALL, ROBOT)
LABELS = np.where(MESH.margin, CONTEXT, CLASSES.index("field")).astype(np.int8)

distances = st.floats(math.log(0.02), math.log(13.0)).map(math.exp)
angles = st.floats(-3.1, 3.1)


def ray_to(distance, angle):
    ray = np.array([distance * math.cos(angle), distance * math.sin(angle), -HEIGHT])
    return ray / np.linalg.norm(ray)


def objects_at(*places, shown=True):
    rays = np.array([ray_to(*each) for each in places])
    return in_cells([TruePlace(BALL, width=0.2, shown=shown) for _ in places], rays, MESH, MANIFEST)


def targets(objects, labels=LABELS):
    return peak_targets(MESH.cells, labels, objects, NUMBERS)


@given(distances, angles)
def test_the_way_from_each_cell_leads_to_the_place(distance, angle):
    (number, column, row, size, shown), *more = objects_at((distance, angle)).tolist()
    assert (number, size, shown, more) == (BALL, 0.0, 1.0, [])
    found = targets(np.array([[number, column, row, size, shown]], np.float32))
    own = np.flatnonzero(found.score[:, 0] == 1.0)
    near = np.flatnonzero(found.near[:, 0])
    np.testing.assert_allclose(MESH.cells[near] + found.way[near, 0, :2], [[column, row]] * len(near), atol=1e-3)
    assert not found.score[:, 1].any()
    assert not found.near[:, 1].any()
    for point in own[found.counts[own, 0]]:  # none, if the place is beyond the last row that counts
        right, left, up, down = (
            MESH.neighbors[point, STEPS[8].index(each)] for each in ((1, 0), (-1, 0), (0, 1), (0, -1))
        )
        across, along = (MESH.rays[a] - MESH.rays[b] for a, b in ((right, left), (up, down)))
        x, y = found.way[point, 0, :2]
        there = MESH.rays[point] + 0.5 * x * across + 0.5 * y * along
        place = HEIGHT * there[:2] / -there[2]
        error = place - distance * np.array([math.cos(angle), math.sin(angle)])
        assert np.hypot(*error) < 0.01 * math.hypot(distance, HEIGHT)


@given(st.lists(st.tuples(distances, angles), min_size=1, max_size=4))
def test_each_object_has_at_most_one_cell_and_a_bell_around_it(places):
    found = targets(objects_at(*places))
    assert found.score.max() <= 1.0
    assert np.count_nonzero((found.score[:, 0] == 1.0) & found.counts[:, 0]) <= len(places)
    np.testing.assert_array_equal(found.counts, np.repeat((LABELS >= 0)[:, None], 2, axis=1))
    assert not (found.near & ~found.counts).any()
    assert (found.score[found.near] > 0.2).all()


def test_around_a_hidden_object_and_for_unknown_places_nothing_is_learned():
    hidden = targets(objects_at((2.0, 0.3), shown=False))
    assert not hidden.score.any()
    assert not hidden.near.any()
    missing = (LABELS >= 0) & ~hidden.counts[:, 0]
    assert 4 <= missing.sum() <= 9
    assert hidden.counts[LABELS >= 0, 1].all()
    unknown = targets(in_cells([TruePlace(ROBOT)], np.full((1, 3), np.nan), MESH, MANIFEST))
    assert not unknown.counts[:, 1].any()
    assert unknown.counts[LABELS >= 0, 0].all()


def test_the_sky_and_what_the_lens_does_not_see_have_no_cell():
    rays = np.array([[0.0, 0.0, 1.0], [np.nan] * 3])
    assert len(in_cells([TruePlace(BALL, shown=True)] * 2, rays, MESH, MANIFEST)) == 0


def test_a_scene_tells_the_places_and_a_mask_those_of_balls_only(tmp_path):
    shown = picture()
    table = scene_table() | {"ball_radius": 0.1, "ball": {"center": [3.0, 1.0, 0.1], "radius": 0.1, "visible": 0.5}}
    scene = write_scene(tmp_path / "scene1.json", table)
    ball, *robots = true_places(shown, scene, MANIFEST)
    assert (ball.number, ball.width, ball.shown) == (BALL, 0.2, True)
    assert ball.pixel == pytest.approx(pixels_of(np.array([[3.0, 1.0, 0.1]]))[0])
    assert [(each.number, each.width, each.shown) for each in robots] == [(ROBOT, 0.4, True), (ROBOT, 0.4, False)]
    assert robots[0].pixel == pytest.approx(pixels_of(np.array([[2.5, 1.6, 0.0]]))[0])
    table["ball"]["visible"] = 0.1
    assert not true_places(shown, write_scene(scene, table), MANIFEST)[0].shown
    labels = shown.labels.copy()
    labels[200:211, 300:321] = BALL
    (first, second) = true_places(replace(shown, labels=labels), tmp_path / "missing.json", MANIFEST)
    assert (first.pixel, first.width, first.shown) == ((310.0, 205.0), 0.2, True)
    assert (second.number, second.shown) == (ROBOT, None)
    scene.write_text("{")
    with pytest.raises(InputError, match=r"scene1\.json"):
        true_places(shown, scene, MANIFEST)


@pytest.mark.parametrize(("known", "shown"), [("ball", []), ("goal:upright", [1, 1, 0]), ("robot:upright", [1, 0])])
def test_a_network_of_few_classes_learns_the_places_of_these(tmp_path, known, shown):
    manifest = ball_manifest(known, "rest", mesh="octaves", peaks=(known.partition(":")[0],))
    labels = np.array([each not in known for each in CLASSES], np.int8)[picture().labels]
    scene = write_scene(tmp_path / "scene1.json", scene_table() | {"ball_radius": 0.1, "ball": None})
    found = true_places(replace(picture(), labels=labels), scene, manifest)
    assert [(each.number, each.shown) for each in found] == [(0, bool(each)) for each in shown]


def test_a_camera_error_moves_the_cell_and_not_the_pixel(tmp_path):
    shown, pixel = picture(), tuple(pixels_of(np.array([[2.5, 1.6, 0.0]]))[0])
    place = [TruePlace(ROBOT, pixel, 0.4, True)]
    plain = graph_of(shown, MANIFEST, places=place)
    changed = graph_of(with_camera_error(shown, height=1.05, tilt=(0.02, 0.03)), MANIFEST, places=place)
    assert not np.allclose(plain.objects, changed.objects, atol=0.1)
    for graph in (plain, changed):
        found = peak_targets(graph.cells, graph.labels, graph.objects, NUMBERS)
        own = np.flatnonzero(found.score[:, 1] == 1.0)
        nearest = np.argmin(np.hypot(*(graph.pixels - pixel).T) + 1e6 * (graph.labels == CONTEXT))
        assert own.tolist() == [nearest]
        assert found.way[nearest, 1, 2] == pytest.approx(math.log(0.4 / 0.2))


def turned(shown):
    """The mirror image of a picture of a level camera, and of its pose."""
    orientation = shown.orientation
    flip = np.diag([1.0, -1.0, 1.0])
    pose = type(orientation)(orientation.height, flip @ orientation.rotation @ flip)
    lens = replace(shown.lens.lens, center=(1.0 - shown.lens.lens.center[0], shown.lens.lens.center[1]))
    return Picture(shown.image[:, ::-1], shown.labels[:, ::-1], type(shown.lens)(lens, pose))


def test_a_mirror_image_has_the_objects_of_the_picture_that_is_mirrored():
    shown = picture()
    pixels = pixels_of(np.array([[2.5, 1.6, 0.0], [3.0, 0.2, 0.1]]))
    places = [TruePlace(number, tuple(each), 0.3, True) for number, each in zip(NUMBERS, pixels, strict=True)]
    mirrored = [replace(each, pixel=(shown.size[0] - 1.0 - each.pixel[0], each.pixel[1])) for each in places]
    one = mirror_image(graph_of(shown, MANIFEST, places=places), MANIFEST.model)
    other = graph_of(turned(shown), MANIFEST, places=mirrored)
    ours, theirs = (peak_targets(each.cells, each.labels, each.objects, NUMBERS) for each in (one, other))
    for each in range(2):
        (mine,), (his,) = (
            np.flatnonzero((found.score[:, each] == 1.0) & found.counts[:, each]) for found in (ours, theirs)
        )
        np.testing.assert_allclose(ours.way[mine, each], theirs.way[his, each], atol=0.02)
        assert one.cells[mine, 1] == other.cells[his, 1]


def test_views_on_disk_keep_the_objects(tmp_path):
    recipe = GraphRecipe(None, MANIFEST, augmentation=Augmentation())
    place = TruePlace(BALL, tuple(pixels_of(np.array([[3.0, 0.2, 0.1]]))[0]), 0.2, True)
    kept = rounded(graph_of(picture(), MANIFEST, places=[place]))
    assert len(kept.objects) == 1
    np.testing.assert_array_equal(kept.part(np.arange(10)).objects, kept.objects)
    other = GraphRecipe(None, replace(MANIFEST, peaks=("ball",)), augmentation=Augmentation())
    folders = {GraphCache(tmp_path, 1, each)._folder for each in (recipe, other)}
    assert len(folders) == 2


def test_a_configuration_on_octaves_has_peaks_for_balls_posts_and_robots():
    configuration = TrainConfiguration()
    assert configuration.manifest.peaks == ()
    octaves = replace(
        configuration,
        mesh=replace(configuration.mesh, model="octaves"),
        network=replace(configuration.network, depth=1, width=8, activation=type(configuration.network)().activation),
    )
    assert octaves.manifest.peaks == ("ball", "goal", "robot")
    assert [octaves.manifest.classes[each].name for each in octaves.peak_numbers] == ["ball", "goal", "robot"]
    assert octaves.network_shape.outputs == len(octaves.manifest.classes) + 12
