"""The network of the layout `canvas` in torch: convolutions on the strips of mesh octaves, at four resolutions.

A convolution is separable: 3 x 3 cells in each channel by itself, then a mix of the channels. Three times the canvas is
halved, so that a cell sees far around; then the answers of the coarser canvases are added to the finer ones (a U-Net:
Ronneberger and others, 2015). Peaks have a separable convolution of their own, since they look for single cells where
classes look for areas. All channels come in multiples of eight, which ONNX Runtime computes fastest.
"""

from __future__ import annotations

from itertools import pairwise
from typing import cast

import torch
from torch import nn

from vm_embedded.network.canvas_layout import place_on_canvas
from vm_embedded.network.manifest import PEAK_OUTPUTS

from .canvas_shape import CanvasShape

_MOMENTUM = 0.05
"""Weight of a batch in the mean colors of batch normalization: a batch has few pictures."""


_RARE = -4.6
"""Score of peaks before training: the logit of the share of cells that hold an object, so that the first steps do not
learn this share only (T. Lin and others, 2017)."""


class Mix(nn.Conv2d):
    """A convolution of single cells, as a product of matrices: torch takes half the time for it in a training."""

    def __init__(self, inputs: int, outputs: int, bias: bool = True) -> None:
        super().__init__(inputs, outputs, 1, bias=bias)

    def forward(self, x: torch.Tensor) -> torch.Tensor:
        """(1, outputs, H, W) from (1, inputs, H, W)."""
        mixed = nn.functional.linear(x.permute(0, 2, 3, 1), self.weight[:, :, 0, 0], self.bias)
        return mixed.permute(0, 3, 1, 2)


class Separable(nn.Module):
    """A separable convolution with batch normalization, added to its input if nothing changes the size, then ReLU."""

    def __init__(self, inputs: int, outputs: int, stride: int = 1) -> None:
        super().__init__()
        self.depthwise = nn.Conv2d(inputs, inputs, 3, stride, padding=1, groups=inputs, bias=False)
        self.mix = Mix(inputs, outputs, bias=False)
        self.norm = nn.BatchNorm2d(outputs, momentum=_MOMENTUM)
        self.adds = stride == 1 and inputs == outputs

    def forward(self, x: torch.Tensor) -> torch.Tensor:
        """(1, outputs, H, W) from (1, inputs, H, W), halved if the stride is two."""
        found = self.norm(self.mix(self.depthwise(x)))
        return torch.relu(x + found if self.adds else found)


class CanvasNetwork(nn.Module):
    """A network on a canvas: from colors to probabilities, or to logits in training."""

    def __init__(self, shape: CanvasShape) -> None:
        super().__init__()
        self.shape = shape
        widths, depths = shape.widths, shape.depths
        steps = list(pairwise(widths))
        self.stem = nn.Conv2d(4, widths[0], 3, padding=1, bias=False)
        self.stem_norm = nn.BatchNorm2d(widths[0], momentum=_MOMENTUM)
        self.down = nn.ModuleList(
            nn.ModuleList(Separable(width, width) for _ in range(depth))
            for width, depth in zip(widths, depths, strict=True)
        )
        self.halve = nn.ModuleList(Separable(fine, coarse, stride=2) for fine, coarse in steps)
        self.lift = nn.ModuleList(Mix(coarse, fine) for fine, coarse in steps)
        self.up = nn.ModuleList(Separable(fine, fine) for fine, _ in steps)
        self.head = Mix(widths[0], shape.classes)
        self.seek = Separable(widths[0], widths[0]) if shape.peaks else None
        self.peaks = Mix(widths[0], PEAK_OUTPUTS * shape.peaks) if shape.peaks else None
        if self.peaks is not None:
            assert self.peaks.bias is not None
            self.peaks.bias.data[::PEAK_OUTPUTS] = _RARE

    @property
    def blocks(self) -> list[list[Separable]]:
        """The separable convolutions on the way down at each resolution, the finest first."""
        return cast("list[list[Separable]]", self.down)

    def canvas_logits(self, points: torch.Tensor, shown: torch.Tensor) -> torch.Tensor:
        """Outputs (1, C + 4 P, H, W) before the softmax; the manifest says what those of the P classes with peaks are.

        points (1, 3, H, W): colors, 0 where nothing is. shown (1, 1, H, W): the cells that are shown.
        """
        canvas = torch.cat([points, shown.to(points.dtype)], dim=1).contiguous(memory_format=torch.channels_last)
        x = torch.relu(self.stem_norm(self.stem(canvas)))
        finer = []
        for level, blocks in enumerate(self.blocks):
            for block in blocks:
                x = block(x)
            if level < len(self.halve):
                finer.append(x)
                x = self.halve[level](x)
        for level in reversed(range(len(finer))):
            lifted = nn.functional.interpolate(self.lift[level](x), scale_factor=2.0, mode="nearest")
            x = self.up[level](torch.relu(finer[level] + lifted))
        logits: torch.Tensor = self.head(x)
        if self.seek is None or self.peaks is None:
            return logits
        return torch.cat([logits, self.peaks(self.seek(x))], dim=1)

    def logits(self, points: torch.Tensor, cells: torch.Tensor) -> torch.Tensor:
        """Outputs (n + 1, C + 4 P) before the softmax, from points (n + 1, 3) and their cells (n, 2) on strips.

        The last row is the off-screen point, which takes no part. The strips of the cells are placed on a canvas as the
        runtime places them.
        """
        count = len(cells)
        _, shape, found = place_on_canvas(cells.cpu().numpy())
        places = torch.tensor(found).to(points.device)
        canvas = torch.zeros((4, shape[0] * shape[1]), dtype=points.dtype, device=points.device)
        canvas[:3, places], canvas[3, places] = points[:count].T, 1.0
        canvas = canvas.reshape(1, 4, *shape)
        outputs = self.canvas_logits(canvas[:, :3], canvas[:, 3:])[0].flatten(1)
        return torch.cat([outputs[:, places], torch.zeros_like(outputs[:, :1])], dim=1).T

    def probabilities(self, points: torch.Tensor, cells: torch.Tensor) -> torch.Tensor:
        """Probabilities (n + 1, C); see `logits`."""
        return self.logits(points, cells)[:, : self.shape.classes].softmax(dim=1)

    def forward(self, points: torch.Tensor, shown: torch.Tensor) -> torch.Tensor:
        """Answers (1, C + 4 P, H, W) for the cells of a canvas, as a model file gives them; see `canvas_logits`."""
        return self.answers(self.canvas_logits(points, shown))

    def answers(self, logits: torch.Tensor) -> torch.Tensor:
        """Probabilities of the classes, and the outputs for peaks as they are, from outputs (n, C + 4 P, ...)."""
        classes = self.shape.classes
        return torch.cat([logits[:, :classes].softmax(dim=1), logits[:, classes:]], dim=1)
