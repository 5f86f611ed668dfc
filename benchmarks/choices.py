"""Measures the effect of each choice of a training: `make choices`, after `make networks` and `make test-data`.

It trains small networks on the same pictures, each with one change, some with several seeds, one training per core, and
scores them on pictures under maps that no training uses. It skips finished trainings. It writes
benchmarks/choices.json, from which benchmarks/choices_report.py makes the tables and the plot of
experiments/mesh-network.md.
"""

from __future__ import annotations

import argparse
import csv
import json
import os
import subprocess
import sys
import tomllib
from collections.abc import Collection, Iterator
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from functools import cache
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import numpy as np

from vm_embedded.config.sections import read_sections
from vm_embedded.files import write_file
from vm_embedded.geometry.lens_files import read_lens_file
from vm_train.data.split import Split
from vm_train.learning.configuration import TrainConfiguration

RESULTS = Path(__file__).with_name("choices.json")
BASE = Path(__file__).with_name("choices.toml")
TRAINING, VALIDATION = 2000, 200
"""Pictures of each training."""

TESTED = 200
"""Held-out pictures to score each network on, in all and for each half."""

Changes = dict[str, dict[str, Any]]

SIX = {
    "ball": {"kind": "object", "colors": [[255, 0, 0]]},
    "goal": {"kind": "upright", "colors": [[255, 255, 0]]},
    "line": {"kind": "area", "colors": [[255, 255, 255]]},
    "field": {"kind": "area", "colors": [[0, 255, 0]]},
    "environment": {"kind": "background", "colors": [[0, 0, 0]]},
    "robot": {"kind": "upright", "colors": [[0, 0, 255]]},
}
POSE = {"height": 0, "tilt": 0, "focal_length": 0, "center": 0}
COLOR = {"brightness": 0, "contrast": 0, "saturation": 0, "hue": 0, "gamma": 0, "noise": 0}
SOFT = {"blur_share": 0, "jpeg_share": 0}
HEXAGONAL = {"grid": "hexagonal", "equal_at": 2.5}
SHIPPED: Changes = {
    "network": {"width": 8, "activation": "elu"},
    "mesh": {"intersections": 3},
    "training": {"optimizer": "muon", "rate": 0.007, "mirrored": 0.5, "views": 2},
}
"""What a mesh network of `ball` on rings had instead of the base."""


@dataclass(frozen=True)
class Variant:
    """A network to compare: the changes to the base configuration, the pictures it learns from (`only` those of one
    lens or height), and the number of seeds."""

    changes: Changes
    only: str = ""
    seeds: int = 1


COMMON: Changes = {"training": {"epochs": 2, "repeats": 4, "views": 1, "rate": 0.02}, "data": {"test": 0.0}}
VARIANTS: dict[str, Variant] = {
    "base": Variant({}, seeds=3),
    "3 layers": Variant({"network": {"depth": 3}}, seeds=2),
    "9 layers": Variant({"network": {"depth": 9}}, seeds=3),
    "hexagonal, 3 layers": Variant({"network": {"depth": 3}, "mesh": HEXAGONAL}, seeds=2),
    "hexagonal, 5 layers": Variant({"mesh": HEXAGONAL}, seeds=3),
    "hexagonal, 9 layers": Variant({"network": {"depth": 9}, "mesh": HEXAGONAL}, seeds=3),
    "as ball": Variant(SHIPPED, seeds=2),
    "hexagonal, as ball": Variant(SHIPPED | {"mesh": SHIPPED["mesh"] | HEXAGONAL}, seeds=2),
    "elu": Variant({"network": {"activation": "elu"}}, seeds=2),
    "relu": Variant({"network": {"activation": "relu"}}, seeds=2),
    "width 2": Variant({"network": {"width": 2}}),
    "width 8": Variant({"network": {"width": 8}, "training": {"rate": 0.005}}),
    "width 16": Variant({"network": {"width": 16}, "training": {"rate": 0.002}}),
    "k = 3": Variant({"mesh": {"intersections": 3}}),
    "k = 5": Variant({"mesh": {"intersections": 5}}),
    "k = 6": Variant({"mesh": {"intersections": 6}}),
    "absolute colors": Variant({"mesh": {"colors": "absolute"}}),
    "bilinear points": Variant({"mesh": {"sampling": "bilinear"}}),
    "mesh to 10 m": Variant({"mesh": {"max_distance": 10}}),
    "balance 0.15": Variant({"training": {"balance": 0.15}}),
    "balance 0.7": Variant({"training": {"balance": 0.7}}),
    "six classes": Variant({"classes": SIX}),
    "all points": Variant({"training": {"selection": "all"}}),
    "focal loss": Variant({"training": {"selection": "all", "loss": "focal"}}),
    "balanced selection": Variant({"training": {"selection": "balanced"}}),
    "hard-example rounds": Variant({"training": {"selection": "hard"}}),
    "no augmentation": Variant({"augmentation": POSE | COLOR | SOFT}),
    "pose not augmented": Variant({"augmentation": POSE}),
    "colors not augmented": Variant({"augmentation": COLOR}),
    "sharpness not augmented": Variant({"augmentation": SOFT}),
    "learned rectilinear": Variant({}, only="rectilinear"),
    "learned fisheye": Variant({}, only="fisheye"),
    "learned low": Variant({}, only="low"),
    "learned high": Variant({}, only="high"),
}
"""Networks to compare, by name; "base" has five layers. The paper compares depths, widths and activations (section
"Network Architecture"), ways to select points (section "Training"), and both meshes (section "Precision")."""

