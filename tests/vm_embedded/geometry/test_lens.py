import math

import numpy as np
import pytest
from hypothesis import assume, example, given
from hypothesis import strategies as st

from vm_embedded.errors import InputError
from vm_embedded.geometry.lens import (
    PROJECTIONS,
    Equidistant,
    Equisolid,
    Rectilinear,
    distort,
    distort_series,
    monotone_radius,
    projection_named,
    undistort,
)

from ..strategies import RADIUS, SIZE, distortions, lenses, radial_lenses, rays_at, rays_within, reals, seeds

strong = distortions(strength=1.5)
MUSTACHE = (1e-6, -1e-12)
"""A distortion that pulls inwards first and turns after."""


def turning_point(distortion):
    """Where undistort stops growing, or a radius far outside of a picture."""
    return min(monotone_radius(distortion), 3.0 * RADIUS)


@given(strong, reals(0.0, 1.0))
@example(MUSTACHE, 0.995)
@example(MUSTACHE, 1.0)
def test_distort_is_the_inverse_of_undistort(distortion, fraction):
    """Held against the undistorted radius, which is well-conditioned up to the turning point."""
    undistorted = undistort(fraction * turning_point(distortion), distortion)
    found = distort(np.array([undistorted]), distortion)
    assert undistort(found, distortion)[0] == pytest.approx(undistorted, abs=1e-6)
    assert 0.0 <= found[0] <= monotone_radius(distortion)


@given(strong, reals(0.0, 0.95))
@example(MUSTACHE, 0.9)
def test_distort_finds_the_radius_that_undistort_came_from(distortion, fraction):
    distorted = fraction * turning_point(distortion)
    slope = undistort(distorted + 0.5, distortion) - undistort(distorted - 0.5, distortion)
    assume(slope > 1e-2)
    assert distort(np.array([undistort(distorted, distortion)]), distortion)[0] == pytest.approx(distorted, abs=1e-5)


@given(strong, seeds)
def test_distort_of_many_is_that_of_each(distortion, seed):
    radii = undistort(np.random.default_rng(seed).random(9) * turning_point(distortion), distortion)
    together = distort(radii, distortion)
    np.testing.assert_allclose(together, [distort(radii[i : i + 1], distortion)[0] for i in range(9)], atol=1e-6)


def test_undistort_follows_the_conventions():
    assert undistort(100.0, (2e-6, 3e-11)) == pytest.approx(100.0 * (1.0 + 2e-6 * 1e4 + 3e-11 * 1e8), rel=1e-14)


@given(strong)
def test_monotone_radius_is_where_undistort_stops_growing(distortion):
    turning = monotone_radius(distortion)
    inside = undistort(np.linspace(0.0, min(turning, 1e5), 2000), distortion)
    assert (np.diff(inside) >= 0).all()
    if math.isfinite(turning):
        beyond = undistort(turning * np.array([1.0, 1.001, 1.01]), distortion)
        assert (np.diff(beyond) < 0).all()


@pytest.mark.parametrize("distortion", [(0.0, 0.0), (1e-6, 0.0), (0.0, 1e-12), (1e-6, 1e-12), (-1e-6, 1e-11)])
def test_a_distortion_that_never_folds_has_no_turning_point(distortion):
    assert monotone_radius(distortion) == math.inf


@given(distortions(strength=0.02), reals(0.0, RADIUS))
def test_the_series_is_close_for_mild_distortion(distortion, undistorted):
    exact = distort(np.array([undistorted]), distortion)[0]
    assert distort_series(undistorted, distortion) == pytest.approx(exact, abs=0.2)


@given(distortions(strength=1.0), reals(0.05, 1.0))
def test_the_series_converges_with_the_tenth_power_of_the_distortion(distortion, share):
    """The first term left out is of fifth order in r^2, so halving the radius leaves 2^-11 of the error, or so."""
    radius = 0.3 * RADIUS * share
    errors = [abs(distort_series(r, distortion) - distort(np.array([r]), distortion)[0]) for r in (radius, radius / 2)]
    assert errors[1] <= errors[0] / 2.0**9 + 1e-9


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


@given(lenses(), seeds)
def test_unproject_undoes_project(lens, seed):
    rays = rays_within(0.97 * lens.limit, 40, np.random.default_rng(seed))
    assert lens.sees(rays).all()
    np.testing.assert_allclose(lens.unproject(lens.project(rays, SIZE), SIZE), rays, atol=1e-6)


@given(lenses(), seeds)
def test_project_undoes_unproject(lens, seed):
    pixels = np.random.default_rng(seed).random((60, 2)) * SIZE
    rays = lens.unproject(pixels, SIZE)
    reached = np.isfinite(rays).all(axis=1)
    assert (np.isfinite(rays).any(axis=1) == reached).all()
    rays, pixels = rays[reached], pixels[reached]
    np.testing.assert_allclose(np.linalg.norm(rays, axis=1), 1.0, atol=1e-9)
    seen = rays[:, 0] > math.cos(0.97 * lens.limit)
    np.testing.assert_allclose(lens.project(rays[seen], SIZE), pixels[seen], atol=1e-5)


