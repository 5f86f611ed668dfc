"""Planes anywhere: what a camera over one sees does not depend on where the world's frame stands."""

import math

import numpy as np
import pytest
from hypothesis import given

from vm_embedded.errors import GeometryError
from vm_embedded.geometry.planes import GROUND, Plane, Pose

from ..strategies import random_direction, reals, rotation, seeds


def random_pose(random, height=None):
    position = random.uniform(-3.0, 3.0, 3)
    if height is not None:
        position[2] = height
    return Pose(rotation(random.uniform(0.0, 3.0) * random_direction(random)), position)


def moved(pose, turn, shift):
    return Pose(turn @ pose.rotation, turn @ pose.position + shift)


@given(seeds, reals(0.1, 5.0))
def test_over_the_ground_a_pose_is_an_orientation(seed, height):
    pose = random_pose(np.random.default_rng(seed), height)
    orientation = GROUND.seen_from(pose)
    assert orientation.height == pytest.approx(height)
    np.testing.assert_allclose(orientation.rotation, pose.rotation, atol=1e-12)
    foot = GROUND.to_world(np.zeros((1, 3)), pose)[0]
    np.testing.assert_allclose(foot, [*pose.position[:2], 0.0], atol=1e-12)


@given(seeds, reals(0.1, 3.0))
def test_height_and_rays_stay_when_camera_and_plane_move_together(seed, height):
    """The angle of each camera ray to the plane, and the camera's height over it, are all that a mesh depends on."""
    random = np.random.default_rng(seed)
    pose = random_pose(random, height)
    turn, shift = rotation(random.uniform(0.0, 3.0) * random_direction(random)), random.uniform(-5.0, 5.0, 3)
    plane = Plane.through("moved", shift, turn @ (0.0, 0.0, 1.0))
    here, there = GROUND.seen_from(pose), plane.seen_from(moved(pose, turn, shift))
    assert there.height == pytest.approx(here.height, abs=1e-9)
    np.testing.assert_allclose(there.rotation[2], here.rotation[2], atol=1e-9)


@given(seeds, reals(0.1, 3.0))
def test_a_point_that_is_seen_on_a_plane_lies_where_its_ray_meets_the_plane(seed, height):
    random = np.random.default_rng(seed)
    plane = Plane("any", tuple(random_direction(random)), random.uniform(-2.0, 2.0))
    pose = random_pose(random)
    lift = height - (np.dot(plane.normal, pose.position) - plane.offset)
    pose = Pose(pose.rotation, pose.position + lift * np.array(plane.normal))
    orientation = plane.seen_from(pose)
    ray = random_direction(random)
    in_plane = orientation.rotation @ ray
    if in_plane[2] > -1e-3:
        ray, in_plane = -ray, -in_plane
    if in_plane[2] > -1e-3:
        return
    hit = in_plane * (orientation.height / -in_plane[2]) + (0.0, 0.0, orientation.height)
    world = plane.to_world(hit[None], pose)[0]
    assert np.dot(plane.normal, world) == pytest.approx(plane.offset, abs=1e-6)
    away = world - pose.position
    np.testing.assert_allclose(away / np.linalg.norm(away), pose.rotation @ ray, atol=1e-6)


@given(seeds)
def test_a_spotlight_has_its_target_straight_below_the_camera(seed):
    random = np.random.default_rng(seed)
    target, pose = random.uniform(-2.0, 2.0, 3), random_pose(random)
    away = float(np.linalg.norm(pose.position - target))
    plane = Plane.spotlight("target", target, pose.position)
    orientation = plane.seen_from(pose)
    assert orientation.height == pytest.approx(away)
    np.testing.assert_allclose(
        orientation.rotation.T @ (0.0, 0.0, -1.0) * away, pose.rotation.T @ (target - pose.position), atol=1e-9
    )
    np.testing.assert_allclose(plane.to_world(np.zeros((1, 3)), pose)[0], target, atol=1e-9)


def test_a_normal_of_any_length_is_the_same_plane():
    assert Plane("table", (0.0, 0.0, 2.0), 1.5) == Plane("table", (0.0, 0.0, 1.0), 0.75)


@pytest.mark.parametrize("normal", [(0.0, 0.0, 0.0), (math.nan, 0.0, 1.0), (0.0, 1.0), "up"])
def test_a_normal_without_direction_is_refused(normal):
    with pytest.raises(GeometryError, match="'table'"):
        Plane("table", normal)


@pytest.mark.parametrize("offset", [(), (1.0, 2.0), None, math.inf])
def test_an_offset_that_is_not_one_number_is_refused(offset):
    with pytest.raises(GeometryError, match=r"'table' needs a normal and an offset \[m\], not "):
        Plane("table", offset=offset)


def test_a_camera_behind_a_plane_is_told_so():
    pose = Pose(np.eye(3), (0.0, 0.0, 0.5))
    with pytest.raises(GeometryError, match=r"0.25 m behind plane 'table'"):
        Plane("table", offset=0.75).seen_from(pose)


@pytest.mark.parametrize("hwc", [np.eye(3), [[1, 2], [3]], np.full((4, 4), math.nan), np.diag([1.0, 1.0, -1.0, 1.0])])
def test_a_pose_that_is_none_is_refused(hwc):
    with pytest.raises(GeometryError):
        Pose.from_hwc(hwc)
