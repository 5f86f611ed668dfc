"""The close look decides by probability, moves to the center it saw, looks again in doubt, reports each object once."""

import json

import numpy as np
import pytest
from hypothesis import given

from tests.looks import look_contract, upright
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
from vm_embedded.geometry.shapes import Circle
from vm_embedded.network.look_contract import JudgedClass
from vm_embedded.network.look_example import ANSWERS

from ..strategies import seeds
from .peaked import answers_of
from .views import BALL, LENS, SIZE, center_at, picture_of

EXTENT = 1.75
MANIFEST = ball_manifest("ball", "other", mesh="octaves", sampling="footprint", peaks=("ball",))
VIEW = MeshCache(MANIFEST, Settings()).view(Orientation.from_roll_pitch(0.9, 0.05, 0.5), LENS, SIZE)
BALLS = tuple(center_at(VIEW, each) for each in ((200.0, 380.0), (430.0, 260.0)))
NOTHING = tuple(center_at(VIEW, each) for each in ((560.0, 400.0), (100.0, 420.0)))


class BrightDisk:
    """Answers as a perfect look network does to a picture of white balls on black ground, by arithmetic.

    seen: how many patches it saw at once.
    """

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
        return np.stack([np.where(fits, 0.9, 0.05), right, down, size], axis=1).astype(np.float32)[:, None]


def found_in(observation, look, explain=True, **settings):
    watch = Stopwatch()
    wanted = Settings(**settings)
    judged = judge_classes(observation, look, wanted, watch, explain)
    found, rejected = locate(observation, judged, wanted, watch, explain)
    assert list(watch.stages) == ["propose", "look", "cluster"]
    return found, rejected


def observed(*places):
    """A picture of BALLS with a peak of balls at each of these places (3,) [m], the first the highest."""
    return observed_by(MANIFEST, *(("ball", each) for each in places))


def observed_by(manifest, *places):
    """The same for peaks of several classes (name, place)."""
    rows = [(name, ray_to(each), 0.0, 6.0 - 0.1 * number) for number, (name, each) in enumerate(places)]
    projected = project(VIEW.mesh, VIEW.rotation, VIEW.lens, VIEW.size)
    answers = answers_of(VIEW, manifest, rows)[projected.answered]
    return Observation(Pyramid(picture_of(VIEW, *BALLS), "bgr"), VIEW, manifest, projected, answers)


def ray_to(center):
    """The unit vector to a place (3,)."""
    return center / np.linalg.norm(center)


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


@pytest.mark.parametrize(("size", "extent"), [(16, 1.6), (24, 0.9)])
def test_patches_that_are_cut_together_are_those_of_each_place(scene, size, extent):
    contract = look_contract(size=size, extent=extent)
    views = scene.view, around_bases(scene, 0.3)
    places = np.array(BALLS), np.array(NOTHING)
    halves = np.repeat([view.shape.half_size for view in views], 2)
    patches, tangents = cut_places(scene.pyramid, scene.view, np.concatenate(places), halves, contract)
    alone = [Tangents.at(view, centers) for view, centers in zip(views, places, strict=True)]
    for number, (view, each) in enumerate(zip(views, alone, strict=True)):
        rows = slice(2 * number, 2 * number + 2)
        np.testing.assert_array_equal(tangents.axes[rows], each.axes)
        expected = cut_patches(scene.pyramid, patch_nodes(view, each, extent), size)
        np.testing.assert_array_equal(patches[rows], expected)


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
        return np.tile(np.array([self.probability, 0.0, 0.0, 0.0], dtype=np.float32), (len(patches), 1, 1))


def test_what_is_too_improbable_has_a_reason(scene):
    found, rejected = found_in(scene, BrightDisk(), min_confidence=0.95)
    assert not found
    assert all(each.reason.startswith("probability 0.") and each.reason.endswith("below 0.95") for each in rejected[:2])


