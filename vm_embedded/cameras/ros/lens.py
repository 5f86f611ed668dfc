"""The lens of a sensor_msgs/CameraInfo, and the CameraInfo of a lens."""

from __future__ import annotations

from typing import Any

from ...errors import InputError
from ...geometry.calibrated_lenses import BrownLens, CalibratedLens, FisheyeLens
from ...geometry.lens import Lens
from ...geometry.lens_files import lens_from_calibration
from ...geometry.radial_lenses import Rectilinear


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
    if message.distortion_model:
        table["distortion_model"] = message.distortion_model
    try:
        return lens_from_calibration(table)
    except InputError as error:
        raise InputError(f"camera_info: {error}") from error


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


def camera_info_message(types: Any, header: Any, lens: Lens, size: tuple[int, int]) -> Any | None:
    """The CameraInfo of a calibrated lens; None for others, which ROS can't describe. size: of the images [px]."""
    if not isinstance(lens, CalibratedLens):
        return None
    (fx, fy), (cx, cy) = lens.focal_lengths, lens.optical_center
    count = len(lens.coefficients)
    model = "equidistant" if isinstance(lens, FisheyeLens) else "plumb_bob" if count <= 5 else "rational_polynomial"
    return types.CameraInfo(
        header=header,
        height=size[1],
        width=size[0],
        distortion_model=model,
        d=types.doubles(lens.coefficients),
        k=types.doubles([fx, 0.0, cx, 0.0, fy, cy, 0.0, 0.0, 1.0]),
        r=types.doubles([1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0]),
        p=types.doubles([fx, 0.0, cx, 0.0, 0.0, fy, cy, 0.0, 0.0, 0.0, 1.0, 0.0]),
        binning_x=0,
        binning_y=0,
        roi=types.RegionOfInterest(x_offset=0, y_offset=0, height=0, width=0, do_rectify=False),
    )
