"""The close look: decides by probability, moves to the center it saw, and reports each object once."""

import json
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from vm_embedded.detection.looking import look_at
from vm_embedded.detection.objects import locate
from vm_embedded.detection.observation import Stopwatch
from vm_embedded.detection.places import PlanePlaces, mean_center
from vm_embedded.detection.settings import Settings
from vm_embedded.network.look_contract import LookContract

from ..strategies import seeds
from .views import center_at, observation_of, view_at

EXTENT = 1.75
OPINION = 2
"""Patches of a second opinion about an object: mirror images of a smaller and of a larger one."""


class BrightDisk:
    """Answers as a perfect look network does to a picture of white balls on black ground, by arithmetic."""

    def __init__(self, passes=2, glance=None):
        self.contract = LookContract(object_class="ball", size=32, extent=EXTENT, above=0.03, passes=passes)
        self.glance = glance
        self.seen = []

    def run(self, patches):
        self.seen.append(len(patches))
        light = patches[..., 0] / 255.0
        steps = ((np.arange(32) + 0.5) / 16.0 - 1.0) * EXTENT
        total = np.maximum(light.sum(axis=(1, 2)), 1e-9)
        right, down = (light.sum(axis=axis) @ steps / total for axis in (1, 2))
        radius = np.sqrt(np.maximum(light.mean(axis=(1, 2)), 1e-9) * (2.0 * EXTENT) ** 2 / np.pi)
        size = np.log(radius)
        fits = (np.abs(size) < 0.3) & (np.hypot(right, down) < 0.6)
        return np.stack([np.where(fits, 0.9, 0.05), right, down, size], axis=1).astype(np.float32)


def found_in(observation, look, explain=True, **settings):
    watch = Stopwatch()
    found, rejected = locate(observation, look, Settings(**settings), watch, explain)
    assert list(watch.stages) == ["propose", "look", "cluster"]
    return found, rejected


@pytest.fixture(scope="module")
def scene():
    view = view_at()
    return observation_of(view, center_at(view, (200.0, 380.0)), center_at(view, (430.0, 260.0)))


def true_centers(scene):
    return center_at(scene.view, (200.0, 380.0)), center_at(scene.view, (430.0, 260.0))


def looked_at(observation, look, centers):
    """The centers of places after all looks, and the answers."""
    places = PlanePlaces(observation, centers)
    answers = look_at(places, look)
    return places.centers, answers


def test_each_ball_is_found_once_where_it_is_and_as_large_as_it_is(scene):
    found, _ = found_in(scene, BrightDisk())
    assert len(found) == 2
    for center in true_centers(scene):
        ball = min(found, key=lambda each: abs(each.distance - np.linalg.norm(center)))
        assert ball.distance == pytest.approx(np.linalg.norm(center), rel=0.01)
        np.testing.assert_allclose(ball.position, center + np.array([0.0, 0.0, scene.view.height]), atol=0.02)
        assert ball.confidence == pytest.approx(0.9)
        assert ball.distances_agree
        assert ball.distance_by_angle == pytest.approx(ball.distance, rel=0.1)
        assert ball.points > 5


def test_looks_move_to_the_center_even_from_a_place_beside_it(scene):
    center = true_centers(scene)[0]
    beside = center + np.array([0.0, 0.05, 0.0])
    moved, answers = looked_at(scene, BrightDisk(passes=3), beside[None])
    assert np.linalg.norm(moved[0] - center) < 0.2 * np.linalg.norm(beside - center)
    assert answers[0, 0] == pytest.approx(0.9)


class Squinting(BrightDisk):
    """Sees every ball too far to the right, and is the surer the farther right it lies in the patch."""

    def run(self, patches):
        answers = super().run(patches)
        log_odds = np.log(9.0) + 2.0 * answers[:, 1]
        answers[:, 0] = 1.0 / (1.0 + np.exp(-log_odds))
        answers[:, 1] += 0.2
        return answers


LEAN = 0.4 * (1.0 / 0.9 + 1.0 / 1.1 - 1.0) / 3.0
"""Log-odds that a second opinion about an object keeps of the error of Squinting, which is 0.4 to one side."""


@pytest.mark.parametrize(("upright_radius", "rest", "lean"), [(0.4, 0.0, 0.0), (0.0, 1.0 / 3.0, LEAN)])
def test_a_second_opinion_cancels_errors_to_one_side(scene, upright_radius, rest, lean):
    """For uprights, it is one mirror image: nothing is left. For objects, it is two: a third is left."""
    centers = np.stack(true_centers(scene))
    radius = scene.view.shape.radius

    def looks(passes):
        look, straight = Squinting(passes), BrightDisk(passes)
        look.contract = straight.contract = replace(look.contract, upright_radius=upright_radius)
        return [looked_at(scene, each, centers) for each in (look, straight)]

    (moved, answers), (straight, expected) = looks(2)
    errors = np.linalg.norm(moved - straight, axis=1) / radius
    np.testing.assert_allclose(errors, 0.2 * rest, atol=0.01)
    expected_odds = np.log(expected[:, 0] / (1.0 - expected[:, 0])) + lean
    np.testing.assert_allclose(answers[:, 0], 1.0 / (1.0 + np.exp(-expected_odds)), atol=0.002)
    (once, _), _ = looks(1)
    assert (np.linalg.norm(once - centers, axis=1) > 0.15 * radius).all()


