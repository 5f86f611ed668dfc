"""The box of an object whose center a person clicked: its size follows from lens, pose and shape."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from vm_embedded.cameras.image_files import lens_file_of
from vm_embedded.detection.projection import to_camera
from vm_embedded.errors import InputError
from vm_embedded.geometry.lens import Size
from vm_embedded.geometry.lens_files import read_lens_file
from vm_embedded.output.box_files import OBJECT, Shares, bounding_box, read_object_file


def box_at(image: Path, size: Size, point: tuple[float, float]) -> Shares:
    """The box of an object on the plane whose center is at a point of an image: x and y as shares of its size [px].

    Raises VisualMeshError if the shape, the lens or the pose is unknown, or if no object can be there.
    """
    if not all(0.0 <= each <= 1.0 for each in point):
        raise InputError(f"a place in a picture has shares from 0 to 1, not {point}")
    shape = read_object_file(image.parent)
    path = lens_file_of(image)
    if shape is None or path is None:
        missing = f"{image.parent / OBJECT}, which has its radius" if shape is None else f"a lens file beside {image}"
        raise InputError(f"the size of an object is unknown without {missing}")
    lens_file = read_lens_file(path)
    pose = lens_file.orientation
    if pose is None:
        raise InputError(f"the size of an object is unknown without a pose: lens file {path} has no Hoc")
    if pose.height <= shape.center_height:
        raise InputError(f"lens file {path}: a camera height of {pose.height:g} m is below the center of the object")
    lens = lens_file.lens.for_image(size)
    ray = lens.unproject(np.array([point]) * size - 0.5, size) @ pose.rotation.T
    if not (np.isfinite(ray).all() and ray[0, 2] < 0.0):
        raise InputError("no object lies on the plane there: it is above the horizon, or outside of the lens")
    rays = to_camera(shape.outline(shape.center_along(ray, pose.height)[0], pose.height), pose.rotation)
    box = bounding_box(lens.project(rays[lens.sees(rays)], size), size)
    if box is None:
        raise InputError("an object there is too small to see")
    return box
