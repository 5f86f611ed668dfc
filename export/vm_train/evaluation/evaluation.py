"""The result of an evaluation: scores of points, objects, proposals and field features, worst errors, skipped pictures.

Results for parts of the pictures add up to the result for all of them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from vm_embedded.errors import GeometryError, InputError

from ..data.classes import Classes
from ..data.picture_files import PictureFault, PictureFiles
from ..data.pictures import Picture, read_picture
from ..scores.field_scores import FieldScores
from ..scores.object_scores import ObjectScores
from ..scores.point_scores import PointScores
from ..scores.proposal_scores import ProposalScores
from ..truth.field import CLASSES, FieldScene, field_truth, read_field
from ..truth.objects import SceneTruth, read_scene, true_objects
from .answers import PictureAnswer, Subject
from .worst_errors import WorstErrors, worst_errors_of

MIN_RADIUS = 2.0
"""Smaller true objects are ignored [px]."""


@dataclass(frozen=True)
class Rules:
    """How to evaluate pictures.

    radius_of: radius for the mesh, and for the search for the outline that fits best. all: the network's; scene: that
    of each picture's balls, from the sceneX.json of vm-synth. strict: stop at the first picture that can't be used.
    """

    radius_of: str = "all"
    strict: bool = False


@dataclass(frozen=True)
class CameraPose:
    """The camera of a picture: height [m] and pitch [rad]."""

    files: PictureFiles
    height: float
    pitch: float


@dataclass(eq=False)
class Evaluation:
    """The result for some pictures.

    objects: scores for each class of the kind object. proposals: scores for each of them that has a
    close look. poses: of the evaluated pictures. radii: of the balls [m], one
    for each picture with a sceneX.json. faults: the reason for each picture that was not evaluated, by path. features:
    scores of field features, for a Visual Mesh with the classes for them.
    """

    points: PointScores
    objects: dict[str, ObjectScores]
    proposals: dict[str, ProposalScores] = field(default_factory=dict)
    poses: list[CameraPose] = field(default_factory=list)
    radii: list[float] = field(default_factory=list)
    faults: dict[str, str] = field(default_factory=dict)
    worst: WorstErrors = field(default_factory=WorstErrors)
    features: FieldScores | None = None

    @classmethod
    def empty(cls, subject: Subject) -> Evaluation:
        """The result for no pictures. It has scores of objects only for a Visual Mesh: the fit works on its rings."""
        classes = subject.manifest.classes
        objects = [each.name for each in classes if each.kind == "object" and subject.grid.is_visual]
        scores = {name: ObjectScores(min_radius=MIN_RADIUS) for name in objects}
        judged = () if subject.look is None else subject.look.contract.names
        proposals = {name: ProposalScores(MIN_RADIUS) for name in scores if name in judged}
        names = {each.name for each in classes}
        features = FieldScores() if subject.grid.is_visual and names.issuperset(CLASSES) else None
        return cls(PointScores([each.name for each in classes]), scores, proposals, features=features)

    def __add__(self, other: Evaluation) -> Evaluation:
        """The result for the pictures of both. Raises InputError if their classes or rules differ."""
        return Evaluation(
            self.points + other.points,
            {name: scores + other.objects[name] for name, scores in self.objects.items()},
            {name: scores + other.proposals[name] for name, scores in self.proposals.items()},
            self.poses + other.poses,
            self.radii + other.radii,
            self.faults | other.faults,
            self.worst + other.worst,
            None if self.features is None or other.features is None else self.features + other.features,
        )

    def count(
        self,
        files: PictureFiles,
        picture: Picture,
        scene: SceneTruth | None,
        answer: PictureAnswer,
        stage: FieldScene | None = None,
    ) -> None:
        """Add a network's answer on a picture. stage: what its scene file tells about the field.

        Raises ModelError for probabilities outside 0 to 1.
        """
        x, y = np.rint(answer.pixels).astype(np.intp).T
        self.points.add(answer.probabilities, picture.labels[y, x], answer.distances)
        for name, truths in true_objects(picture, scene, answer.manifest).items():
            if name in self.objects:
                found = [each for each in answer.found if each.class_name == name]
                mistakes = self.objects[name].add(truths, found)
                self.worst += worst_errors_of(files, name, truths, found, mistakes)
            if name in self.proposals:
                self.proposals[name].add(truths, answer.proposals[name])
        if self.features is not None and answer.features is not None:
            truth = field_truth(picture, stage, [each.name for each in answer.manifest.classes])
            self.features.add(truth, answer.features)
        if scene is not None:
            self.radii.append(scene.radius)
        self.poses.append(CameraPose(files, picture.orientation.height, picture.orientation.pitch))


def evaluate_pictures(subject: Subject, pictures: Sequence[PictureFiles], classes: Classes, rules: Rules) -> Evaluation:
    """The result for these pictures; `faults` names those that can't be used.

    Raises InputError for a mask color that belongs to no class, and with `strict` for any picture that can't be used.
    Raises ModelError for probabilities outside 0 to 1.
    """
    result = Evaluation.empty(subject)
    for files in pictures:
        try:
            picture, scene = _read(files, classes, rules)
            stage = None if result.features is None else read_field(files.scene)
            answer = subject.answer(picture, scene.radius if scene and rules.radius_of == "scene" else None)
        except (InputError, GeometryError) as error:
            if isinstance(error, PictureFault) and error.kind == "color":
                # Many masks may have this color. To skip them all would change what the scores measure.
                reason = str(error).removeprefix(f"{files.mask.name}: ")
                raise InputError(f"{files.mask}: {reason}; assign it to a class with --color CLASS=R,G,B") from error
            if rules.strict:
                raise InputError(f"{files.image}: {error}") from error
            result.faults[str(files.image)] = str(error)
        else:
            result.count(files, picture, scene, answer, stage)
    return result


def _read(files: PictureFiles, classes: Classes, rules: Rules) -> tuple[Picture, SceneTruth | None]:
    picture = read_picture(files, classes)
    scene = read_scene(files.scene)
    if scene is None and rules.radius_of == "scene":
        raise InputError(f"scene{files.number}.json: is missing, but --radius-of scene needs its ball radius")
    return picture, scene