def test_a_look_sees_only_what_its_glance_passes_on_where_it_saw_it(scene):
    class Strict(BrightDisk):
        """Gives no chance to what is not a ball."""

        def run(self, patches):
            answers = super().run(patches)
            answers[answers[:, 0] < 0.5, 0] = 0.0
            return answers

    glance = Strict(passes=1)
    look = BrightDisk(passes=1, glance=glance)
    ball = true_centers(scene)[0]
    nothing = center_at(scene.view, (560.0, 400.0))
    beside = ball + np.array([0.0, 0.03, 0.0])
    moved, answers = looked_at(scene, look, np.stack([nothing, beside]))
    assert (glance.seen, look.seen) == ([2], [1, OPINION])
    assert answers[:, 0] == pytest.approx([0.0, 0.9])
    assert np.linalg.norm(moved[1] - ball) < 0.2 * np.linalg.norm(beside - ball)
    found, rejected = found_in(scene, BrightDisk(passes=1, glance=Strict(passes=1)))
    assert len(found) == 2
    assert all(each.reason for each in rejected)


class Fixed(BrightDisk):
    """Sees every object with the same probability, in the middle of the patch."""

    def __init__(self, probability, glance=None):
        super().__init__(passes=1, glance=glance)
        if glance is not None:
            self.contract = replace(self.contract, glance=glance.contract)
        self.probability = probability

    def run(self, patches):
        self.seen.append(len(patches))
        return np.tile(np.array([self.probability, 0.0, 0.0, 0.0], dtype=np.float32), (len(patches), 1))


def chain(*probabilities):
    """A wide look behind a close look and its glance. probabilities: those of the three, the glance first."""
    look = None
    for each in probabilities:
        look = Fixed(each, look)
    return look


def small_and_large(scene):
    """Centers of a small and of a large ball in the picture, with radii below and above 24 px."""
    centers = np.stack([center_at(scene.view, (430.0, 225.0)), center_at(scene.view, (300.0, 470.0))])
    radii = PlanePlaces(scene, centers).radii(np.arange(2))
    assert radii[0] < 24.0 < radii[1]
    return centers


@pytest.mark.parametrize(("close", "wide"), [(0.9, 0.95), (0.04, 0.99), (0.99, 0.01), (1.0, 0.9), (1.0, 1.0)])
def test_a_wide_look_judges_small_objects_and_the_close_look_counts_too(scene, close, wide):
    look = chain(0.5, close, wide)
    _, answers = looked_at(scene, look, small_and_large(scene))
    surest = 1.0 - 1e-6  # a probability that is rounded to 1 does not outvote the other one
    one, other = min(close, surest), min(wide, surest)
    yes, no = one**0.3 * other**0.7, (1.0 - one) ** 0.3 * (1.0 - other) ** 0.7
    assert answers[:, 0] == pytest.approx([yes / (yes + no), close], abs=2e-6)
    assert look.seen == [1]


def test_a_wide_look_sees_only_what_the_close_look_takes_seriously(scene):
    look = chain(0.5, 0.02, 0.9)
    _, answers = looked_at(scene, look, small_and_large(scene))
    assert answers[:, 0] == pytest.approx([0.02, 0.02])
    assert look.seen == []


@pytest.mark.parametrize("wide", [0.05, 0.99])
def test_a_wide_look_judges_each_object_once(scene, wide):
    """Of several places on the same ball, none stays more probable than the one that it judges."""
    look = chain(0.5, 0.9, wide)
    ball, _ = small_and_large(scene)
    other = center_at(scene.view, (200.0, 225.0))
    radius = scene.view.shape.radius
    beside = ball + radius * np.array([[0.0, 0.0, 0.0], [0.0, 0.1, 0.0], [0.0, -0.1, 0.0]])
    _, answers = looked_at(scene, look, np.stack([*beside, other]))
    assert look.seen == [2]
    assert look.glance.seen == [4]
    (alone,) = looked_at(scene, chain(0.5, 0.9, wide), other[None])[1][:, 0]
    assert answers[3, 0] == pytest.approx(alone)
    assert answers[:3, 0].max() == pytest.approx(alone)
    assert (answers[:3, 0] >= min(alone, 0.9) - 1e-6).all()


