"""The close look: decides by probability, moves to the center it saw, and reports each object once."""

import json

import numpy as np
import pytest
from hypothesis import given

from tests.looks import look_contract
from tests.manifests import ball_manifest
from vm_embedded.detection.at_peaks import judge_classes
from vm_embedded.detection.cache import MeshCache
from vm_embedded.detection.looking import look_at
from vm_embedded.detection.objects import locate
from vm_embedded.detection.observation import Observation
from vm_embedded.detection.places import PlanePlaces, cut_together, mean_center
from vm_embedded.detection.projection import project
from vm_embedded.detection.pyramid import Pyramid
from vm_embedded.detection.settings import Settings
from vm_embedded.detection.stopwatch import Stopwatch
from vm_embedded.detection.upright_bases import around_bases
from vm_embedded.geometry.orientation import Orientation

from ..strategies import seeds
from .peaked import answers_of
from .views import BALL, LENS, SIZE, center_at, picture_of

EXTENT = 1.75
MANIFEST = ball_manifest("ball", "other", mesh="octaves", sampling="footprint", peaks=("ball",))
VIEW = MeshCache(MANIFEST, Settings()).view(Orientation.from_roll_pitch(0.9, 0.05, 0.5), LENS, SIZE)
BALLS = tuple(center_at(VIEW, each) for each in ((200.0, 380.0), (430.0, 260.0)))
NOTHING = tuple(center_at(VIEW, each) for each in ((560.0, 400.0), (100.0, 420.0)))


class BrightDisk:
    """Answers as a perfect look network does to a picture of white balls on black ground, by arithmetic."""

    def __init__(self, passes=2, **contract):
        self.contract = look_contract(size=32, extent=EXTENT, max_proposals=40, passes=passes, **contract)
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
    wanted = Settings(**settings)
    judged = judge_classes(observation, {"ball": look}, wanted, watch, explain)
    found, rejected = locate(observation, judged, wanted, watch, explain)
    assert list(watch.stages) == ["propose", "look", "cluster"]
    return found, rejected


def observed(*places):
    """A picture of BALLS with a peak at each of these places (3,) [m], the first the highest."""
    rows = [("ball", each / np.linalg.norm(each), 0.0, 6.0 - 0.1 * number) for number, each in enumerate(places)]
    projected = project(VIEW.mesh, VIEW.rotation, VIEW.lens, VIEW.size)
    answers = answers_of(VIEW, MANIFEST, rows)[projected.answered]
    return Observation(Pyramid(picture_of(VIEW, *BALLS), "bgr"), VIEW, MANIFEST, projected, answers)


@pytest.fixture(scope="module")
def scene():
    return observed(*BALLS, *NOTHING)


def looked_at(observation, look, centers):
    """The centers of places after all looks, and the answers."""
    places = PlanePlaces(observation.pyramid, observation.view, centers)
    answers = look_at(places, look)
    return places.centers, answers


def test_each_ball_is_found_once_where_it_is_and_as_large_as_it_is(scene):
    found, _ = found_in(scene, BrightDisk())
    assert len(found) == 2
    for center in BALLS:
        ball = min(found, key=lambda each: abs(each.distance - np.linalg.norm(center)))
        assert ball.distance == pytest.approx(np.linalg.norm(center), rel=0.01)
        np.testing.assert_allclose(ball.position, center + np.array([0.0, 0.0, scene.view.height]), atol=0.02)
        assert ball.confidence == pytest.approx(0.9)
        assert ball.distances_agree
        assert ball.distance_by_angle == pytest.approx(ball.distance, rel=0.1)
        assert ball.points > 5


def test_patches_that_are_cut_together_are_those_of_each_place(scene):
    contracts = [look_contract(size=16, extent=extent) for extent in (1.6, 0.9)]
    views = scene.view, around_bases(scene, 0.3)
    groups = [BALLS, NOTHING]

    def places():
        return [PlanePlaces(scene.pyramid, view, np.array(each)) for view, each in zip(views, groups, strict=True)]

    together, alone = places(), places()
    cut_together(scene.pyramid, together, contracts)
    for one, other, contract in zip(together, alone, contracts, strict=True):
        rows = np.arange(len(one))[::-1]
        np.testing.assert_array_equal(one.cut(rows, contract), other.cut(rows, contract))
        for each in (one, other):
            each.move(rows[:1], np.full(1, 0.2), np.full(1, -0.1))
        np.testing.assert_array_equal(one.cut(rows, contract), other.cut(rows, contract))


def test_looks_move_to_the_center_even_from_a_place_beside_it(scene):
    center = BALLS[0]
    beside = center + np.array([0.0, 0.05, 0.0])
    moved, answers = looked_at(scene, BrightDisk(passes=3), beside[None])
    assert np.linalg.norm(moved[0] - center) < 0.2 * np.linalg.norm(beside - center)
    assert answers[0, 0] == pytest.approx(0.9)


class Fixed(BrightDisk):
    """Sees every object with the same probability, in the middle of the patch."""

    def __init__(self, probability):
        super().__init__(passes=1)
        self.probability = probability

    def run(self, patches):
        self.seen.append(len(patches))
        return np.tile(np.array([self.probability, 0.0, 0.0, 0.0], dtype=np.float32), (len(patches), 1))


def test_only_places_with_a_chance_are_looked_at_again(scene):
    for promising, seen in (
        (0.005, [4, 4, 4]),
        (0.5, [4, 2, 2]),
        (0.95, [4]),
    ):  # where no ball is: 0.05
        look = BrightDisk(passes=3, promising=promising)
        found_in(scene, look)
        assert look.seen == seen


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

    beside = (each + BALL.radius * np.array([0.0, 1.2, 0.0]) for each in BALLS)
    found, rejected = found_in(observed(*BALLS, *beside), Everywhere(passes=3))
    assert len(found) == 2
    assert any(each.reason.startswith("the same object as the one at ") for each in rejected)


@given(seed=seeds)
def test_a_center_is_the_mean_of_the_places_that_were_meant_to_be_it(seed):
    random, view = np.random.default_rng(seed), VIEW
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
