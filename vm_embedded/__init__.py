"""The Visual Mesh detector for robots: numpy, ONNX Runtime and OpenCV, nothing else."""

from .detection.detection import Detection
from .detection.detections import ClassPoints, Detections
from .detection.detector import Detector
from .detection.multi_view import CameraView, Sighting, detect_views
from .detection.settings import Settings
from .detection.track import Track
from .detection.track_settings import TrackSettings
from .detection.tracker import Tracker
from .errors import GeometryError, InputError, ModelError, VisualMeshError
from .field.features import Border, CenterCircle, Crossing, FieldFeatures, Segment, Upright
from .geometry.calibrated_lenses import BrownLens, FisheyeLens
from .geometry.lens import Lens
from .geometry.lens_files import read_lens_file
from .geometry.orientation import Orientation
from .geometry.planes import GROUND, Plane, Pose
from .geometry.radial_lenses import Equidistant, Equisolid, Rectilinear
from .geometry.shapes import Circle, Cylinder, Sphere
from .mesh.models import build_mesh

__all__ = [
    "GROUND",
    "Border",
    "BrownLens",
    "CameraView",
    "CenterCircle",
    "Circle",
    "ClassPoints",
    "Crossing",
    "Cylinder",
    "Detection",
    "Detections",
    "Detector",
    "Equidistant",
    "Equisolid",
    "FieldFeatures",
    "FisheyeLens",
    "GeometryError",
    "InputError",
    "Lens",
    "ModelError",
    "Orientation",
    "Plane",
    "Pose",
    "Rectilinear",
    "Segment",
    "Settings",
    "Sighting",
    "Sphere",
    "Track",
    "TrackSettings",
    "Tracker",
    "Upright",
    "VisualMeshError",
    "build_mesh",
    "detect_views",
    "read_lens_file",
]

__version__ = "0.1.0"
