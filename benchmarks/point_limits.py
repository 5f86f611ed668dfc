"""How well single points tell their class: `python -m benchmarks.point_limits FOLDER`.

A point's true class is that of one pixel, but a network sees the mean color around the point. Here, the masks of the
classes take the place of the picture: each point gets the exact share of every class in what a network sees of it. A
network could do better only with what it sees of the neighbors.

Prints the F1 of these shares up to 10 m, and how well the class of the pixel below agrees with that of the point.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np

from benchmarks.field import RANGES
from benchmarks.shipped import classes_of
from vm_embedded.arrays import Singles
from vm_embedded.detection.pyramid import Pyramid
from vm_embedded.detection.sampling import sample
from vm_embedded.network.bundled import model_path
from vm_embedded.network.manifest import Manifest
from vm_embedded.network.model_file import read_model
from vm_export.grid import VISUAL
from vm_train.data.pictures import Picture, find_pictures, read_picture
from vm_train.graphs.labeled_graph import levels_of, plane_distances
from vm_train.graphs.seen_points import seen_points
from vm_train.scores.point_scores import PointScores
from vm_train.truth.objects import read_scene
from vm_workstation.text_tables import aligned

LIMITS = np.linspace(0.05, 0.95, 19)
"""Shares of a class that are tried as the limit from which a point counts as the class."""


def add(exact: PointScores, below: PointScores, picture: Picture, manifest: Manifest) -> None:
    """Add the points of a picture: with the exact shares of the classes, and with the class of the pixel below each."""
    shown = seen_points(picture.lens, picture.size, manifest)
    levels = levels_of(picture, shown.graph, manifest, VISUAL)
    distances = plane_distances(shown.graph.rays, picture.orientation.height)
    x, y = np.rint(shown.pixels).astype(np.intp).T
    labels = picture.labels[y, x]
    classes = np.arange(len(exact.classes))
    masks = [Pyramid(255 * (picture.labels == each).astype(np.uint8), "gray") for each in classes]
    shares: Singles = np.stack([sample(mask, shown.pixels, levels)[0] for mask in masks], axis=1)
    exact.add(np.clip(shares, 0.0, 1.0), labels, distances)
    lower = picture.labels[np.minimum(y + 1, picture.labels.shape[0] - 1), x]
    below.add((lower[:, None] == classes).astype(np.float32), labels, distances)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("pictures", type=Path, help="pictures of vm-synth")
    parser.add_argument("--model", default="soccer", help="network of the package, or a model file")
    options = parser.parse_args()
    path = model_path(options.model)
    classes, manifest = classes_of(path), read_model(path).manifest
    names = [each.name for each in manifest.classes]
    exact, below = PointScores(names), PointScores(names)
    for files in find_pictures(options.pictures):
        picture, scene = read_picture(files, classes), read_scene(files.image.with_name(f"scene{files.number}.json"))
        if scene is not None:
            add(exact, below, picture, manifest.used_for(scene.radius, None))
    rows = [["class", "F1 of exact shares", "best F1", "F1 of the pixel below"]]
    for name in names:
        ranked, other = (each.ranking(name, RANGES["to 10 m"]) for each in (exact, below))
        best = max(ranked.at(limit).f1 for limit in LIMITS)
        rows.append([name, *(f"{value:.3f}" for value in (ranked.at(0.5).f1, best, other.at(0.5).f1))])
    print("\n".join(aligned(rows)))


if __name__ == "__main__":
    main()
