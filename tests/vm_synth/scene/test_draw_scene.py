"""Drawn scenes repeat, stay within their ranges, and the camera sees the ball."""

import math
from dataclasses import replace

import numpy as np
import pytest

from vm_synth.scene.camera import CameraRanges
from vm_synth.scene.field import FieldRanges, line_segments
from vm_workstation.ranges import drawn

from .drawn import DEFAULT, FLOOR, balls, bare, bodies, scenes, under


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


def test_a_ball_lies_at_a_line_in_as_many_fields_as_configured():
    for on_line, expected in ((1.0, 1.0), (0.5, 0.5)):
        near = []
        for scene in scenes(60, bare(on_line=on_line)):
            spot = (scene.ball.center[:2] - np.array(scene.field.middle)) @ scene.field.rotation
            aside = distances_to_lines(scene.field, spot)
            near.append(aside.min() <= 0.5 * scene.field.line_width + scene.ball.radius + 1e-9)
            assert scene.field.on_carpet(spot @ scene.field.rotation.T + np.array(scene.field.middle))
        # With one in two, others lie there by chance.
        assert expected - 0.15 < np.mean(near) <= min(1.0, expected + 0.3)


def distances_to_lines(field, spot):
    """Distances (n,) [m] of a spot (2,) of the field from its straight lines."""
    start, end = line_segments(field.length, field.width).transpose(1, 0, 2)
    along = end - start
    share = np.clip(((spot - start) * along).sum(axis=1) / (along**2).sum(axis=1), 0.0, 1.0)
    return np.linalg.norm(start + share[:, None] * along - spot, axis=1)


@pytest.mark.long
def test_something_touches_the_ball_without_passing_through_it():
    touched = 0
    for scene in scenes(30, bare(touched=1.0, distance=(0.8, 3.0))):
        gaps = [surface_distance(corners, scene.ball.center) - scene.ball.radius for _, _, corners in bodies(scene)]
        if gaps:
            touched += 1
            assert -0.03 * scene.ball.radius < min(gaps) < 0.01
    assert touched > 20  # of others, the ball is between the legs, or the camera too near


def surface_distance(corners, point):
    """Distance [m] of a point (3,) from densely sampled triangles (m, 3, 3)."""
    weights = np.array([(i, j, 24 - i - j) for i in range(25) for j in range(25 - i)]) / 24.0
    near = corners[np.linalg.norm(corners - point, axis=2).min(axis=1) < 0.5]
    return float(np.linalg.norm(weights @ near - point, axis=2).min())


def test_shares_of_zero_draw_nothing():
    """Sets that were rendered before an entry existed can be rendered again."""
    random = np.random.default_rng(1)
    before = random.bit_generator.state
    assert not drawn(random, 0.0)
    assert random.bit_generator.state == before
    assert drawn(random, 1.0)
    assert random.bit_generator.state != before
