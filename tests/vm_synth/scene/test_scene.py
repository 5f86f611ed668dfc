"""Scenes: the ball lies where the camera sees it, nothing stands in it, and all is drawn within its ranges."""

import math
from dataclasses import replace

import numpy as np
import pytest

from vm_synth.bodies.solids import LABELS
from vm_synth.scene.camera import CameraRanges
from vm_synth.scene.configuration import SceneConfiguration, TargetRanges, ThingRanges
from vm_synth.scene.draw_scene import draw_scene
from vm_synth.scene.environment import Environment
from vm_synth.scene.field import FieldRanges

DEFAULT = SceneConfiguration()
NOTHING = ThingRanges(robots=(0, 0), clutter=(0, 0), round_things=(0, 0), furniture=(0, 0), people=(0, 0), carrier=0.0)
NO_OTHER = {"off_plane": 0.0, "wrong_size": 0.0}
FLOOR = math.radians(15.0)


def under(floor=None):
    """An evenly gray environment."""
    return Environment("gray", np.full((64, 128, 3), 0.5, dtype=np.float32), floor)


def bare(**ball):
    """A configuration of scenes with nothing but a ball."""
    return replace(
        DEFAULT,
        things=NOTHING,
        field=FieldRanges(goals=0.0),
        ball=TargetRanges(**({"missing": 0.0, "hidden": 0.0, "cut": 0.0} | NO_OTHER | ball)),
    )


def scenes(count, configuration=DEFAULT, floor=None, first=0):
    environment = under(floor)
    return [draw_scene(np.random.default_rng(first + seed), configuration, environment) for seed in range(count)]


@pytest.fixture(scope="module")
def crowded():
    """Scenes with much around, on fields and on photographed floors."""
    configuration = replace(
        DEFAULT,
        things=ThingRanges(robots=(1, 2), clutter=(2, 4), round_things=(0, 2), carrier=0.7),
        ball=TargetRanges(missing=0.1, hidden=0.5, off_plane=0.4, wrong_size=0.4),
        ground=replace(DEFAULT.ground, photographed=1.0),
    )
    return scenes(60, configuration) + scenes(40, configuration, FLOOR)


def bodies(scene):
    """Name, vertices (n, 3) and triangles' corners (m, 3, 3) of each body of a scene."""
    first = 0
    corners = scene.mesh.vertices[scene.mesh.triangles].astype(np.float64)
    for name, count in zip(scene.names, scene.counts, strict=True):
        own = (scene.mesh.triangles[:, 0] >= first) & (scene.mesh.triangles[:, 0] < first + count)
        yield name, scene.mesh.vertices[first : first + count], corners[own]
        first += count
    assert first == len(scene.mesh.vertices)


def balls(scene):
    return [each for each in (scene.ball, scene.other) if each is not None]


def seen_ray(scene):
    """The camera's ray (3,) to the ball's center, and its pixel (2,)."""
    ray = scene.ball.center - scene.camera
    ray = ray / np.linalg.norm(ray) @ scene.orientation.rotation
    return ray, scene.lens.project(ray[None], scene.size)[0]


def angular_radius(scene):
    return math.asin(scene.ball.radius / float(np.linalg.norm(scene.ball.center - scene.camera)))


def test_the_same_chance_draws_the_same_scene():
    for floor in (None, FLOOR):
        for first, second in zip(scenes(3, floor=floor), scenes(3, floor=floor), strict=True):
            assert (first.lens, first.field, first.names, first.counts, first.sensor, first.seed) == (
                second.lens,
                second.field,
                second.names,
                second.counts,
                second.sensor,
                second.seed,
            )
            np.testing.assert_array_equal(first.mesh.vertices, second.mesh.vertices)
            np.testing.assert_array_equal(first.mesh.labels, second.mesh.labels)
            np.testing.assert_array_equal(first.orientation.rotation, second.orientation.rotation)
            assert len(balls(first)) == len(balls(second))
            for one, other in zip(balls(first), balls(second), strict=True):
                np.testing.assert_array_equal(one.center, other.center)
                np.testing.assert_array_equal(one.attitude, other.attitude)
                assert one.design == other.design


def test_other_chance_draws_another_scene():
    drawn = scenes(10, bare())
    assert len({each.seed for each in drawn}) == 10
    assert len({each.orientation.height for each in drawn}) == 10


def test_balls_lie_on_the_plane_and_are_turned_anyhow(crowded):
    for scene in crowded:
        if scene.ball is not None:
            assert scene.ball.center[2] == scene.ball.radius
            assert DEFAULT.ball.radius[0] <= scene.ball.radius <= DEFAULT.ball.radius[1]
        for ball in balls(scene):
            np.testing.assert_allclose(ball.attitude @ ball.attitude.T, np.eye(3), atol=1e-9)
            assert np.linalg.det(ball.attitude) == pytest.approx(1.0)


@pytest.mark.parametrize("floor", [None, FLOOR])
def test_a_ball_that_is_not_cut_is_in_the_picture(floor):
    """Its whole outline, nearly: near the picture's corners lenses stretch it."""
    for scene in scenes(80, bare(), floor):
        ray, pixel = seen_ray(scene)
        assert scene.lens.sees(ray[None])[0]
        assert (pixel >= 0.0).all()
        assert (pixel <= np.array(scene.size) - 1.0).all()


