"""The Visual Mesh detector for robots: numpy, ONNX Runtime and OpenCV, nothing else."""

from .detection.detections import ClassPoints, Detection, Detections
from .detection.detector import Detector
from .detection.multi_view import Sighting, View, detect_views
from .detection.settings import Settings
from .errors import GeometryError, InputError, ModelError, VisualMeshError
from .geometry.calibrated_lenses import BrownLens, FisheyeLens
from .geometry.lens import Equidistant, Equisolid, Lens, Rectilinear
from .geometry.lens_files import read_lens_file
from .geometry.orientation import Orientation
from .geometry.planes import GROUND, Plane, Pose

__all__ = [
    "GROUND",
    "BrownLens",
    "ClassPoints",
    "Detection",
    "Detections",
    "Detector",
    "Equidistant",
    "Equisolid",
    "FisheyeLens",
    "GeometryError",
    "InputError",
    "Lens",
    "ModelError",
    "Orientation",
    "Plane",
    "Pose",
    "Rectilinear",
    "Settings",
    "Sighting",
    "View",
    "VisualMeshError",
    "detect_views",
    "read_lens_file",
]

__version__ = "0.1.0"