LENSES, HEIGHTS = ("rectilinear", "fisheye"), ("low", "high")
"""Halves of the pictures: by projection, equisolid and equidistant being fisheyes, and by the camera's height."""

MIDDLE = 0.8  # [m] between low and high
SPLIT_TRAINING = 800
"""Training pictures of networks that learn from one half."""


@cache
def kinds_of(folder: Path) -> dict[str, set[str]]:
    """For each picture number of a folder its lens and height, as LENSES and HEIGHTS name them."""
    found = {}
    for path in sorted(folder.glob("lens*.yaml")):
        file = read_lens_file(path)
        assert file.orientation is not None
        lens = "rectilinear" if type(file.lens).__name__ == "Rectilinear" else "fisheye"
        found[path.stem.removeprefix("lens")] = {lens, "low" if file.orientation.height < MIDDLE else "high"}
    return found


def split_of(data: Path, only: str) -> Split:
    """The training and validation pictures of a variant."""
    numbers = [number for number, kinds in kinds_of(data).items() if not only or only in kinds]
    count = SPLIT_TRAINING if only else TRAINING
    return Split(tuple(numbers[VALIDATION : VALIDATION + count]), tuple(numbers[:VALIDATION]), ())


def trained(task: tuple[str, int, Path, Path]) -> Path:
    """Folder of a finished training; it starts or resumes the training if needed."""
    name, seed, data, out = task
    import torch

    from vm_train.learning.run import begin_run, read_run
    from vm_train.learning.training import MeshTraining
    from vm_train.runs.hardware import Hardware
    from vm_train.runs.loop import train

    torch.set_num_threads(1)
    folder = folder_of(out, name, seed)
    if (folder / "run.json").exists():
        run = read_run(folder)
    else:
        table = tomllib.loads(BASE.read_text())
        for changes in (COMMON, VARIANTS[name].changes, {"training": {"seed": seed}}):
            for section, entries in changes.items():
                table[section] = entries if section == "classes" else {**table.get(section, {}), **entries}
        configuration = read_sections(TrainConfiguration, None, table)
        run = begin_run(folder, data, split_of(data, VARIANTS[name].only), configuration, unpacked=out / "unpacked")
    hardware = Hardware("cpu", 0, 1, 0)
    train(MeshTraining(run, hardware), hardware, lambda: False)
    return folder


def folder_of(out: Path, name: str, seed: int) -> Path:
    """Folder of a training."""
    return out / name.replace(" ", "-").replace(",", "").replace("=", "is") / f"seed{seed}"


