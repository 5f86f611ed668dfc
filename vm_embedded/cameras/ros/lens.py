"""The lens of a sensor_msgs/CameraInfo, and the CameraInfo of a lens."""

from __future__ import annotations

from functools import lru_cache
from typing import Any

import numpy as np

from ...errors import InputError
from ...geometry.calibrated_lenses import BrownLens, CalibratedLens, FisheyeLens
from ...geometry.lens import Lens
from ...geometry.lens_files import lens_from_calibration
from ...geometry.radial_lenses import RadialLens, Rectilinear, projection_named

_LARGEST_ERROR = 0.1
"""Largest error of a radial lens as ROS describes it [px]."""

_OWN = "vm_"
"""Distortion models that begin so are the projections of radial lenses, with k0 [px^-2], k1 [px^-4] and fov [rad]."""


def lens_of(message: Any) -> Lens:
    """The lens of a CameraInfo, for images that are not rectified.

    Raises InputError if the camera is not calibrated, or if its images are binned or a part of the sensor.
    """
    if not any(message.k):
        raise InputError("camera_info has no calibration: k is zero; calibrate the camera, or give --lens")
    roi = message.roi
    if max(message.binning_x, message.binning_y) > 1 or roi.x_offset or roi.y_offset:
        raise InputError("camera_info of binned images or of a part of the sensor is not supported; give --lens")
    table = {
        "k": list(message.k),
        "d": list(message.d),
        "width": int(message.width),
        "height": int(message.height),
    }
    if message.distortion_model.startswith(_OWN):
        return _own_lens(message)
    if message.distortion_model:
        table["distortion_model"] = message.distortion_model
    try:
        return lens_from_calibration(table)
    except InputError as error:
        raise InputError(f"camera_info: {error}") from error


def _own_lens(message: Any) -> Lens:
    """The radial lens of a CameraInfo that `camera_info_message` has made. Raises InputError."""
    size = int(message.width), int(message.height)
    if len(message.d) != 3:
        raise InputError(f"camera_info: {message.distortion_model} needs 3 coefficients, not {len(message.d)}")
    k0, k1, fov = map(float, message.d)
    return projection_named(message.distortion_model.removeprefix(_OWN))(
        focal_length=float(message.k[0]),
        center=(0.5 * size[0] - float(message.k[2]), 0.5 * size[1] - float(message.k[5])),
        distortion=(k0, k1),
        fov=fov,
        size=size,
    )


def rectified_doubt(topic: str, lens: Lens) -> str:
    """Why a lens with distortion does not fit the images of a topic whose name says that they are rectified; else "".

    image_proc publishes image_rect and image_rect_color beside the raw images, with the same camera_info.
    """
    is_straight = isinstance(lens, Rectilinear | BrownLens) and not any(
        lens.distortion if isinstance(lens, Rectilinear) else lens.coefficients
    )
    if is_straight or not any(part.startswith("image_rect") for part in topic.split("/")):
        return ""
    return (
        f"images on {topic} are rectified, but the lens is that of raw images, with distortion: use the topic "
        "image_raw, or give --lens with the projection matrix P as camera_matrix and no distortion"
    )


def camera_info_message(types: Any, header: Any, lens: Lens, size: tuple[int, int]) -> Any:
    """The CameraInfo of a lens for images of this size [px]; `lens_of` reads it.

    A radial lens becomes plumb_bob or equidistant, if that is at most 0.1 px off anywhere in the image. Otherwise the
    distortion model has a name that only `lens_of` knows.
    """
    lens = _as_calibrated(lens, size)
    coefficients: tuple[float, ...]
    if isinstance(lens, RadialLens):
        model, coefficients = _OWN + type(lens).__name__.lower(), (*lens.distortion, lens.fov)
        (fx, fy), (cx, cy) = (lens.scale, lens.scale), lens.project(np.array([[1.0, 0.0, 0.0]]), size)[0].tolist()
    elif isinstance(lens, CalibratedLens):
        (fx, fy), (cx, cy) = lens.focal_lengths, lens.optical_center
        coefficients = lens.coefficients or (0.0,) * (4 if isinstance(lens, FisheyeLens) else 5)
        straight = "plumb_bob" if len(coefficients) <= 5 else "rational_polynomial"
        model = "equidistant" if isinstance(lens, FisheyeLens) else straight
    else:
        raise InputError(f"lens of type {type(lens).__name__} has no CameraInfo; use a radial or a calibrated lens")
    return types.CameraInfo(
        header=header,
        height=size[1],
        width=size[0],
        distortion_model=model,
        d=types.doubles(coefficients),
        k=types.doubles([fx, 0.0, cx, 0.0, fy, cy, 0.0, 0.0, 1.0]),
        r=types.doubles([1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0]),
        p=types.doubles([fx, 0.0, cx, 0.0, 0.0, fy, cy, 0.0, 0.0, 0.0, 1.0, 0.0]),
        binning_x=0,
        binning_y=0,
        roi=types.RegionOfInterest(x_offset=0, y_offset=0, height=0, width=0, do_rectify=False),
    )


@lru_cache(16)
def _as_calibrated(lens: Lens, size: tuple[int, int]) -> Lens:
    """A lens for images of this size [px]: a radial one with its distortion fitted as OpenCV describes it, if it is
    near enough."""
    lens = lens.for_image(size)
    if not isinstance(lens, RadialLens):
        return lens
    theta = np.linspace(0.0, 0.999 * lens.limit, 1000)
    rays = np.column_stack([np.cos(theta), -np.sin(theta), np.zeros_like(theta)])
    pixels = lens.project(rays, size)
    center, radius = pixels[0], pixels[:, 0] - pixels[0, 0]
    inside = radius <= np.hypot(*np.maximum(center, size - center))
    theta, rays, radius = theta[inside], rays[inside], radius[inside] / lens.scale
    is_straight = isinstance(lens, Rectilinear)
    plain = np.tan(theta) if is_straight else theta
    share = plain / plain[-1]  # for powers of the same size
    powers = np.arange(3, 9 if is_straight else 11, 2)
    found = np.linalg.lstsq(share[:, None] ** powers, radius - plain, rcond=None)[0] / plain[-1] ** powers
    kind: type[CalibratedLens] = BrownLens if is_straight else FisheyeLens
    fitted = kind(
        fov=lens.fov,
        focal_lengths=(lens.scale, lens.scale),
        optical_center=center,
        coefficients=(*found[:2], 0.0, 0.0, found[2]) if is_straight else found,
        size=size,
    )
    error = np.abs(fitted.project(rays, size)[:, 0] - pixels[inside, 0]).max()
    return fitted if error <= _LARGEST_ERROR and fitted.limit >= 0.99 * theta[-1] else lens
