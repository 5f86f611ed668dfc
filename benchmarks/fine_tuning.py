"""How much a close look learns from some of a team's own frames with boxes, measured on other frames.

    python -m benchmarks.fine_tuning ../shared/boxes/train ../shared/boxes/test --names 0=ball -o work

It fine-tunes a network on 25, 50, 100 and all frames, drawn with each of three seeds, and writes the recall of the test
frames' boxes before and after: at the threshold that lets 1 in 2000 other places pass. `work` keeps the trainings, so
that the program can be interrupted and started again. Results: benchmarks/fine_tuning.json,
benchmarks/experiments/fine-tuning.svg, and a sentence of docs/own-frames.md.
"""

from __future__ import annotations

import argparse
import json
import random
import subprocess
import sys
import textwrap
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.report import DOCS, EXPERIMENTS, fill
from benchmarks.window_scores import score_frames
from vm_embedded.cli.progress import ProgressBar
from vm_embedded.network.bundled import DEFAULT, model_path
from vm_embedded.network.model_file import read_model
from vm_train.boxes.box import BoxedPicture
from vm_train.boxes.read import read_boxes
from vm_train.cli.box_options import parse_names
from vm_train.tuning.box_finding import searching_look
from vm_train.tuning.boxed_objects import all_objects
from vm_train.tuning.candidates import search_radii
from vm_workstation.plots import new_figure, save_figure

RESULTS = Path(__file__).with_name("fine_tuning.json")
OWN_FRAMES = DOCS / "own-frames.md"
COUNTS = (25, 50, 100, 0)
"""Frames to learn from; 0: all."""

SEEDS = (0, 1, 2)


def measure(model: Path, frames: Sequence[BoxedPicture]) -> dict[str, Any]:
    """The scores of a model file's close look on frames with boxes of a round object."""
    look = searching_look(read_model(model))
    radii = search_radii(all_objects(frames, look.name, True))
    bar = ProgressBar(len(frames), "looked at")
    score = score_frames(look, frames, True, radii, bar.advance)
    bar.clear()
    return score.as_dict()


def link_frames(frames: Sequence[BoxedPicture], folder: Path) -> None:
    """Link the images of frames and their YOLO files into a new folder."""
    folder.mkdir(parents=True, exist_ok=True)
    for each in frames:
        for path in (each.image, each.image.with_suffix(".txt")):
            link = folder / path.name
            if not link.is_symlink():
                link.symlink_to(path.resolve())


def fine_tune(model: str, frames: Sequence[BoxedPicture], seed: int, folder: Path, names: Sequence[str]) -> Path:
    """Fine-tune a network on frames, or continue that. Returns the new model file.

    The file `seconds` gets the time that it took; null if it was interrupted.
    """
    made = folder / "run" / "model.onnx"
    if (folder / "seconds").exists():
        return made
    link_frames(frames, folder / "frames")
    command = [sys.executable, "-m", "vm_train"]
    is_continued = (folder / "run" / "run.json").exists()
    if is_continued:
        command += ["resume", str(folder / "run")]
    else:
        command += ["tune", str(folder / "frames"), "--from", model, "--names", *names]
        command += ["-o", str(folder / "run"), "--set", f"training.seed={seed}", "--set", f"data.split_seed={seed}"]
        command += ["--set", "data.test=0"]
    start = time.perf_counter()
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
    seconds = None if is_continued else round(time.perf_counter() - start)
    (folder / "seconds").write_text(json.dumps(seconds))
    return made


def sentence(result: dict[str, Any]) -> str:
    """What docs/own-frames.md says about the gain of fifty frames."""
    before, some = result["before"], [each for each in result["after"] if each["frames"] == 50]
    found, false = ([each[part] for each in some] for part in ("reported_boxes", "reported_others"))
    text = (
        f"On {result['test_frames']} frames from halls where `{result['network']}` found {before['reported_boxes']} of "
        f"{before['boxes']} balls, with {before['reported_others']} false ones, it finds {min(found)} to {max(found)} "
        f"after fine-tuning with fifty frames of other days, with {min(false)} to {max(false)} false ones."
    )
    return textwrap.fill(text, 120)


def plot(result: dict[str, Any], path: Path) -> None:
    """The recall over the number of frames, each seed as a dot."""
    figure = new_figure(6.0, 3.6)
    axes = figure.add_subplot()
    counts = sorted({each["frames"] for each in result["after"]})
    shown = {count: [each["recall"] for each in result["after"] if each["frames"] == count] for count in counts}
    places = range(len(counts) + 1)
    means = [result["before"]["recall"], *(float(np.mean(values)) for values in shown.values())]
    axes.plot(places, [100.0 * each for each in means], color="C0")
    for place, values in zip(places, [[result["before"]["recall"]], *shown.values()], strict=True):
        axes.plot([place] * len(values), [100.0 * each for each in values], "o", color="C0", markersize=4)
    axes.set_xticks(list(places), ["0", *map(str, counts)])
    axes.set_xlabel("own frames")
    axes.set_ylabel("boxes found [%]")
    axes.set_ylim(0, 100)
    axes.grid(alpha=0.3)
    save_figure(figure, path)


def main() -> None:
    """Fine-tune, measure, and write the results."""
    parser = argparse.ArgumentParser(description="Recall of a close look before and after fine-tuning.")
    parser.add_argument("training", type=Path, help="folder of frames with YOLO boxes to learn from")
    parser.add_argument("test", type=Path, help="folder of frames with boxes to measure")
    parser.add_argument("--names", nargs="+", default=[], help="new names of classes, as for vm-train tune")
    parser.add_argument("--from", dest="model", default=DEFAULT, help=f"network to begin with; default {DEFAULT}")
    parser.add_argument("--counts", type=int, nargs="+", default=list(COUNTS), help="frames to learn from; 0: all")
    parser.add_argument("--seeds", type=int, nargs="+", default=list(SEEDS), help="seeds of drawing and training")
    parser.add_argument("-o", "--output", type=Path, required=True, help="folder of the trainings")
    parser.add_argument("--json", type=Path, default=RESULTS, help="results")
    options = parser.parse_args()
    names = parse_names(options.names)
    training, test = (read_boxes(folder, names=names).pictures for folder in (options.training, options.test))
    result: dict[str, Any] = {"network": options.model, "test_frames": len(test)}
    result |= {"before": measure(model_path(options.model), test), "after": []}
    print(f"before: {result['before']}", flush=True)
    for count in options.counts:
        for seed in options.seeds:
            frames = list(training)
            random.Random(seed).shuffle(frames)
            frames = frames[:count] if count else frames
            folder = options.output / f"{len(frames)}-{seed}"
            made = fine_tune(options.model, frames, seed, folder, options.names)
            row = {"frames": len(frames), "seed": seed, "seconds": json.loads((folder / "seconds").read_text())}
            result["after"].append(row | measure(made, test))
            print(result["after"][-1], flush=True)
            options.json.write_text(json.dumps(result, indent=1) + "\n")
    plot(result, EXPERIMENTS / "fine-tuning.svg")
    fill(OWN_FRAMES, {"fine-tuning": sentence(result)})


if __name__ == "__main__":
    main()