@pytest.mark.parametrize(("wide", "opinions"), [(0.1, 0), (0.5, 1), (0.9, 0)])
def test_where_a_wide_look_is_sure_it_sees_no_mirror_image(scene, wide, opinions):
    look = chain(0.5, 0.5, wide)
    looked_at(scene, look, small_and_large(scene))
    assert look.seen == [1] * (1 + opinions)
    assert look.glance.seen == [2, OPINION]  # about the large ball


@pytest.mark.parametrize(
    ("passes", "weight"), [((1, 1), 1.0), ((2, 1), 1.0), ((1, 2), 1.0), ((1, 1, 1), 0.7), ((1, 1, 2), 1.0)]
)
def test_the_answer_of_a_first_glance_does_not_count(scene, passes, weight):
    """weight: of the log-odds of 0.9, the last answers. All others are 0.5, whose log-odds are 0."""
    look = chain(*[0.5] * (len(passes) - 1), 0.9)
    each = look
    for count in reversed(passes):
        each.contract = replace(each.contract, passes=count)
        each = each.glance
    _, answers = looked_at(scene, look, small_and_large(scene)[:1])
    assert answers[0, 0] == pytest.approx(9.0**weight / (1.0 + 9.0**weight))


@given(column=st.floats(100.0, 540.0), row=st.floats(230.0, 440.0))
def test_places_tell_how_large_an_object_is_in_the_picture(scene, column, row):
    view = scene.view
    center = center_at(view, (column, row))
    outline = view.outline(center)
    (radius,) = PlanePlaces(scene, center[None]).radii(np.arange(1))
    x, y = outline.T
    area = 0.5 * abs(x @ np.roll(y, -1) - y @ np.roll(x, -1))
    assert radius == pytest.approx(np.sqrt(area / np.pi), rel=0.05)


def test_only_proposals_with_a_chance_are_looked_at_again(scene):
    look = BrightDisk()
    bare = replace(scene, slot_answers=np.full_like(scene.slot_probabilities, 0.5))
    found_in(bare, look, max_proposals=30)
    assert look.seen == [30, 30, 30 * OPINION]  # 0.05 is a chance

    class Sure(BrightDisk):
        def run(self, patches):
            answers = super().run(patches)
            answers[answers[:, 0] < 0.5, 0] = 0.0
            return answers

    look = Sure()
    found_in(bare, look, max_proposals=30)
    assert look.seen[0] == 30
    assert len(look.seen) == 1 or look.seen[1] < 30


def test_only_the_last_pass_asks_for_a_second_opinion(scene):
    look = BrightDisk(passes=3)
    looked_at(scene, look, np.stack(true_centers(scene)))
    assert look.seen == [2, 2, 2, 2 * OPINION]


@pytest.mark.parametrize(("radius", "seen"), [(0.0, [2, 2]), (0.4, [2, 2, 2])])
def test_a_sure_place_needs_no_second_opinion_unless_it_is_an_upright(scene, radius, seen):
    class Sure(BrightDisk):
        def run(self, patches):
            answers = super().run(patches)
            answers[:, 0] = np.where(answers[:, 0] > 0.5, 0.98, 0.0)
            return answers

    look = Sure()
    look.contract = replace(look.contract, upright_radius=radius)
    _, answers = looked_at(scene, look, np.stack(true_centers(scene)))
    assert look.seen == seen
    assert answers[:, 0] == pytest.approx([0.98, 0.98])


def test_a_second_opinion_is_the_mean_over_sizes_of_the_patch(scene):
    """In a patch of 0.9 times the side, a ball looks larger: 10 % are too much only if the network says so."""
    center = true_centers(scene)[0] + np.array([0.0, 0.02, 0.0])
    places = PlanePlaces(scene, center[None])
    row = np.array([0])
    look = BrightDisk(passes=1)
    one = look.run(places.cut(row, look.contract))[0]
    smaller, larger = (look.run(places.cut(row, look.contract, zoom))[0] for zoom in (0.9, 1.1))
    np.testing.assert_allclose(0.9 * smaller[1:3], one[1:3], atol=0.03)
    np.testing.assert_allclose(1.1 * larger[1:3], one[1:3], atol=0.03)
    np.testing.assert_allclose([smaller[3] + np.log(0.9), larger[3] + np.log(1.1)], one[3], atol=0.03)

    class Hopeful(BrightDisk):
        """A glance that passes everything on where it is."""

        def run(self, patches):
            answers = super().run(patches)
            answers[:] = 0.9, 0.0, 0.0, 0.0
            return answers

    class Short(BrightDisk):
        """Sees less than there is in the larger patches, and is less sure."""

        def run(self, patches):
            answers = super().run(patches)
            answers[answers[:, 3] < -0.05, 0] = 0.1
            return answers

    _, answers = looked_at(scene, Short(passes=1, glance=Hopeful(passes=1)), center[None])
    np.testing.assert_allclose(answers[0, 1:], one[1:], atol=0.03)
    log_odds = np.log(9.0) * (1.0 + 1.0 - 1.0) / 3.0  # of the usual, the smaller and the larger patch
    assert answers[0, 0] == pytest.approx(1.0 / (1.0 + np.exp(-log_odds)))


