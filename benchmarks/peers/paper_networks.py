"""The other detectors of the paper's tab:visualmesh_performance, from their published layer tables, random weights.

SSD MobileNet is in networks.py. The paper names no sizes of inputs. Here they are those that each network was published
with. Batch normalization is folded into the convolutions. All have four classes unless a caller asks for more.
"""

from __future__ import annotations

import itertools
from typing import Any

import cv2
import numpy as np
import onnxruntime
import torch
from onnx import TensorProto, helper
from torch import nn
from torch.nn import functional

from vm_embedded.arrays import Floats, Singles

from .networks import CLASSES, convolution, loaded, one_thread, prepared

_Layers = tuple[tuple[int, int] | tuple[int, int, int] | None, ...]
"""Layers in a row: outputs, size of the kernel and stride, which is 1 if it is left out; None is a pool that halves."""


def stack(inputs: int, layers: _Layers) -> nn.Sequential:
    """Convolutions with leaky ReLU, and pools."""
    made: list[nn.Module] = []
    for layer in layers:
        if layer is None:
            made.append(nn.MaxPool2d(2))
        else:
            outputs, size, stride = (*layer, 1)[:3]
            made.append(convolution(inputs, outputs, size, stride, nn.LeakyReLU(0.1)))
            inputs = outputs
    return nn.Sequential(*made)


def _corners(centers: torch.Tensor, sizes: torch.Tensor) -> torch.Tensor:
    """Boxes (n, 4): left, top, width and height, from centers (n, 2) and sizes (n, 2)."""
    return torch.cat([centers - 0.5 * sizes, sizes], dim=1)


