"""Selection of points, loss and grid compared on the same pictures: `make compare DATA=... HELD_OUT=...`.

Trains every kind with every seed, two at a time, and scores them on pictures of maps that the training saw and of maps
that it did not. What is there already is not done again. Writes benchmarks/comparison.json, from which
benchmarks/comparison_report.py makes the tables and plots of docs/results.md.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
from concurrent.futures import ProcessPoolExecutor
from itertools import product
from multiprocessing import get_context
from pathlib import Path
from typing import Any

from vm_embedded.sections import read_sections
from vm_train.configuration import TrainConfiguration
from vm_train.split import Split

RESULTS = Path(__file__).with_name("comparison.json")
TRAINING, VALIDATION, TEST = range(2000), range(2000, 2200), range(2200, 2700)
"""Numbers of the pictures of DATA."""

SEEDS = (1, 2, 3)
COMMON = {
    "mesh": {"radius_of": "scene", "intersections": 3.0, "max_distance": 10.0},
    "network": {"depth": 5, "width": 8},
    "training": {"epochs": 8, "batch": 8, "rate": 0.01},
}
TRAININGS: dict[str, dict[str, dict[str, Any]]] = {
    "all": {"training": {"selection": "all"}},
    "focal": {"training": {"selection": "all", "loss": "focal"}},
    "rounds": {"training": {"selection": "hard", "rounds": 3}},
    "hexagonal": {"training": {"selection": "balanced"}, "mesh": {"grid": "hexagonal", "equal_at": 2.5}},
}
KINDS = {
    "all": "all/round1.pt",
    "balanced": "rounds/round1.pt",  # the first of the rounds is trained on balanced points
    "hard": "rounds/round3.pt",
    "focal": "focal/round1.pt",
    "hexagonal": "hexagonal/round1.pt",
}
"""Networks that are compared, by the training that makes them."""


def trained(task: tuple[str, int, Path, Path]) -> Path:
    """Folder of a training, done or gone on with."""
    kind, seed, data, out = task
    import torch

    from vm_train.hardware import Hardware
    from vm_train.job import Job
    from vm_train.run import train

    torch.set_num_threads(1)
    folder = out / f"seed{seed}" / kind
    if (folder / "run.json").exists():
        job = Job.read(folder)
    else:
        sections = (*COMMON, *TRAININGS[kind])
        entries = {name: {**COMMON.get(name, {}), **TRAININGS[kind].get(name, {})} for name in sections}
        entries["training"]["seed"] = seed
        configuration = read_sections(TrainConfiguration, None, entries)
        parts = (tuple(f"{each:07d}" for each in part) for part in (TRAINING, VALIDATION, TEST))
        job = Job.begin(folder, data, configuration, Split(*parts), out / "unpacked")
    train(job, Hardware("cpu", 0, 1, 0), lambda: False)
    return folder


def scored(model: Path, data: Path, out: Path, numbers: Path | None) -> dict[str, Any]:
    """What vm-evaluate says of a network."""
    if not (out / "scores.json").exists():
        command = [sys.executable, "-m", "vm_train.evaluate_cli", str(model), str(data), "-o", str(out)]
        command += ["--radius-of", "scene", *(() if numbers is None else ("--list", str(numbers), "--part", "test"))]
        subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
    return _kept(json.loads((out / "scores.json").read_text()))


_POINTS = ("points", "average_precision", "roc_auc", "precision", "recall", "f1", "mcc")
_OBJECTS = ("truths", "hits", "false", "average_precision", "precision", "recall", "false_per_picture")


def _kept(scores: dict[str, Any]) -> dict[str, Any]:
    """Scores that are compared: of each class over all distances, of the ball's points and objects in each bin."""
    points, ball = scores["points"], scores.get("objects", {}).get("ball", {})
    found: dict[str, Any] = {
        "classes": {name: {key: bins["all"][key] for key in _POINTS} for name, bins in points.items()},
        "points": {name: {key: each[key] for key in _POINTS} for name, each in points["ball"].items()},
    }
    for overlap in ("iou_0.5", "iou_0.75"):
        if overlap in ball:
            found[overlap] = {name: {key: each[key] for key in _OBJECTS} for name, each in ball[overlap].items()}
            found[overlap]["all"]["distance_error"] = ball[overlap]["all"]["errors"]["distance_median"]
    return found


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("data", type=Path, help="set of vm-synth with 2700 pictures or more")
    parser.add_argument("held_out", type=Path, help="set of vm-synth with other maps")
    parser.add_argument("out", type=Path, help="folder of the trainings")
    parser.add_argument("--train-only", action="store_true")
    options = parser.parse_args()
    os.environ["OMP_NUM_THREADS"] = "1"
    tasks = [(kind, seed, options.data, options.out) for seed, kind in product(SEEDS, TRAININGS)]
    with ProcessPoolExecutor(2, mp_context=get_context("spawn")) as pool:
        for folder in pool.map(trained, tasks):
            print(folder, flush=True)
    if options.train_only:
        return
    found: dict[str, Any] = {"seen maps": {}, "other maps": {}}
    for kind, seed in product(KINDS, SEEDS):
        model = options.out / f"seed{seed}" / KINDS[kind]
        numbers = model.parent / "pictures.json"
        scores = options.out / "scores" / f"{kind}{seed}"
        for name, data, chosen in (("seen maps", options.data, numbers), ("other maps", options.held_out, None)):
            made = scored(model, data, scores / name.split()[0], chosen)
            found[name].setdefault(kind, {})[str(seed)] = made
            print(kind, seed, name, flush=True)
    RESULTS.write_text(json.dumps(found) + "\n")


if __name__ == "__main__":
    main()
