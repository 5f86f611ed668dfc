"""Images of ROS messages."""

import re

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from vm_embedded.cameras.ros.images import image_of, jpeg_message
from vm_embedded.errors import InputError

from .rolling_ball import TYPES, image_message, stamp

HEADER = TYPES.Header(stamp=stamp(0.0), frame_id="")
RANDOM = np.random.default_rng(5)
SMOOTH = cv2.resize(RANDOM.integers(0, 255, (6, 8, 3), dtype=np.uint8), (64, 48))
"""A colored image without sharp edges, which survives half the resolution of its colors."""


def encoded(encoding):
    """SMOOTH as a camera encodes it (height, width, channels)."""
    if encoding == "bgr8":
        return SMOOTH
    if encoding == "rgb8":
        return SMOOTH[:, :, ::-1]
    if encoding in ("bgra8", "rgba8"):
        code = cv2.COLOR_BGR2BGRA if encoding == "bgra8" else cv2.COLOR_BGR2RGBA
        return cv2.cvtColor(SMOOTH, code)
    if encoding.startswith("bayer"):
        pattern = encoding.removeprefix("bayer_").removesuffix("8")
        mosaic = np.empty(SMOOTH.shape[:2], np.uint8)
        for number, color in enumerate(pattern):
            mosaic[number // 2 :: 2, number % 2 :: 2] = SMOOTH[number // 2 :: 2, number % 2 :: 2, "bgr".index(color)]
        return mosaic[:, :, None]
    code = cv2.COLOR_BGR2YUV_UYVY if encoding in ("uyvy", "yuv422") else cv2.COLOR_BGR2YUV_YUY2
    return cv2.cvtColor(SMOOTH, code)


WHOLE = ["bgr8", "rgb8", "bgra8", "rgba8"]
"""Encodings with all colors of each pixel."""


@pytest.mark.parametrize(
    "encoding",
    [*WHOLE, "bayer_rggb8", "bayer_bggr8", "bayer_gbrg8", "bayer_grbg8", "uyvy", "yuv422", "yuyv", "yuv422_yuy2"],
)
def test_each_encoding_gives_the_same_picture(encoding):
    image = image_of(image_message(encoded(encoding), 0.0, encoding=encoding))
    assert image.shape == SMOOTH.shape
    loss = 0 if encoding in WHOLE else 6
    assert np.abs(image[2:-2, 2:-2].astype(int) - SMOOTH[2:-2, 2:-2]).mean() <= loss


def test_gray_images_have_equal_channels_or_with_raw_one():
    gray = SMOOTH[:, :, 0]
    message = image_message(gray, 0.0, encoding="mono8")
    assert (image_of(message) == gray[:, :, None]).all()
    assert (image_of(message, raw=True) == gray).all()


def test_a_compressed_image_is_decoded():
    message = jpeg_message(TYPES, HEADER, SMOOTH)
    assert message.format == "jpeg"
    assert np.abs(image_of(message).astype(int) - SMOOTH).mean() < 3
    message.data = message.data[:-40]
    with pytest.raises(InputError, match="compressed image is cut short"):
        image_of(message)


@given(padding=st.integers(0, 9), last=st.booleans())
def test_rows_may_be_padded(padding, last):
    """The last row may lack its padding."""
    rows = np.pad(SMOOTH.reshape(48, -1), ((0, 0), (0, padding)), constant_values=7)
    message = image_message(SMOOTH, 0.0)
    message.step = rows.shape[1]
    message.data = rows.reshape(-1)[: rows.size - (padding if last else 0)]
    assert (image_of(message) == SMOOTH).all()


@pytest.mark.parametrize(
    ("changes", "reason"),
    [
        ({"encoding": "rgb16"}, "unknown encoding of an image 'rgb16'; did you mean 'rgb8'?"),
        ({"encoding": "32FC1"}, "unknown encoding"),
        ({"width": 65}, "do not fit"),
        ({"height": 49}, "do not fit"),
        ({"step": 100}, "do not fit"),
        ({"width": 0}, "do not fit"),
    ],
)
def test_a_wrong_message_is_an_error(changes, reason):
    message = image_message(SMOOTH, 0.0)
    for name, value in changes.items():
        setattr(message, name, value)
    with pytest.raises(InputError, match=re.escape(reason)):
        image_of(message)


def test_a_large_image_is_an_error():
    with pytest.raises(InputError, match=r"image has 0\.0 Mpx, more than 0\.001"):
        image_of(image_message(SMOOTH, 0.0), max_megapixels=0.001)