def test_a_ball_that_may_be_cut_is_at_least_partly_in_the_picture():
    """Its center is at most 0.6 of its radius beyond the edge."""
    cut = 0
    for scene in scenes(80, bare(cut=1.0)):
        _, pixel = seen_ray(scene)
        beyond = np.maximum(np.maximum(-0.5 - pixel, pixel - np.array(scene.size) + 0.5), 0.0).max()
        cut += beyond > 0.0
        assert beyond < 2.0 * angular_radius(scene) * scene.lens.focal_length + 1.0
    assert cut > 2


def test_the_size_in_the_picture_is_uniform():
    """By the largest gap between the shares below a size, of the drawn and of the uniform distribution."""
    camera = CameraRanges(
        projections=("equidistant",),
        fisheye_view=(185.0, 185.0),
        picture_height=640,
        image_circle=0.0,
        distorted=0.0,
        height=(0.8, 0.8),
        pitch=(90.0, 90.0),
        steep=0.0,
        tumbled=0.0,
    )
    configuration = replace(bare(radius=(0.1, 0.1), distance=(0.5, 6.0)), camera=camera)
    drawn = scenes(300, configuration)
    found = np.sort([angular_radius(each) for each in drawn])
    smallest, largest = (math.asin(0.1 / math.hypot(distance, 0.7)) for distance in (6.0, 0.5))
    assert smallest - 1e-9 <= found[0] <= found[-1] <= largest + 1e-9
    share = (found - smallest) / (largest - smallest)
    gap = np.abs(share - (np.arange(300) + 0.5) / 300).max()
    assert gap < 1.63 / math.sqrt(300)  # one in a hundred by chance
    distances = [float(np.linalg.norm(each.ball.center[:2])) for each in drawn]
    assert 0.5 - 1e-9 <= min(distances) <= max(distances) <= 6.0 + 1e-9


@pytest.mark.parametrize("missing", [0.0, 0.1, 1.0])
def test_as_many_scenes_as_configured_have_no_ball(missing):
    found = np.mean([each.ball is None for each in scenes(200 if missing == 0.1 else 15, bare(missing=missing))])
    assert found == pytest.approx(missing, abs=0.065 if missing == 0.1 else 0.0)


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


def test_floors_are_shown_by_the_configured_share():
    for photographed, floor, expected in ((1.0, FLOOR, 1.0), (0.0, FLOOR, 0.0), (1.0, None, 0.0), (0.5, FLOOR, 0.5)):
        configuration = replace(bare(), ground=replace(DEFAULT.ground, photographed=photographed))
        drawn = scenes(100 if expected == 0.5 else 10, configuration, floor)
        assert np.mean([each.field is None for each in drawn]) == pytest.approx(expected, abs=0.15 * (expected == 0.5))


def test_the_ground_s_color_is_that_of_field_or_floor():
    environment = under(FLOOR)
    configuration = replace(bare(), ground=replace(DEFAULT.ground, photographed=0.5))
    for scene in scenes(10, configuration, FLOOR):
        expected = environment.floor_albedo if scene.field is None else scene.field.grass
        assert scene.ground_albedo == expected


def test_a_ball_lies_on_the_carpet_if_there_is_room():
    on = [each.field.on_carpet(each.ball.center[:2]) for each in scenes(60, bare(distance=(0.0, 4.0)))]
    assert np.mean(on) > 0.9


def test_without_things_there_is_no_mesh():
    for scene in scenes(15, bare()):
        assert scene.names == scene.counts == ()
        assert len(scene.mesh.vertices) == len(scene.mesh.triangles) == len(scene.mesh.labels) == 0
        assert scene.other is None


KINDS = ("robots", "clutter", "round_things", "furniture", "people")


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


def test_narrow_ranges_give_what_they_say():
    configuration = replace(
        bare(radius=(0.07, 0.08), distance=(1.0, 2.0)),
        camera=CameraRanges(
            picture_width=320,
            picture_height=200,
            projections=("rectilinear",),
            rectilinear_view=(88.0, 92.0),
            height=(0.5, 0.6),
            pitch=(20.0, 30.0),
            steep=0.0,
            roll=(1.0, 2.0),
            tumbled=0.0,
        ),
        field=FieldRanges(length=(9.0, 9.5), line_width=(0.05, 0.06), goals=0.0),
    )
    for scene in scenes(20, configuration):
        assert scene.size == (320, 200)
        assert 0.07 <= scene.ball.radius <= 0.08
        assert 1.0 - 1e-9 <= np.linalg.norm(scene.ball.center[:2]) <= 2.0 + 1e-9
        assert 0.5 <= scene.orientation.height <= 0.6
        assert math.radians(20.0) - 1e-9 <= scene.orientation.pitch <= math.radians(30.0) + 1e-9
        assert math.radians(1.0) - 1e-9 <= scene.orientation.roll <= math.radians(2.0) + 1e-9
        assert 9.0 <= scene.field.length <= 9.5
        assert 0.05 <= scene.field.line_width <= 0.06


def test_the_camera_is_over_the_origin():
    for scene in scenes(5, bare()):
        np.testing.assert_array_equal(scene.camera, (0.0, 0.0, scene.orientation.height))
