"""Peaks: an object is where its cells say, once, whatever the camera, the strip, and cells that don't count say."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import assume, example, given
from hypothesis import strategies as st

from tests.looks import look_contract, upright
from tests.manifests import ball_manifest
from vm_embedded.arrays import frozen
from vm_embedded.detection.cache import MeshCache
from vm_embedded.detection.field_points import locate_features
from vm_embedded.detection.looking import judge_classes
from vm_embedded.detection.objects import locate
from vm_embedded.detection.observation import Observation, Stopwatch, observe
from vm_embedded.detection.prepared_view import PreparedView
from vm_embedded.detection.projection import Projection, project
from vm_embedded.detection.pyramid import Pyramid
from vm_embedded.detection.settings import Settings
from vm_embedded.geometry.orientation import Orientation
from vm_embedded.geometry.radial_lenses import Equisolid, Rectilinear
from vm_embedded.geometry.shapes import Circle, Sphere
from vm_embedded.mesh.grids import STEPS, lattice_neighbors
from vm_embedded.mesh.mesh import Mesh, rays_from_polar
from vm_embedded.network.look_contract import JudgedClass

from ..strategies import SIZE, reals, seeds
from .peaked import answers_of, cells_to

BLACK = frozen(np.zeros((SIZE[1], SIZE[0], 3), dtype=np.uint8))
NAMES = ("ball", "goal", "robot")
SETTINGS = Settings()
BESIDE = [STEPS[8].index(step) for step in ((1, 0), (0, 1), (-1, 0), (0, -1))]
"""Columns of the neighbors to the right, above, to the left and below in a mesh."""


def manifest_for(shape, intersections=3.0, max_distance=10.0, **changes):
    """Three classes with peaks among six, on octaves for this shape."""
    entries = {
        "mesh": "octaves",
        "sampling": "footprint",
        "shape": "sphere" if isinstance(shape, Sphere) else "circle",
        "radius": shape.radius,
        "object_radius": shape.radius,
        "intersections": intersections,
        "max_distance": max_distance,
        "peaks": NAMES,
    }
    names = ("robot:upright", "ball", "field", "goal:upright", "line", "environment")
    return ball_manifest(*names, **(entries | changes))


class Knowing:
    """A network that knows where the objects are; its probabilities are all alike."""

    def __init__(self, view, manifest, objects):
        self._answers = answers_of(view, manifest, objects)
        self._answers[:, : len(manifest.classes)] = 1.0 / len(manifest.classes)

    def run(self, layout, colors, on_screen, points):
        return self._answers[points]


def observed(view, manifest, objects):
    return observe(Pyramid(BLACK, "bgr"), view, manifest, Knowing(view, manifest, objects), SETTINGS, Stopwatch())


@st.composite
def scenes(draw):
    """A manifest and what a camera sees of its mesh."""
    shape = draw(st.sampled_from([Sphere(0.1), Sphere(0.075), Circle(0.12)]))
    manifest = manifest_for(shape, draw(st.sampled_from([2.5, 3.0, 4.0])))
    turn = {"roll": draw(reals(-0.5, 0.5)), "pitch": draw(reals(0.0, 1.3)), "yaw": draw(reals(-3.0, 3.0))}
    lens = draw(st.sampled_from([Equisolid(focal_length=220.0, fov=2.6), Rectilinear(focal_length=380.0, fov=2.0)]))
    height = MeshCache(manifest, SETTINGS).mesh_height(draw(reals(0.45, 1.4)))
    return manifest, MeshCache(manifest, SETTINGS).view(Orientation.from_roll_pitch(height, **turn), lens, SIZE)


def shown_of(view):
    """The points (n,) that count."""
    return project(view.mesh, view.rotation, view.lens, view.size).core


def inner_cells(view):
    """The points that count, half between their neighbors.

    Some at the border of what the bucket holds lack a neighbor, and beyond the last ring, rows are at equal angles.
    """
    z, mesh = view.mesh.rays[:, 2], view.mesh
    around = (mesh.neighbors[:-1, BESIDE] < len(mesh)).all(axis=1)
    return np.flatnonzero(shown_of(view) & around & (z < z[~mesh.margin].max(initial=-1.0) - 1e-9))


def some_place(view, cells, random):
    """A unit vector within half a cell of one of these points, each strip as likely as the others."""
    strips = view.mesh.strips[cells]
    cell = random.choice(cells[strips == random.choice(np.unique(strips))])
    return beside(view, cell, *random.uniform(-0.5, 0.5, 2))


def beside(view, cell, right, up):
    """A unit vector that is shifted [cells] from a point; not shifted where it has no neighbor."""
    rays, ends = np.vstack([view.mesh.rays, view.mesh.rays[cell]]), view.mesh.neighbors[cell, BESIDE[:2]]
    ray = rays[cell] + [right, up] @ (rays[ends] - rays[cell])
    return ray / np.linalg.norm(ray)


def is_near(view, cells, ray):
    """Whether one of these cells is nearest to a ray: about half a cell away."""
    right, up = cells_to(view, ray)
    away = np.where(shown_of(view), right**2 + up**2, np.inf)
    best = np.nanargmin(away)
    return np.isin(best, cells) and max(abs(right[best]), abs(up[best])) < 0.6


def offset(view, one, other):
    """Distance of a ray from an object along another one, in radii of the object."""
    return float(view.shape.offset(one[None], view.shape.center_along(other[None], view.height), view.height)[0, 0])


def assert_found(view, peaks, rays, scores, sizes):
    """These objects, best first, and nothing else."""
    assert len(peaks) == len(rays)
    np.testing.assert_allclose(np.linalg.norm(peaks.rays, axis=1), 1.0)
    assert (np.diff(peaks.scores) <= 0.0).all()
    np.testing.assert_allclose(peaks.probabilities, 1.0 / (1.0 + np.exp(-peaks.scores)))
    for ray, score, size in zip(rays, scores, sizes, strict=True):
        at = int(np.argmax(peaks.rays @ ray))
        assert np.linalg.norm(peaks.rays[at] - ray) < 8e-3
        assert offset(view, peaks.rays[at], ray) < 0.07
        assert score - 2.2 < peaks.scores[at] <= score
        assert peaks.log_sizes[at] == pytest.approx(size)


@given(scenes(), seeds)
def test_an_object_is_found_once_at_its_place_in_any_strip(scene, seed):
    manifest, view = scene
    random, cells = np.random.default_rng(seed), inner_cells(view)
    assume(len(cells))
    ray = some_place(view, cells, random)
    assume(is_near(view, cells, ray))
    seen = observed(view, manifest, [("goal", ray, 0.4, 5.0)])
    assert_found(view, seen.peaks["goal"], [ray], [5.0], [0.4])
    assert len(seen.peaks["ball"]) == len(seen.peaks["robot"]) == 0


@pytest.mark.long
@given(scenes(), seeds)
def test_an_object_on_the_border_between_two_strips_is_found_once(scene, seed):
    """Both strips have it with a high score."""
    manifest, view = scene
    mesh, random, shown = view.mesh, np.random.default_rng(seed), shown_of(view)
    above = mesh.neighbors[:-1, BESIDE[1]]
    border = np.flatnonzero(shown & (above < len(mesh)) & ~np.append(shown, False)[above])
    assume(len(border))
    border = border[mesh.strips[border] > mesh.strips[shown].min()]
    assume(len(border))
    ray = beside(view, random.choice(border), random.uniform(-0.5, 0.5), random.uniform(0.3, 0.7))
    right, up = cells_to(view, ray)
    both = mesh.strips[shown & (np.maximum(np.abs(right), np.abs(up)) < 1.0)]
    assume(len(np.unique(both)) == 2)
    assume(is_near(view, inner_cells(view), ray))
    assert_found(view, observed(view, manifest, [("ball", ray, 0.0, 4.0)]).peaks["ball"], [ray], [4.0], [0.0])


@pytest.mark.long
@given(scenes(), seeds, st.integers(2, 6))
def test_objects_apart_are_all_found_best_first(scene, seed, count):
    manifest, view = scene
    random, cells = np.random.default_rng(seed), inner_cells(view)
    assume(len(cells))
    rays = []
    for _ in range(count):
        ray = some_place(view, cells, random)
        if is_near(view, cells, ray) and all(offset(view, ray, each) > 5.0 for each in rays):
            rays.append(ray)
    assume(rays)
    scores, sizes = random.uniform(2.0, 8.0, len(rays)), random.uniform(-1.0, 1.0, len(rays))
    seen = observed(view, manifest, [("robot", *each) for each in zip(rays, sizes, scores, strict=True)])
    assert_found(view, seen.peaks["robot"], rays, scores, sizes)


VIEW = MeshCache(manifest_for(Sphere(0.1)), SETTINGS).view(
    Orientation.from_roll_pitch(0.6, 0.1, 0.4, 0.7), Equisolid(focal_length=220.0, fov=2.6), SIZE
)
BALLS = manifest_for(Sphere(0.1))


def noise(random, scale=4.0):
    """An observation of random answers."""
    seen = observed(VIEW, BALLS, [])
    return replace(seen, answers=random.normal(0.0, scale, seen.answers.shape).astype(np.float32))


def peaks_by_hand(seen, number):
    """The scores of points that are higher than those of all cells around that count."""
    cells, score = VIEW.mesh.cells[seen.projected.answered], seen.answers[:, len(BALLS.classes) + 4 * number]
    score_at = dict(zip(map(tuple, cells.tolist()), score.tolist(), strict=True))
    beside = [(i, j) for i in (-1, 0, 1) for j in (-1, 0, 1) if (i, j) != (0, 0)]
    return [
        own
        for (x, y), own in score_at.items()
        if own > np.log(0.02 / 0.98) and own > max(score_at.get((x + i, y + j), -np.inf) for i, j in beside)
    ]


@given(seeds, reals(1.0, 6.0))
def test_peaks_of_noise_are_the_highest_maxima_and_none_lies_in_a_better_one(seed, scale):
    seen = noise(np.random.default_rng(seed), scale)
    for number, name in enumerate(NAMES):
        found = seen.peaks[name]
        highest = np.sort(peaks_by_hand(seen, number))[::-1]
        assert 20 < len(found) <= len(highest)
        assert np.isin(found.scores, highest[:128].astype(np.float64)).all()
        assert found.scores[0] == highest[0]
        assert np.isfinite(found.rays).all()
        centers = VIEW.shape.center_along(found.rays, VIEW.height)
        assert not np.tril(VIEW.shape.covers(found.rays, centers, VIEW.height).T, -1).any()
        assert np.abs(found.log_sizes).max() <= 3.0


def test_a_frame_that_is_alike_everywhere_has_few_peaks():
    seen = noise(np.random.default_rng(0), 0.0)
    assert 0 < len(seen.peaks["ball"]) <= 128


def test_an_improbable_peak_is_none():
    ray = VIEW.mesh.rays[np.flatnonzero(shown_of(VIEW))[200]]
    for score, count in ((-2.9, 1), (-3.1, 0)):
        assert len(observed(VIEW, BALLS, [("ball", ray, 0.0, score)]).peaks["ball"]) == count


def test_probabilities_are_the_first_outputs():
    seen = noise(np.random.default_rng(3))
    assert len(seen) == len(seen.pixels) == len(seen.rays) == shown_of(VIEW).sum()
    np.testing.assert_array_equal(seen.probabilities, seen.answers[:, :6])


def panel(inclinations, columns=16, step=0.02, radius=0.1):
    """A view of a lattice of rays with these inclinations (n,) [rad], the same number of columns in each row."""
    azimuth = -(np.arange(columns) - 0.5 * (columns - 1)) * step
    row, column = np.divmod(np.arange(len(inclinations) * columns), columns)
    rays = rays_from_polar(np.asarray(inclinations)[row], azimuth[column])
    cells = np.stack([column, row], axis=1).astype(np.int32)
    mesh = Mesh(rays, lattice_neighbors(cells, STEPS[8]), cells, np.zeros(len(rays), dtype=bool))
    lens = Equisolid(focal_length=220.0, fov=2.6)
    view = PreparedView(mesh, None, None, Sphere(radius), 3.0, 0.6, np.eye(3), np.eye(3), lens, SIZE)
    return view, Projection(mesh, np.zeros((len(mesh), 2)), np.ones(len(mesh), dtype=bool))


@example(5, 15, 1.5, 0.2)
@example(5, 0, 1.5, 0.2)
@given(st.integers(0, 11), st.integers(0, 15), reals(-9.0, 9.0), reals(-9.0, 9.0))
def test_a_shift_follows_the_cells_on_both_sides_or_on_one(row, column, right, up):
    """At the border of a strip as elsewhere; shifts end at two cells."""
    view, projected = panel(np.linspace(1.0, 1.3, 12))
    answers = np.full((len(view.mesh), BALLS.outputs), -9.0, dtype=np.float32)
    answers[16 * row + column, 6:10] = 3.0, right, up, 0.0
    seen = Observation(Pyramid(BLACK, "bgr"), view, BALLS, projected, answers)
    rays = np.append(view.mesh.rays.reshape(12, 16, 3), np.full((12, 1, 3), np.nan), axis=1)
    rays = np.append(rays, np.full((1, 17, 3), np.nan), axis=0)

    def step(after, before):
        known = [each for each in (after, rays[row, column], before) if np.isfinite(each).all()]
        return (known[0] - known[-1]) / (len(known) - 1)

    ray = rays[row, column] + np.clip(right, -2.0, 2.0) * step(rays[row, column + 1], rays[row, column - 1])
    ray += np.clip(up, -2.0, 2.0) * step(rays[row + 1, column], rays[row - 1, column])
    found = seen.peaks[BALLS.peaks[0]]
    np.testing.assert_allclose(found.rays, [ray / np.linalg.norm(ray)], atol=1e-6)


# Uprights


def place_of(view, ray):
    """Where a ray meets the plane (2,) [m], in the plane's frame."""
    x, y, z = view.heading @ ray
    return np.array([x, y]) * view.height / -z


