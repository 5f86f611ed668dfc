"""Load the configured detector and check that the configuration fits together."""

from __future__ import annotations

from ..borders.credentials import without_password
from ..cameras.image_files import check_read_format
from ..cameras.open_camera import Opener, brings_lens_and_pose, camera_opener, is_live
from ..detection.detector import Detector
from ..detection.settings import Settings
from ..errors import GeometryError, InputError
from ..geometry.orientation import Orientation
from ..network.bundled import model_path
from ..network.model_file import ModelFile, parse_model, read_content
from ..poses.settings import check_without_ros
from .bridge import Bridge
from .configuration import Configuration
from .proving_process import prove_in_process


async def prove_model(configuration: Configuration) -> tuple[ModelFile, str]:
    """Check lens, pose and trigger class, and prove the configured network as `prove_network` does.

    `find_opener` checks the camera. Raises VisualMeshError for the first thing that is missing or invalid.
    """
    check_lens_and_pose(configuration)
    model, proved = await prove_network(configuration)
    orientation = configuration.fixed_orientation()
    if orientation is not None and configuration.pose.source == "fixed":
        check_height(orientation, configuration.detector, model)
    return model, proved


async def prove_network(configuration: Configuration) -> tuple[ModelFile, str]:
    """Check the trigger class, and prove the configured network in another process.

    Return the model file and in words what was proved. This process does not run the network, so root may call it for
    a file that it does not trust. Raises VisualMeshError.
    """
    path = model_path(configuration.model)
    content = read_content(path)
    proved = await prove_in_process(path, content)
    model, settings = parse_model(path, content), configuration.detector
    model.manifest.used_for(settings.object_radius, settings.max_distance)  # raises ModelError
    check_trigger_class(configuration, model)
    return model, proved


def check_trigger_class(configuration: Configuration, model: ModelFile) -> None:
    """Raise InputError if the network lacks the class that triggers recordings."""
    if configuration.recorder.trigger_class:
        try:
            model.manifest.column(configuration.recorder.trigger_class)
        except InputError as error:
            raise InputError(f"[recorder] trigger_class: {error}") from error


async def load_checked_detector(configuration: Configuration) -> tuple[Detector, str]:
    """Load the configured network after `prove_model`, whose errors it raises; return also what was proved."""
    model, proved = await prove_model(configuration)
    return Detector(model, configuration.detector), proved


def check_height(orientation: Orientation, settings: Settings, model: ModelFile) -> None:
    """Raise InputError for a camera that is too low for the object: no mesh exists for such a pair."""
    manifest = model.manifest.used_for(settings.object_radius, settings.max_distance)
    try:
        manifest.rings_across(orientation.height, orientation.height)
    except GeometryError as error:
        raise InputError(
            f"{error}: check the camera's height (--height, or Hoc of the lens) and --object-radius, both in meters"
        ) from error


def find_opener(configuration: Configuration, bridge: Bridge | None) -> Opener:
    """The function that opens the camera. Raises InputError for a camera or pose source that a daemon can't use."""
    camera, pose = configuration.camera, configuration.pose
    if not camera.source:
        raise InputError("no camera: give --camera, or [camera] source in vm.toml")
    if bridge is None:
        check_without_ros(pose.source)
    return (bridge.opener if bridge else camera_opener)(camera, configuration.detector.format != "bgr")


def check_lens_and_pose(configuration: Configuration) -> None:
    """Raise InputError for a pixel format, or a lens or pose of a live camera, that is missing or invalid."""
    camera = configuration.camera.source
    check_read_format(configuration.detector.format)
    orientation = configuration.fixed_orientation()  # raises InputError for angles without a height
    if not is_live(camera) or brings_lens_and_pose(camera):
        return
    if configuration.lens is None and configuration.fov is None:
        raise InputError(f"camera {without_password(camera)} needs a lens: give --lens or --fov")
    if configuration.pose.source == "fixed" and orientation is None:
        raise InputError(
            f"camera {without_password(camera)} needs poses: give --height, --pose-source, or Hoc in the lens file"
        )
