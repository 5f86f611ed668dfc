"""Objects are found where they are, whatever cuts them, and what can't be one is rejected with its reason."""

import json
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.manifests import ball_manifest
from vm_embedded.detection.objects import locate
from vm_embedded.detection.observation import Observation, Stopwatch
from vm_embedded.detection.prepared_view import PreparedView
from vm_embedded.detection.projection import Projection, project, to_camera
from vm_embedded.detection.pyramid import Pyramid
from vm_embedded.detection.settings import Settings
from vm_embedded.geometry.orientation import Orientation
from vm_embedded.geometry.radial_lenses import Equisolid, Rectilinear
from vm_embedded.geometry.shapes import Circle, Sphere
from vm_embedded.mesh.models import build_mesh
from vm_embedded.network.choose_layout import PlainLayout

SIZE = (1280, 1024)
PICTURE = Pyramid(np.zeros((SIZE[1], SIZE[0], 3), dtype=np.uint8), "bgr")
K = 5.0
BALLS = ball_manifest(radius=0.08, object_radius=0.08, intersections=K)


def scene_at(height=0.9, pitch=0.6, shape=None, mesh_shape=None, lens=None):
    """An observation of a field, whose points have no probabilities yet."""
    shape = shape or Sphere(0.08)
    mesh_shape = mesh_shape or shape
    lens = lens or Equisolid(focal_length=500.0, fov=2.6)
    orientation = Orientation.from_roll_pitch(height, 0.05, pitch)
    layout = PlainLayout(build_mesh(mesh_shape, height, K, 8.0), "hard")
    rings = K * float(shape.spacing(height) / mesh_shape.spacing(height))
    view = PreparedView(layout, None, shape, rings, height, orientation.level, np.eye(3), lens, SIZE)
    projected = project(layout, orientation.level, lens, SIZE)
    return Observation(PICTURE, view, BALLS, projected, np.zeros((len(layout), 1), dtype=np.float32))


def reordered(scene, order):
    """The same observation of the points `order`, in that order; those at the same place sum in the same order."""
    mesh = build_mesh(scene.view.shape, scene.view.height, K, 8.0)
    layout = PlainLayout(mesh.part(order), "hard")
    layout.slots = order.astype(np.int32)
    projected = Projection(layout, scene.projected.pixels[order], scene.projected.on_screen[order])
    return replace(scene, view=scene.view._replace(layout=layout), projected=projected)


def ideal(scene, *spots, radius=None):
    """Probabilities (n,) of a perfect network that sees objects at these places (x, y) [m] on the plane.

    What is off screen has any answer, and none at all.
    """
    shape = type(scene.view.shape)(radius) if radius else scene.view.shape
    rays = scene.projected.graph.rays
    inside = np.zeros(len(rays), dtype=bool)
    for spot in spots:
        center = np.array([[*spot, shape.center_height - scene.view.height]])
        inside |= shape.offset(rays, center, scene.view.height)[0] < 1.0
    seen = np.where(inside, 0.97, 0.02)
    nonsense = np.resize([0.97, np.nan, 0.99, 0.0], len(rays))
    return np.where(scene.projected.on_screen, seen, nonsense).astype(np.float32)


def lowest_of(scene):
    """The point on screen that is lowest in the picture."""
    return int(np.argmax(np.where(scene.projected.on_screen, scene.projected.pixels[:, 1], -np.inf)))


def objects_in(scene, probability, **settings):
    answered = replace(scene, slot_answers=probability[:, None])
    return locate(answered, None, Settings(**settings), Stopwatch(), explain=True)


@given(distance=st.floats(0.6, 6.0), heading=st.floats(-0.4, 0.4), height=st.floats(0.5, 1.3))
def test_a_ball_is_found_where_it_is(distance, heading, height):
    scene = scene_at(height, pitch=np.arctan2(height, distance))
    spot = np.array([distance * np.cos(heading), distance * np.sin(heading)])
    found, rejected = objects_in(scene, ideal(scene, spot))
    assert len(found) == 1, [each.reason for each in rejected]
    ball = found[0]
    away = float(np.hypot(distance, height - scene.view.shape.radius))
    assert ball.distance == pytest.approx(away, rel=0.05)
    center = np.array([[*spot, scene.view.shape.radius - height]])
    assert scene.view.shape.offset(ball.bearing[None], center, height)[0, 0] < 0.35
    np.testing.assert_allclose(ball.position, ball.bearing * ball.distance + [0, 0, height], atol=1e-9)
    assert ball.position[2] == pytest.approx(scene.view.shape.radius)
    assert ball.distances_agree
    assert np.sin(ball.angular_radius) == pytest.approx(scene.view.shape.radius / away, rel=2.0 / K)
    assert ball.confidence > 0.8


@given(distance=st.floats(0.6, 4.0))
def test_a_circle_is_found_where_it_is(distance):
    scene = scene_at(0.9, pitch=np.arctan2(0.9, distance), shape=Circle(0.1))
    found, _ = objects_in(scene, ideal(scene, (distance, 0.0)))
    assert len(found) == 1
    assert found[0].position[2] == pytest.approx(0.0, abs=1e-9)
    np.testing.assert_allclose(found[0].position[:2], (distance, 0.0), atol=0.06)


@given(height=st.floats(0.5, 1.3), x=st.floats(-0.2, 0.2), y=st.floats(-0.2, 0.2))
def test_a_ball_below_the_camera_is_found(height, x, y):
    scene = scene_at(height, pitch=np.pi / 2)
    found, rejected = objects_in(scene, ideal(scene, (x, y)))
    assert len(found) == 1, [each.reason for each in rejected]
    np.testing.assert_allclose(found[0].position[:2], (x, y), atol=0.05)