@pytest.mark.long
@given(scenes(), seeds)
def test_a_peak_of_an_upright_is_its_base(scene, seed):
    manifest, view = scene
    random, cells = np.random.default_rng(seed), inner_cells(view)
    assume(len(cells))
    ray = some_place(view, cells, random)
    assume(is_near(view, cells, ray))
    size = random.uniform(-1.5, 1.5)
    seen = observed(view, manifest, [("goal", ray, size, 5.0)])
    (base,) = uprights(seen, "goal", None)
    place = place_of(view, ray)
    assert np.hypot(*(base.position - place)) < 0.012 * np.hypot(np.hypot(*place), view.height)
    assert base.width == pytest.approx(2.0 * manifest.radius * np.exp(size), rel=1e-5)
    (score,) = seen.peaks["goal"].scores
    assert base.confidence == pytest.approx(1.0 / (1.0 + np.exp(-score)))
    features = locate_features(seen, judge_classes(seen, None, SETTINGS, Stopwatch()))
    (post,) = features.posts
    assert (post.class_name, post.width, post.confidence) == ("post", base.width, base.confidence)
    np.testing.assert_array_equal(post.position, base.position)
    assert features.robots == ()


def uprights(seen, name, look, settings=SETTINGS):
    """The posts or robots that are found."""
    features = locate_features(seen, judge_classes(seen, look, settings, Stopwatch()))
    return {"goal": features.posts, "robot": features.robots}[name]


