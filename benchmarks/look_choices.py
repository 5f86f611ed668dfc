"""Measures the effect of each choice of a close look: `make look-choices`, after `make networks` and `make test-data`.

It trains looks for the mesh network `ball` on the same pictures, each with one change and three seeds, one training per
core, and scores each on pictures under maps that no training uses. It skips finished trainings, and trainings with the
same patches share them. It writes benchmarks/look_choices.json, from which benchmarks/look_choices_report.py makes the
tables and the plot of experiments/close-look.md.
"""

from __future__ import annotations

import argparse
import json
import os
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from functools import partial
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.frames import frames
from benchmarks.shipped import CANDIDATES, METERS, RANGES, calibration_error, evaluation, numbers
from benchmarks.timing import interleaved
from vm_embedded.config.sections import read_sections
from vm_embedded.detection.detector import Detector
from vm_embedded.detection.settings import Settings
from vm_embedded.network.bundled import model_path
from vm_export.change_model import change_look
from vm_export.look_checkpoint import LookCheckpoint
from vm_train.data.pictures import find_pictures
from vm_train.data.split import Split
from vm_train.look.configuration import LookConfiguration
from vm_train.look.run import LookRun, begin_look_run, read_look_run
from vm_train.look.training import LookTraining
from vm_train.runs.hardware import set_up_hardware
from vm_train.runs.loop import train

BASE = Path(__file__).with_name("look_choices.toml")
RESULTS = Path(__file__).with_name("look_choices.json")
SEEDS = (0, 1, 2)
TRAINING, VALIDATION, EPOCHS = 1000, 300, 8
"""Pictures and epochs of each training, which is short, because it only compares choices."""

TESTED = 200
"""Held-out pictures to score each look on."""

ROUNDS = 20
"""Calls that are timed for each frame."""

VARIANTS: dict[str, dict[str, dict[str, Any]]] = {
    "base": {},
    "16 x 16 samples": {"patches": {"size": 16}},
    "24 x 24 samples": {"patches": {"size": 24}},
    "48 x 48 samples": {"patches": {"size": 48}},
    "1.4 radii": {"patches": {"extent": 1.4}},
    "2.2 radii": {"patches": {"extent": 2.2}},
    "8, 16, 32 channels": {"network": {"channels": [8, 16, 32]}},
    "24, 48, 96 channels": {"network": {"channels": [24, 48, 96]}},
    "500 pictures": {"pictures": {"training": 500}},
    "2000 pictures": {"pictures": {"training": 2000}},
    "4000 pictures": {"pictures": {"training": 4000}},
    "7500 pictures": {"pictures": {"training": 7500}},
    "20 proposals": {"patches": {"max_proposals": 20}},
    "proposals of soccer, also posts and robots": {"mesh": {"network": "soccer"}},
    "one round": {"training": {"rounds": 1}},
    "nothing moved or hidden": {"augmentation": {"rotation": 0.0, "zoom": 0.0, "shift": 0.0, "hidden": 0.0}},
}
"""Looks to compare, by name: the changes to benchmarks/look_choices.toml. `pictures` and `mesh` are not sections of
it: they say how many pictures a training has, and which network proposes. A look judges all that it proposes."""

Task = tuple[str, int, Path, Path, Path]
"""Variant, seed, and the folders of training pictures, test pictures and trainings."""


def folder_of(out: Path, name: str, seed: int) -> Path:
    """Folder of a training."""
    return out / name.replace(" ", "-").replace(",", "") / f"seed{seed}"


def configuration_of(name: str, seed: int) -> LookConfiguration:
    """The configuration of a variant."""
    table = {section: dict(entries) for section, entries in VARIANTS[name].items()}
    for other in ("pictures", "mesh"):
        table.pop(other, None)
    table["training"] = {"seed": seed, "epochs": EPOCHS} | table.get("training", {})
    return read_sections(LookConfiguration, BASE, table)


def split_of(data: Path, count: int) -> Split:
    """`count` pictures for training, and the same validation pictures for every count."""
    found = [each.number for each in find_pictures(data)]
    chosen = [found[place] for place in np.random.default_rng(0).permutation(len(found))]
    training = chosen[VALIDATION : VALIDATION + count]
    if len(training) < count:
        raise SystemExit(f"{data} has {len(found)} pictures; {VALIDATION + count} are needed")
    return Split(tuple(training), tuple(chosen[:VALIDATION]), ())


