"""Objects stand on the ground, apart from the balls and the camera, in the configured numbers."""

import math
from dataclasses import replace

import numpy as np
import pytest

from vm_synth.bodies.solids import LABELS
from vm_synth.scene.camera import CameraRanges
from vm_synth.scene.configuration import TargetRanges
from vm_synth.scene.field import FieldRanges

from .drawn import DEFAULT, FLOOR, NOTHING, balls, bare, bodies, scenes

KINDS = ("robots", "clutter", "round_things", "furniture", "people")


def test_nothing_stands_in_a_ball(crowded):
    """No vertex, and no point of a triangle: taken at a few places of each."""
    weights = np.array([(1, 1, 1), (2, 1, 0), (0, 2, 1), (1, 0, 2), (1, 2, 0), (0, 1, 2), (2, 0, 1)]) / 3.0
    for scene in crowded:
        for name, vertices, corners in bodies(scene):
            places = np.concatenate([vertices, (weights @ corners).reshape(-1, 3)])
            for ball in balls(scene):
                assert np.linalg.norm(places - ball.center, axis=1).min() > 0.979 * ball.radius, name


def test_the_two_balls_are_apart(crowded):
    both = [each for each in crowded if len(balls(each)) == 2]
    assert len(both) > 20
    for scene in both:
        apart = np.linalg.norm(scene.ball.center - scene.other.center)
        assert apart > scene.ball.radius + scene.other.radius


def test_nothing_is_around_the_camera(crowded):
    for scene in crowded:
        for name, vertices, corners in bodies(scene):
            places = np.concatenate([vertices, corners.mean(axis=1)])
            assert np.linalg.norm(places - scene.camera, axis=1).min() > 0.05, name
        for ball in balls(scene):
            assert np.linalg.norm(ball.center - scene.camera) > ball.radius + 0.05


def test_nothing_is_below_the_plane(crowded):
    for scene in crowded:
        if len(scene.mesh.vertices):
            assert scene.mesh.vertices[:, 2].min() > -1e-3


def test_the_mesh_belongs_to_the_bodies(crowded):
    for scene in crowded:
        mesh = scene.mesh
        assert len(scene.names) == len(scene.counts)
        assert sum(scene.counts) == len(mesh.vertices) == len(mesh.normals) == len(mesh.colors) == len(mesh.roughness)
        assert len(mesh.labels) == len(mesh.triangles)
        if len(mesh.triangles):
            assert 0 <= mesh.triangles.min() <= mesh.triangles.max() < len(mesh.vertices)
            assert 0 <= mesh.labels.min() <= mesh.labels.max() < len(LABELS)
    assert any(each.names for each in crowded)


def test_on_a_photographed_floor_nothing_leaves_it():
    """Balls and things are nearer than the floor reaches; there is no field and no goal."""
    configuration = replace(
        DEFAULT,
        things=replace(NOTHING, clutter=(3, 3), robots=(1, 1)),
        ball=TargetRanges(missing=0.0, cut=0.0, hidden=0.0, off_plane=0.3, wrong_size=0.3),
        ground=replace(DEFAULT.ground, photographed=1.0),
    )
    for scene in scenes(30, configuration, FLOOR):
        reach = scene.orientation.height / math.tan(FLOOR)
        assert scene.field is None
        assert not any(name.startswith("goal") for name in scene.names)
        for ball in balls(scene):
            assert np.linalg.norm(ball.center[:2]) <= reach + 1e-9
        # From the ball's center up the floor's edge is no nearer than the floor itself.
        depth = scene.orientation.height - scene.ball.radius
        assert math.atan2(depth, float(np.linalg.norm(scene.ball.center[:2]))) >= FLOOR - 1e-9
        for name, vertices, _ in bodies(scene):
            assert np.hypot(vertices[:, 0], vertices[:, 1]).min() <= reach, name


def test_without_things_there_is_no_mesh():
    for scene in scenes(15, bare()):
        assert scene.names == scene.counts == ()
        assert len(scene.mesh.vertices) == len(scene.mesh.triangles) == len(scene.mesh.labels) == 0
        assert scene.other is None