def objects(seen, look, explain=False):
    """The objects that are found, and the rejected ones."""
    judged = judge_classes(seen, look, SETTINGS, Stopwatch(), explain)
    return locate(seen, judged, SETTINGS, Stopwatch(), explain)


def cells_ahead(*distances):
    """The cells of VIEW that are nearest to these distances [m] straight ahead."""
    rays, shown = VIEW.mesh.rays, np.flatnonzero(shown_of(VIEW))
    toward = np.array([[each, 0.0, -VIEW.height] for each in distances])
    toward /= np.linalg.norm(toward, axis=1, keepdims=True)
    return shown[np.argmax(rays[shown] @ toward.T, axis=0)]


def test_the_least_confidence_of_the_settings_counts_for_bases():
    near, far = VIEW.mesh.rays[cells_ahead(1.5, 4.0)]
    seen = observed(VIEW, BALLS, [("robot", far, 0.0, 1.0), ("robot", near, 0.0, -0.5)])
    for least, count in ((0.3, 2), (0.5, 1), (0.8, 0)):
        found = uprights(seen, "robot", None, Settings(min_confidence=least))
        assert len(found) == count
    both = uprights(seen, "robot", None, Settings(min_confidence=0.3))
    assert np.hypot(*both[0].position) < 2.0 < 3.0 < np.hypot(*both[1].position)