def trained(task: Task) -> Path:
    """Train a variant, unless that is done. Returns its model file."""
    name, seed, data, _, out = task
    folder = folder_of(out, name, seed)
    model = model_path(VARIANTS[name].get("mesh", {}).get("network", "ball"))
    if (folder / "run.json").exists():
        run = read_look_run(folder)
    else:
        split = split_of(data, VARIANTS[name].get("pictures", {}).get("training", TRAINING))
        run = begin_look_run(folder, data, split, configuration_of(name, seed), model, model.stem)
    if not run.result_path.exists():
        with set_up_hardware("cpu", 1, 1) as hardware:
            _share_patches(run, out)
            train(LookTraining(run, hardware), hardware, lambda: False)
    path = folder / "model.onnx"
    if not path.exists():
        change_look(model, path, LookCheckpoint.load(run.result_path))
    return path


def _share_patches(run: LookRun, out: Path) -> None:
    """Link the patches of a training that has collected the same ones."""
    for path in sorted(out.glob("*/seed*/run.json")):
        other = read_look_run(path.parent)
        same = (other.split, other.digests[other.mesh.name]) == (run.split, run.digests[run.mesh.name])
        if same and _cut(other) == _cut(run) and other.result_path.exists() and not any(run.patches.iterdir()):
            for file in other.patches.iterdir():
                os.link(file, run.patches / file.name)


def _cut(run: LookRun) -> LookConfiguration:
    """What decides about the patches of a run."""
    return replace(LookConfiguration(), classes=run.configuration.classes, patches=run.configuration.patches)


def scored(model: Path, test: Path) -> dict[str, Any]:
    """Average precision, recall and false balls of a model file on the first pictures of a set."""
    pictures = find_pictures(test)[:TESTED]
    ranked, used = (evaluation(model, pictures, each, 1).objects["ball"] for each in (CANDIDATES, Settings()))
    return {
        "ap50": {each: numbers(ranked, bins)["average_precision"] for each, bins in (RANGES | METERS).items()},
        "ap75": {each: numbers(ranked, bins, 0.75)["average_precision"] for each, bins in RANGES.items()},
        "used": {each: numbers(used, bins) for each, bins in RANGES.items()},
        "all": numbers(used, None),
        "calibration_error": round(calibration_error(ranked), 5),
    }


def milliseconds(models: dict[str, Path]) -> dict[str, float]:
    """Median over the frames of `make bench` of the time [ms] of a whole call of each model, in turns, on one core."""
    os.sched_setaffinity(0, {min(os.sched_getaffinity(0))})
    detectors = {name: Detector.from_file(path) for name, path in models.items()}
    times = []
    for frame in frames()[1]:
        shown = (frame.image, frame.orientation, frame.lens)
        times.append(interleaved({name: partial(each.detect, *shown) for name, each in detectors.items()}, ROUNDS))
    return {name: round(float(np.median([each[name]["first"] for each in times])), 3) for name in models}


def tasks(data: Path, test: Path, out: Path, seeds: int) -> Iterator[Task]:
    """Every variant with every seed, ordered by seed."""
    for seed in SEEDS[:seeds]:
        for name in VARIANTS:
            yield name, seed, data, test, out


def measured(task: Task) -> dict[str, Any]:
    """Train a variant and score it."""
    model = trained(task)
    path = model.with_name("scores.json")
    if not path.exists():
        path.write_text(json.dumps(scored(model, task[3])))
    found: dict[str, Any] = json.loads(path.read_text())
    return found


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("data", type=Path, help="set of vm-synth with 7800 pictures or more")
    parser.add_argument("test", type=Path, help="set of vm-synth with other maps")
    parser.add_argument("out", type=Path, help="folder of the trainings")
    parser.add_argument("--seeds", type=int, default=len(SEEDS), choices=range(1, len(SEEDS) + 1))
    options = parser.parse_args()
    os.environ["OMP_NUM_THREADS"] = "1"
    todo = list(tasks(options.data, options.test, options.out, options.seeds))
    found: dict[str, Any] = {}
    with ProcessPoolExecutor(len(os.sched_getaffinity(0)), mp_context=get_context("spawn")) as pool:
        for task, scores in zip(todo, pool.map(measured, todo), strict=True):
            found.setdefault(task[0], {})[str(task[1])] = scores
            print(*task[:2], scores["ap50"], flush=True)
    times = milliseconds({name: folder_of(options.out, name, SEEDS[0]) / "model.onnx" for name in found})
    RESULTS.write_text(json.dumps({"scores": found, "milliseconds": times}) + "\n")


if __name__ == "__main__":
    main()
