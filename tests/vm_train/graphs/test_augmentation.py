"""Augmentation: what each entry changes, what it leaves alone, and that a seed says it all."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from vm_embedded import Orientation
from vm_embedded.config.entries import check_entries
from vm_embedded.errors import InputError
from vm_embedded.geometry.calibrated_lenses import BrownLens, FisheyeLens
from vm_embedded.geometry.lens_files import LensFile
from vm_embedded.geometry.radial_lenses import Equidistant, Equisolid, Rectilinear
from vm_train.data.pictures import Picture
from vm_train.graphs.augmentation import (
    Augmentation,
    Tone,
    apply_tone,
    perturb_camera,
    perturb_colors,
    perturb_sharpness,
    soften,
    with_camera_error,
)

from ..no_augmentation import NO_AUGMENTATION

SIZE = (96, 64)
LENSES = [
    Rectilinear(focal_length=60.0, fov=2.4, center=(1.5, -2.0), distortion=(-1e-5, 1e-9)),
    Equisolid(focal_length=45.0, fov=2.8),
    Equidistant(focal_length=80.0, fov=3.0, center=(2.0, 1.0), size=(192, 128)),
    BrownLens(fov=2.4, focal_lengths=(60.0, 61.0), optical_center=(47.0, 33.0), coefficients=(-0.1, 0.02, 0.0, 0.0)),
    FisheyeLens(fov=2.8, focal_lengths=(90.0, 90.0), optical_center=(95.0, 62.0), size=(192, 128)),
]
FULL = Augmentation(
    height=0.5,
    tilt=20.0,
    focal_length=0.2,
    center=0.1,
    brightness=4.0,
    contrast=4.0,
    saturation=4.0,
    hue=180.0,
    gamma=4.0,
    noise=1.0,
    blur_share=1.0,
    jpeg_share=1.0,
)

seeds = st.integers(0, 2**32)
factors = st.floats(0.3, 3.0)
colors_of_points = arrays(np.float32, (23, 3), elements=st.floats(0.0, 1.0, width=32))
lenses = st.sampled_from(LENSES)


def picture(lens=LENSES[0], height=0.8, roll=0.1, pitch=0.5, yaw=2.0):
    random = np.random.default_rng(7)
    return Picture(
        random.integers(0, 256, (SIZE[1], SIZE[0], 3), dtype=np.uint8),
        random.integers(-1, 3, (SIZE[1], SIZE[0]), dtype=np.int8),
        LensFile(lens, Orientation.from_roll_pitch(height, roll, pitch, yaw)),
    )


def generator(seed=0):
    return np.random.default_rng(seed)


def tilt_of(made, of):
    """Angle [rad] between the plane's normals that two pictures tell, seen from the camera."""
    cosine = made.lens.orientation.rotation[2] @ of.lens.orientation.rotation[2]
    return math.acos(min(cosine, 1.0))


@given(colors_of_points, lenses, seeds)
def test_off_changes_nothing(colors, lens, seed):
    before = picture(lens)
    assert perturb_camera(before, NO_AUGMENTATION, generator(seed)) is before
    assert perturb_sharpness(before, NO_AUGMENTATION, generator(seed)) is before
    assert np.array_equal(perturb_colors(colors, NO_AUGMENTATION, generator(seed)), colors)


def test_off_is_every_entry_at_0_and_all_can_be_0():
    on = {name for name, value in vars(NO_AUGMENTATION).items() if value != 0}
    assert on == {"blur", "jpeg"}
    check_entries(NO_AUGMENTATION)


@pytest.mark.parametrize(
    ("name", "value", "said"),
    [
        ("height", -0.1, "height must be a number from 0 to 0.5, not -0.1"),
        ("tilt", 30.0, "tilt must be a number from 0 to 20 deg, not 30.0"),
        ("jpeg", [90, 40], "jpeg must be"),
        ("blur_share", 1.5, "blur_share must be a number from 0 to 1, not 1.5"),
    ],
)
def test_entries_that_cant_be_are_named(name, value, said):
    with pytest.raises(InputError, match=said):
        Augmentation(**{name: value})


@given(colors_of_points, lenses, seeds)
def test_same_seed_same_result(colors, lens, seed):
    def all_three():
        random = generator(seed)
        made = perturb_sharpness(perturb_camera(picture(lens), FULL, random), FULL, random)
        return made, perturb_colors(colors, FULL, random)

    (first, first_colors), (second, second_colors) = all_three(), all_three()
    assert first.lens.lens == second.lens.lens
    assert first.lens.orientation.height == second.lens.orientation.height
    assert np.array_equal(first.lens.orientation.rotation, second.lens.orientation.rotation)
    assert np.array_equal(first.image, second.image)
    assert np.array_equal(first_colors, second_colors)