@pytest.mark.parametrize(("width", "is_same"), [(0.2, False), (3.0, True)])
def test_two_peaks_of_a_wide_upright_are_one_base(width, is_same):
    rays = VIEW.mesh.rays[cells_ahead(2.0, 3.0)]
    size = np.log(width / (2.0 * BALLS.radius))
    seen = observed(VIEW, BALLS, [("robot", rays[0], size, 1.0), ("robot", rays[1], size, 4.0)])
    found = uprights(seen, "robot", None)
    assert len(seen.peaks["robot"]) == 2
    assert len(found) == (1 if is_same else 2)
    assert max(each.confidence for each in found) == pytest.approx(1.0 / (1.0 + np.exp(-4.0)), abs=1e-4)


def test_a_peak_above_the_horizon_is_no_base():
    view, projected = panel(np.linspace(1.4, 1.7, 12))
    answers = np.full((len(view.mesh), BALLS.outputs), -9.0, dtype=np.float32)
    below, above = 16 * 2 + 3, 16 * 9 + 3
    robot = len(BALLS.classes) + 4 * BALLS.peaks.index("robot")
    answers[[below, above], robot : robot + 4] = 2.0, 0.0, 0.0, 0.0
    seen = Observation(Pyramid(BLACK, "bgr"), view, BALLS, projected, answers)
    assert len(seen.peaks["robot"]) == 2
    (base,) = uprights(seen, "robot", None)
    np.testing.assert_allclose(base.position, place_of(view, view.mesh.rays[below]))


