import math

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from benchmarks.mesh_pictures import PAPER_CAMERA, EarlySphere
from vm_embedded.errors import GeometryError, InputError
from vm_embedded.geometry.orientation import Orientation
from vm_embedded.geometry.radial_lenses import Equisolid
from vm_embedded.geometry.shapes import Sphere
from vm_embedded.mesh.models import build_mesh
from vm_train.evaluation.points_on_ball import BEARINGS, PosedCamera, centers, points_on_ball, rings_across
from vm_train.evaluation.points_on_ball_plot import points_figure, points_over_distance
from vm_workstation.plots import new_figure, save_figure

from ...vm_embedded.strategies import reals

heights, radii, intersections = reals(0.4, 1.8), reals(0.05, 0.15), st.integers(2, 6)
FULL = math.pi / 4.0
"""Of k x k points, the part that a round object covers."""

PAPER_BALL = Sphere(0.075)
"""The ball of the pictures of the paper's authors."""

SMALL = PosedCamera(
    Orientation.from_roll_pitch(0.9, pitch=math.radians(45.0)),
    Equisolid(focal_length=105.0, fov=2.6, size=(320, 256)),
    (320, 256),
)


@pytest.fixture(scope="module")
def curves():
    """Of the paper's camera, by mesh and k."""
    distances = np.array([0.0, 0.025, 0.05, 0.5, 1.0, 2.5, 5.0, 10.0])
    found = points_over_distance(PAPER_CAMERA, PAPER_BALL, (3, 4, 5), distances)
    return {(curve.mesh, curve.intersections): curve for curve in found}


@given(radii, heights, reals(0.0, 10.0), st.integers(0, 2**32 - 1))
def test_a_ray_hits_a_ball_if_it_comes_nearer_to_its_center_than_its_radius(radius, height, distance, seed):
    ball, bearings = Sphere(radius), BEARINGS[:5]
    random = np.random.default_rng(seed)
    middle = centers(ball, height, distance, bearings)
    rays = middle[random.integers(0, 5, 300)] + 2.0 * radius * random.normal(size=(300, 3))
    rays = np.append(rays / np.linalg.norm(rays, axis=1, keepdims=True), [[np.nan] * 3], axis=0)
    along = rays @ middle.T
    apart = np.linalg.norm(along[:, :, None] * rays[:, None] - middle, axis=2)
    assume((np.abs(apart[:-1] - radius) > 1e-6).all())
    expected = ((apart < radius) & (along > 0.0)).sum(axis=0)
    np.testing.assert_array_equal(points_on_ball(rays, ball, height, distance, bearings), expected)


@given(radii, heights, intersections, reals(0.0, 8.0))
def test_as_many_rings_cross_a_ball_as_wanted_within_one_at_every_distance(radius, height, k, distance):
    ball = Sphere(radius)
    mesh = build_mesh(ball, height, k, 10.0 + 30.0 * radius / (height - 2.0 * radius) * 10.0)
    assert abs(rings_across(mesh, ball, height, distance) - k) <= 1


@given(radii, heights, st.integers(3, 6), reals(0.5, 5.0))
def test_the_visual_mesh_has_about_the_same_number_of_points_on_a_ball_at_every_distance(radius, height, k, distance):
    ball = Sphere(radius)
    mesh = build_mesh(ball, height, k, 5.0 * height / (height - 2.0 * radius) + 1.0)
    counts = points_on_ball(mesh.rays, ball, height, distance)
    assert FULL * (k - 1) ** 2 - 1 <= counts.min()
    assert counts.max() <= FULL * (k + 1) ** 2 + 1
    assert counts.mean() == pytest.approx(FULL * k * k, rel=0.25)


