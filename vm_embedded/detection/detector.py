"""The detector: from a frame and the camera's orientation to detections."""

from __future__ import annotations

from pathlib import Path

from ..arrays import AnyImage
from ..errors import InputError
from ..geometry.lens import Lens, Size
from ..geometry.orientation import Orientation
from ..network.bundled import model_path
from ..network.close_look import CloseLook
from ..network.model_file import ModelFile, read_model
from ..network.session import Session
from .cache import MeshCache
from .detections import Detections
from .field_points import locate_features
from .objects import locate
from .observation import Observation, Stopwatch, observe
from .pixel_formats import checked_image
from .pyramid import Pyramid
from .settings import Settings


class Detector:
    """A network, its meshes and its settings.

        detector = Detector.from_file("model.onnx")
        for ball in detector.detect(image, orientation, lens):
            print(ball.class_name, ball.distance, ball.position)

    Use it from one thread only; its calls share a cache. Several detectors may run in threads at the same time. A
    detector can't be pickled: load one in each process. Raises ModelError if the network does not run.
    """

    def __init__(self, model: ModelFile, settings: Settings | None = None) -> None:
        if not isinstance(model, ModelFile):
            raise InputError(f"model must be a ModelFile, not {model!r}; Detector.from_file takes names and paths")
        if not isinstance(settings, Settings | None):
            raise InputError(f"settings must be Settings(...), not {settings!r}")
        self.settings = settings or Settings()
        self.manifest = model.manifest.used_for(self.settings.object_radius, self.settings.max_distance)
        self.session = Session(model, self.settings.threads, self.settings.spinning)
        self.look = CloseLook.of(model, self.settings.threads, self.settings.spinning)
        self.upright_looks = CloseLook.of_uprights(model, self.settings.threads, self.settings.spinning)
        self.cache = MeshCache(self.manifest, self.settings, self.session.arrange)
        self.shape = self.manifest.object_shape

    @classmethod
    def from_file(cls, path: str | Path, settings: Settings | None = None) -> Detector:
        """Load a detector from a file that vm-export wrote, or by the name of a network of the package.

        Raises InputError for an unknown name, ModelError if the file is damaged or the network does not run.
        """
        return cls(read_model(model_path(path)), settings)

    def detect(
        self, image: AnyImage | None, orientation: Orientation | None, lens: Lens, explain: bool = False
    ) -> Detections:
        """Find objects in an image. A camera that sees no part of the plane gives no points and no detections.

        image: uint8 (height, width[, channels]) in the pixel format of the settings. It is not copied, and drawing or
        saving the result reads it again. orientation: of the camera at the time of the image. explain: also return the
        rejected candidates.

        Raises InputError for an image or lens that doesn't fit, and if image or orientation is None. GeometryError: the
        camera is too low for the object. cv2.imread returns None if it can't read a file. A lens file without a pose
        has the orientation None.
        """
        return self.locate(self.observe(image, orientation, lens), explain)

    def prepare_nearby(self, orientation: Orientation, lens: Lens, size: Size) -> bool:
        """Prepare a missing bucket beside the bucket of a frame's orientation, and return whether one was prepared.

        Call it between frames, when there is time: it takes as long as a call of `detect`. When the camera moves on,
        the frame that needs the bucket is then as fast as the others. lens, orientation: of the last frame; size: of
        its image, as width and height [px]. Raises InputError for a lens that doesn't fit, GeometryError for a camera
        too low for the object.
        """
        return self.cache.prepare_nearby(orientation, lens.for_image(size), size)

    def observe(self, image: AnyImage | None, orientation: Orientation | None, lens: Lens) -> Observation:
        """Classify the mesh points in an image: the first step of `detect`, with the same arguments and errors.

        The image is not copied, and `locate` reads it again.
        """
        frame = checked_image(image, self.settings.format)
        if orientation is None:
            raise InputError("there is no orientation: perhaps the lens file has no pose (Hoc); give an Orientation")
        if not isinstance(orientation, Orientation):
            raise InputError(
                "orientation must be an Orientation, as read_lens_file(PATH).orientation, "
                f"not {type(orientation).__name__}"
            )
        if not isinstance(lens, Lens):
            raise InputError(f"lens must be a Lens, as read_lens_file(PATH).lens, not {type(lens).__name__}")
        size = frame.shape[1], frame.shape[0]
        lens = lens.for_image(size)
        watch = Stopwatch()
        view = self.cache.view(orientation, lens, size)
        watch.lap("mesh")
        return observe(Pyramid(frame, self.settings.format), view, self.manifest, self.session, self.settings, watch)

    def locate(self, observation: Observation, explain: bool = False) -> Detections:
        """Find objects and field features among classified points: the second step of `detect`.

        The result keeps the frame in memory. Raises ModelError if the close look does not run.
        """
        watch = Stopwatch()
        found, rejected = locate(observation, self.look, self.settings, watch, explain)
        is_wanted = self.settings.field_features
        features = locate_features(observation, self.upright_looks, self.settings) if is_wanted else None
        if features is not None:
            watch.lap("field")
        timing = {**observation.timing_ms, **watch.stages}
        timing["total"] = sum(timing.values())
        return Detections(found, rejected, observation, self.settings.threshold, timing, features)
