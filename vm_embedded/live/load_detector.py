"""Load the configured detector and check that the configuration fits together."""

from __future__ import annotations

from ..cameras.camera import without_password
from ..cameras.open_camera import brings_lens_and_pose, camera_opener, is_live
from ..detection.detector import Detector
from ..errors import InputError
from ..network.bundled import model_path
from ..network.model_file import read_model
from .configuration import Configuration
from .proof import prove


def load_checked_detector(configuration: Configuration) -> tuple[Detector, str]:
    """Load the configured network, prove that it works, and check camera, lens, poses and trigger class.

    Return the detector, and in words what was proved. Raises VisualMeshError for the first thing that is missing or
    invalid.
    """
    model = read_model(model_path(configuration.model))
    proved = prove(model)
    detector = Detector(model, configuration.detector)
    camera = configuration.camera.source
    orientation = configuration.fixed_orientation()  # raises InputError for angles without a height
    if is_live(camera):
        camera_opener(configuration.camera, raw=configuration.detector.format != "bgr")  # only for its checks
    if configuration.recorder.trigger_class:
        detector.manifest.column(configuration.recorder.trigger_class)
    if is_live(camera) and not brings_lens_and_pose(camera):
        if configuration.lens is None:
            raise InputError(f"camera {without_password(camera)} needs a lens: give --lens")
        if configuration.pose.source == "fixed" and orientation is None:
            raise InputError(
                f"camera {without_password(camera)} needs poses: give --height, --pose-source, or Hoc in the lens file"
            )
    return detector, proved
