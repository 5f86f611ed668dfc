"""The default settings of detection, chosen on the validation pictures of a training: `python -m benchmarks.threshold`.

    python -m benchmarks.threshold build/networks/mesh data/soccer

Answers are computed once; each combination of settings then judges them. Prints recall, precision, F1 and false balls
per picture, best F1 first, and the default settings last.
"""

from __future__ import annotations

import argparse
import tomllib
from collections.abc import Iterator
from dataclasses import replace
from itertools import product
from pathlib import Path

from benchmarks.shipped import FRAMES_AN_HOUR, NETWORKS
from vm_embedded.detection.objects import locate
from vm_embedded.detection.observation import Observation, Stopwatch
from vm_embedded.detection.settings import Settings
from vm_embedded.errors import GeometryError
from vm_train.data.class_table import ClassTable
from vm_train.data.pictures import read_picture
from vm_train.evaluation.answers import ExactSubject, load_subject
from vm_train.evaluation.picture_selection import select_pictures
from vm_train.scores.object_scores import ObjectScores
from vm_train.scores.overlaps import TrueObject
from vm_train.truth.objects import read_scene, true_objects

THRESHOLDS, INSIDES, AROUNDS = (0.5, 0.6, 0.7, 0.8, 0.9), (0.5, 0.6, 0.7, 0.75, 0.8, 0.85, 0.9, 0.95), (0.25, 0.4)


def observed(
    subject: ExactSubject, data: Path, numbers: Path, part: str
) -> Iterator[tuple[list[TrueObject], Observation]]:
    """True balls and classified points of each picture in one part of a training."""
    table = tomllib.loads((NETWORKS / "mesh.toml").read_text())["classes"]
    classes = ClassTable.from_table(table).mask_classes()
    for files in select_pictures([data], numbers, part):
        picture = read_picture(files, classes)
        scene = read_scene(files.image.with_name(f"scene{files.number}.json"))
        assert scene is not None
        manifest = replace(subject.manifest, radius=scene.radius, object_radius=scene.ball_radius)
        try:
            observation = subject.observe(picture, scene.radius)
        except GeometryError:
            continue
        yield true_objects(picture, scene, manifest)["ball"], observation


def scored(pictures: list[tuple[list[TrueObject], Observation]], settings: Settings) -> ObjectScores:
    """Scores of all pictures with some settings."""
    scores = ObjectScores(min_radius=2.0)
    for truths, observation in pictures:
        found, _ = locate(observation, None, settings, Stopwatch())
        scores.add(truths, found)
    return scores


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("run", type=Path, help="folder of a training")
    parser.add_argument("data", type=Path, help="its pictures")
    parser.add_argument("--part", default="validation", choices=("training", "validation", "test"))
    options = parser.parse_args()
    subject = load_subject(options.run / "model.pt", Settings())
    assert isinstance(subject, ExactSubject)
    pictures = list(observed(subject, options.data, options.run / "pictures.json", options.part))
    rows = []
    for threshold, inside, around in product(THRESHOLDS, INSIDES, AROUNDS):
        settings = Settings(threshold=threshold, min_inside=inside, max_around=around)
        outcome = scored(pictures, settings).ranking(0.5).at()
        rows.append((outcome.f1, threshold, inside, around, outcome))
    print(f"{len(pictures)} pictures\nthreshold min_inside max_around    F1 recall precision false/picture  an hour")
    best = sorted(rows, key=lambda row: -row[0])[:20]
    usual = Settings()
    default = [row for row in rows if row[1:4] == (usual.threshold, usual.min_inside, usual.max_around)]
    for f1, threshold, inside, around, outcome in [*best, *default]:
        hourly = FRAMES_AN_HOUR * outcome.false_per_picture
        print(
            f"{threshold:9.2f} {inside:10.2f} {around:10.2f} {f1:.3f} {outcome.recall:6.3f} {outcome.precision:9.3f} "
            f"{outcome.false_per_picture:13.4f} {hourly:8.0f}"
        )


if __name__ == "__main__":
    main()
