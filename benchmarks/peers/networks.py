"""The detectors that users would choose instead, from their published layer tables, with random weights.

Weights do not change how long a network takes. Batch normalization is folded into the convolutions, as it is for
inference. They have four classes, like a team's own training; the eighty or ninety of their papers would be slower.

The paper compares SSD MobileNet, RCNN and YOLO v1 to v3 (section "Training").
"""

from __future__ import annotations

import io
import itertools
import warnings
from collections.abc import Callable
from dataclasses import dataclass

import cv2
import numpy as np
import onnxruntime
import torch
from torch import nn

CLASSES = 4
KEPT, SCORE, OVERLAP = 100, 0.5, 0.45
"""Non-maximum suppression: number of boxes, lowest score, and the overlap from which two boxes are one object."""


def convolution(inputs: int, outputs: int, size: int, stride: int, activation: nn.Module, groups: int = 1) -> nn.Module:
    return nn.Sequential(nn.Conv2d(inputs, outputs, size, stride, size // 2, groups=groups), activation)


def separable(inputs: int, outputs: int, stride: int, activation: Callable[[], nn.Module]) -> nn.Module:
    return nn.Sequential(
        convolution(inputs, inputs, 3, stride, activation(), groups=inputs),
        convolution(inputs, outputs, 1, 1, activation()),
    )


class Heads(nn.Module):
    """SSD: boxes and class scores at each scale, all scales in one list."""

    def __init__(self, widths: list[int], anchors: list[int], light: bool) -> None:
        super().__init__()

        def head(width: int, outputs: int) -> nn.Module:
            if not light:
                return nn.Conv2d(width, outputs, 1)
            return nn.Sequential(
                convolution(width, width, 3, 1, nn.ReLU6(), groups=width), nn.Conv2d(width, outputs, 1)
            )

        self.boxes = nn.ModuleList(head(width, 4 * count) for width, count in zip(widths, anchors, strict=True))
        self.scores = nn.ModuleList(
            head(width, (CLASSES + 1) * count) for width, count in zip(widths, anchors, strict=True)
        )

    def forward(self, scales: list[torch.Tensor]) -> tuple[torch.Tensor, torch.Tensor]:
        def listed(heads: nn.ModuleList, width: int) -> torch.Tensor:
            parts = [head(x).permute(0, 2, 3, 1).reshape(1, -1, width) for head, x in zip(heads, scales, strict=True)]
            return torch.cat(parts, dim=1)[0]

        return listed(self.boxes, 4), listed(self.scores, CLASSES + 1).softmax(dim=1)[:, 1:]


class SsdMobileNetV1(nn.Module):
    """SSD on MobileNet v1, 300 x 300: 1917 boxes."""

    def __init__(self) -> None:
        super().__init__()
        strides = ((64, 1), (128, 2), (128, 1), (256, 2), (256, 1), (512, 2), *((512, 1),) * 5)
        layers: list[nn.Module] = [convolution(3, 32, 3, 2, nn.ReLU6())]
        width = 32
        for outputs, stride in strides:
            layers.append(separable(width, outputs, stride, nn.ReLU6))
            width = outputs
        self.first = nn.Sequential(*layers)
        self.second = nn.Sequential(separable(512, 1024, 2, nn.ReLU6), separable(1024, 1024, 1, nn.ReLU6))
        self.extras = nn.ModuleList(
            nn.Sequential(convolution(a, b, 1, 1, nn.ReLU6()), convolution(b, c, 3, 2, nn.ReLU6()))
            for a, b, c in ((1024, 256, 512), (512, 128, 256), (256, 128, 256), (256, 64, 128))
        )
        self.heads = Heads([512, 1024, 512, 256, 256, 128], [3, 6, 6, 6, 6, 6], light=False)

    def forward(self, x: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
        scales = [self.first(x)]
        scales.append(self.second(scales[0]))
        for extra in self.extras:
            scales.append(extra(scales[-1]))
        return self.heads(scales)


class Squeeze(nn.Module):
    """Squeeze and excitation."""

    def __init__(self, width: int) -> None:
        super().__init__()
        inner = max(8, (width // 4 + 7) // 8 * 8)
        self.gate = nn.Sequential(
            nn.AdaptiveAvgPool2d(1), nn.Conv2d(width, inner, 1), nn.ReLU(), nn.Conv2d(inner, width, 1), nn.Hardsigmoid()
        )

    def forward(self, x: torch.Tensor) -> torch.Tensor:
        return x * self.gate(x)


class Bottleneck(nn.Module):
    """MobileNet v3's block: wider, depthwise, narrower; with a skip connection if the size stays."""

    def __init__(self, inputs: int, size: int, wide: int, outputs: int, squeeze: bool, hard: bool, stride: int) -> None:
        super().__init__()
        activation = nn.Hardswish if hard else nn.ReLU
        layers = [] if wide == inputs else [convolution(inputs, wide, 1, 1, activation())]
        self.widen = nn.Sequential(*layers)
        self.narrow = nn.Sequential(
            convolution(wide, wide, size, stride, activation(), groups=wide),
            Squeeze(wide) if squeeze else nn.Identity(),
            nn.Conv2d(wide, outputs, 1),
        )
        self.around = stride == 1 and inputs == outputs

    def forward(self, x: torch.Tensor) -> torch.Tensor:
        y = self.narrow(self.widen(x))
        return x + y if self.around else y


class SsdLiteMobileNetV3(nn.Module):
    """SSDLite on MobileNet v3 large with its tail reduced, 320 x 320: 3234 boxes."""

    def __init__(self) -> None:
        super().__init__()
        table = (
            (3, 16, 16, False, False, 1),
            (3, 64, 24, False, False, 2),
            (3, 72, 24, False, False, 1),
            (5, 72, 40, True, False, 2),
            (5, 120, 40, True, False, 1),
            (5, 120, 40, True, False, 1),
            (3, 240, 80, False, True, 2),
            (3, 200, 80, False, True, 1),
            (3, 184, 80, False, True, 1),
            (3, 184, 80, False, True, 1),
            (3, 480, 112, True, True, 1),
            (3, 672, 112, True, True, 1),
            (5, 672, 80, True, True, 2),
            (5, 480, 80, True, True, 1),
            (5, 480, 80, True, True, 1),
        )
        blocks = []
        width = 16
        for size, wide, outputs, squeeze, hard, stride in table:
            blocks.append(Bottleneck(width, size, wide, outputs, squeeze, hard, stride))
            width = outputs
        self.first = nn.Sequential(convolution(3, 16, 3, 2, nn.Hardswish()), *blocks[:12])
        self.turn = blocks[12]
        self.second = nn.Sequential(*blocks[13:], convolution(80, 480, 1, 1, nn.Hardswish()))
        self.extras = nn.ModuleList(
            nn.Sequential(convolution(a, b, 1, 1, nn.ReLU6()), separable(b, c, 2, nn.ReLU6))
            for a, b, c in ((480, 256, 512), (512, 128, 256), (256, 128, 256), (256, 64, 128))
        )
        self.heads = Heads([672, 480, 512, 256, 256, 128], [6] * 6, light=True)

    def forward(self, x: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
        wide = self.turn.widen(self.first(x))
        scales = [wide, self.second(self.turn.narrow(wide))]
        for extra in self.extras:
            scales.append(extra(scales[-1]))
        return self.heads(scales)


class Split(nn.Module):
    """YOLO v8's block: half of the channels pass bottlenecks, and the outputs of all stages are concatenated."""

    def __init__(self, inputs: int, outputs: int, count: int, around: bool) -> None:
        super().__init__()
        half = outputs // 2
        self.around = around
        self.open = convolution(inputs, outputs, 1, 1, nn.SiLU())
        self.stages = nn.ModuleList(
            nn.Sequential(convolution(half, half, 3, 1, nn.SiLU()), convolution(half, half, 3, 1, nn.SiLU()))
            for _ in range(count)
        )
        self.close = convolution((2 + count) * half, outputs, 1, 1, nn.SiLU())

    def forward(self, x: torch.Tensor) -> torch.Tensor:
        parts = list(self.open(x).chunk(2, dim=1))
        for stage in self.stages:
            y = stage(parts[-1])
            parts.append(parts[-1] + y if self.around else y)
        return self.close(torch.cat(parts, dim=1))


class Pyramid(nn.Module):
    """Spatial pyramid pooling by three pools in a row."""

    def __init__(self, width: int) -> None:
        super().__init__()
        self.open = convolution(width, width // 2, 1, 1, nn.SiLU())
        self.pool = nn.MaxPool2d(5, 1, 2)
        self.close = convolution(2 * width, width, 1, 1, nn.SiLU())

    def forward(self, x: torch.Tensor) -> torch.Tensor:
        parts = [self.open(x)]
        for _ in range(3):
            parts.append(self.pool(parts[-1]))
        return self.close(torch.cat(parts, dim=1))


class YoloNano(nn.Module):
    """A nano YOLO as of version 8: 8400 boxes at 640 x 640."""

    def __init__(self) -> None:
        super().__init__()

        def down(inputs: int, outputs: int) -> nn.Module:
            return convolution(inputs, outputs, 3, 2, nn.SiLU())

        self.first = nn.Sequential(
            down(3, 16), down(16, 32), Split(32, 32, 1, True), down(32, 64), Split(64, 64, 2, True)
        )
        self.second = nn.Sequential(down(64, 128), Split(128, 128, 2, True))
        self.third = nn.Sequential(down(128, 256), Split(256, 256, 1, True), Pyramid(256))
        self.up = nn.Upsample(scale_factor=2)
        self.merge = nn.ModuleList(
            [Split(384, 128, 1, False), Split(192, 64, 1, False), Split(192, 128, 1, False), Split(384, 256, 1, False)]
        )
        self.down = nn.ModuleList([down(64, 64), down(128, 128)])
        self.boxes, self.scores = (
            nn.ModuleList(
                nn.Sequential(
                    convolution(width, 64, 3, 1, nn.SiLU()), convolution(64, 64, 3, 1, nn.SiLU()), nn.Conv2d(64, out, 1)
                )
                for width in (64, 128, 256)
            )
            for out in (64, CLASSES)
        )

    def forward(self, x: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
        a = self.first(x)
        b = self.second(a)
        c = self.third(b)
        b = self.merge[0](torch.cat([self.up(c), b], dim=1))
        a = self.merge[1](torch.cat([self.up(b), a], dim=1))
        b = self.merge[2](torch.cat([self.down[0](a), b], dim=1))
        c = self.merge[3](torch.cat([self.down[1](b), c], dim=1))
        boxes = torch.cat([head(y).reshape(4, 16, -1) for head, y in zip(self.boxes, (a, b, c), strict=True)], dim=2)
        scores = torch.cat(
            [head(y).reshape(CLASSES, -1) for head, y in zip(self.scores, (a, b, c), strict=True)], dim=1
        )
        # Each side of a box is the mean of a distribution over 16 distances.
        sides = (boxes.softmax(dim=1) * torch.arange(16.0)[None, :, None]).sum(dim=1)
        return sides.T, scores.sigmoid().T


class TinyYolo(nn.Module):
    """Tiny YOLO as of version 3, 416 x 416: 2535 boxes."""

    def __init__(self) -> None:
        super().__init__()

        def layer(inputs: int, outputs: int, size: int = 3) -> nn.Module:
            return convolution(inputs, outputs, size, 1, nn.LeakyReLU(0.1))

        widths = (3, 16, 32, 64, 128, 256)
        layers: list[nn.Module] = []
        for inputs, outputs in itertools.pairwise(widths):
            layers += [layer(inputs, outputs), nn.MaxPool2d(2)]
        self.first = nn.Sequential(*layers[:-1])
        self.second = nn.Sequential(
            nn.MaxPool2d(2), layer(256, 512), nn.ZeroPad2d((0, 1, 0, 1)), nn.MaxPool2d(2, 1), layer(512, 1024),
            layer(1024, 256, 1),
        )  # fmt: skip
        self.coarse = nn.Sequential(layer(256, 512), nn.Conv2d(512, 3 * (5 + CLASSES), 1))
        self.turn = nn.Sequential(layer(256, 128, 1), nn.Upsample(scale_factor=2))
        self.fine = nn.Sequential(layer(384, 256), nn.Conv2d(256, 3 * (5 + CLASSES), 1))

    def forward(self, x: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
        fine = self.first(x)
        coarse = self.second(fine)
        outputs = [self.coarse(coarse), self.fine(torch.cat([self.turn(coarse), fine], dim=1))]
        rows = torch.cat([y.reshape(3, 5 + CLASSES, -1).permute(0, 2, 1).reshape(-1, 5 + CLASSES) for y in outputs])
        return rows[:, :4], rows[:, 4:5].sigmoid() * rows[:, 5:].sigmoid()


@dataclass(frozen=True)
class Peer:
    """A peer: its name, its network, and the side of its square input [px]."""

    name: str
    network: type[nn.Module]
    side: int


PEERS = (
    Peer("SSD MobileNet v1, 300", SsdMobileNetV1, 300),
    Peer("SSDLite MobileNet v3, 320", SsdLiteMobileNetV3, 320),
    Peer("YOLO nano, 320", YoloNano, 320),
    Peer("YOLO nano, 640", YoloNano, 640),
    Peer("Tiny YOLO, 416", TinyYolo, 416),
)


def loaded(
    network: nn.Module,
    examples: dict[str, torch.Tensor],
    outputs: list[str],
    free: dict[str, dict[int, str]] | None = None,
) -> onnxruntime.InferenceSession:
    """A network in ONNX Runtime on one thread.

    examples: its inputs by name. outputs: their names. free: axes whose length is free, by input, with a name for each.
    """
    file = io.BytesIO()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        torch.onnx.export(
            network.eval(),
            tuple(examples.values()),
            file,
            dynamo=False,
            input_names=list(examples),
            output_names=outputs,
            dynamic_axes=free,
            opset_version=17,
        )
    return one_thread(file.getvalue())


def one_thread(model: bytes | str) -> onnxruntime.InferenceSession:
    """A network in ONNX Runtime on one thread, from the content or the path of a file."""
    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = 1
    options.log_severity_level = 3
    return onnxruntime.InferenceSession(model, options, providers=["CPUExecutionProvider"])


def prepared(image: np.ndarray, width: int, height: int) -> np.ndarray:
    """A BGR image scaled to this size [px], as RGB (1, 3, height, width) from -1 to 1."""
    return cv2.dnn.blobFromImage(image, 1.0 / 127.5, (width, height), (127.5, 127.5, 127.5), swapRB=True)


class PeerDetector:
    """A peer from frame to boxes on one thread: preparing the frame, network, selection and suppression of boxes."""

    def __init__(self, peer: Peer) -> None:
        torch.manual_seed(0)
        example = torch.zeros(1, 3, peer.side, peer.side)
        self._session = loaded(peer.network(), {"x": example}, ["boxes", "scores"])
        self._side = peer.side

    def detect(self, image: np.ndarray) -> int:
        """Number of objects in a BGR image."""
        boxes, scores = self._session.run(None, {"x": prepared(image, self._side, self._side)})
        best = scores.max(axis=1)
        kept = min(KEPT, len(best))
        chosen = np.argpartition(best, -kept)[-kept:]
        return len(cv2.dnn.NMSBoxes(boxes[chosen].tolist(), best[chosen].tolist(), SCORE, OVERLAP))
