import math

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from vm_embedded.detection.projection import may_be_on_screen, project, to_camera
from vm_embedded.geometry.calibrated_lenses import BrownLens, FisheyeLens
from vm_embedded.geometry.lens_files import read_lens_file
from vm_embedded.geometry.orientation import Orientation
from vm_embedded.geometry.radial_lenses import Equidistant, Equisolid, Rectilinear
from vm_embedded.geometry.shapes import Sphere
from vm_embedded.mesh.models import build_mesh

from ..strategies import (
    SIZE,
    distortions,
    lenses,
    orientations,
    random_direction,
    reals,
    rotation,
    scattered_mesh,
    seeds,
)

sizes = st.sampled_from([SIZE, (480, 640), (160, 120), (101, 37)])


def on_screen(rays, turn, lens, size):
    """Which rays (n, 3) a camera turned by `turn` (3, 3) shows, by the words of the conventions."""
    camera = rays @ turn
    x, y = lens.project(camera, size).T
    with np.errstate(invalid="ignore"):
        return lens.sees(camera) & (x >= 0) & (x + 1 < size[0]) & (y >= 0) & (y + 1 < size[1])


@given(orientations(), seeds)
def test_to_camera_is_the_transposed_rotation(orientation, seed):
    rays = scattered_mesh(20, np.random.default_rng(seed)).rays
    expected = [orientation.rotation.T @ ray for ray in rays]
    np.testing.assert_allclose(to_camera(rays, orientation.rotation), expected, atol=1e-15)


@given(orientations(), seeds)
def test_the_digits_of_a_ray_do_not_depend_on_the_others(orientation, seed):
    random = np.random.default_rng(seed)
    rays = scattered_mesh(200, random).rays
    some = random.permutation(200)[:37]
    together = to_camera(rays, orientation.rotation)
    np.testing.assert_array_equal(to_camera(rays[some], orientation.rotation), together[some])


@given(lenses(), orientations(), sizes, seeds)
def test_points_on_screen_are_those_of_the_conventions(lens, orientation, size, seed):
    mesh = scattered_mesh(2000, np.random.default_rng(seed))
    shown = on_screen(mesh.rays, orientation.rotation, lens, size)
    projected = project(mesh, orientation.rotation, lens, size)
    assert projected.graph is mesh
    assert len(projected) == len(projected.pixels) == len(mesh)
    np.testing.assert_array_equal(projected.on_screen, shown)
    visible = projected.visible
    np.testing.assert_array_equal(visible.graph.rays, mesh.rays[shown])
    np.testing.assert_array_equal(visible.pixels, projected.pixels[shown])
    np.testing.assert_allclose(
        visible.pixels, lens.project(mesh.rays[shown] @ orientation.rotation, size), rtol=1e-9, atol=1e-3
    )
    assert len(visible) == shown.sum() == len(visible.pixels) == visible.on_screen.sum()


@given(lenses(), orientations(), seeds)
def test_only_some_points_are_those_that_are_on_screen_too(lens, orientation, seed):
    random = np.random.default_rng(seed)
    projected = project(scattered_mesh(1000, random), orientation.rotation, lens, SIZE)
    chosen = random.random(1000) < 0.5
    some = projected.only(chosen)
    np.testing.assert_array_equal(some.on_screen, projected.on_screen & chosen)
    np.testing.assert_array_equal(some.pixels, projected.pixels)
    assert some.graph is projected.graph


@given(lenses(), orientations(0.3, 1.5), sizes)
def test_projected_points_keep_their_links_on_screen(lens, orientation, size):
    mesh = build_mesh(Sphere(0.1), orientation.height, 2.0, 3.0)
    visible = project(mesh, orientation.rotation, lens, size).visible
    kept = np.flatnonzero(on_screen(mesh.rays, orientation.rotation, lens, size))
    np.testing.assert_array_equal(visible.graph.neighbors, mesh.part(kept).neighbors)


@given(lenses(), orientations(), seeds)
def test_all_four_pixels_around_a_point_are_in_the_picture(lens, orientation, seed):
    mesh = scattered_mesh(1000, np.random.default_rng(seed))
    corner = project(mesh, orientation.rotation, lens, SIZE).visible.pixels.astype(int)
    assert (corner >= 0).all()
    assert (corner + 1 < SIZE).all()


@given(lenses(strength=0.2), orientations(), reals(-math.pi, math.pi))
def test_turning_camera_and_mesh_together_changes_no_pixel(lens, orientation, yaw):
    mesh = build_mesh(Sphere(0.1), 1.0, 1.0, 2.0)
    turn = rotation([0.0, 0.0, yaw])
    turned = project(
        type(mesh)(np.asfortranarray(mesh.rays @ turn.T), mesh.neighbors), turn @ orientation.rotation, lens, SIZE
    ).visible
    plain = project(mesh, orientation.rotation, lens, SIZE).visible
    if len(turned) == len(plain):  # noise may decide on a point at the very border
        np.testing.assert_allclose(turned.pixels, plain.pixels, atol=1e-3)
    assert abs(len(turned) - len(plain)) <= 2


