"""Trains a nano YOLO with the trainer of the package ultralytics (license AGPL-3.0; only the extra bench has it).

The network starts from the weights that the package nudenet ships, a YOLO v8 nano that was trained on photographs of
people at 320 px: it is the package on PyPI with weights of this network, and the trainer would fetch others from the
internet. Only the layers that name classes start at random.
"""

from __future__ import annotations

import csv
import os
from importlib.resources import files
from itertools import pairwise
from pathlib import Path
from typing import Any

import onnx
import torch
from onnx import numpy_helper

from . import cpu_torchvision  # noqa: F401  # before ultralytics

RATE = {"optimizer": "AdamW", "lr0": 1e-3, "lrf": 0.01, "cos_lr": True, "warmup_epochs": 0.3, "weight_decay": 5e-4}
AUGMENTATION = {"mosaic": 0.5, "close_mosaic": 1, "scale": 0.5, "fliplr": 0.5}
"""As the trainer's own, but mosaics of four pictures in half of the cases."""


def packaged_weights() -> dict[str, torch.Tensor]:
    """The weights of the package nudenet by the names of the trainer's network.

    They have no batch normalization, because an exported network multiplies it into its convolutions. So each
    normalization gets the bias of its convolution, and with a scale of 1, a mean of 0 and a variance of 1 the network
    gives the same answers. A training replaces mean and variance by those of its batches, so it first changes them.
    """
    graph = onnx.load(str(files("nudenet") / "320n.onnx")).graph
    found = {each.name: torch.from_numpy(numpy_helper.to_array(each).copy()) for each in graph.initializer}
    for name in [each for each in found if each.endswith(".conv.bias")]:
        found[name.replace(".conv.", ".bn.")] = found.pop(name)
    return found


def start(path: Path) -> None:
    """Write the network with which a training begins. Raises SystemExit if the packaged weights do not fit."""
    from ultralytics import YOLO

    model = YOLO("yolov8n.yaml")
    network, found = model.model, packaged_weights()
    state = network.state_dict()
    fits = {name: value for name, value in found.items() if name in state and state[name].shape == value.shape}
    last = f"model.{len(network.model) - 1}."
    for name in state:
        if name.endswith("running_var"):
            fits[name] = torch.ones_like(state[name])
        elif name.endswith("running_mean"):
            fits[name] = torch.zeros_like(state[name])
    missing = [each for each in state if each not in fits and "num_batches" not in each and not each.startswith(last)]
    missing = [each for each in missing if not each.endswith("bn.weight")]
    if missing:
        raise SystemExit(f"the packaged weights lack {missing[0]}")
    network.load_state_dict(fits, strict=False)
    path.parent.mkdir(parents=True, exist_ok=True)
    model.save(path)


def train(data: Path, out: Path, side: int, epochs: int, begin: Path | None = None) -> None:
    """Train for pictures of side x side px, or continue an interrupted training; a finished one stays.

    data: folder of `write_boxes`. out: gets `weights/best.pt`, `weights/last.pt` and `results.csv`. begin: a network to
    start from, or None for the packaged weights.
    """
    if (out / "results.csv").exists() and len(log(out)) >= epochs:
        return
    os.environ.setdefault("YOLO_CONFIG_DIR", str(out.parent.resolve()))
    from ultralytics import YOLO, settings

    settings.update({"sync": False, "tensorboard": False})
    last = out / "weights" / "last.pt"
    if last.exists():
        YOLO(last).train(resume=True)
        return
    if begin is None:
        begin = out.parent / "start.pt"
        start(begin)
    more: dict[str, Any] = {"project": str(out.parent.resolve()), "name": out.name, "exist_ok": True, "plots": False}
    more |= {"device": "cpu", "workers": 1, "batch": 16, "seed": 0, "single_cls": True, "amp": False}
    YOLO(begin).train(data=str(data / "data.yaml"), imgsz=side, epochs=epochs, **more, **RATE, **AUGMENTATION)


def export(out: Path, path: Path, side: int) -> None:
    """Write the best network of a training as ONNX: centers, sizes and scores of all boxes."""
    from ultralytics import YOLO

    made = YOLO(out / "weights" / "best.pt").export(format="onnx", imgsz=side, opset=17, simplify=False, device="cpu")
    Path(made).replace(path)


def log(out: Path) -> list[dict[str, float]]:
    """Loss and average precision on validation pictures after each epoch."""
    with (out / "results.csv").open() as file:
        rows = [{name.strip(): float(value) for name, value in row.items()} for row in csv.DictReader(file)]
    ends = [0.0, *(row["time"] for row in rows)]
    return [
        {
            "epoch": int(row["epoch"]),
            "seconds": round(end - begin),
            "loss": round(sum(row[f"train/{part}_loss"] for part in ("box", "cls", "dfl")), 4),
            "ap50": row["metrics/mAP50(B)"],
            "ap50_95": row["metrics/mAP50-95(B)"],
        }
        for row, (begin, end) in zip(rows, pairwise(ends), strict=True)
    ]