@given(colors_of_points, seeds)
def test_an_entry_leaves_the_draws_of_others_as_they_were(colors, seed):
    only_colors = replace(NO_AUGMENTATION, hue=30.0, brightness=0.5)
    both = replace(only_colors, height=0.1, blur_share=1.0)

    def last_of(augmentation):
        random = generator(seed)
        perturb_sharpness(perturb_camera(picture(), augmentation, random), augmentation, random)
        return perturb_colors(colors, augmentation, random)

    assert np.array_equal(last_of(only_colors), last_of(both))


@given(lenses, seeds)
def test_moved_keeps_image_and_labels_and_stays_a_camera(lens, seed):
    before = picture(lens)
    made = perturb_camera(before, FULL, generator(seed))
    assert made.image is before.image
    assert made.labels is before.labels
    assert made.lens.orientation.height > 0.01
    fitted = made.lens.lens.for_image(SIZE)
    assert type(fitted) is type(lens)
    assert fitted.limit == pytest.approx(lens.limit, abs=2e-3)
    # What it sees of its own picture comes back to where it was.
    middle = np.array([[40.0, 30.0], [50.0, 35.0]])
    rays = fitted.unproject(middle, SIZE)
    assume(np.isfinite(rays).all())
    assert fitted.project(rays, SIZE) == pytest.approx(middle, abs=1e-3)


@given(seeds)
def test_a_tilt_turns_nothing_about_the_planes_normal(seed):
    before = picture()
    made = perturb_camera(before, replace(NO_AUGMENTATION, tilt=5.0), generator(seed))
    turn = made.lens.orientation.rotation @ before.lens.orientation.rotation.T
    assert turn[1, 0] - turn[0, 1] == pytest.approx(0.0, abs=1e-9)
    assert made.lens.orientation.height == before.lens.orientation.height


def test_errors_of_the_camera_are_as_large_as_the_entries_say():
    before, random = picture(), generator()
    augmentation = replace(NO_AUGMENTATION, height=0.02, tilt=1.0, focal_length=0.01, center=0.005)
    made = [perturb_camera(before, augmentation, random) for _ in range(2000)]
    heights = [math.log(each.lens.orientation.height / 0.8) for each in made]
    assert np.mean(heights) == pytest.approx(0.0, abs=0.002)
    assert np.std(heights) == pytest.approx(0.02, rel=0.1)
    tilts = np.degrees([tilt_of(each, before) for each in made])
    assert np.sqrt((tilts**2).mean() / 2.0) == pytest.approx(1.0, rel=0.1)
    assert tilts.mean() == pytest.approx(1.25, rel=0.1)
    focal_lengths = [math.log(each.lens.lens.focal_length / 60.0) for each in made]
    assert np.std(focal_lengths) == pytest.approx(0.01, rel=0.1)
    centers = np.array([each.lens.lens.center for each in made])
    assert centers.mean(axis=0) == pytest.approx((1.5, -2.0), abs=0.05)
    assert centers.std(axis=0) == pytest.approx(0.005 * SIZE[0], rel=0.1)


@pytest.mark.parametrize("lens", LENSES, ids=lambda lens: type(lens).__name__)
def test_a_shifted_center_shifts_the_picture(lens):
    before = picture(lens)
    made = with_camera_error(before, center=(0.1, -0.05))
    rays = np.array([[1.0, 0.0, 0.0], [0.9, 0.3, 0.1]]) / [[1.0], [math.sqrt(0.91)]]
    shift = made.lens.lens.for_image(SIZE).project(rays, SIZE) - lens.for_image(SIZE).project(rays, SIZE)
    assert shift == pytest.approx(np.array([[9.6, -4.8]] * 2), abs=1e-6)


@pytest.mark.parametrize("lens", LENSES, ids=lambda lens: type(lens).__name__)
def test_a_longer_focal_length_enlarges_the_picture_about_the_center(lens):
    made = with_camera_error(picture(lens), focal_length=1.1).lens.lens.for_image(SIZE)
    fitted = lens.for_image(SIZE)
    rays = np.array([[1.0, 0.0, 0.0], [0.8, 0.0, 0.6], [0.8, -0.6, 0.0]])
    spans = [each.project(rays, SIZE)[1:] - each.project(rays, SIZE)[0] for each in (fitted, made)]
    assert spans[1] == pytest.approx(1.1 * spans[0])