class YoloV1(nn.Module):
    """YOLO, 448 x 448: 24 convolutions, two fully connected layers, 7 x 7 cells with two boxes each.

    Layers of Redmon et al. 2015, figure 3. The configuration that was released later replaces the first fully connected
    layer by a locally connected one.
    """

    def __init__(self, classes: int = CLASSES) -> None:
        super().__init__()
        self.classes = classes
        self.convolutions = stack(
            3,
            (
                (64, 7, 2), None, (192, 3), None, (128, 1), (256, 3), (256, 1), (512, 3), None,
                *((256, 1), (512, 3)) * 4, (512, 1), (1024, 3), None,
                *((512, 1), (1024, 3)) * 2, (1024, 3), (1024, 3, 2), (1024, 3), (1024, 3),
            ),
        )  # fmt: skip
        self.hidden = nn.Linear(7 * 7 * 1024, 4096)
        self.answers = nn.Linear(4096, 7 * 7 * (2 * 5 + classes))

    def cells(self, x: torch.Tensor) -> torch.Tensor:
        """Answers (7, 7, 10 + classes) of the cells: the classes, then for each box its place and its confidence."""
        hidden = functional.leaky_relu(self.hidden(self.convolutions(x).flatten(1)), 0.1)
        return self.answers(hidden).reshape(7, 7, -1)

    def forward(self, x: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
        """Boxes (98, 4) and their scores (98, classes)."""
        cells = self.cells(x).reshape(49, -1)
        boxes = cells[:, self.classes :].reshape(49, 2, 5)
        number = torch.arange(49)
        corner = torch.stack([number % 7, number // 7], dim=1)[:, None]
        centers, sizes = (boxes[:, :, :2] + corner) / 7.0, boxes[:, :, 2:4].square()
        scores = boxes[:, :, 4:] * cells[:, None, : self.classes]
        return _corners(centers.reshape(98, 2), sizes.reshape(98, 2)), scores.reshape(98, self.classes)


class Grid(nn.Module):
    """Boxes of YOLO v2 and v3 from the outputs of one scale.

    anchors: sizes of the boxes at each cell [cells].
    """

    def __init__(self, anchors: tuple[tuple[float, float], ...], classes: int, independent: bool) -> None:
        super().__init__()
        self.anchors, self.classes, self.independent = anchors, classes, independent

    def forward(self, x: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
        """Boxes (n, 4) in shares of the picture, and scores (n, classes), from (1, anchors * (5 + classes), h, w)."""
        height, width = x.shape[2:]
        rows = x.reshape(len(self.anchors), 5 + self.classes, -1).permute(0, 2, 1)
        number = torch.arange(height * width)
        corner = torch.stack([number % width, torch.div(number, width, rounding_mode="floor")], dim=1)
        size = torch.tensor([float(width), float(height)])
        centers = (rows[:, :, :2].sigmoid() + corner) / size
        sizes = rows[:, :, 2:4].exp() * torch.tensor(self.anchors)[:, None] / size
        classes = rows[:, :, 5:].sigmoid() if self.independent else rows[:, :, 5:].softmax(dim=2)
        scores = rows[:, :, 4:5].sigmoid() * classes
        return _corners(centers.reshape(-1, 2), sizes.reshape(-1, 2)), scores.reshape(-1, self.classes)


class YoloV2(nn.Module):
    """YOLO v2, 416 x 416: Darknet-19, a passthrough from 26 x 26 cells, and 13 x 13 cells with five boxes each.

    Layers of the configuration that its authors released. There a convolution narrows the passthrough to 64 channels,
    which the text of Redmon and Farhadi 2017 does not mention; without it, the network has a fifth more operations.
    """

    def __init__(self, classes: int = CLASSES) -> None:
        super().__init__()
        self.fine = stack(
            3,
            (
                (32, 3), None, (64, 3), None, (128, 3), (64, 1), (128, 3), None, (256, 3), (128, 1), (256, 3), None,
                *((512, 3), (256, 1)) * 2, (512, 3),
            ),
        )  # fmt: skip
        self.coarse = stack(512, (None, *((1024, 3), (512, 1)) * 2, (1024, 3), (1024, 3), (1024, 3)))
        self.passthrough = nn.Sequential(stack(512, ((64, 1),)), nn.PixelUnshuffle(2))
        self.head = nn.Sequential(stack(1024 + 4 * 64, ((1024, 3),)), nn.Conv2d(1024, 5 * (5 + classes), 1))
        anchors = ((0.57, 0.68), (1.87, 2.06), (3.34, 5.47), (7.88, 3.53), (9.77, 9.17))
        self.grid = Grid(anchors, classes, independent=False)

    def cells(self, x: torch.Tensor) -> torch.Tensor:
        """Outputs (1, 5 * (5 + classes), 13, 13)."""
        fine = self.fine(x)
        return self.head(torch.cat([self.passthrough(fine), self.coarse(fine)], dim=1))

    def forward(self, x: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
        """Boxes (845, 4) and their scores (845, classes)."""
        return self.grid(self.cells(x))


class Residual(nn.Module):
    """Darknet-53's block: narrower, then wider again, with a skip connection."""

    def __init__(self, width: int) -> None:
        super().__init__()
        self.layers = stack(width, ((width // 2, 1), (width, 3)))

    def forward(self, x: torch.Tensor) -> torch.Tensor:
        return x + self.layers(x)


class YoloV3(nn.Module):
    """YOLO v3, 416 x 416: Darknet-53, and three scales with three boxes at each cell, 10647 in all.

    Layers of Redmon and Farhadi 2018 (table 1) and of the configuration that its authors released.
    """

    def __init__(self, classes: int = CLASSES) -> None:
        super().__init__()

        def stage(inputs: int, count: int) -> nn.Module:
            blocks = (Residual(2 * inputs) for _ in range(count))
            return nn.Sequential(stack(inputs, ((2 * inputs, 3, 2),)), *blocks)

        self.first = nn.Sequential(stack(3, ((32, 3),)), stage(32, 1), stage(64, 2), stage(128, 8))
        self.second, self.third = stage(256, 8), stage(512, 4)
        self.necks = nn.ModuleList(
            stack(inputs, (*((width, 1), (2 * width, 3)) * 2, (width, 1)))
            for inputs, width in ((1024, 512), (768, 256), (384, 128))
        )
        self.turns = nn.ModuleList(
            nn.Sequential(stack(width, ((width // 2, 1),)), nn.Upsample(scale_factor=2)) for width in (512, 256)
        )
        self.heads = nn.ModuleList(
            nn.Sequential(stack(width, ((2 * width, 3),)), nn.Conv2d(2 * width, 3 * (5 + classes), 1))
            for width in (512, 256, 128)
        )
        anchors = (((116, 90), (156, 198), (373, 326)), ((30, 61), (62, 45), (59, 119)), ((10, 13), (16, 30), (33, 23)))
        self.grids = nn.ModuleList(
            Grid(tuple((w / stride, h / stride) for w, h in sizes), classes, independent=True)
            for sizes, stride in zip(anchors, (32, 16, 8), strict=True)
        )

    def forward(self, x: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
        """Boxes (10647, 4) and their scores (10647, classes)."""
        fine = self.first(x)
        middle = self.second(fine)
        y = self.necks[0](self.third(middle))
        outputs = [self.grids[0](self.heads[0](y))]
        for number, skipped in enumerate((middle, fine)):
            y = self.necks[number + 1](torch.cat([self.turns[number](y), skipped], dim=1))
            outputs.append(self.grids[number + 1](self.heads[number + 1](y)))
        boxes, scores = (torch.cat(parts) for parts in zip(*outputs, strict=True))
        return boxes, scores


class Mixed(nn.Module):
    """Inception v2's block: parallel branches, concatenated.

    single: outputs of the branch of one 1 x 1 convolution; None halves the resolution, and the pool has no convolution.
    double, triple: outputs of a 1 x 1 convolution and of one or two 3 x 3 convolutions after it. pooled: outputs of the
    convolution after the pool. average: the pool averages.
    """

    def __init__(
        self,
        inputs: int,
        single: int | None,
        double: tuple[int, int],
        triple: tuple[int, int],
        pooled: int = 0,
        average: bool = True,
    ) -> None:
        super().__init__()
        stride = 2 if single is None else 1

        def layer(inputs: int, outputs: int, size: int, stride: int = 1) -> nn.Module:
            return convolution(inputs, outputs, size, stride, nn.ReLU())

        narrow, wide = triple
        branches = [
            nn.Sequential(layer(inputs, double[0], 1), layer(double[0], double[1], 3, stride)),
            nn.Sequential(layer(inputs, narrow, 1), layer(narrow, wide, 3), layer(wide, wide, 3, stride)),
        ]
        pool = nn.AvgPool2d(3, 1, 1) if average and stride == 1 else nn.MaxPool2d(3, stride, 1)
        if single is None:
            branches.append(nn.Sequential(pool))
        else:
            branches = [
                nn.Sequential(layer(inputs, single, 1)),
                *branches,
                nn.Sequential(pool, layer(inputs, pooled, 1)),
            ]
        self.branches = nn.ModuleList(branches)

    def forward(self, x: torch.Tensor) -> torch.Tensor:
        return torch.cat([branch(x) for branch in self.branches], dim=1)


RATIOS, SCALES, BASE, STRIDE = (0.5, 1.0, 2.0), (0.25, 0.5, 1.0, 2.0), 256, 16
"""Anchors: width over height, size as a share of the base [px], base [px], distance between places [px]."""

PROPOSALS, CROP = 300, 14
"""Proposals for the second stage, and the side of the features that it gets of each."""

_PER_PLACE = len(RATIOS) * len(SCALES)
_PROPOSAL_OVERLAP, _OVERLAP, _KEPT = 0.7, 0.6, 100
"""Overlap from which two proposals, or two boxes of a class, are one object, and most boxes of a class."""


class RegionProposals(nn.Module):
    """First stage of Faster R-CNN: Inception v2 to the block Mixed_4e, and the network for proposals."""

    def __init__(self) -> None:
        super().__init__()
        # The first convolution is separable, with eight kernels for each color and no activation between its parts.
        self.backbone = nn.Sequential(
            nn.Conv2d(3, 24, 7, 2, 3, groups=3),
            convolution(24, 64, 1, 1, nn.ReLU()),
            nn.MaxPool2d(3, 2, 1),
            convolution(64, 64, 1, 1, nn.ReLU()),
            convolution(64, 192, 3, 1, nn.ReLU()),
            nn.MaxPool2d(3, 2, 1),
            Mixed(192, 64, (64, 64), (64, 96), 32),
            Mixed(256, 64, (64, 96), (64, 96), 64),
            Mixed(320, None, (128, 160), (64, 96)),
            Mixed(576, 224, (64, 96), (96, 128), 128),
            Mixed(576, 192, (96, 128), (96, 128), 128),
            Mixed(576, 160, (128, 160), (128, 160), 96),
            Mixed(576, 96, (128, 192), (160, 192), 96),
        )
        self.shared = convolution(576, 512, 3, 1, nn.ReLU6())
        self.offsets = nn.Conv2d(512, 4 * _PER_PLACE, 1)
        self.scores = nn.Conv2d(512, 2 * _PER_PLACE, 1)

    def forward(self, x: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor, torch.Tensor]:
        """Features (1, 576, h, w), offsets of the boxes (n, 4) and probabilities of an object (n,)."""
        features = self.backbone(x)
        shared = self.shared(features)
        offsets = self.offsets(shared).permute(0, 2, 3, 1).reshape(-1, 4)
        scores = self.scores(shared).permute(0, 2, 3, 1).reshape(-1, 2)
        return features, offsets, scores.softmax(dim=1)[:, 1]


class Crop(torch.autograd.Function):
    """Features (n, c, CROP, CROP) in boxes (n, 4), left, top, right and bottom [cells], of features (1, c, h, w).

    Each has one bilinear sample in the middle of each of CROP x CROP parts of its box. TensorFlow's operator samples as
    often, but from border to border.
    """

    @staticmethod
    def forward(context: Any, features: torch.Tensor, boxes: torch.Tensor) -> torch.Tensor:
        count, channels = len(boxes), features.shape[1]
        steps = (torch.arange(CROP, device=boxes.device) + 0.5) / CROP
        x, y = (
            (low[:, None] + (high - low)[:, None] * steps) / (length - 1) * 2.0 - 1.0
            for low, high, length in zip(boxes.T[:2], boxes.T[2:], (features.shape[3], features.shape[2]), strict=True)
        )
        grid = torch.stack([x[:, None].expand(-1, CROP, -1), y[:, :, None].expand(-1, -1, CROP)], dim=3)
        cut = functional.grid_sample(
            features, grid.reshape(1, count * CROP, CROP, 2), padding_mode="border", align_corners=True
        )
        return cut.reshape(channels, count, CROP, CROP).transpose(0, 1)

    @staticmethod
    def symbolic(g: Any, features: Any, boxes: Any) -> Any:
        picture = g.op("Constant", value_t=torch.zeros(PROPOSALS, dtype=torch.int64))
        attributes = {"mode_s": "avg", "coordinate_transformation_mode_s": "output_half_pixel"}
        size = {"output_height_i": CROP, "output_width_i": CROP, "sampling_ratio_i": 1, "spatial_scale_f": 1.0}
        return g.op("RoiAlign", features, boxes, picture, **attributes, **size)


class BoxClassifier(nn.Module):
    """Second stage of Faster R-CNN: the last blocks of Inception v2 for each proposal, its class and its box."""

    def __init__(self, classes: int = CLASSES) -> None:
        super().__init__()
        self.pool = nn.MaxPool2d(2)
        self.blocks = nn.Sequential(
            Mixed(576, None, (128, 192), (192, 256)),
            Mixed(1024, 352, (192, 320), (160, 224), 128),
            Mixed(1024, 352, (192, 320), (192, 224), 128, average=False),
        )
        self.offsets, self.scores = nn.Linear(1024, 4 * classes), nn.Linear(1024, classes + 1)

    def forward(self, features: torch.Tensor, boxes: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
        """Offsets (n, 4 * classes) and probabilities (n, classes) of the objects in boxes (n, 4) [cells]."""
        crops = self.pool(Crop.apply(features, boxes))
        x = self.blocks(crops).mean(dim=(2, 3))
        return self.offsets(x), self.scores(x).softmax(dim=1)[:, 1:]


def anchors(rows: int, columns: int) -> Floats:
    """Anchors (rows * columns * 12, 4): center x and y, width and height [px]."""
    sizes = np.array(
        [(BASE * scale * ratio**0.5, BASE * scale / ratio**0.5) for scale, ratio in itertools.product(SCALES, RATIOS)]
    )
    y, x = np.meshgrid(STRIDE * np.arange(rows), STRIDE * np.arange(columns), indexing="ij")
    centers = np.repeat(np.stack([x.ravel(), y.ravel()], axis=1), len(sizes), axis=0)
    return np.concatenate([centers, np.tile(sizes, (rows * columns, 1))], axis=1)


def decoded(offsets: Singles, bases: Floats, size: tuple[int, int]) -> Singles:
    """Boxes (..., 4), left, top, right and bottom [px], inside a picture of this width and height [px].

    offsets (..., 4): shift over the size of the base and logarithm of the growth, times 10 and 5, as the box coder of
    the TensorFlow Object Detection API scales them. bases (..., 4): center x and y, width and height [px].
    """
    centers = bases[..., :2] + offsets[..., :2] / 10.0 * bases[..., 2:]
    half = 0.5 * bases[..., 2:] * np.exp(offsets[..., 2:] / 5.0)
    boxes = np.concatenate([centers - half, centers + half], axis=-1)
    return np.clip(boxes, 0.0, np.tile(np.array(size, dtype=np.float64), 2)).astype(np.float32)


def _suppression() -> onnxruntime.InferenceSession:
    """Indices of the PROPOSALS best boxes (1, n, 4) by scores (1, 1, n) that do not overlap."""
    shapes = {"boxes": (1, "n", 4), "scores": (1, 1, "n")}
    inputs = [helper.make_tensor_value_info(name, TensorProto.FLOAT, shape) for name, shape in shapes.items()]
    limits = [
        helper.make_tensor("most", TensorProto.INT64, [1], [PROPOSALS]),
        helper.make_tensor("overlap", TensorProto.FLOAT, [1], [_PROPOSAL_OVERLAP]),
    ]
    node = helper.make_node("NonMaxSuppression", ["boxes", "scores", "most", "overlap"], ["kept"])
    output = helper.make_tensor_value_info("kept", TensorProto.INT64, ("k", 3))
    graph = helper.make_graph([node], "suppression", inputs, [output], limits)
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 17)], ir_version=8)
    return one_thread(model.SerializeToString())


class FasterRcnn:
    """Faster R-CNN with Inception v2 from frame to boxes on one thread, in two sessions.

    As in TensorFlow's model zoo: the shorter side has 600 px, the longer one at most 1024; twelve anchors at each
    place; 300 proposals, each cropped to 14 x 14 features and pooled to 7 x 7. If suppression leaves fewer than 300,
    the rest are empty boxes, for which the second stage runs all the same.

    size: width and height of the frames [px].
    """

    def __init__(self, size: tuple[int, int]) -> None:
        torch.manual_seed(0)
        factor = min(600.0 / min(size), 1024.0 / max(size))
        self.size = round(size[0] * factor), round(size[1] * factor)
        picture = torch.zeros(1, 3, self.size[1], self.size[0])
        self._first = loaded(RegionProposals(), {"x": picture}, ["features", "offsets", "scores"])
        features, *_ = self._first.run(None, {"x": picture.numpy()})
        self._anchors = anchors(*features.shape[2:])
        examples = {"features": torch.from_numpy(features), "boxes": torch.zeros(PROPOSALS, 4)}
        self._second = loaded(BoxClassifier(), examples, ["offsets", "scores"])
        self._suppress = _suppression()

    def propose(self, offsets: Singles, scores: Singles) -> Singles:
        """Proposals (300, 4) [px] from the outputs of the first stage."""
        boxes = decoded(offsets, self._anchors, self.size)
        kept = self._suppress.run(None, {"boxes": boxes[None], "scores": scores[None, None]})[0][:, 2]
        proposals = np.zeros((PROPOSALS, 4), dtype=np.float32)
        proposals[: len(kept)] = boxes[kept]
        return proposals

    def detect(self, image: np.ndarray) -> int:
        """Number of objects in a BGR image."""
        features, offsets, scores = self._first.run(None, {"x": prepared(image, *self.size)})
        proposals = self.propose(offsets, scores)
        offsets, scores = self._second.run(None, {"features": features, "boxes": proposals / STRIDE})
        corners = proposals.reshape(PROPOSALS, 1, 2, 2)
        bases = np.concatenate([corners.mean(axis=2), corners[:, :, 1] - corners[:, :, 0]], axis=2)
        boxes = decoded(offsets.reshape(PROPOSALS, -1, 4), bases, self.size)
        boxes[..., 2:] -= boxes[..., :2]
        return sum(
            len(cv2.dnn.NMSBoxes(boxes[:, each].tolist(), scores[:, each].tolist(), 0.0, _OVERLAP, top_k=_KEPT))
            for each in range(scores.shape[1])
        )