# Looks


class Sure:
    """A look that gives these answers for each class to every patch."""

    def __init__(self, right=0.0, probability=0.9, down=0.0, classes=("ball",), **contract):
        self.contract = look_contract(*classes, **{"size": 16, "extent": 1.6} | contract)
        self._answer = np.array([probability, right, down, 0.0], dtype=np.float32)

    def run(self, patches):
        return np.tile(self._answer, (len(patches), len(self.contract.classes), 1))


class ByClass(Sure):
    """A look that gives each class answers of its own to every patch. It keeps how many patches it saw at once."""

    def __init__(self, answers, **contract):
        super().__init__(classes=tuple(each if each == "ball" else upright(each) for each in answers), **contract)
        self._answers = np.array(list(answers.values()), dtype=np.float32)
        self.seen = []

    def run(self, patches):
        self.seen.append(len(patches))
        return np.tile(self._answers, (len(patches), 1, 1))


def log_odds(probability):
    return np.log(probability / (1.0 - probability))


@given(reals(-3.0, 9.0), reals(0.0, 2.0), reals(0.01, 0.99), reals(-0.4, 0.4))
def test_the_look_judges_peaks_and_the_score_counts_as_often_as_its_contract_says(score, weight, probability, right):
    """Also where the look has moved the place. In doubt it moves it back in the mirrored second patch."""
    (cell,) = cells_ahead(2.0)
    ray = VIEW.mesh.rays[cell]
    expected = log_odds(np.float64(np.float32(probability))) + weight * score
    assume(abs(abs(expected) - 3.0) > 1e-3)
    seen = observed(VIEW, BALLS, [("ball", ray, 0.0, score)])
    look = Sure(right, probability, classes=(JudgedClass(name="ball", mesh_weight=weight),))
    ((_, (judged,)),) = judge_classes(seen, look, SETTINGS, Stopwatch(), explain=True, uprights=False).values()
    moved = offset(VIEW, judged.center / np.linalg.norm(judged.center), ray)
    assert moved == pytest.approx(abs(right) * (1.0 if abs(expected) > 3.0 else 0.5), abs=0.02)
    assert judged.confidence == pytest.approx(min(1.0 / (1.0 + np.exp(-expected)), 1.0 - 1e-6), abs=2e-6)
    assert (judged.reason is None) == (judged.confidence >= SETTINGS.min_confidence)