def test_pixels_are_those_of_the_outline():
    scene = scene_at(0.9, pitch=0.5, lens=Rectilinear(focal_length=700.0, fov=2.0))
    found, _ = objects_in(scene, ideal(scene, (1.6, 0.2)))
    ball = found[0]
    center = to_camera(ball.bearing[None], scene.view.rotation)
    assert np.linalg.norm(scene.view.lens.project(center, SIZE)[0] - ball.center) < 2.0
    reach = np.linalg.norm(ball.outline - ball.center, axis=1)
    assert reach.min() <= ball.radius <= reach.max()


def test_an_object_that_the_border_cuts_keeps_its_center():
    scene = scene_at(0.9, pitch=0.5)
    border = scene.projected.graph.rays[lowest_of(scene)]
    spot = scene.view.shape.center_along(border[None], scene.view.height)[0, :2]
    found, _ = objects_in(scene, ideal(scene, spot))
    assert len(found) == 1
    assert np.linalg.norm(found[0].position[:2] - spot) < 0.5 * scene.view.shape.radius


def test_two_objects_are_two():
    scene = scene_at()
    found, _ = objects_in(scene, ideal(scene, (1.2, 0.25), (1.2, -0.25)))
    assert len(found) == 2


def test_what_is_much_wider_is_rejected_by_its_diameter():
    scene = scene_at()
    found, rejected = objects_in(scene, ideal(scene, (1.3, 0.0), radius=0.3))
    assert not found
    assert "wider than" in rejected[0].reason


def test_what_is_somewhat_wider_is_rejected_by_the_band_around():
    scene = scene_at()
    found, rejected = objects_in(scene, ideal(scene, (1.3, 0.0), radius=0.13))
    assert not found
    assert "around its outline" in rejected[0].reason


def test_what_is_much_smaller_is_rejected_by_its_inside():
    scene = scene_at()
    found, rejected = objects_in(scene, ideal(scene, (1.3, 0.0), radius=0.035))
    assert not found
    assert "points, where" in rejected[0].reason or "inside its outline" in rejected[0].reason


def test_a_corner_of_an_object_is_too_little_to_tell():
    scene = scene_at()
    probability = ideal(scene)
    probability[lowest_of(scene)] = 0.97
    found, rejected = objects_in(scene, probability)
    assert not found
    assert len(rejected) == 1


@given(st.integers(0, 2**32 - 1), st.floats(0.0, 1.0))
@settings(max_examples=15)
def test_noise_never_breaks_the_search(seed, share):
    scene = scene_at(lens=Rectilinear(focal_length=300.0, fov=3.1) if seed % 2 else None)
    random = np.random.default_rng(seed)
    probability = np.where(random.random(len(scene.projected)) < share, random.random(len(scene.projected)), 0.0)
    found, rejected = objects_in(scene, probability.astype(np.float32))
    for each in (*found, *rejected):
        json.dumps(each.as_dict(), allow_nan=False)
        assert 0.0 <= each.confidence <= 1.0
        assert (each.reason is None) == (each in found)


def test_reasons_are_only_collected_when_asked_for():
    scene = scene_at()
    observation = replace(scene, slot_answers=ideal(scene, (1.3, 0.0), radius=0.3)[:, None])
    _, rejected = locate(observation, None, Settings(), Stopwatch())
    assert rejected == ()


def test_a_larger_object_radius_is_an_object_of_more_rings():
    scene = scene_at(shape=Sphere(0.12), mesh_shape=Sphere(0.08))
    assert scene.view.rings > K * 1.4
    found, _ = objects_in(scene, ideal(scene, (1.5, 0.1)))
    assert len(found) == 1
    assert found[0].position[2] == pytest.approx(0.12)


@pytest.mark.long
@given(st.integers(0, 2**32 - 1), st.floats(0.0, 0.2))
@settings(max_examples=25)
def test_how_the_mesh_lies_in_memory_changes_no_digit(seed, noise):
    random = np.random.default_rng(seed)
    scene = scene_at(random.uniform(0.6, 1.2), pitch=random.uniform(0.3, 1.5))
    spots = [(random.uniform(0.3, 2.5), random.uniform(-0.8, 0.8)) for _ in range(3)]
    probability = ideal(scene, *spots)
    probability = np.where(random.random(len(probability)) < noise, random.random(len(probability)), probability)
    order = random.permutation(len(probability))
    plain = objects_in(scene, probability)
    other = objects_in(reordered(scene, order), probability[order])
    for before, after in zip(plain, other, strict=True):
        assert [each.as_dict() for each in before] == [each.as_dict() for each in after]


@given(st.integers(0, 2**32 - 1))
@settings(max_examples=15)
def test_what_is_off_screen_changes_nothing(seed):
    """Neither its probabilities nor whether the mesh has it at all."""
    random = np.random.default_rng(seed)
    scene = scene_at(0.9, pitch=random.uniform(0.3, 1.2))
    spot = scene.view.shape.center_along(scene.projected.graph.rays[[lowest_of(scene)]], scene.view.height)[0, :2]
    probability = ideal(scene, spot, (1.2, 0.3))
    shown = np.flatnonzero(scene.projected.on_screen)
    with_it, without_it = objects_in(scene, probability), objects_in(reordered(scene, shown), probability[shown])
    assert len(with_it[0]) == 2
    for one, other in zip(with_it, without_it, strict=True):
        assert [each.as_dict() for each in one] == [each.as_dict() for each in other]