def scored(model: Path, data: Path, out: Path, numbers: list[str]) -> dict[str, Any]:
    """Scores that vm-evaluate gives a network on some pictures of a folder."""
    if not (out / "scores.json").exists():
        out.mkdir(parents=True, exist_ok=True)
        command = [sys.executable, "-m", "vm_train.cli.evaluate", str(model), str(data), "-o", str(out)]
        listed = out / "numbers.txt"
        listed.write_text("\n".join(numbers) + "\n")
        command += ["--radius-of", "scene", "--workers", "1", "--list", str(listed)]
        subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
    return _kept(json.loads((out / "scores.json").read_text())) | {"curve": _curve(out / "point_curves.csv")}


_POINTS = ("points", "average_precision", "f1")
_OBJECTS = ("truths", "hits", "false", "average_precision", "recall", "false_per_picture")


def _kept(scores: dict[str, Any]) -> dict[str, Any]:
    """Scores of the class ball to compare: of points and objects, in all and by distance."""
    found: dict[str, Any] = {
        "points": {name: {key: each[key] for key in _POINTS} for name, each in scores["points"]["ball"].items()}
    }
    ball = scores.get("objects", {}).get("ball", {})
    for overlap in ("iou_0.5", "iou_0.75"):
        if overlap in ball:
            found[overlap] = {key: ball[overlap]["all"][key] for key in _OBJECTS}
    return found


def _curve(path: Path) -> list[tuple[float, float]]:
    """Recall and precision of ball points, at a hundred recalls or fewer."""
    with path.open() as file:
        rows = [each for each in csv.DictReader(file) if each["class"] == "ball"]
    recall = np.array([float(each["recall"]) for each in rows])
    precision = np.array([float(each["precision"] or "nan") for each in rows])
    chosen = np.unique(np.searchsorted(recall, np.linspace(0.0, recall.max(initial=0.0), 100)))
    chosen = chosen[chosen < len(recall)]
    return [(round(float(recall[at]), 4), round(float(precision[at]), 4)) for at in chosen]


def tasks(names: Collection[str]) -> Iterator[tuple[str, int]]:
    """The variants with these names, each with every seed, ordered by seed."""
    for seed in range(1, 4):
        for name, variant in VARIANTS.items():
            if name in names and seed <= variant.seeds:
                yield name, seed


def evaluated(task: tuple[str, int, Path, Path]) -> dict[str, Any]:
    """Scores of a trained variant, on all test pictures and on the halves that it is compared on."""
    name, seed, held_out, out = task
    folder, kinds = folder_of(out, name, seed), kinds_of(held_out)
    found = {"all": scored(folder / "model.pt", held_out, folder / "scores", list(kinds)[:TESTED])}
    for half in LENSES + HEIGHTS if VARIANTS[name].only or name == "base" else ():
        numbers = [number for number, its in kinds.items() if half in its][:TESTED]
        found[half] = scored(folder / "model.pt", held_out, folder / f"scores-{half}", numbers)
    return found


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("data", type=Path, help="set of vm-synth with 2200 pictures or more")
    parser.add_argument("held_out", type=Path, help="set of vm-synth with other maps")
    parser.add_argument("out", type=Path, help="folder of the trainings")
    parser.add_argument("--only", choices=VARIANTS, action="append", help="measure only this variant; repeatable")
    options = parser.parse_args()
    os.environ["OMP_NUM_THREADS"] = "1"
    names = options.only or list(VARIANTS)
    found: dict[str, Any] = json.loads(RESULTS.read_text()) if options.only else {}
    found |= {name: {} for name in names}
    with ProcessPoolExecutor(len(os.sched_getaffinity(0)), mp_context=get_context("spawn")) as pool:
        todo = list(tasks(names))
        for folder in pool.map(trained, [(*each, options.data, options.out) for each in todo]):
            print(folder, flush=True)
        scores = pool.map(evaluated, [(*each, options.held_out, options.out) for each in todo])
        for (name, seed), score in zip(todo, scores, strict=True):
            found[name][str(seed)] = score
            print(name, seed, flush=True)
    write_file(RESULTS, json.dumps(found) + "\n")


if __name__ == "__main__":
    main()
