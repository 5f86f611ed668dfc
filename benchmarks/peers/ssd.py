"""Trains SSDLite with MobileNet v3 at 320 x 320 px: torchvision's network, loss and augmentation (license BSD).

No package ships weights of it, so it starts at random. Its default boxes are smaller than torchvision's, whose smallest
has 64 px: a ball at 10 m has three.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path
from time import perf_counter
from typing import Any

import cv2
import numpy as np
import torch
from torch import nn
from torch.utils.data import DataLoader, Dataset

from vm_embedded.cameras.image_files import read_image
from vm_embedded.files import atomic_write

from . import cpu_torchvision  # noqa: F401  # before torchvision
from .boxes import read_boxes
from .precision import fast_convolutions

SIDE = 320
SMALLEST, LARGEST = 0.02, 0.8
"""Sides of the default boxes of the finest and of the coarsest layer, as shares of the picture."""

BATCH, RATE, DECAY, WARM_UP = 16, 2e-3, 5e-4, 200
Target = dict[str, torch.Tensor]


def new_network() -> nn.Module:
    """The network with random weights, for one class besides the background."""
    from torchvision.models.detection import ssdlite320_mobilenet_v3_large
    from torchvision.models.detection.anchor_utils import DefaultBoxGenerator

    network = ssdlite320_mobilenet_v3_large(weights=None, weights_backbone=None, num_classes=2)
    network.anchor_generator = DefaultBoxGenerator([[2, 3] for _ in range(6)], min_ratio=SMALLEST, max_ratio=LARGEST)
    return network


class BoxedPictures(Dataset[tuple[torch.Tensor, Target]]):
    """Pictures of a part of a folder of `write_boxes`, with their boxes; augmented for training."""

    def __init__(self, data: Path, part: str) -> None:
        from torchvision.transforms import v2

        self._paths = sorted((data / "images" / part).iterdir())
        self._labels = data / "labels" / part
        steps: list[nn.Module] = []
        if part == "training":
            steps += [v2.RandomPhotometricDistort(), v2.RandomIoUCrop(min_scale=0.5), v2.RandomHorizontalFlip()]
        steps += [v2.Resize((SIDE, SIDE), antialias=True), v2.SanitizeBoundingBoxes(min_size=1.0)]
        steps += [v2.ToDtype(torch.float32, scale=True)]
        self._augment = v2.Compose(steps)

    def __len__(self) -> int:
        return len(self._paths)

    def __getitem__(self, number: int) -> tuple[torch.Tensor, Target]:
        from torchvision.transforms import v2
        from torchvision.tv_tensors import BoundingBoxes

        path = self._paths[number]
        image = v2.functional.to_image(cv2.cvtColor(read_image(path), cv2.COLOR_BGR2RGB))
        height, width = image.shape[1:]
        corners = torch.from_numpy(read_boxes(self._labels / f"{path.stem}.txt", width, height).astype(np.float32))
        boxes = BoundingBoxes(corners, format="XYXY", canvas_size=(height, width))
        target = {"boxes": boxes, "labels": torch.ones(len(corners), dtype=torch.int64)}
        return self._augment(image, target)  # type: ignore[no-any-return]


def _batches(pictures: BoxedPictures, seed: int | None) -> Iterator[Any]:
    """Batches of pictures and targets in random order, or in order without a seed."""
    order = range(len(pictures))
    if seed is not None:
        order = np.random.default_rng(seed).permutation(len(pictures)).tolist()
    chunks = [list(order[start : start + BATCH]) for start in range(0, len(order), BATCH)]
    yield from DataLoader(pictures, batch_sampler=chunks, num_workers=1, collate_fn=_lists)


def _lists(batch: list[tuple[torch.Tensor, Target]]) -> tuple[list[torch.Tensor], list[Target]]:
    return [image for image, _ in batch], [target for _, target in batch]


def _rate(step: int, steps: int) -> float:
    """Learning rate: it rises, then falls along a cosine."""
    return RATE * min((step + 1) / WARM_UP, 0.5 * (1.0 + math.cos(math.pi * step / steps)))


def train(data: Path, out: Path, epochs: int) -> list[dict[str, float]]:
    """Train, or continue an interrupted training from its last whole epoch.

    data: folder of `write_boxes`. out: gets state.pt with the network, and as `log` the loss of training and validation
    pictures after each epoch. Returns this log.
    """
    fast_convolutions()
    torch.manual_seed(0)
    network = new_network().to(memory_format=torch.channels_last)
    optimizer = torch.optim.AdamW(network.parameters(), RATE, weight_decay=DECAY)
    log: list[dict[str, float]] = []
    out.mkdir(parents=True, exist_ok=True)
    if (out / "state.pt").exists():
        state = torch.load(out / "state.pt", weights_only=True)
        network.load_state_dict(state["network"])
        optimizer.load_state_dict(state["optimizer"])
        log = state["log"]
    pictures = BoxedPictures(data, "training")
    steps = math.ceil(len(pictures) / BATCH)
    for epoch in range(len(log), epochs):
        torch.manual_seed(epoch)
        began, losses = perf_counter(), []
        network.train()
        for number, (images, targets) in enumerate(_batches(pictures, epoch)):
            for group in optimizer.param_groups:
                group["lr"] = _rate(epoch * steps + number, epochs * steps)
            loss = sum(network(images, targets).values())
            optimizer.zero_grad()
            loss.backward()
            optimizer.step()
            losses.append(float(loss.detach()))
            if number % 20 == 0:
                print(f"epoch {epoch + 1}/{epochs}, {number}/{steps}, loss {np.mean(losses):.3f}", flush=True)
        row = {"epoch": epoch + 1, "seconds": round(perf_counter() - began), "loss": round(float(np.mean(losses)), 4)}
        log.append(row | {"validation_loss": round(_validation_loss(network, data), 4)})
        with atomic_write(out / "state.pt") as path:
            torch.save({"network": network.state_dict(), "optimizer": optimizer.state_dict(), "log": log}, path)
    return log


@torch.no_grad()
def _validation_loss(network: nn.Module, data: Path) -> float:
    """Mean loss of the validation pictures, with the statistics of the training."""
    network.train()  # else it returns boxes instead of losses
    for each in network.modules():
        if isinstance(each, nn.BatchNorm2d):
            each.eval()
    found = [float(sum(network(*batch).values())) for batch in _batches(BoxedPictures(data, "validation"), None)]
    return float(np.mean(found))


class _Boxes(nn.Module):
    """The network from a picture (1, 3, SIDE, SIDE) to boxes (n, 4) left, top, right, bottom [px] and scores (n,)."""

    def __init__(self, network: nn.Module) -> None:
        super().__init__()
        self.network = network
        with torch.no_grad():
            empty = torch.zeros(1, 3, SIDE, SIDE)
            maps = list(network.backbone(empty).values())
            from torchvision.models.detection.image_list import ImageList

            self.register_buffer("defaults", network.anchor_generator(ImageList(empty, [(SIDE, SIDE)]), maps)[0])

    def forward(self, x: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
        heads = self.network.head(list(self.network.backbone((x - 0.5) / 0.5).values()))
        boxes = self.network.box_coder.decode_single(heads["bbox_regression"][0], self.defaults)
        return boxes, heads["cls_logits"][0].softmax(dim=1)[:, 1]


def export(out: Path, path: Path) -> None:
    """Write the last network of a training as ONNX."""
    network = new_network()
    network.load_state_dict(torch.load(out / "state.pt", weights_only=True)["network"])
    wrapped = _Boxes(network.eval()).eval()
    names = {"input_names": ["x"], "output_names": ["boxes", "scores"]}
    torch.onnx.export(wrapped, (torch.zeros(1, 3, SIDE, SIDE),), str(path), dynamo=False, opset_version=17, **names)
