import math

import numpy as np
import pytest
from hypothesis import assume, example, given

from vm_embedded.errors import InputError
from vm_embedded.geometry.calibrated_lenses import BrownLens
from vm_embedded.geometry.radial_lenses import PROJECTIONS, Equidistant, Rectilinear

from ..strategies import SIZE, lenses, rays_at, rays_within, seeds

NEARLY_FLAT = BrownLens(
    fov=2.0,
    size=SIZE,
    focal_lengths=(150.0, 150.0),
    optical_center=(280.0, 200.0),
    coefficients=(-0.3125, 0.0703125, 0.0, 0.001953125, 0.0, 0.0, 0.0625, 0.0),
)
"""Its radial part hardly grows at 1.3 focal lengths, so the tangential part folds it there."""


@given(lenses(), seeds)
@example(NEARLY_FLAT, 0)
@example(NEARLY_FLAT, 249)
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


def test_lenses_take_what_opencv_calibrates():
    matrix = np.array([[420.0, 0.0, 318.0], [0.0, 415.0, 250.0], [0.0, 0.0, 1.0]])
    coefficients = np.array([[-0.2, 0.05, 0.001, -0.0005, 0.0]])  # of the shape that calibrateCamera returns
    given = BrownLens(
        fov=2.0,
        size=np.array([640, 512]),
        focal_lengths=matrix[[0, 1], [0, 1]],
        optical_center=matrix[:2, 2],
        coefficients=coefficients,
    )
    expected = BrownLens(
        fov=2.0,
        size=(640, 512),
        focal_lengths=(420.0, 415.0),
        optical_center=(318.0, 250.0),
        coefficients=(-0.2, 0.05, 0.001, -0.0005, 0.0),
    )
    assert given == expected
    assert hash(given) == hash(expected)  # the detector's cache needs it
    radial = Equidistant(fov=2.0, focal_length=300.0, center=np.array([1.0, 2.0]), distortion=[1e-7, 0.0])
    assert hash(radial) == hash(Equidistant(fov=2.0, focal_length=300.0, center=(1.0, 2.0), distortion=(1e-7, 0.0)))


@pytest.mark.parametrize(
    ("entries", "message"),
    [
        ({"center": 5.0}, "lens center must be 2 finite numbers, not 5.0"),
        ({"center": (1.0, 2.0, 3.0)}, "lens center must be 2 finite numbers"),
        ({"center": (10**400, 0)}, "lens center must be 2 finite numbers"),
        ({"distortion": (0.0,)}, "lens distortion must be 2 finite numbers"),
        ({"size": (640,)}, "lens size must be 2 finite numbers"),
        ({"size": 640}, "lens size must be 2 finite numbers, not 640"),
        ({"size": (640.5, 480)}, "lens image size must be whole numbers of at least 2 x 2 px, not 640.5 x 480"),
    ],
)
def test_entries_of_another_shape_are_refused(entries, message):
    with pytest.raises(InputError, match=message):
        Equidistant(fov=2.0, focal_length=300.0, **entries)
