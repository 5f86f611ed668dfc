"""The close look: decides by probability, moves to the center it saw, and reports each object once."""

import json

import numpy as np
import pytest
from hypothesis import given

from tests.looks import look_contract
from tests.manifests import ball_manifest
from vm_embedded.detection.cache import MeshCache
from vm_embedded.detection.looking import around_bases, judge_classes, judged_places
from vm_embedded.detection.objects import locate
from vm_embedded.detection.observation import Observation, Stopwatch
from vm_embedded.detection.patches import Tangents, cut_patches, cut_places, patch_nodes
from vm_embedded.detection.projection import project
from vm_embedded.detection.pyramid import Pyramid
from vm_embedded.detection.settings import Settings
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

    def __init__(self, **contract):
        self.contract = look_contract(size=32, extent=EXTENT, max_proposals=40, **contract)
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


@pytest.mark.parametrize("sizes", [(16, 16, 16), (16, 24, 16)])
def test_patches_that_are_cut_together_are_those_of_each_place(scene, sizes):
    contracts = [look_contract(size=size, extent=extent) for size, extent in zip(sizes, (1.6, 0.9, 2.0), strict=True)]
    views = scene.view, around_bases(scene, 0.3), scene.view
    centers = [np.array(BALLS), np.empty((0, 3)), np.array(NOTHING)]
    found = cut_places(scene.pyramid, views, centers, contracts)
    for view, places, contract, (patches, tangents) in zip(views, centers, contracts, found, strict=True):
        alone = Tangents.at(view, places)
        np.testing.assert_array_equal(tangents.axes, alone.axes)
        expected = cut_patches(scene.pyramid, patch_nodes(view, alone, contract.extent), contract.size)
        np.testing.assert_array_equal(patches, expected)


def test_looks_move_to_the_center_even_from_a_place_beside_it():
    center = BALLS[0]
    beside = center + np.array([0.0, 0.05, 0.0])
    (found,), _ = found_in(observed(beside), BrightDisk())
    moved = found.position - np.array([0.0, 0.0, VIEW.height])
    assert np.linalg.norm(moved - center) < 0.2 * np.linalg.norm(beside - center)
    assert found.confidence == pytest.approx(0.9)


class Fixed(BrightDisk):
    """Sees every object with the same probability, in the middle of the patch."""

    def __init__(self, probability):
        super().__init__()
        self.probability = probability

    def run(self, patches):
        self.seen.append(len(patches))
        return np.tile(np.array([self.probability, 0.0, 0.0, 0.0], dtype=np.float32), (len(patches), 1))


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
    found, rejected = found_in(observed(*BALLS, *beside), Everywhere())
    assert len(found) == 2
    assert any(each.reason.startswith("the same object as the one at ") for each in rejected)


@given(seed=seeds)
def test_a_center_is_the_mean_of_the_places_that_were_meant_to_be_it(seed):
    random = np.random.default_rng(seed)
    meant = np.array([200.0, 380.0]) + random.uniform(-1.0, 1.0, (6, 2))
    others = np.array([430.0, 260.0]) + random.uniform(-1.0, 1.0, (5, 2))
    centers = np.array([center_at(VIEW, each) for each in (*meant, *others)])
    answers = np.zeros((11, 4), dtype=np.float32)
    answers[:, 0] = random.uniform(0.1, 0.9, 11)
    for places, chosen in (((*meant, *others), slice(6)), (meant[:1], slice(1))):
        count = len(places)
        judged = judged_places(VIEW, centers[:count], answers[:count], Settings(min_confidence=0.0), False)
        expected = center_at(VIEW, np.average(meant[chosen], axis=0, weights=answers[chosen, 0]))
        assert min(np.linalg.norm(each.center - expected) for each in judged) < 1e-3


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
