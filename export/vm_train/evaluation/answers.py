"""A network's answers on pictures, from a checkpoint, a model file, or a detector as it runs on a robot.

A checkpoint and a model file classify the same points as the training: those of the mesh at the picture's own pose. A
robot shares meshes between similar poses, so its points differ.
"""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Protocol

from vm_embedded.arrays import Chosen, Floats, Mask, Singles
from vm_embedded.detection.detection import Detection
from vm_embedded.detection.detector import Detector
from vm_embedded.detection.field_points import locate_features
from vm_embedded.detection.looking import judge_classes
from vm_embedded.detection.objects import locate
from vm_embedded.detection.observation import Classifier, Observation, Stopwatch, classify
from vm_embedded.detection.prepared_view import PreparedView
from vm_embedded.detection.pyramid import Pyramid
from vm_embedded.detection.settings import Settings
from vm_embedded.errors import InputError
from vm_embedded.field.features import FieldFeatures
from vm_embedded.files import read_bytes
from vm_embedded.geometry.orientation import rotation_z
from vm_embedded.mesh.mesh import Mesh
from vm_embedded.network.choose_layout import choose_layout
from vm_embedded.network.layout import Layout
from vm_embedded.network.manifest import Manifest
from vm_embedded.network.model_file import read_model
from vm_embedded.network.session import CloseLook, Session
from vm_export.grid import VISUAL, Grid

from ..data.pictures import Picture
from ..graphs.labeled_graph import levels_of, plane_distances
from ..graphs.seen_points import seen_points

if TYPE_CHECKING:
    from vm_export.checkpoint import Checkpoint


@dataclass(frozen=True, eq=False)
class PictureAnswer:
    """The answer to a picture: pixels (n, 2), distances (n,) on the plane [m] and probabilities (n, C) of its points,
    and the objects found, most confident first.

    proposals: for each class of kind object with a close look, the centers (c, 3) [m] of the peaks that it judges,
    relative to the camera, in the frame of `Detection.bearing`. features: of the field, or None if the network has
    none. manifest: with the radius of the objects that were looked for.
    """

    pixels: Floats
    distances: Floats
    probabilities: Singles
    found: tuple[Detection, ...]
    proposals: Mapping[str, Floats]
    manifest: Manifest
    features: FieldFeatures | None = None


class Subject(Protocol):
    """A network to evaluate. sha256: of its file. look: its close look."""

    @property
    def manifest(self) -> Manifest: ...
    @property
    def grid(self) -> Grid: ...
    @property
    def sha256(self) -> str: ...
    @property
    def look(self) -> CloseLook | None: ...

    def answer(self, picture: Picture, radius: float | None = None) -> PictureAnswer:
        """Its answer to a picture. radius [m]: of the objects, for the mesh and the fits, if not the manifest's.

        Raises GeometryError if the camera is too low for a mesh, and InputError for a lens that does not fit.
        """


@dataclass(eq=False)
class ExactSubject:
    """A network at the points of each picture's own mesh."""

    manifest: Manifest
    grid: Grid
    sha256: str
    settings: Settings
    network: Classifier
    look: CloseLook | None = None

    def answer(self, picture: Picture, radius: float | None = None) -> PictureAnswer:
        observation = self.observe(picture, radius)
        found: tuple[Detection, ...] = ()
        features = None
        if self.grid.is_visual:
            is_wanted = self.settings.field_features
            judged = judge_classes(observation, self.look, self.settings, Stopwatch(), uprights=is_wanted)
            found, _ = locate(observation, judged, self.settings, Stopwatch())
            features = locate_features(observation, judged) if is_wanted else None
        return _answer(observation, found, features, self.look)

    def observe(self, picture: Picture, radius: float | None = None) -> Observation:
        """The points of a picture with their probabilities; see `Subject.answer`."""
        manifest = self.manifest.used_for(self.settings.object_radius, self.settings.max_distance)
        if radius is not None:
            manifest = replace(manifest, radius=radius, object_radius=radius)
        shown = seen_points(picture.lens, picture.size, manifest, self.grid)
        view = _view(picture, shown.graph, manifest, self.grid)
        return classify(Pyramid(picture.image, "bgr"), view, shown, manifest, self.network, self.settings, Stopwatch())


