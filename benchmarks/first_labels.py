"""How much a team gains from its first forty labeled frames, and how long that takes: every command as it is typed.

    python -m benchmarks.first_labels ../shared/boxes -o work

It finds balls in recordings, answers the page of vm-label as a person would who knows the true boxes, fine-tunes,
exports, and scores the networks on the test part, and on the frames of other days in `test`. Needs no lens files: the
cameras are of one kind, and their lens was estimated from the boxes of balls on the floor.
"""

from __future__ import annotations

import argparse
import json
import re
import shutil
import subprocess
import sys
import time
import urllib.request
from collections.abc import Sequence
from pathlib import Path
from resource import RUSAGE_CHILDREN, getrusage

from vm_embedded.output.box_files import Shares, edges, overlap
from vm_label.box_folder import read_box_folder
from vm_label.crops import Crop

LENS = "projection: EQUIDISTANT\nfocal_length: 260\ncentre: [0, -40]\nfov: 3.2\nsize: [608, 800]\n"
CAMERA = ("--lens", "lens.yaml", "--height", "0.8", "--pitch", "12deg", "--object-radius", "0.11")
PROGRAMS = {
    "vm-detect": "vm_embedded.cli.detect",
    "vm-label": "vm_label.cli",
    "vm-train": "vm_train.cli.train",
    "vm-export": "vm_export.cli",
    "vm-evaluate": "vm_train.cli.evaluate",
}

RECORDINGS = ("20230709_r5_cam0", "20230709_r6_cam0", "20240222_r14_cam0", "20240222_r12_cam0")

FRAMES = 40
"""Frames to label."""

MATCH, TOUCH = 0.5, 0.1
"""IoU with a true box from which on a person says yes, and below which no; between them they skip the crop."""


class Loop:
    """Runs the commands in a folder, and keeps their wall times and processor times [s]."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.times: dict[str, tuple[float, float]] = {}

    def run(self, *words: str) -> str:
        """Run a command to its end, and return what it printed."""
        done = subprocess.run(self._command(*words), cwd=self.folder, stdout=subprocess.PIPE, text=True, check=True)
        print(done.stdout[-2500:], flush=True)
        return done.stdout

    def start(self, *words: str) -> subprocess.Popen[str]:
        """Start a command that runs on."""
        return subprocess.Popen(self._command(*words), cwd=self.folder, stdout=subprocess.PIPE, text=True)

    def _command(self, *words: str) -> list[str]:
        print("$", *words, flush=True)
        module = PROGRAMS[words[0]]
        code = f"import sys; from {module} import main; sys.argv[0] = {words[0]!r}; sys.exit(main())"
        return [sys.executable, "-c", code, *words[1:]]

    def timed(self, step: str, *commands: Sequence[str]) -> None:
        """Run commands as one step."""
        with Timer(self, step):
            for words in commands:
                self.run(*words)


class Timer:
    """Measures a step of a loop, with all its processes."""

    def __init__(self, loop: Loop, step: str) -> None:
        self._loop, self._step = loop, step

    def __enter__(self) -> None:
        self._start = time.perf_counter(), _processor_time()

    def __exit__(self, *_: object) -> None:
        wall, processor = self._start
        self._loop.times[self._step] = time.perf_counter() - wall, _processor_time() - processor
        print(f"{self._step}: {json.dumps([round(each) for each in self._loop.times[self._step]])} s", flush=True)


def _processor_time() -> float:
    used = getrusage(RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def true_boxes(truth: Path) -> list[Shares]:
    """The balls in a label file."""
    rows = (line.split() for line in truth.read_text().splitlines())
    return [(float(x), float(y), float(w), float(h)) for name, x, y, w, h in rows if name == "0"]


def answers_for(boxes: Sequence[Shares], true: Sequence[Shares]) -> list[str]:
    """What a person answers to the boxes of an image. With a ball that none of them shows, they skip the image."""
    overlaps = [[overlap(edges(box), edges(each)) for each in true] for box in boxes]
    if not all(any(row[number] >= MATCH for row in overlaps) for number in range(len(true))):
        return ["skip"] * len(boxes)
    best = [max(row, default=0.0) for row in overlaps]
    return ["yes" if each >= MATCH else "no" if each < TOUCH else "skip" for each in best]


def label(loop: Loop, truth: Path) -> int:
    """Answer the page's crops of images until so many are judged; returns the number of answers."""
    page = loop.start("vm-label", "boxes", "--no-browser", "--port", "0")
    assert page.stdout is not None
    address = re.search(r"http://\S+/", page.stdout.readline())
    assert address is not None
    with urllib.request.urlopen(address[0] + "state") as response:
        state = json.load(response)
    by_image: dict[str, list[Crop]] = {}
    for crop in read_box_folder(loop.folder / "boxes").crops:
        by_image.setdefault(crop.image, []).append(crop)
    judged = count = 0
    for image in dict.fromkeys(each["image"] for each in state["crops"]):
        true = true_boxes(truth / (Path(image).stem.removeprefix("image-") + ".txt"))
        answers = answers_for([crop.shares for crop in by_image[image]], true)
        for crop, answer in zip(by_image[image], answers, strict=True):
            body = json.dumps({"session": state["session"], "crop": crop.id, "answer": answer}).encode()
            request = urllib.request.Request(address[0] + "answer", body, {"Content-Type": "application/json"})
            urllib.request.urlopen(request).close()
            count += 1
        judged += "skip" not in answers
        if judged == FRAMES:
            break
    page.terminate()
    print(page.communicate()[0])
    return count


