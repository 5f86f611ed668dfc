"""Whether the configured camera can work, as far as a program can tell before it runs."""

from __future__ import annotations

from ..cameras.image_files import open_source
from ..cameras.open_camera import ROS, camera_opener, is_live
from ..cameras.ros.bags import is_bag
from ..geometry.lens import Size
from ..live.configuration import Configuration


def check_source(configuration: Configuration) -> Size | None:
    """The size [px] of the camera's images: that of the first one of files, else the configured one; None if unknown.

    A live camera is not opened. Raises InputError for a source or setting that can never work, and for files without a
    readable image.
    """
    camera, raw = configuration.camera, configuration.detector.format != "bgr"
    if camera.source and not is_live(camera.source) and not is_bag(camera.source):
        image = next(open_source(camera.source, raw, camera.max_megapixels).frames).read()
        return image.shape[1], image.shape[0]
    if camera.source not in ("", ROS):  # vm-ros opens a topic itself
        camera_opener(camera, raw)
    return (camera.width, camera.height) if camera.width and camera.height else None