@dataclass(eq=False)
class RobotSubject:
    """A detector as it runs on a robot, with its shared meshes."""

    detector: Detector
    sha256: str
    grid: Grid = VISUAL

    @property
    def manifest(self) -> Manifest:
        return self.detector.manifest

    @property
    def look(self) -> CloseLook | None:
        return self.detector.look

    def answer(self, picture: Picture, radius: float | None = None) -> PictureAnswer:
        assert radius is None  # a robot's network is for balls of one size
        seen = self.detector.detect(picture.image, picture.orientation, picture.lens.lens)
        return _answer(seen.observation, seen.objects, seen.field, self.look)


def _answer(
    observation: Observation,
    found: tuple[Detection, ...],
    features: FieldFeatures | None,
    look: CloseLook | None,
) -> PictureAnswer:
    distances, view = plane_distances(observation.rays, observation.view.height), observation.view
    proposals = {}
    if look is not None:
        for name in (each.name for each in look.contract.classes if not each.upright_radius):
            rays = observation.peaks[name].rays[: look.contract.max_proposals]
            proposals[name] = view.shape.center_along(rays, view.height) @ view.heading.T
    return PictureAnswer(
        observation.pixels, distances, observation.probabilities, found, proposals, observation.manifest, features
    )


def _view(picture: Picture, mesh: Mesh, manifest: Manifest, grid: Grid) -> PreparedView:
    """The view of a picture with this mesh for its own height."""
    orientation = picture.orientation
    return PreparedView(
        mesh=mesh,
        layout=choose_layout(mesh, manifest),
        levels=levels_of(picture, mesh, manifest, grid),
        shape=manifest.object_shape,
        rings=manifest.rings_across(orientation.height, orientation.height),
        height=orientation.height,
        rotation=orientation.level,
        heading=rotation_z(orientation.yaw),
        lens=picture.fitted_lens,
        size=picture.size,
    )


def load_subject(path: Path, settings: Settings, as_robot: bool = False) -> Subject:
    """Read a checkpoint (.pt) or a model file (.onnx).

    as_robot: run it as a robot does; only model files can. Raises InputError or ModelError for other files.
    """
    kind = path.suffix.lower()
    if kind == ".onnx":
        model = read_model(path)
        if as_robot:
            return RobotSubject(Detector(model, settings), model.sha256)
        session = Session(model, settings.threads, settings.spinning)
        look = CloseLook.of(model, settings.threads, settings.spinning)
        return ExactSubject(model.manifest, VISUAL, model.sha256, settings, session, look)
    if kind != ".pt":
        raise InputError(f"{path}: a model must be a checkpoint (.pt) or a model file (.onnx), not {path.suffix!r}")
    if as_robot:
        raise InputError(f"{path}: a robot runs model files, not checkpoints; export it with vm-export first")
    from vm_export.checkpoint import Checkpoint  # torch takes a second to load, and model files don't need it

    checkpoint = Checkpoint.load(path)
    digest = hashlib.sha256(read_bytes(path)).hexdigest()
    return ExactSubject(checkpoint.manifest, checkpoint.grid, digest, settings, TorchNetwork(checkpoint))


class TorchNetwork:
    """A checkpoint's network on one thread of torch."""

    def __init__(self, checkpoint: Checkpoint) -> None:
        import torch

        torch.set_num_threads(1)
        self._network = checkpoint.network

    def run(self, layout: Layout, colors: Singles, on_screen: Mask, points: Chosen) -> Singles:
        """See detection.observation.Classifier."""
        import torch

        feeds = {name: torch.from_numpy(each) for name, each in layout.feeds(colors, on_screen).items()}
        with torch.inference_mode():
            output: Singles = self._network(**feeds).numpy()
        return layout.read(output, points)
