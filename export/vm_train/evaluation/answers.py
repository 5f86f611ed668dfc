"""A network's answers on pictures: those of a checkpoint and of a model file alike, or what a robot would get.

Checkpoints and model files are asked at the same points, those of the mesh at a picture's own pose, which are also
those of the training. A robot shares meshes between poses that are near each other, so its points differ.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Protocol

import numpy as np

from vm_embedded.arrays import Floats, Singles
from vm_embedded.detection.detections import Detection
from vm_embedded.detection.detector import Detector
from vm_embedded.detection.objects import Scene, find_objects
from vm_embedded.detection.projection import Projection
from vm_embedded.detection.settings import Settings
from vm_embedded.errors import InputError
from vm_embedded.geometry.orientation import Orientation, rotation_z
from vm_embedded.mesh.mesh import Mesh
from vm_embedded.network.choose_layout import choose_layout
from vm_embedded.network.layout import Layout
from vm_embedded.network.manifest import Manifest
from vm_embedded.network.model_file import read_model
from vm_embedded.network.plain_layout import PlainLayout
from vm_embedded.network.session import Session
from vm_export.grid import VISUAL, Grid

from ..data.pictures import Picture
from ..graphs.labeled_graph import OFF_SCREEN, color, plane_distances, seen_points

if TYPE_CHECKING:
    from vm_export.checkpoint import Checkpoint

Network = Callable[[Mesh, Singles], Singles]
"""Probabilities (n, C) of a mesh's points from their colors (n, 3)."""


@dataclass(frozen=True, eq=False)
class Answer:
    """What a network says of a picture: pixels (n, 2), distances (n,) on the plane [m] and probabilities (n, C) of its
    points, and the objects that it found, most confident first."""

    pixels: Floats
    distances: Floats
    probabilities: Singles
    found: tuple[Detection, ...]


class Subject(Protocol):
    """What is evaluated. sha256: of the file that it was read from."""

    @property
    def manifest(self) -> Manifest: ...
    @property
    def grid(self) -> Grid: ...
    @property
    def sha256(self) -> str: ...

    def answer(self, picture: Picture, radius: float | None = None) -> Answer:
        """What it says of a picture. radius [m]: of the objects that mesh and fit are for, if not the manifest's.

        Raises GeometryError if the camera is too low for a mesh, and InputError for a lens that does not fit.
        """


@dataclass(eq=False)
class Exact:
    """A network at the points of a picture's own mesh."""

    manifest: Manifest
    grid: Grid
    sha256: str
    settings: Settings
    network: Network

    def answer(self, picture: Picture, radius: float | None = None) -> Answer:
        manifest = self.manifest.used_for(self.settings.object_radius, self.settings.max_distance)
        if radius is not None:
            manifest = replace(manifest, radius=radius, object_radius=radius)
        height, width = picture.labels.shape
        orientation = _orientation(picture)
        shown = seen_points(picture.lens, (width, height), manifest, self.grid)
        colors = np.empty((len(shown), 3), dtype=np.float32)
        color(picture, shown, manifest, self.grid, self.settings.sampling, colors)
        probabilities = np.zeros((0, len(manifest.classes)), dtype=np.float32)
        if len(shown):
            probabilities = self.network(shown.graph, colors)
        found: tuple[Detection, ...] = ()
        if self.grid.kind == VISUAL.kind:
            scene = scene_of(picture, shown, manifest)
            found, _ = find_objects(scene, manifest.classes, probabilities, self.settings)
        return Answer(shown.pixels, plane_distances(shown.graph.rays, orientation.height), probabilities, found)


@dataclass(eq=False)
class Robot:
    """A detector as it runs on a robot, with its shared meshes."""

    detector: Detector
    sha256: str
    grid: Grid = VISUAL

    @property
    def manifest(self) -> Manifest:
        return self.detector.manifest

    def answer(self, picture: Picture, radius: float | None = None) -> Answer:
        assert radius is None  # a robot's network is for balls of one size
        orientation = _orientation(picture)
        seen = self.detector.detect(picture.image, orientation, picture.lens.lens)
        return Answer(seen.pixels, plane_distances(seen.rays, orientation.height), seen.probabilities, seen.objects)


def load_subject(path: Path, settings: Settings, as_robot: bool = False) -> Subject:
    """Read a checkpoint (.pt) or a model file (.onnx).

    Raises InputError or ModelError for a file that is neither, or for a checkpoint that is to run as on a robot.
    """
    kind = path.suffix.lower()
    if kind == ".onnx":
        model = read_model(path)
        if as_robot:
            return Robot(Detector(model, settings), model.sha256)
        return Exact(model.manifest, VISUAL, model.sha256, settings, _of_session(Session(model, settings)))
    if kind != ".pt":
        raise InputError(f"{path}: a model is a checkpoint (.pt) or a model file (.onnx)")
    if as_robot:
        raise InputError(f"{path}: a robot has no checkpoints; write a model file with vm-export first")
    from vm_export.checkpoint import Checkpoint  # torch takes a second to load, and model files do without it

    checkpoint = Checkpoint.load(path)
    digest = hashlib.sha256(path.read_bytes()).hexdigest()
    return Exact(checkpoint.manifest, checkpoint.grid, digest, settings, _of_checkpoint(checkpoint))


def _of_session(session: Session) -> Network:
    def run(mesh: Mesh, colors: Singles) -> Singles:
        layout = choose_layout(mesh, session.model.manifest)
        return session.run(layout, _colored(layout, colors), layout.slots < len(mesh))[layout.places]

    return run


def _of_checkpoint(checkpoint: Checkpoint) -> Network:
    import torch

    torch.set_num_threads(1)

    def run(mesh: Mesh, colors: Singles) -> Singles:
        layout = PlainLayout(mesh, checkpoint.manifest.edge)
        feeds = layout.feeds(_colored(layout, colors), np.ones(len(mesh), dtype=bool))
        with torch.inference_mode():
            output = checkpoint.network(torch.from_numpy(feeds["points"]), torch.from_numpy(feeds["neighbors"]))
        return np.asarray(output[:-1].numpy())

    return run


def _colored(layout: Layout, colors: Singles) -> Singles:
    """A layout's points with the colors (n, 3) of its mesh."""
    points = layout.points()
    layout.colors(points)[:] = np.append(colors, np.full((1, 3), OFF_SCREEN, dtype=np.float32), axis=0)[layout.slots]
    return points


def _orientation(picture: Picture) -> Orientation:
    orientation = picture.lens.orientation
    assert orientation is not None  # read_picture has seen to it
    return orientation


def scene_of(picture: Picture, shown: Projection[Mesh], manifest: Manifest) -> Scene:
    """Where objects are sought among the points of a picture's own mesh."""
    height, width = picture.labels.shape
    orientation = _orientation(picture)
    shape = manifest.object_shape
    above = orientation.height
    return Scene(
        shape=shape,
        height=above,
        rotation=orientation.level,
        heading=rotation_z(orientation.yaw),
        lens=picture.lens.lens.for_image((width, height)),
        size=(width, height),
        projected=shown,
        order=np.arange(len(shown), dtype=np.int32),
        rings=manifest.model.rings(manifest.mesh_shape, above, manifest.intersections, shape, above),
    )
