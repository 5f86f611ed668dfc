import warnings

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from vm_embedded.detection.footprint import uniform_levels
from vm_embedded.detection.pixel_formats import FORMATS, checked_image
from vm_embedded.detection.pyramid import Pyramid
from vm_embedded.detection.sampling import sample
from vm_embedded.errors import InputError

from ..strategies import seeds

COLOR_ORDERS = {"bgr": (2, 1, 0), "rgb": (0, 1, 2), "bgra": (2, 1, 0), "rgba": (0, 1, 2)}
BAYER = ("bayer_rggb", "bayer_bggr", "bayer_grbg", "bayer_gbrg")


def sampled(image, pixels, format):
    return sample(Pyramid(checked_image(image, format), format), pixels, uniform_levels(len(pixels), 1.0)).T


def noise(random, height, width, channels):
    return random.integers(0, 256, (height, width, channels), dtype=np.uint8)


def pixels_in(random, count, height, width):
    """Points whose four pixels are in the picture, whole ones and those at the very border among them."""
    pixels = random.random((count, 2)) * (width - 1, height - 1)
    pixels[: count // 4] = np.floor(pixels[: count // 4])
    if count:
        pixels[-1] = np.nextafter(width - 1.0, 0.0), np.nextafter(height - 1.0, 0.0)
        pixels[0] = 0.0, 0.0
    return pixels


def bilinear(image, pixels):
    """Values (n, channels), 0 to 255, point by point in double precision."""
    values = np.empty((len(pixels), image.shape[2]))
    for row, (x, y) in enumerate(pixels):
        i, j = int(y), int(x)
        u, v = x - j, y - i
        patch = image[i : i + 2, j : j + 2].astype(float)
        upper = patch[0, 0] * (1.0 - u) + patch[0, 1] * u
        lower = patch[1, 0] * (1.0 - u) + patch[1, 1] * u
        values[row] = upper * (1.0 - v) + lower * v
    return values


shapes = st.tuples(st.integers(2, 30), st.integers(2, 30))


@given(shapes, st.sampled_from(sorted(COLOR_ORDERS)), st.integers(0, 40), seeds)
def test_sampling_is_bilinear_to_the_last_digits(shape, format, count, seed):
    random = np.random.default_rng(seed)
    image = noise(random, *shape, 4 if format.endswith("a") else 3)
    pixels = pixels_in(random, count, *shape)
    expected = bilinear(image, pixels)[:, COLOR_ORDERS[format]] / 255.0
    np.testing.assert_allclose(sampled(image, pixels, format), expected, atol=1e-5)


@given(shapes, seeds)
def test_sampling_of_gray_is_bilinear_and_the_same_in_all_colors(shape, seed):
    random = np.random.default_rng(seed)
    image = noise(random, *shape, 1)
    pixels = pixels_in(random, 20, *shape)
    values = sampled(image, pixels, "gray")
    np.testing.assert_allclose(values, np.repeat(bilinear(image, pixels) / 255.0, 3, axis=1), atol=1e-5)


@given(shapes, seeds)
def test_whole_pixels_are_read_as_they_are(shape, seed):
    random = np.random.default_rng(seed)
    image = noise(random, *shape, 3)
    rows, columns = np.mgrid[: shape[0] - 1, : shape[1] - 1].reshape(2, -1)
    pixels = np.stack([columns, rows], axis=1).astype(np.float64)
    expected = image[rows, columns].astype(np.float32) / np.float32(255.0)
    np.testing.assert_allclose(sampled(image, pixels, "rgb"), expected, atol=1e-7)


@given(seeds, st.sampled_from([0, 1, 63, 64, 65, 1000]))
def test_sampling_reads_any_number_of_points(seed, count):
    random = np.random.default_rng(seed)
    image = noise(random, 20, 30, 3)
    pixels = pixels_in(random, count, 20, 30)
    values = sampled(image, pixels, "rgb")
    assert values.shape == (count, 3)
    one_by_one = [sampled(image, pixels[i : i + 1], "rgb")[0] for i in range(min(count, 10))]
    np.testing.assert_array_equal(values[:10], np.array(one_by_one).reshape(-1, 3))


@given(shapes, seeds)
def test_all_color_formats_of_one_scene_give_the_same_colors(shape, seed):
    random = np.random.default_rng(seed)
    rgb = noise(random, *shape, 3)
    alpha = noise(random, *shape, 1)
    pixels = pixels_in(random, 20, *shape)
    expected = sampled(rgb, pixels, "rgb")
    scenes = {
        "bgr": rgb[:, :, ::-1],
        "rgba": np.concatenate([rgb, alpha], axis=2),
        "bgra": np.concatenate([rgb[:, :, ::-1], alpha], axis=2),
    }
    for format, image in scenes.items():
        np.testing.assert_array_equal(sampled(image, pixels, format), expected, err_msg=format)


@given(shapes, seeds)
def test_a_gray_scene_looks_gray_in_every_format(shape, seed):
    random = np.random.default_rng(seed)
    gray = noise(random, *shape, 1)
    pixels = pixels_in(random, 20, *shape)
    expected = sampled(np.repeat(gray, 3, axis=2), pixels, "rgb")
    for image in (gray, gray[:, :, 0]):
        np.testing.assert_array_equal(sampled(image, pixels, "gray"), expected)


def mosaic(rgb, format):
    """What a sensor with this filter pattern, named by its upper left 2 x 2 pixels in reading order, sees."""
    raw = np.empty(rgb.shape[:2], dtype=np.uint8)
    for position, color in enumerate(format.removeprefix("bayer_")):
        row, column = divmod(position, 2)
        raw[row::2, column::2] = rgb[row::2, column::2, "rgb".index(color)]
    return raw


@pytest.mark.parametrize("format", BAYER)
@given(seeds)
def test_a_mosaic_of_a_smooth_scene_gives_the_scene_s_colors(format, seed):
    random = np.random.default_rng(seed)
    y, x = np.mgrid[:24, :32]
    # Three slopes, so different that no two colors can be taken for each other.
    slopes = random.permutation([[3.0, 0.0], [-1.5, 1.5], [0.0, -3.0]])
    rgb = np.stack([130.0 + a * (x - 16) + b * (y - 12) for a, b in slopes], axis=2).round().astype(np.uint8)
    pixels = 2.0 + random.random((50, 2)) * (27.0, 19.0)
    expected = sampled(rgb, pixels, "rgb")
    for raw in (mosaic(rgb, format), mosaic(rgb, format)[:, :, None]):
        np.testing.assert_allclose(sampled(raw, pixels, format), expected, atol=3.0 / 255.0)


def views(image):
    """The same picture in other memory orders."""
    height, width, channels = image.shape
    roomy = np.zeros((height + 3, width + 5, channels + 1), dtype=np.uint8)
    roomy[2 : 2 + height, 1 : 1 + width, :channels] = image
    yield "cut out", roomy[2 : 2 + height, 1 : 1 + width, :channels]
    yield "upside down", np.ascontiguousarray(image[::-1])[::-1]
    yield "mirrored", np.ascontiguousarray(image[:, ::-1])[:, ::-1]
    yield "transposed", np.ascontiguousarray(image.transpose(1, 0, 2)).transpose(1, 0, 2)
    yield "planes", np.ascontiguousarray(image.transpose(2, 0, 1)).transpose(1, 2, 0)
    yield "every second", np.repeat(np.repeat(image, 2, axis=0), 2, axis=1)[::2, ::2]
    read_only = image.copy()
    read_only.flags.writeable = False
    yield "read-only", read_only


@pytest.mark.parametrize("format", FORMATS)
def test_memory_order_changes_no_color(format):
    random = np.random.default_rng(7)
    channels = {"bgr": 3, "rgb": 3, "bgra": 4, "rgba": 4}.get(format, 1)
    image = noise(random, 12, 18, channels)
    pixels = pixels_in(random, 30, 12, 18)
    expected = sampled(image, pixels, format)
    for name, view in views(image):
        np.testing.assert_array_equal(sampled(view, pixels, format), expected, err_msg=name)


@pytest.mark.parametrize("format", FORMATS)
@given(seeds)
def test_colors_are_from_0_to_1(format, seed):
    random = np.random.default_rng(seed)
    channels = {"bgr": 3, "rgb": 3, "bgra": 4, "rgba": 4}.get(format, 1)
    image = noise(random, 10, 10, channels) // 128 * 255
    values = sampled(image, pixels_in(random, 40, 10, 10), format)
    assert (values >= 0.0).all()
    assert (values <= 1.0).all()


FAR = [
    np.nan,
    np.inf,
    -np.inf,
    1e300,
    -1e300,
    1e38,
    -1e38,
    2.0**63,
    -(2.0**63),
    2.0**31,
    -(2.0**31),
    1e9,
    -1e9,
    32768.0,
]
"""Where a lens may put what it does not see."""


@pytest.mark.parametrize("format", FORMATS)
@given(st.integers(0, 300), seeds)
def test_pixels_off_screen_have_any_color_and_disturb_no_other(format, count, seed):
    random = np.random.default_rng(seed)
    channels = {"bgr": 3, "rgb": 3, "bgra": 4, "rgba": 4}.get(format, 1)
    image = noise(random, 12, 18, channels)
    pixels = pixels_in(random, count, 12, 18)
    expected = sampled(image, pixels, format)
    off_screen = random.random(count) < 0.5
    near = random.uniform(-30.0, 40.0, (count, 2))
    pixels[off_screen] = np.where(random.random((count, 2)) < 0.5, random.choice(FAR, (count, 2)), near)[off_screen]
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        values = sampled(image, pixels, format)
    assert values.shape == expected.shape
    np.testing.assert_array_equal(values[~off_screen], expected[~off_screen])


@pytest.mark.parametrize("format", FORMATS)
@pytest.mark.parametrize("dtype", [np.float32, np.uint16, np.int8, bool])
def test_other_types_than_uint8_are_refused_by_name(format, dtype):
    channels = {"bgr": 3, "rgb": 3, "bgra": 4, "rgba": 4}.get(format, 1)
    with pytest.raises(InputError, match=np.dtype(dtype).name):
        checked_image(np.zeros((8, 8, channels), dtype=dtype), format)


@pytest.mark.parametrize("image", [None, [[0, 1], [2, 3]], "image.png"])
def test_what_is_no_array_is_refused_by_type(image):
    with pytest.raises(InputError, match=type(image).__name__):
        checked_image(image, "bgr")


@pytest.mark.parametrize(
    ("format", "shape"),
    [
        ("bgr", (8, 8)),
        ("bgr", (8, 8, 1)),
        ("rgb", (8, 8, 4)),
        ("rgba", (8, 8, 3)),
        ("bgra", (8, 8)),
        ("gray", (8, 8, 3)),
        ("gray", (8, 8, 2)),
        ("gray", (8,)),
        ("bayer_rggb", (8, 8, 3)),
        ("rgb", (2, 8, 8, 3)),
        ("rgb", ()),
    ],
)
def test_other_shapes_are_refused_with_both_named(format, shape):
    with pytest.raises(InputError) as caught:
        checked_image(np.zeros(shape, dtype=np.uint8), format)
    assert format in str(caught.value)
    assert str(shape) in str(caught.value)


@pytest.mark.parametrize("shape", [(1, 8, 3), (8, 1, 3), (0, 0, 3)])
def test_pictures_too_small_to_sample_are_refused(shape):
    with pytest.raises(InputError, match=rf"2 x 2.*{shape[1]} x {shape[0]}"):
        checked_image(np.zeros(shape, dtype=np.uint8), "rgb")


def test_an_unknown_format_names_the_nearest():
    with pytest.raises(InputError, match=r"'bayer_rgbg'.*'bayer_rggb'"):
        checked_image(np.zeros((8, 8), dtype=np.uint8), "bayer_rgbg")


def test_checking_copies_nothing():
    image = np.zeros((8, 9, 3), dtype=np.uint8)
    assert checked_image(image, "rgb") is image
    assert np.shares_memory(checked_image(image[:, :, :1], "gray"), image)
