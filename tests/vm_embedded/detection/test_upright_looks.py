"""The close look at goal posts and robots: proposals at bases, and what a look makes of them."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.drawn_scenes import FOLDER, IMAGES, MODEL
from tests.looks import look_contract
from vm_embedded import Detector, Orientation, read_lens_file
from vm_embedded.cameras.image_files import read_image
from vm_embedded.detection.field_points import locate_features
from vm_embedded.detection.settings import Settings
from vm_embedded.detection.upright_looks import around_bases, find_bases, nearest_points
from vm_embedded.network.manifest import ObjectClass

from ..strategies import seeds

LENS = read_lens_file(FOLDER / "lens0000000.yaml").lens
IMAGE = read_image(IMAGES[0])
CLASSES = tuple(
    ObjectClass(name, kind)
    for name, kind in (("ball", "object"), ("goal", "upright"), ("field", "area"), ("environment", "background"))
)
RADIUS = 0.3
SETTINGS = Settings()


@pytest.fixture(scope="module")
def detector():
    return Detector.from_file(MODEL)


def post_at(detector, base, height=1.0, half=0.08, yaw=0.0):
    """An observation of a white field with a post at a base [m] in the mesh frame, whatever the frame shows."""
    seen = detector.observe(IMAGE, Orientation.from_roll_pitch(0.8, 0.0, 0.4, yaw), LENS)
    rays = seen.layout.rays
    distance = np.hypot(*base)
    toward, aside = np.array(base) / distance, np.array([-base[1], base[0]]) / distance
    with np.errstate(invalid="ignore", divide="ignore"):
        along = distance / (rays[:, :2] @ toward)  # where a ray is above the base
        across = along * (rays[:, :2] @ aside)
        above = seen.view.height + along * rays[:, 2]
    on_post = (along > 0.0) & (np.abs(across) < half) & (above > 0.0) & (above < height)
    label = np.where(on_post, 1, 2)
    return replace(
        seen,
        manifest=replace(seen.manifest, classes=CLASSES, look=None),
        slot_answers=np.eye(4, dtype=np.float32)[label] * 0.9 + 0.025,
    )


class Sure:
    """A look that finds an upright with these answers in every patch."""

    glance = None
    calls = 0

    def __init__(self, right=0.0, down=0.0, probability=0.9, width=0.1):
        self.contract = look_contract(
            object_class="goal", upright_radius=RADIUS, size=16, extent=1.6, above=0.1, passes=1
        )
        self._answer = np.array([probability, right, down, np.log(width / (2.0 * RADIUS))], dtype=np.float32)

    def run(self, patches):
        assert patches.shape[1:] == (16, 16, 3)
        self.calls += 1
        return np.tile(self._answer, (len(patches), 1))


bases = st.tuples(st.floats(1.5, 4.0), st.floats(-0.5, 0.5))


@given(base=bases)
def test_the_nearest_points_of_a_post_propose_its_base(detector, base):
    seen = post_at(detector, base)
    found = find_bases(seen, Sure(), SETTINGS)
    ranges = [np.hypot(*each.position) for each in found]
    assert ranges == sorted(ranges)
    rays = np.array([[*place, -seen.view.height] for place in (found[0].position, base)])
    distance = np.linalg.norm(rays[1])
    rays /= np.linalg.norm(rays, axis=1, keepdims=True)
    assert np.linalg.norm(rays[0] - rays[1]) < 0.6 * RADIUS / distance, "the look reaches the base"
    assert {round(each.width, 4) for each in found} == {0.1}
    assert {round(each.confidence, 3) for each in found} == {0.9}
    assert len(found) < 5, "few directions have only points higher up"


def test_each_of_two_posts_is_found_and_the_nearest_comes_first(detector):
    near, far = post_at(detector, (2.0, -0.4)), post_at(detector, (3.0, 0.5))
    both = replace(near, slot_answers=np.maximum(near.slot_probabilities, far.slot_probabilities))
    found = [each.position for each in find_bases(both, Sure(), SETTINGS)]
    assert found[0] == pytest.approx((2.0, -0.4), abs=0.3)
    assert min(np.hypot(*(each - (3.0, 0.5))) for each in found[1:]) < 0.4


@pytest.mark.parametrize("width", [0.1, 2.4])
def test_bases_of_one_upright_are_reported_once(detector, width):
    here = post_at(detector, (6.0, 0.0))
    for beside, is_same in ((0.5, True), (1.0, width > 1.0), (2.0, False)):
        there = post_at(detector, (6.0, beside))
        both = replace(here, slot_answers=np.maximum(here.slot_probabilities, there.slot_probabilities))
        found = [each.position for each in find_bases(both, Sure(width=width), SETTINGS)]
        assert (min([9.0, *(np.hypot(*(each - found[0])) for each in found[1:])]) > beside + 0.3) == is_same


def test_a_place_that_the_first_look_doubts_gets_no_second_one(detector):
    doubting, trusting = (Sure(probability=each) for each in (0.02, 0.6))
    for look in (doubting, trusting):
        look.contract = replace(look.contract, passes=2)
        find_bases(post_at(detector, (2.5, 0.3)), look, SETTINGS)
    assert (doubting.calls, trusting.calls) == (1, 3)  # the second pass, then the mirror images


def test_the_least_confidence_of_the_settings_counts(detector):
    seen, look = post_at(detector, (2.5, 0.3)), Sure(probability=0.6)
    assert find_bases(seen, look, Settings(min_confidence=0.55))
    assert find_bases(seen, look, Settings(min_confidence=0.65)) == []


@pytest.mark.parametrize("yaw", [1.0, -2.5])
def test_a_turn_of_the_camera_turns_the_bases(detector, yaw):
    straight, turned = (
        find_bases(post_at(detector, (2.5, 0.3), yaw=each), Sure(), SETTINGS)[0].position for each in (0.0, yaw)
    )
    turn = np.array([[np.cos(yaw), -np.sin(yaw)], [np.sin(yaw), np.cos(yaw)]])
    assert turned == pytest.approx(turn @ straight, abs=1e-6)


def test_a_base_is_where_the_look_sees_it(detector):
    seen = post_at(detector, (2.5, 0.3))
    still = find_bases(seen, Sure(), SETTINGS)[0].position
    right = find_bases(seen, Sure(right=0.5), SETTINGS)[0].position - still
    down = find_bases(seen, Sure(down=0.2), SETTINGS)[0].position - still
    assert right[1] == pytest.approx(-0.5 * RADIUS, abs=0.03)  # y is to the left
    assert np.hypot(*(still + down)) < np.hypot(*still) - 0.05  # lower in the picture is nearer


def test_a_doubtful_look_reports_nothing(detector):
    assert find_bases(post_at(detector, (2.5, 0.3)), Sure(probability=0.25), SETTINGS) == []


def test_without_points_of_the_class_there_is_nothing_to_look_at(detector):
    seen = post_at(detector, (2.5, 0.3))
    nothing = replace(seen, slot_answers=np.zeros_like(seen.slot_probabilities))
    assert find_bases(nothing, Sure(), SETTINGS) == []


@given(seeds, st.floats(0.0, 0.9))
def test_the_nearest_points_are_the_nearest_of_their_probability_in_their_direction(detector, seed, above):
    seen = post_at(detector, (2.5, 0.3))
    probabilities = np.random.default_rng(seed).random(len(seen.layout)).astype(np.float32)
    found = nearest_points(seen, probabilities, above)
    rays = seen.layout.rays
    kept = np.flatnonzero(found)
    np.testing.assert_array_equal(found[kept], probabilities[kept])
    may = np.flatnonzero(seen.projected.on_screen & (probabilities > above) & (rays[:, 2] < 0.0))
    assert np.isin(kept, may).all()
    ranges = np.hypot(rays[:, 0], rays[:, 1]) / -rays[:, 2]
    columns = np.floor(np.arctan2(rays[:, 1], rays[:, 0]) / 0.012)
    low = np.zeros(len(rays), dtype=bool)
    for column in np.unique(columns[may]):
        for level in (above, 0.1, 0.3, 0.6, 0.9):
            inside = may[(columns[may] == column) & (probabilities[may] > level)]
            low[inside] |= ranges[inside] <= 1.12 * ranges[inside].min(initial=np.inf)
    np.testing.assert_array_equal(kept, np.flatnonzero(low))


def test_a_doubtful_point_in_front_does_not_hide_a_base(detector):
    seen = post_at(detector, (2.5, 0.3))
    post = seen.slot_probabilities[:, 1]
    bases = np.flatnonzero(nearest_points(seen, post, 0.03))
    distances = np.hypot(*(seen.layout.rays[:, :2] / -seen.layout.rays[:, 2:]).T)
    in_front = seen.projected.on_screen & (distances < 0.6 * distances[bases].min())
    doubtful = np.where(in_front, np.float32(0.05), post)
    assert np.isin(bases, np.flatnonzero(nearest_points(seen, doubtful, 0.03))).all()


def test_a_class_with_a_look_needs_no_rules(detector):
    seen = post_at(detector, (2.5, 0.3))
    looked = locate_features(seen, {"goal": Sure(width=0.12)}, SETTINGS)
    assert {round(each.width, 4) for each in looked.posts} == {0.12}
    assert {each.class_name for each in looked.posts} == {"post"}
    ruled = locate_features(seen, {}, SETTINGS)
    assert 0.12 not in {round(each.width, 4) for each in ruled.posts}


def test_circles_around_bases_change_nothing_but_the_shape(detector):
    seen = post_at(detector, (2.5, 0.3))
    circles = around_bases(seen, 0.4)
    assert circles.view.shape.half_size == 0.4
    assert circles.view._replace(shape=seen.view.shape) == seen.view
    assert circles.slot_answers is seen.slot_answers
