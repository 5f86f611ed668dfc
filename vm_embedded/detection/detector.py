"""The straight line from a frame and an orientation to detections."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from time import perf_counter

from ..arrays import Image
from ..geometry.lens import Lens
from ..geometry.orientation import Orientation
from ..network.bundled import model_path
from ..network.model_file import ModelFile, read_model
from ..network.session import Session
from .cache import MeshCache
from .color_normalization import make_relative
from .detections import Detections
from .objects import Scene, find_objects
from .projection import project
from .sampling import checked_image, sample
from .settings import Settings


class Detector:
    """A network, its meshes and its settings.

        detector = Detector.from_file("model.onnx")
        for ball in detector.detect(image, orientation, lens):
            print(ball.class_name, ball.distance, ball.position)

    Not for several threads at once: they share its cache.
    """

    def __init__(self, model: ModelFile, settings: Settings | None = None) -> None:
        self.settings = settings or Settings()
        self.manifest = model.manifest.used_for(self.settings.object_radius, self.settings.max_distance)
        self.session = Session(model, self.settings)
        self.cache = MeshCache(self.manifest, self.settings)
        self.shape = self.manifest.object_shape

    @classmethod
    def from_file(cls, path: str | Path, settings: Settings | None = None) -> Detector:
        """From a file that vm-export wrote, or a network of the package by its name.

        Raises ModelError if it is not to be trusted or does not run.
        """
        return cls(read_model(model_path(path)), settings)

    def detect(self, image: Image, orientation: Orientation, lens: Lens, explain: bool = False) -> Detections:
        """What the image shows.

        image: uint8 (height, width[, channels]) in the settings' pixel format. orientation: of the camera when it was
        taken. explain: also return the rejected clusters. A camera that sees no part of the plane gives no points and
        no detections.

        Raises InputError for an image or lens that doesn't fit, GeometryError for a camera too low for the object.
        """
        timing: dict[str, float] = {}
        started = perf_counter()
        image = checked_image(image, self.settings.format)
        size = image.shape[1], image.shape[0]
        lens = lens.for_image(size)
        with _timed(timing, "mesh"):
            view = self.cache.view(orientation, lens, size)
            rings = self.manifest.model.rings(
                self.cache.shape, view.mesh_height, self.manifest.intersections, self.shape, orientation.height
            )
        layout = view.layout
        with _timed(timing, "project"):
            projected = project(layout, view.rotation, lens, size)
        with _timed(timing, "sample"):
            points = layout.points()
            colors = layout.colors(points)
            sample(image, projected.pixels, self.settings.format, self.settings.sampling, colors, view.levels)
            if self.manifest.colors == "relative":
                make_relative(colors, projected.on_screen & layout.original)
        with _timed(timing, "infer"):
            probabilities = self.session.run(layout, points, projected.on_screen)
        with _timed(timing, "cluster"):
            projected = projected.only(layout.original)
            scene = Scene(
                shape=self.shape,
                height=orientation.height,
                rotation=view.rotation,
                heading=view.heading,
                lens=lens,
                size=size,
                projected=projected,
                order=layout.slots,
                rings=rings,
            )
            found, rejected = find_objects(scene, self.manifest.classes, probabilities, self.settings, explain)
        timing["total"] = 1e3 * (perf_counter() - started)
        return Detections(
            objects=found,
            rejected=rejected,
            manifest=self.manifest,
            layout=layout,
            projected=projected,
            answers=probabilities,
            heading=view.heading,
            threshold=self.settings.threshold,
            timing_ms=timing,
        )


@contextmanager
def _timed(timing: dict[str, float], stage: str) -> Iterator[None]:
    """Add a stage's milliseconds to `timing`."""
    started = perf_counter()
    yield
    timing[stage] = 1e3 * (perf_counter() - started)
