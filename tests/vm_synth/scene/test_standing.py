"""The description of posts, robots and people agrees with the field and with the drawn bodies."""

import numpy as np
import pytest

from vm_synth.scene.configuration import GroundRanges, SceneConfiguration, ThingRanges
from vm_synth.scene.standing import standing_objects

from .drawn import bodies, scenes

PEOPLE, ROBOTS = ("legs", "person"), ("humanoid", "nao", "wheeled robot")

CROWD = SceneConfiguration(
    ground=GroundRanges(photographed=0.0), things=ThingRanges(robots=(1, 3), people=(1, 2), carrier=1.0)
)


@pytest.fixture(scope="module", params=range(12))
def scene(request):
    return scenes(1, CROWD, first=request.param)[0]


def of_kind(scene, kind):
    return [each for each in standing_objects(scene) if each.kind == kind]


def test_posts_stand_in_pairs_at_the_ends_of_the_field(scene):
    field, posts = scene.field, of_kind(scene, "post")
    assert len(posts) == 2 * scene.names.count("goal")
    places = (np.array([each.base for each in posts]).reshape(-1, 2) - field.middle) @ field.rotation
    np.testing.assert_allclose(np.abs(places[:, 0]), field.length / 2.0, atol=0.02)
    pairs = places[:, 1].reshape(-1, 2)
    np.testing.assert_allclose(pairs.sum(axis=1), 0.0, atol=0.02)
    assert (np.abs(pairs) > 0.2).all()
    for each in posts:
        assert 0.09 < each.width < 0.18
        assert each.height > 0.3


def test_robots_and_people_are_described_where_their_bodies_are(scene):
    people = sum(name in PEOPLE for name in scene.names)
    robots = sum(name in ROBOTS for name in scene.names)
    assert (len(of_kind(scene, "person")), len(of_kind(scene, "robot"))) == (people, robots)
    drawn = [vertices for name, vertices, _ in bodies(scene) if name in PEOPLE + ROBOTS]
    found = [each for each in standing_objects(scene) if each.kind != "post"]
    for body, each in zip(drawn, found, strict=True):
        assert each.height == pytest.approx(body[:, 2].max())
        low, high = body[:, :2].min(axis=0), body[:, :2].max(axis=0)
        assert (low <= each.base).all()
        assert (each.base <= high).all()
        assert 0.0 < each.width <= np.hypot(*(high - low)) + 1e-5


def test_the_base_of_a_robot_is_the_front_of_its_foot(scene):
    drawn = [vertices for name, vertices, _ in bodies(scene) if name in PEOPLE + ROBOTS]
    found = [each for each in standing_objects(scene) if each.kind != "post"]
    for body, each in zip(drawn, found, strict=True):
        foot = body[body[:, 2] <= 0.2 * body[:, 2].max()][:, :2]
        ahead = np.array(each.base) / np.hypot(*each.base)
        along = foot @ ahead
        assert along.min() - 1e-4 <= np.hypot(*each.base) <= along.max()
        sides = np.arctan2(foot @ (-ahead[1], ahead[0]), along)
        assert sides.max() == pytest.approx(-sides.min(), abs=1e-4)
        # All of the foot that is as near lies to one side: the base is on the edge of its convex hull.
        nearer = foot - each.base
        turns = np.arctan2(nearer @ (-ahead[1], ahead[0]), nearer @ ahead)
        assert np.ptp(turns) <= np.pi + 1e-3


def test_the_carrier_of_the_camera_does_not_count(scene):
    assert any(name.startswith("own ") for name in scene.names)
    assert all(np.hypot(*each.base) > 0.1 for each in standing_objects(scene))
