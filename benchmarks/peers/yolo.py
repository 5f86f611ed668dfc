"""Trains a nano YOLO with the trainer of the package ultralytics (license AGPL-3.0; only the extra bench has it).

The network starts from the weights that the package nudenet ships, a YOLO v8 nano that was trained on photographs of
people at 320 px: it is the package on PyPI with weights of this network, and the trainer would fetch others from the
internet. Only the last layers, which name classes, start at random.
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from importlib.resources import files
from pathlib import Path
from typing import Any

import cv2
import onnx
import torch
from onnx import numpy_helper

from vm_embedded.cameras.image_files import read_image

from . import cpu_torchvision  # noqa: F401  # before ultralytics
from .course import read_course
from .detector import boxed_in
from .normalization import measure
from .precision import fast_convolutions

START_SIDE, MEASURED, BATCH = 320, 64, 16
"""Side of the pictures of the packaged weights [px], how many pictures measure their normalizations, and how many make
a batch."""

RATE = {"optimizer": "AdamW", "lr0": 1e-3, "lrf": 0.01, "cos_lr": True, "weight_decay": 5e-4}
RATE |= {"warmup_epochs": 0.3, "warmup_bias_lr": 0.0, "nbs": BATCH}
"""The trainer's own rate for biases is a hundred times that of AdamW, and it makes a step for four batches only."""

AUGMENTATION = {"mosaic": 0.5, "close_mosaic": 1, "scale": 0.2, "fliplr": 0.5}
"""As the trainer's own, but mosaics of four pictures in half of the cases. With its scale of 0.5, pictures shrink to a
half, and the trainer drops boxes of less than 2 px."""


def packaged_weights() -> dict[str, torch.Tensor]:
    """The weights of the package nudenet by the names of the trainer's network.

    They have no batch normalization, because an exported network multiplies it into its convolutions. So each
    normalization gets the bias of its convolution.
    """
    graph = onnx.load(str(files("nudenet") / "320n.onnx")).graph
    found = {each.name: torch.from_numpy(numpy_helper.to_array(each).copy()) for each in graph.initializer}
    for name in [each for each in found if each.endswith(".conv.bias")]:
        found[name.replace(".conv.", ".bn.")] = found.pop(name)
    return found


def new_network(pictures: Path) -> torch.nn.Module:
    """The network with which a training begins. Raises SystemExit if the packaged weights do not fit.

    Its normalizations have the statistics of the first of the training pictures.
    """
    from ultralytics.nn.tasks import DetectionModel

    network = DetectionModel("yolov8n.yaml", nc=1, verbose=False)
    found, state = packaged_weights(), network.state_dict()
    fits = {name: value for name, value in found.items() if name in state and state[name].shape == value.shape}
    missing = [each for each in state if each not in fits and each.endswith(("conv.weight", "bn.bias"))]
    if missing:
        raise SystemExit(f"the packaged weights lack {missing[0]}")
    network.load_state_dict(fits, strict=False)
    for layer in network.modules():
        if isinstance(layer, torch.nn.BatchNorm2d):
            assert layer.running_var is not None
            torch.nn.init.constant_(layer.weight, (1.0 + layer.eps) ** 0.5)  # a variance of 1 changes nothing
    measure(network, _batches(sorted(pictures.iterdir())[:MEASURED]))
    return network


def _batches(paths: list[Path]) -> Iterator[torch.Tensor]:
    """Pictures as inputs (n, 3, side, side) of the network."""
    for start in range(0, len(paths), BATCH):
        squares = [boxed_in(read_image(path), START_SIDE) for path in paths[start : start + BATCH]]
        yield torch.from_numpy(cv2.dnn.blobFromImages(squares, 1.0 / 255.0, swapRB=True))


def train(data: Path, out: Path, side: int, epochs: int, begin: Path | None = None) -> None:
    """Train for pictures of side x side px, or continue an interrupted training; a finished one stays.

    data: folder of `write_boxes`. out: gets `weights/best.pt`, `weights/last.pt` and `results.csv`. begin: a network to
    start from, or None for the packaged weights.
    """
    if (out / "results.csv").exists() and len(read_course(out / "results.csv")) >= epochs:
        return
    os.environ.setdefault("YOLO_CONFIG_DIR", str(out.parent.resolve()))
    from ultralytics import YOLO, settings

    settings.update({"sync": False, "tensorboard": False})
    torch.manual_seed(0)
    last, resume = out / "weights" / "last.pt", {}
    if last.exists():
        begin, resume = last, {"resume": True}
    elif begin is None:
        begin = out.parent / "start.pt"
        begin.parent.mkdir(parents=True, exist_ok=True)
        torch.save({"model": new_network(data / "images" / "training")}, begin)
    more: dict[str, Any] = {"project": str(out.parent.resolve()), "name": out.name, "exist_ok": True, "plots": False}
    more |= {"device": "cpu", "workers": 1, "batch": BATCH, "seed": 0, "single_cls": True, "amp": False}
    more |= {"data": str(data / "data.yaml"), "imgsz": side, "epochs": epochs, **RATE, **AUGMENTATION}
    model = YOLO(begin)
    model.add_callback("on_pretrain_routine_end", _speed_up)
    fast_convolutions()
    model.train(**(resume or more))


def _speed_up(trainer: Any) -> None:
    """Let the network use the order of values in memory that is fastest for a CPU."""
    trainer.model.to(memory_format=torch.channels_last)


def export(out: Path, path: Path, side: int) -> None:
    """Write the best network of a training as ONNX: centers, sizes and scores of all boxes."""
    from ultralytics import YOLO

    made = YOLO(out / "weights" / "best.pt").export(format="onnx", imgsz=side, opset=17, simplify=False, device="cpu")
    Path(made).replace(path)
