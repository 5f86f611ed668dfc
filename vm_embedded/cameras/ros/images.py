"""Images of ROS: sensor_msgs/Image and CompressedImage as arrays, and JPEG images as messages."""

from __future__ import annotations

from typing import Any

import cv2
import numpy as np

from ...arrays import Image
from ...errors import InputError, unknown
from ..decoding import decode
from ..image_header import MAX_MEGAPIXELS

_CHANNELS = {
    "bgr8": 3,
    "rgb8": 3,
    "8UC3": 3,
    "bgra8": 4,
    "rgba8": 4,
    "8UC4": 4,
    "mono8": 1,
    "8UC1": 1,
    "bayer_rggb8": 1,
    "bayer_bggr8": 1,
    "bayer_gbrg8": 1,
    "bayer_grbg8": 1,
    "yuv422": 2,
    "uyvy": 2,
    "yuv422_yuy2": 2,
    "yuyv": 2,
}
"""Encodings of sensor_msgs/Image, and the bytes of a pixel."""

# OpenCV names the Bayer patterns by the second row and column.
_TO_BGR = {
    "rgb8": cv2.COLOR_RGB2BGR,
    "bgra8": cv2.COLOR_BGRA2BGR,
    "rgba8": cv2.COLOR_RGBA2BGR,
    "8UC4": cv2.COLOR_BGRA2BGR,
    "mono8": cv2.COLOR_GRAY2BGR,
    "8UC1": cv2.COLOR_GRAY2BGR,
    "bayer_rggb8": cv2.COLOR_BayerBG2BGR,
    "bayer_bggr8": cv2.COLOR_BayerRG2BGR,
    "bayer_gbrg8": cv2.COLOR_BayerGR2BGR,
    "bayer_grbg8": cv2.COLOR_BayerGB2BGR,
    "yuv422": cv2.COLOR_YUV2BGR_UYVY,
    "uyvy": cv2.COLOR_YUV2BGR_UYVY,
    "yuv422_yuy2": cv2.COLOR_YUV2BGR_YUY2,
    "yuyv": cv2.COLOR_YUV2BGR_YUY2,
}

_QUALITY = 90
"""Of the JPEGs that are published."""


def image_of(message: Any, raw: bool = False, max_megapixels: float = MAX_MEGAPIXELS) -> Image:
    """The image of a sensor_msgs/Image or CompressedImage, as BGR, or with `raw` in its own channels.

    Raises InputError for an unknown encoding, for data that does not fit, and for more than `max_megapixels` [Mpx].
    """
    if not hasattr(message, "encoding"):
        try:
            return decode(bytes(message.data), raw, max_megapixels)
        except InputError as error:
            raise InputError(f"compressed image {error}") from error
    encoding = message.encoding
    if encoding not in _CHANNELS:
        raise InputError(unknown("encoding of an image", encoding, _CHANNELS))
    width, height, step, channels = message.width, message.height, message.step, _CHANNELS[encoding]
    data = np.frombuffer(message.data, dtype=np.uint8)
    if not (width and height) or step < width * channels or data.size < step * (height - 1) + width * channels:
        raise InputError(
            f"image of {width} x {height} px in {encoding} has a step of {step} and {data.size} bytes; they do not fit"
        )
    if 1e-6 * width * height > max_megapixels:
        raise InputError(f"image has {1e-6 * width * height:.1f} Mpx, more than {max_megapixels:g}")
    if data.size < step * height:  # the last row may lack its padding
        data = np.pad(data, (0, step * height - data.size))
    rows = data[: step * height].reshape(height, step)
    pixels = rows[:, : width * channels].reshape(height, width, channels)
    image: Image = np.ascontiguousarray(pixels)
    if raw:
        return image[:, :, 0] if channels == 1 else image
    if encoding not in _TO_BGR:
        return image
    return np.asarray(cv2.cvtColor(image, _TO_BGR[encoding]), dtype=np.uint8)


def jpeg_message(types: Any, header: Any, image: Image) -> Any:
    """A sensor_msgs/CompressedImage of a BGR image."""
    _, content = cv2.imencode(".jpg", image, [cv2.IMWRITE_JPEG_QUALITY, _QUALITY])
    return types.CompressedImage(header=header, format="jpeg", data=types.octets(content.tobytes()))