def test_only_likely_places_get_a_second_opinion(scene):
    class Hopeful(BrightDisk):
        """A glance that passes everything on."""

        def run(self, patches):
            answers = super().run(patches)
            answers[:, 0] = 0.9
            return answers

    class Strict(BrightDisk):
        def run(self, patches):
            answers = super().run(patches)
            answers[answers[:, 0] < 0.5, 0] = 0.001
            return answers

    look = Strict(passes=1, glance=Hopeful(passes=1))
    balls = true_centers(scene)
    nothing = [center_at(scene.view, (560.0, 400.0)), center_at(scene.view, (100.0, 420.0))]
    _, answers = looked_at(scene, look, np.stack([*nothing, *balls]))
    assert look.seen == [4, OPINION * len(balls)]
    assert answers[:, 0] == pytest.approx([0.001, 0.001] + [0.9] * len(balls), abs=1e-3)


@pytest.mark.parametrize(("radius", "least"), [(0.0, 0.005), (0.4, 0.03)])
def test_a_place_is_looked_at_again_above_a_limit_which_is_higher_for_uprights(scene, radius, least):
    class Unsure(BrightDisk):
        def run(self, patches):
            answers = super().run(patches)
            answers[:, 0] = least * np.array([1.1, 0.9], dtype=np.float32)
            return answers

    look, glance = BrightDisk(passes=1), Unsure(passes=1)
    look.contract = replace(look.contract, upright_radius=radius)
    look.glance = glance
    _, answers = looked_at(scene, look, np.stack(true_centers(scene)))
    assert look.seen == [1, 1 if radius else OPINION]  # only the first place
    assert answers[:, 0] == pytest.approx([0.9, 0.9 * least], abs=1e-3)


def test_what_is_too_improbable_has_a_reason(scene):
    found, rejected = found_in(scene, BrightDisk(), min_confidence=0.95)
    assert not found
    assert all(each.reason.startswith("probability 0.") and each.reason.endswith("below 0.95") for each in rejected[:2])


def test_an_object_that_is_seen_from_two_proposals_is_one(scene):
    class Everywhere(BrightDisk):
        """Sees the same ball from the other proposals, too."""

        def run(self, patches):
            answers = super().run(patches)
            answers[:, 0] = np.where(answers[:, 3] > -3.0, 0.9, 0.0)
            return answers

    background = replace(scene, slot_answers=np.maximum(scene.slot_probabilities, np.float32(0.1)))
    found, rejected = found_in(background, Everywhere(passes=3))
    assert len(found) == 2
    assert any(each.reason.startswith("the same object as the one at ") for each in rejected)


@given(seed=seeds)
def test_a_center_is_the_mean_of_the_places_that_were_meant_to_be_it(scene, seed):
    random, view = np.random.default_rng(seed), scene.view
    meant = np.array([200.0, 380.0]) + random.uniform(-1.0, 1.0, (6, 2))
    others = np.array([430.0, 260.0]) + random.uniform(-1.0, 1.0, (5, 2))
    centers = np.array([center_at(view, each) for each in (*meant, *others)])
    probabilities = random.uniform(0.1, 1.0, 11).astype(np.float32)
    found = mean_center(view, centers, probabilities, 2)
    expected = center_at(view, np.average(meant, axis=0, weights=probabilities[:6]))
    np.testing.assert_allclose(found, expected, atol=1e-4)
    np.testing.assert_allclose(mean_center(view, centers[:1], probabilities[:1], 0), centers[0])


def test_reasons_are_only_collected_when_asked_for(scene):
    assert found_in(scene, BrightDisk(), explain=False, min_confidence=0.95) == ((), ())


def test_a_probability_that_is_rounded_to_one_does_not_reach_a_threshold_of_one(scene):
    found, _ = found_in(scene, Fixed(1.0))
    assert found
    assert all(0.999 < each.confidence < 1.0 for each in found)
    assert not found_in(scene, Fixed(1.0), min_confidence=1.0)[0]


@pytest.mark.parametrize("size", [-3e38, 3e38])
def test_a_network_that_sees_impossible_sizes_gives_finite_numbers(scene, size):
    class Giant(BrightDisk):
        def run(self, patches):
            answers = super().run(patches)
            answers[:, 3] = size
            return answers

    found, rejected = found_in(scene, Giant(), min_confidence=0.0)
    for each in (*found, *rejected):
        json.dumps(each.as_dict(), allow_nan=False)
