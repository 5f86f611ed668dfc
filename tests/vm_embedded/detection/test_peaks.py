"""Peaks: an object is where its cells say, once, whatever the camera, the strip, and cells that don't count say."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import assume, example, given
from hypothesis import strategies as st

from tests.looks import look_contract
from tests.manifests import ball_manifest
from vm_embedded.arrays import frozen
from vm_embedded.detection.cache import MeshCache
from vm_embedded.detection.field_points import locate_features
from vm_embedded.detection.looking import look_closely
from vm_embedded.detection.objects import locate
from vm_embedded.detection.observation import Observation, Stopwatch, observe
from vm_embedded.detection.prepared_view import PreparedView
from vm_embedded.detection.projection import Projection, project
from vm_embedded.detection.pyramid import Pyramid
from vm_embedded.detection.settings import Settings
from vm_embedded.detection.upright_looks import find_bases
from vm_embedded.detection.upright_peaks import peak_bases
from vm_embedded.geometry.orientation import Orientation
from vm_embedded.geometry.radial_lenses import Equisolid, Rectilinear
from vm_embedded.geometry.shapes import Circle, Sphere
from vm_embedded.mesh.grids import STEPS
from vm_embedded.mesh.mesh import Mesh, rays_from_polar
from vm_embedded.network.canvas_layout import CanvasLayout

from ..strategies import SIZE, reals, seeds

BLACK = frozen(np.zeros((SIZE[1], SIZE[0], 3), dtype=np.uint8))
NAMES = ("ball", "goal", "robot")
SETTINGS = Settings()


def manifest_for(shape, intersections=3.0, max_distance=10.0, **changes):
    """Three classes with peaks among six, on octaves for this shape."""
    entries = {
        "mesh": "octaves",
        "layout": "canvas",
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


def cells_to(view, ray):
    """Right and up [cells] from each slot (m,) to a ray (3,): by the azimuths and inclinations of columns and rows, and
    on the plane around the foot. NaN in gaps."""
    layout = view.layout
    right, up = np.full((2, len(layout)), np.nan)
    for piece in layout.pieces:
        box = np.arange(len(layout)).reshape(layout.shape)[piece.region]
        x, y, z = layout.rays[box].transpose(2, 0, 1)
        held = np.isfinite(z)
        row, cells, used = np.nonzero(held)[0], box[held], np.flatnonzero(held.any(axis=1))
        lowest, highest = (find(z[used], axis=1) for find in (np.nanmin, np.nanmax))
        if (highest - lowest).max() > 1e-9:  # a lattice of the plane
            step = np.nanmax(np.abs(np.diff(-y / z, axis=1)))
            right[cells] = (ray[1] / ray[2] - (y / z)[held]) / step
            up[cells] = ((x / z)[held] - ray[0] / ray[2]) / step
            continue
        around = np.arctan2(y, x)
        steps = np.abs(wrapped(np.diff(around, axis=1)))
        if np.isfinite(steps).any():
            right[cells] = wrapped(around[held] - np.arctan2(ray[1], ray[0])) / np.nanmean(steps)
            inclinations = np.arccos(-lowest)
            at = np.interp(np.arccos(-ray[2]), inclinations[::-1], used[::-1], left=np.nan, right=np.nan)
            up[cells] = row - at
    return right, up


def wrapped(angles):
    return (angles + np.pi) % (2.0 * np.pi) - np.pi


def answers_of(view, manifest, objects):
    """Answers (m, outputs) of a network that knows objects: rows (class, ray, log size, height of the score)."""
    answers = np.zeros((len(view.layout), manifest.outputs), dtype=np.float32)
    first = len(manifest.classes)
    answers[:, first::4] = -12.0
    for name, ray, size, top in objects:
        own = answers[:, first + 4 * manifest.peaks.index(name) :][:, :4]
        right, up = cells_to(view, ray)
        score = np.nan_to_num(top - 3.0 * (right**2 + up**2), nan=-np.inf)
        better = score > own[:, 0]
        own[better] = np.stack([score, right, up, np.full(len(score), size)], axis=1)[better]
    return answers


class Knowing:
    """A network that knows where the objects are; its probabilities are all alike."""

    def __init__(self, view, manifest, objects):
        self._answers = answers_of(view, manifest, objects)
        self._answers[:, : len(manifest.classes)] = 1.0 / len(manifest.classes)

    def run(self, layout, colors, on_screen):
        return self._answers


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
    """The cells (m,) that count."""
    return project(view.layout, view.rotation, view.lens, view.size).only(view.layout.original).on_screen


def inner_cells(view):
    """The cells that count, half between their neighbors.

    Some at the border of what the bucket holds lack a neighbor, and beyond the last ring, rows are at equal angles.
    """
    z = view.layout.rays[:, 2].reshape(view.layout.shape)
    padded = np.pad(z, 1, constant_values=np.nan)
    around = np.isfinite(padded[1:-1, :-2] + padded[1:-1, 2:] + padded[:-2, 1:-1] + padded[2:, 1:-1])
    return np.flatnonzero(shown_of(view) & (around & (z < z.ravel()[view.layout.places].max() - 1e-9)).ravel())


def some_place(view, cells, random):
    """A unit vector within half a cell of one of these cells, each strip as likely as the others."""
    strips = view.layout.strips[cells]
    cell = random.choice(cells[strips == random.choice(np.unique(strips))])
    return beside(view, cell, *random.uniform(-0.5, 0.5, 2))


def beside(view, cell, right, up):
    """A unit vector that is shifted [cells] from a cell; not shifted where the cells there have no rays."""
    rays, columns = view.layout.rays, view.layout.shape[1]
    steps = [np.nan_to_num(rays[min(cell + each, len(rays) - 1)] - rays[cell]) for each in (1, -columns)]
    ray = rays[cell] + right * steps[0] + up * steps[1]
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
    assert_found(view, seen.find_peaks("goal", 40), [ray], [5.0], [0.4])
    assert len(seen.find_peaks("ball", 40)) == len(seen.find_peaks("robot", 40)) == 0


@pytest.mark.long
@given(scenes(), seeds)
def test_an_object_on_the_border_between_two_strips_is_found_once(scene, seed):
    """Both strips have it with a high score."""
    manifest, view = scene
    layout, random, shown = view.layout, np.random.default_rng(seed), shown_of(view)
    above = np.roll(shown & layout.original, layout.shape[1])  # whether the cell above counts
    border = np.flatnonzero(shown & ~above & np.isfinite(np.roll(layout.rays[:, 2], layout.shape[1])))
    border = border[layout.strips[border] > layout.strips[shown].min()]
    assume(len(border))
    ray = beside(view, random.choice(border), random.uniform(-0.5, 0.5), random.uniform(0.3, 0.7))
    right, up = cells_to(view, ray)
    both = layout.strips[shown & (np.maximum(np.abs(right), np.abs(up)) < 1.0)]
    assume(len(np.unique(both)) == 2)
    assume(is_near(view, inner_cells(view), ray))
    assert_found(view, observed(view, manifest, [("ball", ray, 0.0, 4.0)]).find_peaks("ball", 9), [ray], [4.0], [0.0])


@pytest.mark.long
@given(scenes(), seeds, st.integers(2, 6))
def test_objects_apart_are_all_found_best_first_and_not_more_than_asked_for(scene, seed, count):
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
    found = seen.find_peaks("robot", 40)
    assert_found(view, found, rays, scores, sizes)
    np.testing.assert_array_equal(seen.find_peaks("robot", 1).scores, found.scores[:1])


VIEW = MeshCache(manifest_for(Sphere(0.1)), SETTINGS).view(
    Orientation.from_roll_pitch(0.6, 0.1, 0.4, 0.7), Equisolid(focal_length=220.0, fov=2.6), SIZE
)
BALLS = manifest_for(Sphere(0.1))


def noise(random, scale=4.0):
    """An observation of random answers, and which slots count."""
    answers = random.normal(0.0, scale, (len(VIEW.layout), BALLS.outputs)).astype(np.float32)
    return replace(observed(VIEW, BALLS, []), slot_answers=answers)


@given(seeds)
def test_cells_that_do_not_count_neither_are_peaks_nor_hide_one(seed):
    """Margins, gaps and what is off screen may say anything."""
    random = np.random.default_rng(seed)
    seen = noise(random, 2.0)
    seen = replace(seen, projected=seen.projected.only(random.random(len(VIEW.layout)) < 0.8))
    answers = seen.slot_answers.copy()
    answers[~seen.projected.on_screen] = random.choice([np.nan, np.inf, -np.inf, 1e30, 0.0])
    other = replace(seen, slot_answers=answers)
    for name in NAMES:
        one, two = (each.find_peaks(name, 40) for each in (seen, other))
        assert len(one)
        for key in ("rays", "scores", "log_sizes"):
            np.testing.assert_array_equal(getattr(one, key), getattr(two, key))


def peaks_by_hand(seen, number):
    """The cells that count and have a higher score than all cells around them that count."""
    shape = seen.layout.shape
    score = np.where(seen.projected.on_screen, seen.slot_answers[:, len(BALLS.classes) + 4 * number], -np.inf)
    (rows, columns), padded = shape, np.pad(score.reshape(shape), 1, constant_values=-np.inf)
    beside = [(i, j) for i in range(3) for j in range(3) if (i, j) != (1, 1)]
    around = np.max([padded[i : i + rows, j : j + columns] for i, j in beside], axis=0).ravel()
    return np.flatnonzero((score > around) & (score > np.log(0.02 / 0.98)))


@given(seeds, reals(1.0, 6.0))
def test_peaks_of_noise_are_the_highest_maxima_and_none_lies_in_a_better_one(seed, scale):
    seen = noise(np.random.default_rng(seed), scale)
    for number, name in enumerate(NAMES):
        found = seen.find_peaks(name, 1000)
        highest = np.sort(seen.slot_answers[peaks_by_hand(seen, number), len(BALLS.classes) + 4 * number])[::-1]
        assert 20 < len(found) <= len(highest)
        assert np.isin(found.scores, highest[:128].astype(np.float64)).all()
        assert found.scores[0] == highest[0]
        assert np.isfinite(found.rays).all()
        centers = VIEW.shape.center_along(found.rays, VIEW.height)
        assert not np.tril(VIEW.shape.covers(found.rays, centers, VIEW.height).T, -1).any()
        assert np.abs(found.log_sizes).max() <= 3.0


def test_a_frame_that_is_alike_everywhere_has_few_peaks():
    seen = noise(np.random.default_rng(0), 0.0)
    assert 0 < len(seen.find_peaks("ball", 1000)) <= 128


def test_an_improbable_peak_is_none():
    ray = VIEW.layout.rays[np.flatnonzero(shown_of(VIEW))[200]]
    for score, count in ((-3.8, 1), (-4.0, 0)):
        assert len(observed(VIEW, BALLS, [("ball", ray, 0.0, score)]).find_peaks("ball", 40)) == count


def test_probabilities_are_the_first_outputs():
    seen = noise(np.random.default_rng(3))
    assert seen.slot_probabilities.shape == (len(VIEW.layout), 6)
    assert seen.probabilities.shape == (len(seen), 6)
    np.testing.assert_array_equal(seen.slot_probabilities, seen.slot_answers[:, :6])


def panel(inclinations, columns=16, step=0.02, radius=0.1):
    """A view of a lattice of rays with these inclinations (n,) [rad], the same number of columns in each row."""
    azimuth = -(np.arange(columns) - 0.5 * (columns - 1)) * step
    row, column = np.divmod(np.arange(len(inclinations) * columns), columns)
    rays = rays_from_polar(np.asarray(inclinations)[row], azimuth[column])
    cells = np.stack([column, row], axis=1).astype(np.int32)
    mesh = Mesh(rays, np.zeros((len(rays) + 1, 8), dtype=np.int32), cells, np.zeros(len(rays), dtype=bool))
    layout = CanvasLayout(mesh, STEPS[8])
    lens = Equisolid(focal_length=220.0, fov=2.6)
    view = PreparedView(layout, None, Sphere(radius), 3.0, 0.6, np.eye(3), np.eye(3), lens, SIZE)
    return view, Projection(layout, np.zeros((len(layout), 2)), layout.original)


@example(5, 15, 1.5, 0.2)
@example(5, 0, 1.5, 0.2)
@given(st.integers(0, 11), st.integers(0, 15), reals(-9.0, 9.0), reals(-9.0, 9.0))
def test_a_shift_follows_the_cells_on_both_sides_or_on_one(row, column, right, up):
    """At the border of a canvas as elsewhere; shifts end at two cells."""
    view, projected = panel(np.linspace(1.0, 1.3, 12))
    assert view.layout.shape[1] == 16  # a row begins where the one above it ends
    cell = np.flatnonzero(view.layout.slots == 16 * row + column)[0]
    answers = np.full((len(view.layout), BALLS.outputs), -9.0, dtype=np.float32)
    answers[cell, 6:10] = 3.0, right, up, 0.0
    seen = Observation(Pyramid(BLACK, "bgr"), view, BALLS, projected, answers)
    rays = np.append(view.layout.rays[view.layout.places].reshape(12, 16, 3), np.full((12, 1, 3), np.nan), axis=1)
    rays = np.append(rays, np.full((1, 17, 3), np.nan), axis=0)

    def step(after, before):
        known = [each for each in (after, rays[row, column], before) if np.isfinite(each).all()]
        return (known[0] - known[-1]) / (len(known) - 1)

    ray = rays[row, column] + np.clip(right, -2.0, 2.0) * step(rays[row, column + 1], rays[row, column - 1])
    ray += np.clip(up, -2.0, 2.0) * step(rays[row + 1, column], rays[row - 1, column])
    found = seen.find_peaks(BALLS.peaks[0], 5)
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
    (base,) = peak_bases(seen, "goal", SETTINGS)
    place = place_of(view, ray)
    assert np.hypot(*(base.position - place)) < 0.012 * np.hypot(np.hypot(*place), view.height)
    assert base.width == pytest.approx(2.0 * manifest.radius * np.exp(size), rel=1e-5)
    (score,) = seen.find_peaks("goal", 9).scores
    assert base.confidence == pytest.approx(1.0 / (1.0 + np.exp(-score)))
    features = locate_features(seen, {}, SETTINGS)
    (post,) = features.posts
    assert (post.class_name, post.width, post.confidence) == ("post", base.width, base.confidence)
    np.testing.assert_array_equal(post.position, base.position)
    assert features.robots == ()


def cells_ahead(*distances):
    """The cells of VIEW that are nearest to these distances [m] straight ahead."""
    rays, shown = VIEW.layout.rays, np.flatnonzero(shown_of(VIEW))
    toward = np.array([[each, 0.0, -VIEW.height] for each in distances])
    toward /= np.linalg.norm(toward, axis=1, keepdims=True)
    return shown[np.argmax(rays[shown] @ toward.T, axis=0)]


def test_the_least_confidence_of_the_settings_counts_for_bases():
    near, far = VIEW.layout.rays[cells_ahead(1.5, 4.0)]
    seen = observed(VIEW, BALLS, [("robot", far, 0.0, 1.0), ("robot", near, 0.0, -0.5)])
    for least, count in ((0.3, 2), (0.5, 1), (0.8, 0)):
        found = peak_bases(seen, "robot", Settings(min_confidence=least))
        assert len(found) == count
    both = peak_bases(seen, "robot", Settings(min_confidence=0.3))
    assert np.hypot(*both[0].position) < 2.0 < 3.0 < np.hypot(*both[1].position)
    assert len(peak_bases(seen, "robot", Settings(max_proposals=1))) == 1


@pytest.mark.parametrize(("width", "is_same"), [(0.2, False), (3.0, True)])
def test_two_peaks_of_a_wide_upright_are_one_base(width, is_same):
    rays = VIEW.layout.rays[cells_ahead(2.0, 3.0)]
    size = np.log(width / (2.0 * BALLS.radius))
    seen = observed(VIEW, BALLS, [("robot", rays[0], size, 1.0), ("robot", rays[1], size, 4.0)])
    found = peak_bases(seen, "robot", SETTINGS)
    assert len(seen.find_peaks("robot", 9)) == 2
    assert len(found) == (1 if is_same else 2)
    assert max(each.confidence for each in found) == pytest.approx(1.0 / (1.0 + np.exp(-4.0)), abs=1e-4)


def test_a_peak_above_the_horizon_is_no_base():
    view, projected = panel(np.linspace(1.4, 1.7, 12))
    answers = np.full((len(view.layout), BALLS.outputs), -9.0, dtype=np.float32)
    below, above = view.layout.places[[16 * 2 + 3, 16 * 9 + 3]]
    robot = len(BALLS.classes) + 4 * BALLS.peaks.index("robot")
    answers[[below, above], robot : robot + 4] = 2.0, 0.0, 0.0, 0.0
    seen = Observation(Pyramid(BLACK, "bgr"), view, BALLS, projected, answers)
    assert len(seen.find_peaks("robot", 9)) == 2
    (base,) = peak_bases(seen, "robot", SETTINGS)
    np.testing.assert_allclose(base.position, place_of(view, view.layout.rays[below]))


# Looks


class Sure:
    """A look that gives these answers to every patch."""

    glance = None

    def __init__(self, right=0.0, probability=0.9, **contract):
        entries = {"object_class": "ball", "size": 16, "extent": 1.6, "above": 0.1, "passes": 1}
        self.contract = look_contract(**(entries | contract))
        self._answer = np.array([probability, right, 0.0, 0.0], dtype=np.float32)

    def run(self, patches):
        return np.tile(self._answer, (len(patches), 1))


def log_odds(probability):
    return np.log(probability / (1.0 - probability))


@given(reals(-3.0, 9.0), reals(0.0, 2.0), reals(0.01, 0.99), reals(-0.4, 0.4))
def test_the_look_judges_peaks_and_the_score_counts_as_often_as_its_contract_says(score, weight, probability, right):
    """Also where the look has moved the place."""
    (cell,) = cells_ahead(2.0)
    ray = VIEW.layout.rays[cell]
    seen = observed(VIEW, BALLS, [("ball", ray, 0.0, score)])
    look = Sure(right, probability, mesh_weight=weight)
    (judged,) = look_closely(seen, look, seen.slot_probabilities[:, 1], SETTINGS, Stopwatch(), explain=True)
    moved = offset(VIEW, judged.center / np.linalg.norm(judged.center), ray)
    assert moved == pytest.approx(abs(right), abs=0.02)
    expected = log_odds(np.float64(np.float32(probability))) + weight * score
    assert judged.confidence == pytest.approx(min(1.0 / (1.0 + np.exp(-expected)), 1.0 - 1e-6), abs=2e-6)
    assert (judged.reason is None) == (judged.confidence >= SETTINGS.min_confidence)


def test_each_place_keeps_the_score_of_its_own_peak():
    rays = VIEW.layout.rays[cells_ahead(1.2, 2.5, 5.0)]
    scores = (1.0, 3.0, 2.0)
    seen = observed(VIEW, BALLS, [("ball", ray, 0.0, score) for ray, score in zip(rays, scores, strict=True)])
    found, _ = locate(seen, Sure(0.2, 0.5, mesh_weight=0.5, passes=2), SETTINGS, Stopwatch())
    assert len(found) == 3
    assert found[2].distance < found[0].distance < found[1].distance
    for each, score in zip(found, (3.0, 2.0, 1.0), strict=True):
        assert each.confidence == pytest.approx(1.0 / (1.0 + np.exp(-0.5 * score)), abs=0.02)


def test_without_peaks_probable_points_propose():
    seen = observed(VIEW, BALLS, [])
    assert len(seen.find_peaks("ball", 40)) == 0
    assert look_closely(seen, Sure(), seen.slot_probabilities[:, 1], SETTINGS, Stopwatch()) == []
    without = replace(seen, manifest=replace(BALLS, peaks=()))
    assert look_closely(without, Sure(), seen.slot_probabilities[:, 1], SETTINGS, Stopwatch())


def test_without_a_look_the_peaks_are_the_objects():
    """With their scores as confidence, and the size that the network sees as the apparent one."""
    rays = VIEW.layout.rays[cells_ahead(1.2, 2.5, 5.0)]
    scores, sizes = (1.0, 3.0, -2.0), (0.0, 0.1, 0.0)
    rows = [("ball", *each) for each in zip(rays, sizes, scores, strict=True)]
    for larger in (1.0, 1.5):
        balls = replace(BALLS, object_radius=larger * BALLS.radius)
        found, rejected = locate(observed(VIEW, balls, rows), None, SETTINGS, Stopwatch(), explain=True)
        assert [each.confidence for each in found] == pytest.approx([0.9526, 0.7311], abs=1e-3)
        for each, ray, size in zip(found, rays[[1, 0]], (0.1, 0.0), strict=True):
            assert offset(VIEW, VIEW.heading.T @ each.bearing, ray) < 0.01
            assert each.distance_by_angle == pytest.approx(each.distance * larger / np.exp(size), rel=1e-3)
        (other,) = rejected
        assert (other.confidence, "below" in other.reason) == (pytest.approx(0.1192, abs=1e-3), True)


def test_a_look_at_uprights_judges_their_peaks():
    (cell,) = cells_ahead(2.0)
    seen = observed(VIEW, BALLS, [("goal", VIEW.layout.rays[cell], 0.0, 3.0)])
    look = Sure(object_class="goal", upright_radius=0.3)
    (base,) = find_bases(seen, look, SETTINGS)
    np.testing.assert_allclose(base.position, place_of(VIEW, VIEW.layout.rays[cell]), atol=1e-3)
    assert base.width == pytest.approx(0.6)
    (post,) = locate_features(seen, {"goal": look}, SETTINGS).posts
    assert post.confidence == pytest.approx(0.9)