def test_an_object_that_is_seen_from_two_proposals_is_one(scene):
    class Everywhere(BrightDisk):
        """Sees the same ball from the other proposals, too."""

        def run(self, patches):
            answers = super().run(patches)
            answers[..., 0] = np.where(answers[..., 3] > -3.0, 0.9, 0.0)
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


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("value", [-3e38, 3e38])
@pytest.mark.parametrize("answer", [1, 2, 3], ids=ANSWERS[1:])
@pytest.mark.parametrize("probability", [0.9, 0.999], ids=["doubtful", "certain"])
def test_a_network_that_sees_impossible_shifts_or_sizes_gives_finite_numbers(scene, answer, value, probability):
    class Giant(Fixed):
        def run(self, patches):
            answers = super().run(patches)
            answers[..., answer] = value
            return answers

    found, rejected = found_in(scene, Giant(probability), min_confidence=0.0)
    assert found or rejected
    for each in (*found, *rejected):
        json.dumps(each.as_dict(), allow_nan=False)


# Second looks


class Script(BrightDisk):
    """A look whose answers are given, one array (n, C, 4) for each run. It keeps the patches that it saw."""

    def __init__(self, *answers, classes=("ball",)):
        self.contract = look_contract(*classes, size=32, extent=EXTENT, max_proposals=40)
        self.answers = [np.array(each, dtype=np.float32) for each in answers]
        self.seen = []

    def run(self, patches):
        self.seen.append(patches)
        return self.answers[len(self.seen) - 1]


def judgments(observation, look, min_confidence=0.0):
    """What a look judges of each class in peaks, most probable first."""
    judged = judge_classes(observation, look, Settings(min_confidence=min_confidence), Stopwatch(), explain=True)
    return {name: found for name, (_, found) in judged.items()}


def log_odds(probability):
    return np.log(np.divide(probability, np.subtract(1.0, probability)))


def probability(logit):
    return 1.0 / (1.0 + np.exp(-logit))


def beside(ray, answer, sign=1.0, shape=BALL):
    """The ray to the place that an answer shows in the patch around a ray. sign: -1 for a mirrored patch."""
    _, right, down, _ = answer
    tangents = Tangents.around(shape.center_along(ray[None], VIEW.height), shape.half_size)
    return tangents.rays(np.array([sign * right]), np.array([down]))[0]


def one_place(observation):
    """The ray of the only peak."""
    (ray,) = observation.peaks["ball"].rays
    return ray


def test_a_doubtful_place_gets_a_second_look_at_the_mirrored_patch_around_the_center_that_was_seen():
    seen = observed(BALLS[0])
    first, second = (0.8, 0.4, -0.3, 0.2), (0.3, 0.1, 0.2, -0.4)
    look = Script([[first]], [[second]])
    (judged,) = judgments(seen, look)["ball"]
    assert len(look.seen) == 2
    ray = one_place(seen)
    again = beside(ray, first)
    for patches, center, mirrored in ((look.seen[0], ray, False), (look.seen[1], again, True)):
        centers = BALL.center_along(center[None], VIEW.height)
        expected, _ = cut_places(seen.pyramid, VIEW, centers, np.array([BALL.half_size]), look.contract)
        np.testing.assert_array_equal(patches, expected[:, :, ::-1] if mirrored else expected)
        assert patches.flags.c_contiguous
    assert judged.confidence == pytest.approx(probability(log_odds([0.8, 0.3]).mean()), abs=1e-5)
    assert judged.scale == pytest.approx(np.exp((0.2 - 0.4) / 2.0), abs=1e-6)
    middle = ray_to(again + beside(again, second, sign=-1.0))
    np.testing.assert_allclose(ray_to(judged.center), middle, atol=1e-6)


@pytest.mark.parametrize("sure", [0.96, 0.04])
def test_the_first_answer_about_a_place_that_is_not_doubtful_counts(sure):
    seen = observed(BALLS[0])
    answer = (sure, 0.4, -0.3, 0.2)
    look = Script([[answer]])
    (judged,) = judgments(seen, look)["ball"]
    assert len(look.seen) == 1
    assert judged.confidence == pytest.approx(sure, abs=1e-5)
    assert judged.scale == pytest.approx(np.exp(0.2), abs=1e-6)
    np.testing.assert_allclose(ray_to(judged.center), beside(one_place(seen), answer), atol=1e-6)


