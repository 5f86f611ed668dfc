import math

import numpy as np
import pytest
from hypothesis import assume, example, given
from hypothesis import strategies as st

from vm_embedded.errors import InputError
from vm_embedded.geometry.radial_lenses import (
    PROJECTIONS,
    Equidistant,
    Equisolid,
    Rectilinear,
    monotone_radius,
    projection_named,
    undistort,
)

from ..strategies import RADIUS, SIZE, radial_lenses, rays_at, rays_within, reals, seeds

GOOD = {"focal_length": 300.0, "fov": 2.0}


@given(radial_lenses(), reals(0.001, 0.98), reals(-math.pi, math.pi))
def test_pixels_follow_the_conventions(lens, share, around):
    """One ray at a time, by the formulas as they are written down."""
    theta = share * lens.limit
    x, y, z = rays_at(theta, around)
    f = lens.focal_length
    undistorted = {
        Rectilinear: f * math.tan(theta),
        Equisolid: 2.0 * f * math.sin(theta / 2.0),
        Equidistant: f * theta,
    }[type(lens)]
    low, high = 0.0, min(monotone_radius(lens.distortion), 1e6)
    for _ in range(200):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if undistort(middle, lens.distortion) < undistorted else (low, middle)
    expected = [
        SIZE[0] / 2 - low * y / math.sqrt(1.0 - x * x) - lens.center[0],
        SIZE[1] / 2 - low * z / math.sqrt(1.0 - x * x) - lens.center[1],
    ]
    assert lens.sees(np.array([[x, y, z]])).all()
    np.testing.assert_allclose(lens.project(np.array([[x, y, z]]), SIZE)[0], expected, rtol=1e-6, atol=1e-4)


@pytest.mark.parametrize("kind", PROJECTIONS.values())
def test_a_lens_without_distortion_is_limited_by_its_fov_alone(kind):
    assert kind(focal_length=300.0, fov=2.5).limit == 1.25


@given(radial_lenses(strength=3.0), reals(-math.pi, math.pi))
@example(Equisolid(focal_length=269.0, fov=3.0, distortion=(6.25e-6, -3.90625e-11)), 0.0)
def test_a_strongly_distorted_lens_never_folds(lens, around):
    """Whatever the lens sees, farther from the axis is farther out in the picture."""
    near_limit = lens.limit * (1.0 - np.geomspace(1e-6, 1e-2, 200))
    theta = np.unique(np.concatenate([np.linspace(0.0, math.pi, 1001), near_limit]))
    rays = rays_at(theta, around)
    seen = lens.sees(rays)
    assert (np.diff(seen.astype(int)) <= 0).all()
    middle = np.array(SIZE) / 2.0 - lens.center
    radius = np.linalg.norm(lens.project(rays, SIZE)[seen] - middle, axis=1)
    assert (np.diff(radius) > 0).all()


@given(radial_lenses(), reals(0.05, 0.6))
def test_a_lens_sees_nothing_beyond_its_turning_point(lens, barrel):
    distortion = (-barrel / RADIUS**2, 0.0)
    lens = type(lens)(focal_length=lens.focal_length, fov=lens.fov, distortion=distortion)
    turning = float(lens.angle(undistort(monotone_radius(distortion), distortion)))
    if math.isnan(turning) or turning > lens.fov / 2.0:
        turning = lens.fov / 2.0
    assert lens.limit == pytest.approx(turning, rel=1e-12)
    beyond = np.array([turning * 1.0001])
    assume(beyond[0] < math.pi)
    assert not lens.sees(rays_at(beyond, 0.0)).any()


@given(radial_lenses(strength=0.3), reals(0.2, 4.0), seeds)
def test_a_scaled_radial_lens_scales_pixels(lens, factor, seed):
    size = (round(SIZE[0] * factor), round(SIZE[1] * factor))
    rays = rays_within(0.95 * lens.limit, 20, np.random.default_rng(seed))
    scaled = lens.scaled(factor, size)
    assert scaled.size == size
    assert scaled.limit == pytest.approx(lens.limit, rel=1e-9)
    middle, scaled_middle = (np.array(each) / 2.0 for each in (SIZE, size))
    expected = factor * (lens.project(rays, SIZE) - middle)
    np.testing.assert_allclose(scaled.project(rays, size) - scaled_middle, expected, rtol=1e-6, atol=1e-4)


@given(radial_lenses(strength=0.3))
def test_scaling_back_gives_the_lens_itself(lens):
    there = lens.scaled(2.0, (2 * SIZE[0], 2 * SIZE[1]))
    assert there.scaled(0.5, SIZE).scaled(2.0, there.size) == there


@pytest.mark.parametrize("kind", PROJECTIONS.values())
@pytest.mark.parametrize(
    ("wrong", "names"),
    [
        ({"fov": 0.0}, "fov"),
        ({"fov": -1.0}, "fov"),
        ({"fov": 6.3}, "fov"),
        ({"fov": math.nan}, "fov"),
        ({"focal_length": 0.0}, "focal length"),
        ({"focal_length": -5.0}, "focal length"),
        ({"focal_length": math.inf}, "focal length"),
        ({"center": (math.nan, 0.0)}, "center"),
        ({"distortion": (0.0, math.inf)}, "distortion"),
        ({"size": (1, 480)}, "size"),
    ],
)
def test_a_wrong_value_is_refused_by_name(kind, wrong, names):
    with pytest.raises(InputError, match=names):
        kind(**(GOOD | wrong))


def test_a_rectilinear_lens_covers_less_than_half_a_turn():
    with pytest.raises(InputError, match="rectilinear"):
        Rectilinear(focal_length=300.0, fov=math.pi)


@given(st.sampled_from(sorted(PROJECTIONS)), st.booleans())
def test_a_projection_is_found_in_either_case(name, upper):
    assert projection_named(name.upper() if upper else name) is PROJECTIONS[name]


def test_an_unknown_projection_names_the_nearest():
    with pytest.raises(InputError, match=r"'equisold'.*'equisolid'"):
        projection_named("equisold")