def test_each_place_keeps_the_score_of_its_own_peak():
    rays = VIEW.mesh.rays[cells_ahead(1.2, 2.5, 5.0)]
    scores = (1.0, 3.0, 2.0)
    seen = observed(VIEW, BALLS, [("ball", ray, 0.0, score) for ray, score in zip(rays, scores, strict=True)])
    found, _ = objects(seen, Sure(0.2, 0.5, classes=(JudgedClass(name="ball", mesh_weight=0.5),)))
    assert len(found) == 3
    assert found[2].distance < found[0].distance < found[1].distance
    for each, score in zip(found, (3.0, 2.0, 1.0), strict=True):
        assert each.confidence == pytest.approx(1.0 / (1.0 + np.exp(-0.5 * score)), abs=0.02)


def test_a_look_judges_the_best_peaks():
    rays = VIEW.mesh.rays[cells_ahead(1.2, 2.5, 5.0)]
    seen = observed(VIEW, BALLS, [("ball", ray, 0.0, score) for ray, score in zip(rays, (1.0, 3.0, 2.0), strict=True)])
    found, _ = objects(seen, Sure(max_proposals=2))
    assert len(found) == 2
    assert min(each.distance for each in found) > 2.0  # not the nearest, whose score is the lowest


def test_one_look_judges_each_class_by_its_own_answers():
    """The peaks of a class that it does not judge are the objects."""
    rays = VIEW.mesh.rays[cells_ahead(1.2, 2.5, 5.0)]
    rows = [(name, ray, 0.0, 1.0) for name, ray in zip(NAMES, rays, strict=True)]
    seen = observed(VIEW, BALLS, rows)
    look = ByClass({"goal": (0.99, 0.5, 0.0, 0.2), "ball": (0.97, 0.0, 0.0, -0.1)})
    judged = judge_classes(seen, look, SETTINGS, Stopwatch())
    assert look.seen == [2]
    assert {name: of.number for name, (of, _) in judged.items()} == {"ball": 1, "goal": 0, "robot": None}
    (ball,), (goal,), (robot,) = (judged[name][1] for name in NAMES)
    assert (ball.confidence, goal.confidence) == (pytest.approx(0.97), pytest.approx(0.99))
    assert robot.confidence == pytest.approx(1.0 / (1.0 + np.exp(-1.0)), abs=1e-3)
    assert np.log([ball.scale, goal.scale]) == pytest.approx([-0.1, 0.2], abs=1e-6)
    for each, ray in zip((ball, robot), rays[[0, 2]], strict=True):
        np.testing.assert_allclose(each.center / np.linalg.norm(each.center), ray, atol=1e-3)
    moved = goal.center - rays[1] * (VIEW.height / -rays[1][2])
    assert np.linalg.norm(moved) == pytest.approx(0.5 * 0.3, abs=0.03)


