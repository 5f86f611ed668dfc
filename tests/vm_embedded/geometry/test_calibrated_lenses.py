import math

import cv2
import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from vm_embedded.errors import InputError
from vm_embedded.geometry.calibrated_lenses import BrownLens, FisheyeLens
from vm_embedded.geometry.orientation import OPTICAL_TO_CAMERA

from ..strategies import SIZE, brown_lenses, fisheye_lenses, rays_at, rays_within, reals, seeds

MATRIX = {"focal_lengths": (500.0, 505.0), "optical_center": (315.0, 244.0)}
NO_TURN = np.zeros(3)


def camera_matrix(lens):
    (fx, fy), (cx, cy) = lens.focal_lengths, lens.optical_center
    return np.array([[fx, 0.0, cx], [0.0, fy, cy], [0.0, 0.0, 1.0]])


def opencv_points(rays):
    """Rays (n, 3) of the camera frame as points in OpenCV's optical frame, 3 m away."""
    return 3.0 * (rays @ OPTICAL_TO_CAMERA)[:, None]


@given(brown_lenses(), seeds)
def test_brown_lens_projects_as_opencv(lens, seed):
    rays = rays_within(lens.limit, 30, np.random.default_rng(seed))
    coefficients = np.array(lens.coefficients) if lens.coefficients else None
    expected, _ = cv2.projectPoints(opencv_points(rays), NO_TURN, NO_TURN, camera_matrix(lens), coefficients)
    np.testing.assert_allclose(lens.project(rays, SIZE), expected[:, 0], rtol=1e-9, atol=1e-6)


@given(fisheye_lenses(), seeds)
def test_fisheye_lens_projects_as_opencv(lens, seed):
    # OpenCV's own is for points in front of the camera only.
    rays = rays_within(min(lens.limit, 1.5), 30, np.random.default_rng(seed))
    coefficients = np.array(lens.coefficients or (0.0,) * 4)
    expected, _ = cv2.fisheye.projectPoints(opencv_points(rays), NO_TURN, NO_TURN, camera_matrix(lens), coefficients)
    np.testing.assert_allclose(lens.project(rays, SIZE), expected[:, 0], rtol=1e-9, atol=1e-6)


@given(fisheye_lenses(), reals(0.0, 1.0), reals(-math.pi, math.pi))
def test_fisheye_lens_follows_its_polynomial_behind_the_camera_too(lens, share, around):
    theta = share * lens.limit
    k1, k2, k3, k4 = lens.coefficients or (0.0,) * 4
    radius = theta * (1.0 + k1 * theta**2 + k2 * theta**4 + k3 * theta**6 + k4 * theta**8)
    expected = [
        lens.optical_center[0] - lens.focal_lengths[0] * radius * math.cos(around),
        lens.optical_center[1] - lens.focal_lengths[1] * radius * math.sin(around),
    ]
    found = lens.project(rays_at(np.array([theta]), around), SIZE)[0]
    np.testing.assert_allclose(found, expected, rtol=1e-7, atol=1e-5)


def radii(lens, theta, around):
    """Distances from the optical center, in focal lengths."""
    pixels = lens.project(rays_at(theta, around), SIZE)
    return np.linalg.norm((pixels - lens.optical_center) / lens.focal_lengths, axis=1)


@given(st.tuples(reals(-0.6, -0.1), reals(-0.1, 0.0), reals(-1e-4, 1e-4), reals(-1e-4, 1e-4), reals(-0.1, 0.0)))
@example((0.2, -0.3, 0.0, 0.0))
def test_a_strongly_distorted_brown_lens_never_folds(coefficients):
    """Whatever the lens sees, farther from the axis is farther out in the picture."""
    lens = BrownLens(**MATRIX, coefficients=coefficients, fov=math.radians(160.0))
    theta = np.linspace(0.0, 0.499 * math.pi, 20001)
    seen = lens.sees(rays_at(theta, 0.4))
    assert lens.limit < lens.fov / 2.0
    assert 100 < seen.sum() < len(theta)
    assert (np.diff(seen.astype(int)) <= 0).all()
    k1, k2, _, _, k3 = (*coefficients, 0.0)[:5]
    tangent = np.tan(theta[seen])
    assert (np.diff(tangent * (1.0 + k1 * tangent**2 + k2 * tangent**4 + k3 * tangent**6)) > 0).all()


