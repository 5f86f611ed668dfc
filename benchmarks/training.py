"""Speed of vm-train and of its parts: `make bench-train DATA=...`.

It times each part alone on one pinned core, then whole trainings with one reading and one learning process.
Writes benchmarks/training.json and the table of experiments/training.md.
"""

from __future__ import annotations

import argparse
import json
import os
import tempfile
from collections.abc import Callable
from pathlib import Path
from time import perf_counter

import cv2
import numpy as np
import torch

from benchmarks.report import EXPERIMENTS, fill
from vm_embedded.cli.bench import describe_machine
from vm_embedded.config.sections import read_sections
from vm_export.network import Network
from vm_train.data.pictures import find_pictures
from vm_train.data.split import Split
from vm_train.graphs.loading import PictureGraphs
from vm_train.graphs.schedule import Item
from vm_train.learning.configuration import TrainConfiguration
from vm_train.learning.run import begin_run
from vm_train.learning.trainer import Trainer
from vm_train.learning.training import MeshTraining
from vm_train.runs.hardware import Hardware
from vm_train.runs.loop import train

RESULTS = Path(__file__).with_name("training.json")
PAGE = EXPERIMENTS / "training.md"
NETWORKS = {"5 x 4": (5, 4), "9 x 8": (9, 8)}
BATCH = 8


def configuration(depth: int, width: int) -> TrainConfiguration:
    """A short training."""
    entries = {
        "mesh": {"sampling": "bilinear", "colors": "absolute"},
        "network": {"depth": depth, "width": width},
        "training": {"epochs": 4, "batch": BATCH, "selection": "balanced"},
    }
    return read_sections(TrainConfiguration, None, entries)


def per_second(call: Callable[[int], object], count: int) -> float:
    """Calls per second, from the median time."""
    times = []
    for number in range(count):
        started = perf_counter()
        call(number)
        times.append(perf_counter() - started)
    return round(1.0 / float(np.median(times)), 1)


def parts(data: Path, numbers: tuple[str, ...], folder: Path) -> dict[str, float]:
    """Pictures per second on one core."""
    made = configuration(5, 4)
    run = begin_run(folder / "parts", data, Split(numbers, (), ()), made, unpacked=folder / "unpacked")
    kept = run.graphs(numbers)
    plain = PictureGraphs(list(kept.pictures), kept.recipe, None)
    for each in range(len(numbers)):
        kept[Item(each)]
    found = {
        "decode, mesh and sample": per_second(lambda each: plain[Item(each)], len(numbers)),
        "unpacked, mesh and sample": per_second(lambda each: kept[Item(each)], len(numbers)),
        "unpacked and augmented": per_second(lambda each: kept[Item(each, (0, each))], len(numbers)),
    }
    graphs = [kept[Item(each)] for each in range(len(numbers))]
    for name, (depth, width) in NETWORKS.items():
        recipe = configuration(depth, width).training
        torch.manual_seed(0)
        network = Network(configuration(depth, width).network_shape)
        training = Trainer(network, recipe, 10**6, np.full(network.shape.classes, 0.1), np.ones(network.shape.classes))
        batches = [graphs[start : start + BATCH] for start in range(0, len(graphs) - BATCH + 1, BATCH)]

        def step(number: int, training: Trainer = training, batches: list = batches) -> None:
            batch = batches[number % len(batches)]
            training.step([Item(each, (number, each)) for each in range(len(batch))], batch)

        found[f"learn, {name}"] = round(BATCH * per_second(step, 2 * len(batches)), 1)
    found["points"] = round(float(np.mean([len(each) for each in graphs])), 1)
    return found


def whole(data: Path, numbers: tuple[str, ...], folder: Path, workers: int) -> dict[str, float]:
    """Pictures per second of trainings with decoded pictures on disk, start and validation included."""
    found = {}
    for name, (depth, width) in NETWORKS.items():
        split = Split(numbers[8:], numbers[:8], ())
        made = configuration(depth, width)
        run = begin_run(folder / f"{depth}x{width}", data, split, made, unpacked=folder / "unpacked")
        graphs = run.graphs(numbers)
        for each in range(len(numbers)):
            graphs[Item(each)]  # unpacks it
        hardware = Hardware("cpu", 0, 1, workers)
        done = MeshTraining(run, hardware)
        train(done, hardware, lambda: False)
        found[name] = round(done.speed, 1)
    return found


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("data", type=Path, help="folder of pictures, as vm-synth makes them")
    parser.add_argument("--count", type=int, default=800, help="number of pictures of the trainings; default 800")
    options = parser.parse_args()
    numbers = tuple(each.number for each in find_pictures(options.data)[: options.count])
    cores = sorted(os.sched_getaffinity(0))
    cv2.setNumThreads(1)
    torch.set_num_threads(1)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        os.sched_setaffinity(0, cores[:1])
        alone = parts(options.data, numbers[:160], folder)
        os.sched_setaffinity(0, cores)
        together = whole(options.data, numbers, folder, workers=1)
    RESULTS.write_text(
        json.dumps({"machine": describe_machine(), "one core": alone, "two cores": together}, indent=1) + "\n"
    )
    rows = [f"| {name} | {value:.0f} |" for name, value in alone.items() if name != "points"]
    rows += [f"| training, {name}, one core reads, one learns | {value:.0f} |" for name, value in together.items()]
    fill(PAGE, {"throughput": "\n".join(["| | pictures/s |", "| --- | ---: |", *rows])})


if __name__ == "__main__":
    main()