@given(reals(0.05, 0.12), reals(0.7, 1.8), st.integers(3, 6))
def test_below_the_camera_early_widths_give_about_twice_the_points_and_ours_no_more(radius, height, k):
    """Near the camera's foot, over balls that lie up to half a radius from it, which all hide it."""
    ball = Sphere(radius)

    def mean(shape):
        rays = build_mesh(shape, height, k, 1.5).rays
        places = radius * np.linspace(0.0, 0.5, 11)
        return np.mean([points_on_ball(rays, ball, height, place).mean() for place in places.tolist()])

    assert 1.5 < mean(EarlySphere(radius)) / (FULL * k * k) < 3.0
    assert 0.7 < mean(ball) / (FULL * k * k) < 1.15


@pytest.mark.parametrize("k", [3, 4, 5])
def test_with_as_many_points_on_screen_the_hexagonal_mesh_falls_where_the_visual_mesh_is_constant(curves, k):
    ours, hexagonal = curves["visual", k], curves["hexagonal", k]
    assert hexagonal.count == pytest.approx(ours.count, rel=0.01)
    assert (np.diff(hexagonal.mean[3:]) < 0.0).all()
    assert hexagonal.mean[3] > 50.0 * hexagonal.mean[-1]
    assert ours.mean[3:].max() < 1.3 * ours.mean[3:].min()
    assert (np.abs(ours.rings - k) <= 1.0).all()
    assert (np.diff(hexagonal.rings[3:]) < 0.0).all()


def test_the_two_meshes_have_equally_many_points_on_a_ball_where_they_are_made_to():
    distances = np.linspace(2.25, 2.75, 11)
    ours, hexagonal = points_over_distance(PAPER_CAMERA, PAPER_BALL, (4,), distances, equal_at=2.5)
    assert hexagonal.mean.mean() == pytest.approx(ours.mean.mean(), rel=0.03)


def test_a_ball_that_the_picture_cuts_or_lacks_is_not_counted():
    ahead = PosedCamera(Orientation.from_roll_pitch(0.9), Equisolid(focal_length=200.0, fov=1.2), (320, 256))
    ours, _ = points_over_distance(ahead, PAPER_BALL, (3,), np.array([0.0, 0.3, 4.0]))
    assert np.isnan(ours.mean[:2]).all()
    assert np.isnan(ours.rings[:2]).all()
    assert ours.mean[2] > 5.0
    with pytest.raises(InputError, match="no complete ball at"):
        points_over_distance(ahead, PAPER_BALL, (3,), np.array([4.0]), equal_at=0.3)


def test_a_camera_that_is_too_low_or_shows_no_mesh_is_refused():
    low = PosedCamera(Orientation.from_roll_pitch(0.1, pitch=0.5), SMALL.lens, SMALL.size)
    with pytest.raises(GeometryError, match="diameter"):
        points_over_distance(low, PAPER_BALL, (3,), np.array([1.0]))
    up = PosedCamera(Orientation.from_roll_pitch(0.9, pitch=-1.5), Equisolid(focal_length=200.0, fov=1.2), SMALL.size)
    with pytest.raises(InputError, match="sees no point"):
        points_over_distance(up, PAPER_BALL, (3,), np.array([1.0]))


@pytest.mark.parametrize("suffix", [".png", ".svg"])
def test_the_same_curves_give_the_same_plot(tmp_path, suffix):
    pytest.importorskip("matplotlib")
    curves = points_over_distance(SMALL, PAPER_BALL, (3,), np.linspace(0.0, 10.0, 5))
    one, other = tmp_path / f"one{suffix}", tmp_path / f"other{suffix}"
    for path in (one, other):
        save_figure(points_figure(curves, "a title"), path)
    assert one.read_bytes() == other.read_bytes()
    assert sorted(path.name for path in tmp_path.iterdir()) == sorted([one.name, other.name])


def test_a_plot_of_another_kind_is_refused(tmp_path):
    with pytest.raises(InputError, match=r"\.png or \.svg"):
        save_figure(new_figure(1.0, 1.0), tmp_path / "plot.txt")