def test_a_barrel_turns_where_its_derivative_is_zero():
    """r + k r^3 grows until r^2 = -1 / (3 k)."""
    lens = BrownLens(**MATRIX, coefficients=(-0.4, 0.0, 0.0, 0.0), fov=math.radians(160.0))
    assert math.tan(lens.limit) == pytest.approx(1.0 / math.sqrt(1.2), abs=3e-3)


@given(st.tuples(reals(-0.4, -0.06), *(reals(-0.01, 0.0),) * 3))
@example((0.05, -0.02, 0.0, 0.0))
def test_a_strongly_distorted_fisheye_never_folds(coefficients):
    lens = FisheyeLens(**MATRIX, coefficients=coefficients, fov=2.0 * math.pi)
    theta = np.linspace(0.0, math.pi, 20001)
    seen = lens.sees(rays_at(theta, 0.4))
    assert lens.limit < math.pi
    assert 100 < seen.sum() < len(theta)
    assert (np.diff(seen.astype(int)) <= 0).all()
    assert (np.diff(radii(lens, theta[seen], 0.4)) > 0).all()


@given(brown_lenses(), reals(0.2, 4.0), seeds)
def test_a_scaled_brown_lens_keeps_the_corner_of_the_picture(lens, factor, seed):
    """Pixel centers are at whole numbers, so a picture's corner is at -0.5."""
    size = (round(SIZE[0] * factor), round(SIZE[1] * factor))
    rays = rays_within(0.95 * lens.limit, 20, np.random.default_rng(seed))
    scaled = lens.scaled(factor, size).project(rays, size)
    np.testing.assert_allclose(scaled + 0.5, factor * (lens.project(rays, SIZE) + 0.5), rtol=1e-9, atol=1e-6)


@given(fisheye_lenses(), seeds)
def test_a_fisheye_lens_is_halved_with_its_picture(lens, seed):
    rays = rays_within(0.95 * lens.limit, 20, np.random.default_rng(seed))
    half = lens.for_image((320, 240))
    assert half.size == (320, 240)
    found = half.project(rays, (320, 240))
    np.testing.assert_allclose(found + 0.5, 0.5 * (lens.project(rays, SIZE) + 0.5), rtol=1e-9, atol=1e-6)


@pytest.mark.parametrize("kind", [BrownLens, FisheyeLens])
def test_an_image_of_other_proportions_is_refused(kind):
    with pytest.raises(InputError, match=r"640 x 480.*640 x 400"):
        kind(**MATRIX, fov=2.0, size=SIZE).for_image((640, 400))


@pytest.mark.parametrize("kind", [BrownLens, FisheyeLens])
def test_without_a_size_the_lens_is_used_as_it_is(kind):
    lens = kind(**MATRIX, fov=2.0)
    assert lens.for_image((123, 45)) is lens


@pytest.mark.parametrize("kind", [BrownLens, FisheyeLens])
@pytest.mark.parametrize(
    ("wrong", "names"),
    [
        ({"fov": math.nan}, "fov"),
        ({"focal_lengths": (500.0, 0.0)}, "focal lengths"),
        ({"focal_lengths": (-1.0, 500.0)}, "focal lengths"),
        ({"focal_lengths": (math.inf, 500.0)}, "finite"),
        ({"optical_center": (math.nan, 240.0)}, "finite"),
        ({"coefficients": (0.1, math.nan, 0.0, 0.0)}, "finite"),
        ({"coefficients": (0.1, 0.2)}, "coefficients"),
        ({"coefficients": (0.1,) * 12}, "coefficients"),
        ({"size": (640, 1)}, "size"),
    ],
)
def test_a_wrong_value_is_refused_by_name(kind, wrong, names):
    with pytest.raises(InputError, match=names):
        kind(**(MATRIX | {"fov": 2.0} | wrong))


def test_a_brown_lens_covers_less_than_half_a_turn():
    with pytest.raises(InputError, match="rectilinear"):
        BrownLens(**MATRIX, fov=math.pi)