def test_blurred_changes_only_the_image_of_as_many_pictures_as_asked_for():
    before, random = picture(), generator()
    made = [perturb_sharpness(before, replace(NO_AUGMENTATION, blur_share=0.3), random) for _ in range(600)]
    changed = [each for each in made if each is not before]
    assert len(changed) / len(made) == pytest.approx(0.3, abs=0.06)
    for each in changed:
        assert each.labels is before.labels
        assert each.lens is before.lens
        assert each.image.shape == before.image.shape
        assert each.image.dtype == np.uint8


def test_more_blur_and_less_quality_take_more_away():
    image = picture().image

    def lost(**change):
        return float(np.abs(soften(image, **change).astype(float) - image).mean())

    assert 0.0 == lost() < lost(blur=0.5) < lost(blur=1.5)
    assert lost(jpeg=95) < lost(jpeg=30)


@given(colors_of_points, seeds)
def test_colors_stay_colors(colors, seed):
    before = colors.copy()
    made = perturb_colors(colors, FULL, generator(seed))
    assert made.shape == colors.shape
    assert made.dtype == np.float32
    assert made.min() >= 0.0
    assert made.max() <= 1.0
    assert np.array_equal(colors, before)


def test_no_points_have_no_colors():
    assert perturb_colors(np.empty((0, 3), np.float32), FULL, generator()).shape == (0, 3)


@given(colors_of_points, st.integers(1, 22), seeds)
def test_a_point_changes_whatever_the_others_are(colors, count, seed):
    augmentation = replace(FULL, noise=0.0)
    whole, part = (perturb_colors(each, augmentation, generator(seed)) for each in (colors, colors[:count]))
    assert part == pytest.approx(whole[:count], abs=1e-4)


@given(colors_of_points, factors, factors)
def test_brighter_is_brighter_and_a_larger_gamma_darker(colors, one, other):
    low, high = sorted((one, other))
    darker, brighter = (apply_tone(colors, Tone(brightness=each), generator()) for each in (low, high))
    assert (darker <= brighter).all()
    light, dark = (apply_tone(colors, Tone(gamma=each), generator()) for each in (low, high))
    assert (dark <= light + 1e-6).all()
    ends = np.array([[0.0, 0.0, 0.0], [1.0, 1.0, 1.0]], np.float32)
    assert np.array_equal(apply_tone(ends, Tone(gamma=one), generator()), ends)


@given(colors_of_points, st.floats(0.1, 1.0))
def test_contrast_leaves_mid_gray_alone_and_draws_all_others_from_it(colors, factor):
    gray = np.full((1, 3), 0.5, np.float32)
    assert apply_tone(gray, Tone(contrast=1.0 / factor), generator()) == pytest.approx(gray, abs=1e-6)
    near = apply_tone(colors, Tone(contrast=factor), generator())
    assert near - 0.5 == pytest.approx(factor * (colors - 0.5), abs=1e-5)


@given(st.floats(0.0, 1.0, width=32), st.floats(0.0, 3.0), st.floats(-180.0, 180.0))
def test_saturation_and_hue_leave_gray_alone(level, saturation, hue):
    gray = np.full((1, 3), level, np.float32)
    assert apply_tone(gray, Tone(saturation=saturation, hue=hue), generator()) == pytest.approx(gray, abs=1e-5)


@given(colors_of_points)
def test_no_saturation_is_gray_and_a_third_of_a_turn_swaps_channels(colors):
    assert np.ptp(apply_tone(colors, Tone(saturation=0.0), generator()), axis=1) == pytest.approx(0.0, abs=1e-5)
    turned = apply_tone(colors, Tone(hue=120.0), generator())
    assert turned == pytest.approx(np.roll(colors, 1, axis=1), abs=1e-5)


def test_noise_is_as_strong_as_it_says_and_each_points_own():
    gray = np.full((20000, 3), 0.5, np.float32)
    made = apply_tone(gray, Tone(noise=0.05), generator())
    assert made.mean() == pytest.approx(0.5, abs=0.001)
    assert made.std(axis=0) == pytest.approx(0.05, rel=0.05)
    assert abs(np.corrcoef(made.T)[0, 1]) < 0.05