def test_a_look_judges_the_best_peaks_of_each_class():
    rays = VIEW.mesh.rays[cells_ahead(1.2, 2.5, 5.0)]
    rows = [
        (name, ray, 0.0, score) for name in ("ball", "goal") for ray, score in zip(rays, (1.0, 3.0, 2.0), strict=True)
    ]
    look = ByClass({"ball": (0.99, 0.0, 0.0, 0.0), "goal": (0.98, 0.0, 0.0, 0.0)}, max_proposals=2)
    judged = judge_classes(observed(VIEW, BALLS, rows), look, SETTINGS, Stopwatch())
    assert look.seen == [4]
    for name, confidence in (("ball", 0.99), ("goal", 0.98)):
        found = judged[name][1]
        assert [each.confidence for each in found] == pytest.approx([confidence] * 2)
        assert min(np.linalg.norm(each.center) for each in found) > 2.0  # not the nearest, whose score is the lowest


def test_a_look_without_peaks_of_its_classes_is_not_run():
    (ray,) = VIEW.mesh.rays[cells_ahead(2.0)]
    look = ByClass({"goal": (0.99, 0.0, 0.0, 0.0)})
    (found,), _ = objects(observed(VIEW, BALLS, [("ball", ray, 0.0, 1.0)]), look)
    assert found.confidence == pytest.approx(1.0 / (1.0 + np.exp(-1.0)), abs=1e-3)
    assert look.seen == []


def test_without_a_look_the_peaks_are_the_objects():
    """With their scores as confidence, and the size that the network sees as the apparent one."""
    rays = VIEW.mesh.rays[cells_ahead(1.2, 2.5, 5.0)]
    scores, sizes = (1.0, 3.0, -2.0), (0.0, 0.1, 0.0)
    rows = [("ball", *each) for each in zip(rays, sizes, scores, strict=True)]
    for larger in (1.0, 1.5):
        balls = replace(BALLS, object_radius=larger * BALLS.radius)
        seen = observed(VIEW._replace(shape=balls.object_shape), balls, rows)
        found, rejected = objects(seen, None, explain=True)
        assert [each.confidence for each in found] == pytest.approx([0.9526, 0.7311], abs=1e-3)
        for each, ray, size in zip(found, rays[[1, 0]], (0.1, 0.0), strict=True):
            assert offset(VIEW, VIEW.heading.T @ each.bearing, ray) < 0.01
            assert each.distance_by_angle == pytest.approx(each.distance * larger / np.exp(size), rel=1e-3)
        (other,) = rejected
        assert (other.confidence, "below" in other.reason) == (pytest.approx(0.1192, abs=1e-3), True)


def test_a_look_at_uprights_judges_their_peaks():
    (cell,) = cells_ahead(2.0)
    seen = observed(VIEW, BALLS, [("goal", VIEW.mesh.rays[cell], 0.0, 3.0)])
    look = Sure(classes=(upright("goal"),))
    (base,) = uprights(seen, "goal", look)
    np.testing.assert_allclose(base.position, place_of(VIEW, VIEW.mesh.rays[cell]), atol=1e-3)
    assert base.width == pytest.approx(0.6)
    (post,) = locate_features(seen, judge_classes(seen, look, SETTINGS, Stopwatch())).posts
    assert post.confidence == pytest.approx(0.9)


def test_a_base_moves_as_its_look_says_and_an_improbable_one_is_not_reported():
    (cell,) = cells_ahead(2.0)
    seen = observed(VIEW, BALLS, [("goal", VIEW.mesh.rays[cell], 0.0, 3.0)])

    def found(probability=0.99, **shift):
        look = Sure(probability=probability, classes=(upright("goal"),), **shift)
        return [VIEW.heading.T[:2, :2] @ each.position for each in uprights(seen, "goal", look)]

    (still,), (right,), (down,) = found(), found(right=0.5), found(down=0.2)
    assert (right - still)[1] == pytest.approx(-0.15, abs=0.03)  # y is to the left
    assert np.hypot(*down) < np.hypot(*still) - 0.05  # lower in the picture is nearer
    assert found(probability=0.25) == []
    assert found(probability=0.01) == []
