"""Trains the peers on pictures of vm-synth; an interrupted training continues after its last whole epoch.

    python -m benchmarks.peers.train data/peers build/peers
    python -m benchmarks.peers.train data/peers build/peers --lens rectilinear

The folder OUT gets an ONNX file for each peer, and benchmarks/peer_training.json the course of each training. With
--lens, they learn from the pictures of one kind of lens only, and all goes into a folder of OUT with its name. The nano
YOLO for 640 px continues from that for 320 px, which takes a quarter of the time for a picture. The paper trained other
detectors on the same pictures, too (section "Training").
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path
from typing import Any

from vm_embedded.files import write_file

from .boxes import LENSES, PARTS, SEED, VALIDATION, link_pictures, write_boxes
from .course import read_course
from .detector import TRAINED

LOG = Path(__file__).parents[1] / "peer_training.json"
ALL_LENSES = "all lenses"
EPOCHS = {
    ALL_LENSES: {"ssdlite": 6, "yolo320": 10, "yolo640": 4},
    "rectilinear": {"ssdlite": 6, "yolo320": 6, "yolo640": 3},
}
JUDGED_BY = {"ssdlite": ("validation_loss", min), "yolo320": ("ap50_95", max), "yolo640": ("ap50_95", max)}
"""The value of an epoch that decides whether a training still improved. For YOLO, the trainer keeps the network of the
epoch with the best AP50 to AP95 of validation pictures. For SSDLite, `ssd.train` keeps that of the last epoch."""


def folder_of(out: Path, lens: str) -> Path:
    """The folder with the trainings for a kind of lens, or for all lenses."""
    return out if lens == ALL_LENSES else out / lens


def train(stem: str, boxes: Path, out: Path, epochs: int) -> list[dict[str, float]]:
    """Train a peer and write its file of ONNX. Returns the course of the training."""
    folder, file = out / stem, out / f"{stem}.onnx"
    if stem == "ssdlite":
        from . import ssd

        log = ssd.train(boxes, folder, epochs)
        ssd.export(folder, file)
        return log
    from . import yolo

    side = next(each.side for each in TRAINED if each.stem == stem)
    yolo.train(boxes, folder, side, epochs, out / "yolo320" / "weights" / "best.pt" if side > 320 else None)
    yolo.export(folder, file, side)
    return read_course(folder / "results.csv")


def still_improved(stem: str, log: list[dict[str, float]], planned: int) -> bool:
    """Whether the last epoch was the best one, by the value that judges this training, or some epochs are missing.

    planned: number of epochs; an interrupted training has fewer.
    """
    value, best = JUDGED_BY[stem]
    return len(log) < planned or log[-1][value] == best(row[value] for row in log)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("data", type=Path, help="folder of pictures of vm-synth")
    parser.add_argument("out", type=Path, help="folder for the trainings")
    parser.add_argument("--only", choices=[each.stem for each in TRAINED], action="append", help="train only this peer")
    parser.add_argument("--lens", choices=LENSES, default=ALL_LENSES, help="learn only from pictures of this kind")
    parser.add_argument("--as-is", action="store_true", help="take interrupted trainings after their last whole epoch")
    options = parser.parse_args()
    out, data = folder_of(options.out, options.lens), options.data
    if options.lens != ALL_LENSES:
        data = out / "pictures"
        link_pictures(options.data, data, options.lens)
    write_boxes(data, out / "boxes")
    for stem in options.only or EPOCHS[options.lens]:
        planned = EPOCHS[options.lens][stem]
        log = train(stem, out / "boxes", out, 0 if options.as_is else planned)
        found: dict[str, Any] = json.loads(LOG.read_text()) if LOG.exists() else {}
        found |= {"validation": VALIDATION, "split_seed": SEED}
        part = found.setdefault(options.lens, {})
        part |= {f"{each} pictures": len(list((out / "boxes" / "labels" / each).glob("*.txt"))) for each in PARTS}
        row = {"seed": 0, "planned": planned, "still_improved": still_improved(stem, log, planned), "epochs": log}
        part[stem] = row
        write_file(LOG, json.dumps(found, indent=1) + "\n")


if __name__ == "__main__":
    main()
