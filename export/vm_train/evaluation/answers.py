"""A network's answers on pictures, from a checkpoint, a model file, or a detector as it runs on a robot.

A checkpoint and a model file classify the same points as the training: those of the mesh at the picture's own pose. A
robot shares meshes between similar poses, so its points differ.
"""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Protocol

import numpy as np

from vm_embedded.arrays import Floats, Mask, Singles
from vm_embedded.detection.detection import Detection
from vm_embedded.detection.detector import Detector
from vm_embedded.detection.field_points import locate_features
from vm_embedded.detection.looking import Look, chain_of, look_at, worth_of
from vm_embedded.detection.objects import locate
from vm_embedded.detection.observation import Network, Observation, Stopwatch, classify
from vm_embedded.detection.places import PlanePlaces
from vm_embedded.detection.prepared_view import PreparedView
from vm_embedded.detection.projection import Projection
from vm_embedded.detection.proposals import propose
from vm_embedded.detection.pyramid import Pyramid
from vm_embedded.detection.settings import Settings
from vm_embedded.errors import InputError
from vm_embedded.field.features import FieldFeatures
from vm_embedded.files import read_bytes
from vm_embedded.geometry.orientation import rotation_z
from vm_embedded.network.choose_layout import choose_layout
from vm_embedded.network.close_look import CloseLook
from vm_embedded.network.layout import Feeds, Layout
from vm_embedded.network.manifest import Manifest
from vm_embedded.network.model_file import read_model
from vm_embedded.network.session import Session
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

    proposals: for the close look's class, the centers (c, 3) [m] of its proposals, relative to the camera, in the frame
    of `Detection.bearing`. Empty without a close look. passed: the same for the places that its first glance passes on,
    where the glance saw an object. Empty without a glance. features: of the field, or None if the network has none.
    manifest: with the radius of the objects that were looked for.
    """

    pixels: Floats
    distances: Floats
    probabilities: Singles
    found: tuple[Detection, ...]
    proposals: Mapping[str, Floats]
    passed: Mapping[str, Floats]
    manifest: Manifest
    features: FieldFeatures | None = None


class Subject(Protocol):
    """A network to evaluate. sha256: of its file. look: its close look, if it has one."""

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
    network: Network
    look: CloseLook | None = None
    upright_looks: Mapping[str, CloseLook] = field(default_factory=dict)

    def answer(self, picture: Picture, radius: float | None = None) -> PictureAnswer:
        observation = self.observe(picture, radius)
        found: tuple[Detection, ...] = ()
        features = None
        if self.grid.is_visual:
            found, _ = locate(observation, self.look, self.settings, Stopwatch())
            is_wanted = self.settings.field_features
            features = locate_features(observation, self.upright_looks, self.settings) if is_wanted else None
        return _answer(observation, found, features, self.look, self.settings)

    def observe(self, picture: Picture, radius: float | None = None) -> Observation:
        """The points of a picture with their probabilities; see `Subject.answer`."""
        manifest = self.manifest.used_for(self.settings.object_radius, self.settings.max_distance)
        if radius is not None:
            manifest = replace(manifest, radius=radius, object_radius=radius)
        shown = seen_points(picture.lens, picture.size, manifest, self.grid)
        layout = choose_layout(shown.graph, manifest)
        pixels = np.append(shown.pixels, np.full((1, 2), np.nan), axis=0)[layout.slots]  # NaN in gaps
        projected = Projection(layout, pixels, layout.slots < len(shown))
        view = _view(picture, layout, manifest, self.grid)
        return classify(
            Pyramid(picture.image, "bgr"), view, projected, manifest, self.network, self.settings, Stopwatch()
        )


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
        return _answer(seen.observation, seen.objects, seen.field, self.look, self.detector.settings)


def _answer(
    observation: Observation,
    found: tuple[Detection, ...],
    features: FieldFeatures | None,
    look: CloseLook | None,
    settings: Settings,
) -> PictureAnswer:
    distances = plane_distances(observation.rays, observation.view.height)
    proposals, passed = {}, {}
    if look is not None:
        contract = look.contract
        probabilities = observation.slot_probabilities[:, observation.manifest.column(contract.object_class)]
        name, most = contract.object_class, settings.max_proposals
        centers, _ = propose(observation, name, probabilities, contract.above, most)
        proposals[name] = centers @ observation.view.heading.T
        chain = chain_of(look)
        if len(chain) > 1:
            centers = passed_on(observation, centers, chain[0], worth_of(chain[1].contract))
            passed[name] = centers @ observation.view.heading.T
    return PictureAnswer(
        observation.pixels,
        distances,
        observation.probabilities,
        found,
        proposals,
        passed,
        observation.manifest,
        features,
    )


def passed_on(observation: Observation, centers: Floats, glance: Look, least: float) -> Floats:
    """Of places with these centers (c, 3), those to which a glance gives more than the probability `least`.

    Their centers (k, 3), where the glance saw an object. Raises ModelError if the glance does not run.
    """
    places = PlanePlaces(observation, centers)
    answers = look_at(places, glance)
    return places.centers[(answers[:, 0] > least) & (places.centers[:, 2] < 0.0)]


def _view(picture: Picture, layout: Layout, manifest: Manifest, grid: Grid) -> PreparedView:
    """The view of a picture with a mesh for its own height."""
    orientation = picture.orientation
    return PreparedView(
        layout=layout,
        levels=levels_of(picture, layout, manifest, grid),
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
        uprights = CloseLook.of_uprights(model, settings.threads, settings.spinning)
        return ExactSubject(model.manifest, VISUAL, model.sha256, settings, session, look, uprights)
    if kind != ".pt":
        raise InputError(f"{path}: a model must be a checkpoint (.pt) or a model file (.onnx), not {path.suffix!r}")
    if as_robot:
        raise InputError(f"{path}: a robot runs model files, not checkpoints; export it with vm-export first")
    from vm_export.checkpoint import Checkpoint  # torch takes a second to load, and model files don't need it

    checkpoint = Checkpoint.load(path)
    digest = hashlib.sha256(read_bytes(path)).hexdigest()
    on_canvas = checkpoint.manifest.layout == "canvas"
    manifest = checkpoint.manifest if on_canvas else replace(checkpoint.manifest, layout="plain")
    return ExactSubject(manifest, checkpoint.grid, digest, settings, TorchNetwork(checkpoint))


class TorchNetwork:
    """A checkpoint's network on one thread of torch."""

    def __init__(self, checkpoint: Checkpoint) -> None:
        import torch

        torch.set_num_threads(1)
        self._network = checkpoint.network

    def run(self, layout: Layout, colors: Singles, on_screen: Mask) -> Singles:
        """Probabilities (m, C) of the slots of a plain layout or a canvas, from their colors (3, m)."""
        import torch

        def network(feeds: Feeds) -> Singles:
            with torch.inference_mode():
                output = self._network(**{name: torch.from_numpy(each) for name, each in feeds.items()})
            return np.asarray(output.numpy(), dtype=np.float32)

        return layout.answers(network, colors, on_screen)
