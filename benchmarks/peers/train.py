"""Trains the peers on pictures of vm-synth; an interrupted training continues after its last whole epoch.

    python -m benchmarks.peers.train data/peers build/peers

The folder OUT gets an ONNX file for each peer, and benchmarks/peer_training.json the course of each training. The
nano YOLO for 640 px continues from that for 320 px, which takes a quarter of the time for a picture. The paper trained
other detectors on the same pictures, too (section "Training").
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path
from typing import Any

from vm_embedded.files import atomic_write
from vm_train.data.pictures import find_pictures

from .boxes import SEED, VALIDATION, write_boxes
from .detector import TRAINED

LOG = Path(__file__).parents[1] / "peer_training.json"
EPOCHS = {"ssdlite": 6, "yolo320": 4, "yolo640": 2}
JUDGED_BY = {"ssdlite": ("validation_loss", min), "yolo320": ("ap50", max), "yolo640": ("ap50", max)}
"""The value of an epoch that decides whether a training still improved. The trainer of YOLO keeps the epoch with the
best AP50 to AP95; SSDLite keeps its last one."""


def train(stem: str, boxes: Path, out: Path) -> list[dict[str, float]]:
    """Train a peer and write its file of ONNX. Returns the course of the training."""
    folder, file = out / stem, out / f"{stem}.onnx"
    if stem == "ssdlite":
        from . import ssd

        log = ssd.train(boxes, folder, EPOCHS[stem])
        ssd.export(folder, file)
        return log
    from . import yolo

    side = next(each.side for each in TRAINED if each.stem == stem)
    yolo.train(boxes, folder, side, EPOCHS[stem], out / "yolo320" / "weights" / "best.pt" if side > 320 else None)
    yolo.export(folder, file, side)
    return yolo.log(folder)


def still_improved(stem: str, log: list[dict[str, float]]) -> bool:
    """Whether the last epoch was the best one."""
    value, best = JUDGED_BY[stem]
    return log[-1][value] == best(row[value] for row in log)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("data", type=Path, help="folder of pictures of vm-synth")
    parser.add_argument("out", type=Path, help="folder for the trainings")
    parser.add_argument("--only", choices=list(EPOCHS), action="append", help="train only this peer; repeatable")
    options = parser.parse_args()
    boxes = options.out / "boxes"
    write_boxes(options.data, boxes)
    for stem in options.only or EPOCHS:
        log = train(stem, boxes, options.out)
        found: dict[str, Any] = json.loads(LOG.read_text()) if LOG.exists() else {}
        found |= {"pictures": len(find_pictures(options.data)), "validation": VALIDATION, "split_seed": SEED}
        found[stem] = {"seed": 0, "still_improved": still_improved(stem, log), "epochs": log}
        with atomic_write(LOG) as path:
            path.write_text(json.dumps(found, indent=1) + "\n")


if __name__ == "__main__":
    main()
