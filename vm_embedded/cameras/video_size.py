"""The size of the frames of videos and streams, which have no header of an image to check before they are decoded."""

from __future__ import annotations

import cv2

from ..arrays import Image
from .image_header import check_pixels


def check_video(capture: cv2.VideoCapture, max_megapixels: float) -> None:
    """Raise InputError for a video, stream or device that says it has larger frames [Mpx], before one is decoded."""
    width, height = (int(capture.get(each)) for each in (cv2.CAP_PROP_FRAME_WIDTH, cv2.CAP_PROP_FRAME_HEIGHT))
    check_pixels(width, height, max_megapixels)


def check_frame(image: Image, max_megapixels: float) -> None:
    """Raise InputError for a larger decoded frame [Mpx]: a stream may change its size at any time."""
    check_pixels(image.shape[1], image.shape[0], max_megapixels)