def turned_by(turn, slack, random):
    """A rotation that differs by up to `slack` [rad], mostly by nearly all of it."""
    angle = slack * (1.0 - random.random() ** 4)
    return turn @ rotation(angle * random_direction(random))


WIDE = {"optical_center": (320.0, 240.0), "focal_lengths": (100.0, 100.0)}
ALL_AROUND = [
    Equisolid(focal_length=100.0, fov=2.0 * math.pi),
    Equidistant(focal_length=60.0, fov=2.0 * math.pi),
    FisheyeLens(**WIDE, fov=2.0 * math.pi),
]
"""Their whole circle is inside of the picture, so they see everything there is."""

slacks = reals(1e-3, 0.6)


def assert_none_is_dropped(lens, orientation, size, slack, seed):
    random = np.random.default_rng(seed)
    mesh = scattered_mesh(2000, random)
    possible = may_be_on_screen(mesh, orientation.rotation, lens, size, slack)
    for _ in range(10):
        turn = turned_by(orientation.rotation, slack, random)
        dropped = on_screen(mesh.rays, turn, lens, size) & ~possible
        assert not dropped.any(), f"{dropped.sum()} points that can be on screen were left out"


LEVEL = Orientation.from_roll_pitch(1.0)


@given(lenses(), orientations(), sizes, slacks, seeds)
@example(ALL_AROUND[0], LEVEL, SIZE, 0.05, 0)
@example(ALL_AROUND[1], LEVEL, SIZE, 0.05, 0)
@example(ALL_AROUND[2], LEVEL, SIZE, 0.05, 0)
def test_no_point_that_a_turn_can_bring_on_screen_is_dropped(lens, orientation, size, slack, seed):
    assert_none_is_dropped(lens, orientation, size, slack, seed)


@given(
    st.sampled_from([Rectilinear, Equisolid, Equidistant]), distortions(strength=1.5), reals(0.5, 2.5), slacks, seeds
)
def test_no_point_is_dropped_by_a_lens_of_strong_distortion(kind, distortion, fov, slack, seed):
    lens = kind(focal_length=300.0, fov=fov, distortion=distortion)
    assert_none_is_dropped(lens, LEVEL, SIZE, slack, seed)


@given(reals(-0.5, -0.05), slacks, seeds)
def test_no_point_is_dropped_by_a_lens_that_turns_inside_of_the_picture(k1, slack, seed):
    matrix = {"focal_lengths": (300.0, 300.0), "optical_center": (320.0, 240.0)}
    assert_none_is_dropped(BrownLens(**matrix, coefficients=(k1, 0.0, 0.0, 0.0), fov=2.5), LEVEL, SIZE, slack, seed)


@given(lenses(), orientations(), slacks, slacks, seeds)
def test_more_slack_never_keeps_fewer_points(lens, orientation, first, second, seed):
    mesh = scattered_mesh(1000, np.random.default_rng(seed))
    less, more = (may_be_on_screen(mesh, orientation.rotation, lens, SIZE, slack) for slack in sorted((first, second)))
    assert not (less & ~more).any()


@pytest.mark.parametrize(
    "lens",
    [
        Rectilinear(focal_length=500.0, fov=2.0),
        Equisolid(focal_length=400.0, fov=2.5, distortion=(1e-7, 0.0)),
        Equidistant(focal_length=400.0, fov=2.5),
        FisheyeLens(focal_lengths=(400.0, 400.0), optical_center=(320.0, 240.0), fov=2.5),
        BrownLens(focal_lengths=(500.0, 500.0), optical_center=(320.0, 240.0), fov=2.5),
    ],
    ids=lambda lens: type(lens).__name__,
)
def test_a_small_slack_keeps_little_more_than_is_on_screen(lens):
    mesh = scattered_mesh(50_000, np.random.default_rng(5))
    shown = on_screen(mesh.rays, np.eye(3), lens, SIZE)
    kept = may_be_on_screen(mesh, np.eye(3), lens, SIZE, 0.02)
    assert shown.sum() <= kept.sum() < 1.4 * shown.sum()


def test_a_camera_that_looks_at_the_sky_has_no_points():
    mesh = build_mesh(Sphere(0.1), 0.8, 4.0, 5.0)
    lens = Rectilinear(focal_length=600.0, fov=1.2)
    projected = project(mesh, Orientation.from_roll_pitch(0.8, pitch=-1.2).rotation, lens, SIZE)
    assert not projected.on_screen.any()
    visible = projected.visible
    assert len(visible) == 0
    assert visible.pixels.shape == (0, 2)
    np.testing.assert_array_equal(visible.graph.neighbors, np.zeros((1, 6)))


@pytest.mark.parametrize("index", [0, 1, 5, 10])
def test_the_reference_s_own_cameras_see_the_reference_s_own_points(shared, index):
    file = read_lens_file(shared / f"reference/images/lens{index:07d}.yaml")
    golden = np.load(shared / f"reference/golden/golden{index:07d}.npz")
    rays = golden["rays"].astype(np.float64)
    camera = to_camera(rays, file.orientation.rotation)
    np.testing.assert_allclose(file.lens.project(camera, (1280, 1024)), golden["pixels"], atol=1e-2)
