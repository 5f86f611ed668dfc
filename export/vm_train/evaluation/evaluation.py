"""How well a network does on pictures: scores of points and of objects, the worst, and what could not be read.

Evaluations of parts of the pictures add up.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from vm_embedded.errors import GeometryError, InputError
from vm_embedded.network.manifest import Manifest

from ..data.classes import Classes
from ..data.picture_files import PictureFault, PictureFiles
from ..data.pictures import Picture, read_picture
from ..scores.object_scores import ObjectScores
from ..scores.point_scores import PointScores
from .answers import Answer, Subject
from .object_truth import SceneTruth, read_scene, true_objects
from .worst_errors import WorstErrors, worst_errors_of

RADII = ("all", "scene")
"""Which radius mesh and fit have. all: the network's. scene: that of each picture's own balls, as vm-synth knows it."""


@dataclass(frozen=True)
class Rules:
    """How pictures are evaluated. radius_of: one of RADII. min_radius: of objects that are to be found [px]. strict:
    a picture that can't be used ends it."""

    radius_of: str = "all"
    min_radius: float = 2.0
    strict: bool = False


@dataclass(frozen=True)
class CameraPose:
    """Where the camera of a picture was: height [m] and pitch [rad]."""

    files: PictureFiles
    height: float
    pitch: float


@dataclass(eq=False)
class Evaluation:
    """What came of some pictures.

    objects: scores by class of the kind object. poses: of all pictures that were evaluated. radii: of the balls [m], of
    each picture that has a sceneX.json. faults: pictures that were not evaluated, by path, and why.
    """

    points: PointScores
    objects: dict[str, ObjectScores]
    poses: list[CameraPose] = field(default_factory=list)
    radii: list[float] = field(default_factory=list)
    faults: dict[str, str] = field(default_factory=dict)
    worst: WorstErrors = field(default_factory=WorstErrors)

    @classmethod
    def of_nothing(cls, subject: Subject, rules: Rules) -> Evaluation:
        """What comes of no pictures. A network of another grid than the runtime's finds no objects."""
        classes = subject.manifest.classes
        objects = [each.name for each in classes if each.kind == "object" and subject.grid.kind == "visual"]
        scores = {name: ObjectScores(min_radius=rules.min_radius) for name in objects}
        return cls(PointScores([each.name for each in classes]), scores)

    def __add__(self, other: Evaluation) -> Evaluation:
        """What came of the pictures of both. Raises InputError if they are of other classes or rules."""
        return Evaluation(
            self.points + other.points,
            {name: scores + other.objects[name] for name, scores in self.objects.items()},
            self.poses + other.poses,
            self.radii + other.radii,
            self.faults | other.faults,
            self.worst + other.worst,
        )

    def count(
        self, files: PictureFiles, picture: Picture, scene: SceneTruth | None, answer: Answer, manifest: Manifest
    ) -> None:
        """Count what a network answered on a picture. Raises ModelError for answers that are no probabilities."""
        x, y = np.rint(answer.pixels).astype(np.intp).T
        self.points.add(answer.probabilities, picture.labels[y, x], answer.distances)
        for name, truths in true_objects(picture, scene, manifest).items():
            if name in self.objects:
                found = [each for each in answer.found if each.class_name == name]
                mistakes = self.objects[name].add(truths, found)
                self.worst += worst_errors_of(files, name, truths, found, mistakes)
        if scene is not None:
            self.radii.append(scene.ball_radius)
        orientation = picture.lens.orientation
        assert orientation is not None
        self.poses.append(CameraPose(files, orientation.height, orientation.pitch))


def evaluated(subject: Subject, pictures: Sequence[PictureFiles], classes: Classes, rules: Rules) -> Evaluation:
    """What comes of these pictures; those that can't be used are named in `faults`.

    Raises InputError for a mask with a color of no class, with `strict` for every picture that can't be used, and
    ModelError for answers that are no probabilities.
    """
    result = Evaluation.of_nothing(subject, rules)
    for files in pictures:
        try:
            picture, scene = _read(files, classes, rules)
            answer = subject.answer(picture, scene.ball_radius if scene and rules.radius_of == "scene" else None)
        except (InputError, GeometryError) as error:
            if isinstance(error, PictureFault) and error.kind == "color":
                # Such colors are in many masks, and to leave these out would make another set of it.
                raise InputError(f"{files.mask}: {error}; --color CLASS=R,G,B gives a color to a class") from error
            if rules.strict:
                raise InputError(f"{files.image}: {error}") from error
            result.faults[str(files.image)] = str(error)
        else:
            result.count(files, picture, scene, answer, subject.manifest)
    return result


def _read(files: PictureFiles, classes: Classes, rules: Rules) -> tuple[Picture, SceneTruth | None]:
    picture = read_picture(files, classes)
    scene = read_scene(files.image.with_name(f"scene{files.number}.json"))
    if scene is None and rules.radius_of == "scene":
        raise InputError(f"scene{files.number}.json: is missing, and would tell the radius of the balls")
    return picture, scene