def main() -> None:
    """Run the loop and write the times and scores."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("boxes", type=Path, help="folder with train/ and test/: frames with YOLO boxes, 0 is the ball")
    parser.add_argument("--recordings", nargs="+", default=RECORDINGS, help="recordings to label frames of")
    parser.add_argument("-o", "--output", type=Path, required=True, help="new folder to work in")
    options = parser.parse_args()
    train, test = options.boxes.resolve() / "train", options.boxes.resolve() / "test"
    options.output.mkdir(parents=True)
    loop = Loop(options.output)
    (loop.folder / "lens.yaml").write_text(LENS)
    for name in options.recordings:
        (loop.folder / name).mkdir()
        for image in train.glob(f"{name}_*.jpg"):
            shutil.copy(image, loop.folder / name)
    saving = [["vm-detect", each, *CAMERA, "--save-boxes", f"boxes/{each}"] for each in options.recordings]
    loop.timed("vm-detect", *saving)
    with Timer(loop, "vm-label"):
        answers = label(loop, train)
        loop.run("vm-label", "boxes", "--write", "judged")
    loop.timed("vm-train", ["vm-train", "tune", "judged", "--from", "ball", "-o", "tuned"])
    loop.timed("vm-export", ["vm-export", "ball", "--look", "tuned/look.pt", "-o", "own.onnx"])
    held_out = ["--list", "tuned/pictures.json", "--object-radius", "0.11", "ball", "own.onnx"]
    loop.timed("vm-evaluate", ["vm-evaluate", "--boxes", "judged", *held_out, "-o", "evaluation"])
    total = [round(sum(each[at] for each in loop.times.values())) for at in (0, 1)]
    print(f"{answers} answers; {total[0]} s, {total[1]} s of processor time")
    loop.run("vm-evaluate", "--boxes", str(test), "--names", "0=ball", "ball", "own.onnx", "-o", "elsewhere")
    scores = {
        each: json.loads((loop.folder / each / "scores.json").read_text()) for each in ("evaluation", "elsewhere")
    }
    result = {"answers": answers, "seconds": total, "steps": loop.times}
    result |= {name: each["networks"] for name, each in scores.items()}
    (loop.folder / "result.json").write_text(json.dumps(result, indent=1) + "\n")


if __name__ == "__main__":
    main()
