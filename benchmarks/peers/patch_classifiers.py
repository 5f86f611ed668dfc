"""Classifiers of patches, as the paper's related work uses them after color segmentation, with random weights.

The paper cites two times: 2.36 ms per proposal for the best network of Javadi et al., and about 1 ms for that of Cruz
et al. It gives no layers. What is known, and what is assumed here:

- Javadi et al. compare LeNet, SqueezeNet and GoogLeNet, each in Caffe. Which of them took 2.36 ms, and the size of its
  patches, is not known here. So there is LeNet as Caffe has it, and SqueezeNet 1.1 as its authors released it, both for
  color patches of 32 x 32 px. GoogLeNet is left out: it shrinks its input to a 32nd, so such patches do not fit it.
- Cruz et al. use a small SqueezeNet, and a network with binary weights, which ONNX Runtime can't run. Gray patches of
  24 x 24 px, a convolution of 16 channels and two blocks are assumed.
- Albani et al. compare networks of three to five layers. Color patches of 16 x 16 px, and two convolutions of 16 and 32
  channels before a fully connected layer, are assumed.
"""

from __future__ import annotations

from dataclasses import dataclass

import torch
from torch import nn

from .networks import convolution

CLASSES = 2


class LeNet(nn.Module):
    """Caffe's LeNet on color patches of 32 x 32 px."""

    def __init__(self) -> None:
        super().__init__()
        self.layers = nn.Sequential(
            nn.Conv2d(3, 20, 5), nn.MaxPool2d(2), nn.Conv2d(20, 50, 5), nn.MaxPool2d(2), nn.Flatten(),
            nn.Linear(50 * 5 * 5, 500), nn.ReLU(), nn.Linear(500, CLASSES),
        )  # fmt: skip

    def forward(self, x: torch.Tensor) -> torch.Tensor:
        return self.layers(x).softmax(dim=1)


class Fire(nn.Module):
    """SqueezeNet's block: narrower, then 1 x 1 and 3 x 3 convolutions side by side."""

    def __init__(self, inputs: int, narrow: int, wide: int) -> None:
        super().__init__()
        self.narrow = convolution(inputs, narrow, 1, 1, nn.ReLU())
        self.wide = nn.ModuleList(convolution(narrow, wide, size, 1, nn.ReLU()) for size in (1, 3))

    def forward(self, x: torch.Tensor) -> torch.Tensor:
        x = self.narrow(x)
        return torch.cat([layer(x) for layer in self.wide], dim=1)


class SqueezeNet(nn.Module):
    """SqueezeNet 1.1 on color patches of 32 x 32 px."""

    def __init__(self) -> None:
        super().__init__()
        self.layers = nn.Sequential(
            convolution(3, 64, 3, 2, nn.ReLU()), nn.MaxPool2d(3, 2, 1), Fire(64, 16, 64), Fire(128, 16, 64),
            nn.MaxPool2d(3, 2, 1), Fire(128, 32, 128), Fire(256, 32, 128),
            nn.MaxPool2d(3, 2, 1), Fire(256, 48, 192), Fire(384, 48, 192), Fire(384, 64, 256), Fire(512, 64, 256),
            convolution(512, CLASSES, 1, 1, nn.ReLU()),
        )  # fmt: skip

    def forward(self, x: torch.Tensor) -> torch.Tensor:
        return self.layers(x).mean(dim=(2, 3)).softmax(dim=1)


class SmallSqueezeNet(nn.Module):
    """A SqueezeNet with two blocks on gray patches of 24 x 24 px."""

    def __init__(self) -> None:
        super().__init__()
        self.layers = nn.Sequential(
            convolution(1, 16, 3, 1, nn.ReLU()), nn.MaxPool2d(2), Fire(16, 8, 16), nn.MaxPool2d(2), Fire(32, 8, 16),
            convolution(32, CLASSES, 1, 1, nn.ReLU()),
        )  # fmt: skip

    def forward(self, x: torch.Tensor) -> torch.Tensor:
        return self.layers(x).mean(dim=(2, 3)).softmax(dim=1)


class ThreeLayers(nn.Module):
    """Two convolutions and a fully connected layer on color patches of 16 x 16 px."""

    def __init__(self) -> None:
        super().__init__()
        self.layers = nn.Sequential(
            convolution(3, 16, 3, 1, nn.ReLU()), nn.MaxPool2d(2), convolution(16, 32, 3, 1, nn.ReLU()),
            nn.MaxPool2d(2), nn.Flatten(), nn.Linear(32 * 4 * 4, CLASSES),
        )  # fmt: skip

    def forward(self, x: torch.Tensor) -> torch.Tensor:
        return self.layers(x).softmax(dim=1)


@dataclass(frozen=True)
class PatchClassifier:
    """A classifier: its name, its network, the side [px] and the channels of its patches."""

    name: str
    network: type[nn.Module]
    side: int
    channels: int


CLASSIFIERS = (
    PatchClassifier("LeNet, 32 x 32", LeNet, 32, 3),
    PatchClassifier("SqueezeNet 1.1, 32 x 32", SqueezeNet, 32, 3),
    PatchClassifier("small SqueezeNet, 24 x 24", SmallSqueezeNet, 24, 1),
    PatchClassifier("three layers, 16 x 16", ThreeLayers, 16, 3),
)
