"""--check-config: whether a program can run a configuration, before it runs."""

from __future__ import annotations

import asyncio

from ..cameras.open_camera import ROS, camera_opener
from ..errors import InputError
from ..live.configuration import Configuration
from ..live.load_detector import prove_model
from .camera_source import check_pose_source, check_source
from .finding import BAD
from .openings import check_openings


def check_configuration(configuration: Configuration, with_ros: bool) -> str:
    """Check the source of the camera, what the daemon opens, and the model; say in words what is good.

    with_ros: whether vm-ros will run it, which also gets images and poses from ROS. Raises VisualMeshError.
    """
    check_source(configuration)
    if not with_ros:
        if configuration.camera.source == ROS:
            camera_opener(configuration.camera)  # raises InputError
        check_pose_source(configuration)
    for finding in check_openings(configuration):
        if finding.state == BAD:
            raise InputError(f"{finding.about}: {finding.seen}")
    model, proved = asyncio.run(prove_model(configuration))
    names = ", ".join(each.name for each in model.manifest.classes)
    good = f"{configuration.model}: classes {names}; {proved}; the configuration is good"
    if configuration.camera.source:
        return good
    return f"{good}, but names no camera: set [camera] source, or give --camera"