@given(lenses(), seeds)
@example(Rectilinear(focal_length=127.0, fov=1.0, distortion=(3.125e-6, 0.0)), 0)
def test_the_pixel_of_a_ray_does_not_depend_on_the_other_rays(lens, seed):
    """To the last digit: else what is prepared for a frame would change its answers."""
    random = np.random.default_rng(seed)
    rays = rays_within(lens.limit, 300, random)
    rays = np.asfortranarray(rays[np.argsort(-rays[:, 0])])  # from the axis outwards
    together = lens.project(rays, SIZE)
    for some in (slice(0, 150), slice(100, 110), slice(50, 51), random.permutation(300)[:70]):
        np.testing.assert_array_equal(lens.project(np.asfortranarray(rays[some]), SIZE), together[some])


@given(lenses())
def test_pixels_without_a_ray_are_beyond_what_the_lens_sees(lens):
    steps = np.stack(np.meshgrid(np.arange(0.0, SIZE[0], 16), np.arange(0.0, SIZE[1], 16)), axis=2).reshape(-1, 2)
    unreached = steps[np.isnan(lens.unproject(steps, SIZE)).any(axis=1)]
    around = np.linspace(0.0, 2.0 * np.pi, 720, endpoint=False)
    middle = lens.project(np.array([[1.0, 0.0, 0.0]]), SIZE)[0]
    rim = lens.project(rays_at(0.999 * lens.limit, around), SIZE) - middle
    # The rim is round, or nearly: no pixel without a ray lies clearly inside of it.
    assert (np.linalg.norm(unreached - middle, axis=1) > 0.99 * np.linalg.norm(rim, axis=1).min() - 1.0).all()


@given(lenses())
def test_the_optical_axis_is_a_pixel_like_any_other(lens):
    axis = np.array([[1.0, 0.0, 0.0]])
    pixel = lens.project(axis, SIZE)
    nearby = lens.project(rays_at(1e-7, np.array([0.3])), SIZE)
    np.testing.assert_allclose(pixel, nearby, atol=1e-3)
    np.testing.assert_allclose(lens.unproject(pixel, SIZE), axis, atol=1e-9)


@given(lenses(strength=0.2), seeds)
def test_left_in_space_is_left_in_the_picture_and_up_is_up(lens, seed):
    theta = 0.5 * min(lens.limit, 1.0) * (0.1 + 0.9 * np.random.default_rng(seed).random(5))
    left, up = (lens.project(rays_at(theta, around), SIZE) for around in (0.0, np.pi / 2))
    middle = lens.project(np.array([[1.0, 0.0, 0.0]]), SIZE)[0]
    assert (left[:, 0] < middle[0]).all()
    assert (up[:, 1] < middle[1]).all()


@given(lenses(), seeds)
def test_a_lens_sees_what_is_within_half_its_fov_and_its_limit(lens, seed):
    assert 0.0 < lens.limit <= lens.fov / 2.0
    random = np.random.default_rng(seed)
    assert lens.sees(rays_within(0.999 * lens.limit, 50, random)).all()
    beyond = 1.001 * lens.limit
    assume(beyond < math.pi)
    assert not lens.sees(rays_at(np.linspace(beyond, math.pi, 50), 2.0 * np.pi * random.random(50))).any()


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
def test_a_lens_for_its_own_size_or_for_any_is_used_as_it_is(kind):
    for size in (None, SIZE):
        lens = kind(focal_length=300.0, fov=2.0, size=size)
        assert lens.for_image(SIZE) is lens


@pytest.mark.parametrize("kind", PROJECTIONS.values())
def test_a_lens_is_scaled_to_an_image_of_the_same_proportions(kind):
    lens = kind(focal_length=300.0, fov=2.0, center=(4.0, -8.0), distortion=(1e-7, 0.0), size=SIZE)
    assert lens.for_image((320, 240)) == lens.scaled(0.5, (320, 240))
    assert lens.for_image((320, 240)).focal_length == 150.0
    assert lens.for_image((320, 241)).size == (320, 241)  # one pixel off is rounding


@pytest.mark.parametrize("size", [(640, 400), (480, 640), (320, 242), (1280, 720)])
def test_an_image_of_other_proportions_is_refused(size):
    lens = Rectilinear(focal_length=300.0, fov=2.0, size=SIZE)
    with pytest.raises(InputError, match=rf"640 x 480.*{size[0]} x {size[1]}"):
        lens.for_image(size)


@given(lenses())
def test_equal_lenses_are_one_key_of_a_table(lens):
    twin = lens.scaled(1.0, SIZE)
    assert twin == lens.scaled(1.0, SIZE)
    assert hash(twin) == hash(lens.scaled(1.0, SIZE))
    assert twin != lens.scaled(1.5, SIZE)


GOOD = {"focal_length": 300.0, "fov": 2.0}


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