@pytest.mark.parametrize("weight", [0.0, 0.25])
@pytest.mark.parametrize(("logit", "looks"), [(-3.1, 1), (-2.9, 2), (2.9, 2), (3.1, 1)])
def test_the_score_of_the_peak_counts_in_the_doubt(weight, logit, looks):
    seen = observed(BALLS[0])
    (score,) = seen.peaks["ball"].scores
    own = logit - weight * score
    answers = [[(probability(own), 0.0, 0.0, 0.0)]], [[(0.5, 0.0, 0.0, 0.0)]]
    look = Script(*answers, classes=(JudgedClass(name="ball", mesh_weight=weight),))
    (judged,) = judgments(seen, look)["ball"]
    assert len(look.seen) == looks
    expected = logit if looks == 1 else own / 2.0 + weight * score
    assert judged.confidence == pytest.approx(probability(expected), abs=1e-5)


def test_only_the_doubtful_ones_of_several_places_get_a_second_look():
    seen = observed(*BALLS, *NOTHING)
    first = [(0.99, 0.1, 0.0, 0.0), (0.7, 0.0, 0.0, 0.1), (0.01, 0.0, 0.2, 0.0), (0.2, 0.0, 0.0, 0.0)]
    second = [(0.9, 0.2, 0.0, 0.3), (0.1, 0.0, 0.0, 0.0)]
    look = Script([[each] for each in first], [[each] for each in second])
    judged = judgments(seen, look)["ball"]
    assert [len(each) for each in look.seen] == [4, 2]
    np.testing.assert_array_equal(look.seen[1], look.seen[0][[1, 3], :, ::-1])  # the first look moved neither
    logits = [log_odds(0.99), log_odds([0.7, 0.9]).mean(), log_odds([0.2, 0.1]).mean(), log_odds(0.01)]
    assert [each.confidence for each in judged] == pytest.approx(probability(np.array(logits)), abs=1e-5)
    rays = seen.peaks["ball"].rays
    moved = [
        beside(rays[0], first[0]),
        ray_to(rays[1] + beside(rays[1], second[0], sign=-1.0)),
        rays[3],
        beside(rays[2], first[2]),
    ]
    np.testing.assert_allclose([ray_to(each.center) for each in judged], moved, atol=1e-6)
    assert [each.scale for each in judged] == pytest.approx([1.0, np.exp(0.2), 1.0, 1.0], abs=1e-6)


def test_each_class_is_in_doubt_by_its_own_answers():
    """The look judges them in another order than the mesh network. What it says of the others does not count."""
    manifest = ball_manifest("ball", "goal:upright", mesh="octaves", sampling="footprint", peaks=("ball", "goal"))
    seen = observed_by(manifest, ("ball", BALLS[0]), ("goal", BALLS[1]))
    sure, doubtful, again = (0.99, 0.1, 0.0, 0.1), (0.6, 0.2, 0.1, 0.3), (0.9, -0.3, 0.0, 0.1)
    nothing = (0.01, 0.0, 0.0, 0.0)
    classes = upright("robot"), upright("goal", 0.2), "ball"
    look = Script([[nothing, doubtful, sure], [nothing, doubtful, sure]], [[nothing, again, sure]], classes=classes)
    judged = judgments(seen, look)
    (ball,), (goal,) = judged["ball"], judged["goal"]
    assert [len(each) for each in look.seen] == [2, 1]
    assert ball.confidence == pytest.approx(0.99, abs=1e-5)
    np.testing.assert_allclose(ray_to(ball.center), beside(seen.peaks["ball"].rays[0], sure), atol=1e-6)
    assert goal.confidence == pytest.approx(probability(log_odds([0.6, 0.9]).mean()), abs=1e-5)
    assert goal.scale == pytest.approx(np.exp(0.2), abs=1e-6)
    base = Circle(0.2)
    seen_first = beside(seen.peaks["goal"].rays[0], doubtful, shape=base)
    centers = base.center_along(seen_first[None], VIEW.height)
    expected, _ = cut_places(seen.pyramid, VIEW, centers, np.array([base.half_size]), look.contract)
    np.testing.assert_array_equal(look.seen[1], expected[:, :, ::-1])
    middle = ray_to(seen_first + beside(seen_first, again, sign=-1.0, shape=base))
    np.testing.assert_allclose(ray_to(goal.center), middle, atol=1e-6)