@pytest.mark.parametrize("kind", KINDS)
def test_there_are_as_many_things_as_configured(kind):
    """No more than that; fewer where the view has no room for them."""
    configuration = replace(
        bare(missing=1.0, distance=(3.0, 3.0)),
        things=replace(NOTHING, **{kind: (2, 2)}),
        camera=CameraRanges(
            projections=("equidistant",), fisheye_view=(180.0, 180.0), height=(1.2, 1.2), image_circle=0.0
        ),
    )
    drawn = scenes(5, configuration)
    spots = [len({tuple(np.round(v[:, :2].mean(axis=0), 1)) for _, v, _ in bodies(each)}) for each in drawn]
    assert max(spots) >= 2
    if kind in ("clutter", "furniture"):
        assert all(len(each.names) <= 2 for each in drawn)


def test_the_camera_s_carrier_is_shown_by_the_configured_share():
    camera = CameraRanges(height=(1.0, 1.4))
    for share, expected in ((0.0, 0), (1.0, 10)):
        configuration = replace(bare(missing=1.0), things=replace(NOTHING, carrier=share), camera=camera)
        assert (
            sum(any(name.startswith("own ") for name in each.names) for each in scenes(10, configuration)) == expected
        )


def test_goals_stand_at_both_ends_of_the_field():
    configuration = replace(
        bare(missing=1.0), field=FieldRanges(goals=1.0, goal_width=(1.5, 1.5), goal_height=(1.0, 1.0))
    )
    found = 0
    for scene in scenes(8, configuration):
        posts = [vertices for name, vertices, _ in bodies(scene) if name == "goal"]
        found += len(posts)
        ends = [
            scene.field.middle + scene.field.rotation @ (side * scene.field.length / 2.0, 0.0) for side in (-1.0, 1.0)
        ]
        for vertices in posts:
            middle = (vertices[:, :2].min(axis=0) + vertices[:, :2].max(axis=0)) / 2.0
            assert min(np.linalg.norm(middle - end) for end in ends) < 0.1
            assert vertices[:, 2].max() == pytest.approx(1.1, abs=0.05)
            assert np.linalg.norm(np.ptp(vertices[:, :2], axis=0)) > 1.5
    assert found > 8


def test_something_is_before_or_beside_a_hidden_ball():
    """Nearer to the camera than the ball, and not far from the line of sight."""
    configuration = bare(hidden=1.0, distance=(2.0, 5.0))
    drawn = [each for each in scenes(25, configuration) if each.names]
    assert len(drawn) > 12
    for scene in drawn:
        spot = scene.ball.center[:2]
        distance = float(np.linalg.norm(spot))
        ahead = spot / distance
        places = np.concatenate([vertices[:, :2] for _, vertices, _ in bodies(scene)])
        along, aside = places @ ahead, places @ np.array([-ahead[1], ahead[0]])
        assert 0.0 < along.min() <= along.max() < distance
        # Its middle is at most its own reach and the ball's to the side.
        assert abs(aside.min() + aside.max()) / 2.0 < 2.0 * np.ptp(aside) + scene.ball.radius


def test_a_ball_off_the_plane_is_as_high_as_configured_and_labeled_so():
    configuration = bare(off_plane=1.0, off_plane_height=(0.3, 0.5), off_plane_label="robot")
    drawn = [each for each in scenes(30, configuration) if each.other is not None]
    assert len(drawn) > 10
    pedestals = 0
    for scene in drawn:
        stands = scene.other.center[2] - scene.other.radius
        assert 0.3 - 1e-9 <= stands <= 0.5 + 1e-9
        assert scene.other.radius == scene.ball.radius
        assert scene.other_label == "robot"
        for name, vertices, _ in bodies(scene):
            assert name == "pedestal"
            assert vertices[:, 2].max() == pytest.approx(stands, abs=1e-4)
            pedestals += 1
    assert 0.5 < pedestals / len(drawn) < 1.0


def test_a_ball_of_another_size_is_as_large_as_configured_and_no_ball():
    configuration = bare(wrong_size=1.0, smaller=(0.3, 0.5), larger=(2.0, 2.5))
    drawn = [each for each in scenes(30, configuration) if each.other is not None]
    factors = np.array([each.other.radius / each.ball.radius for each in drawn])
    small, large = (factors > 0.3) & (factors < 0.5), (factors > 2.0) & (factors < 2.5)
    assert (small | large).all()
    assert small.any()
    assert large.any()
    for scene in drawn:
        assert scene.other.center[2] == pytest.approx(scene.other.radius)
        assert scene.other_label == "environment"
