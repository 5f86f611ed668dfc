"""The Visual Mesh detector for robots: numpy, ONNX Runtime and OpenCV, nothing else."""

from .detections import ClassPoints, Detection, Detections
from .detector import Detector
from .errors import GeometryError, InputError, ModelError, VisualMeshError
from .lens import Equidistant, Equisolid, Lens, Rectilinear
from .lens_file import read_lens_file
from .lens_opencv import BrownLens, FisheyeLens
from .orientation import Orientation
from .planes import GROUND, Plane, Pose
from .settings import Settings
from .views import Sighting, View, detect_views

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
