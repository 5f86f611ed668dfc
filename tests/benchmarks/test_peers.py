"""The other detectors have the shapes and the numbers of operations that were published for them."""

import json
import re

import numpy as np
import pytest
import torch
from torch import nn

from benchmarks.peers import report
from benchmarks.peers.networks import SsdMobileNetV1, TinyYolo, YoloNano, loaded
from benchmarks.peers.operations import operations
from benchmarks.peers.paper_networks import (
    CROP,
    PROPOSALS,
    BoxClassifier,
    Crop,
    FasterRcnn,
    RegionProposals,
    YoloV1,
    YoloV2,
    YoloV3,
    anchors,
    decoded,
)
from benchmarks.peers.patch_classifiers import CLASSIFIERS
from benchmarks.peers.times import ORDER


@pytest.fixture
def weightless():
    """Networks in this context have shapes, but no values."""
    with torch.device("meta"), torch.no_grad():
        yield


def shapes(outputs):
    return [tuple(each.shape) for each in outputs]


def test_cells_of_yolo_v1(weightless):
    network, picture = YoloV1(classes=20), torch.empty(1, 3, 448, 448)
    assert network.cells(picture).shape == (7, 7, 30)
    assert shapes(network(picture)) == [(98, 4), (98, 20)]
    layers = [type(layer) for layer in network.modules() if isinstance(layer, nn.Conv2d | nn.Linear)]
    assert layers == [nn.Conv2d] * 24 + [nn.Linear] * 2


def test_cells_of_yolo_v2(weightless):
    network, picture = YoloV2(), torch.empty(1, 3, 416, 416)
    assert network.cells(picture).shape == (1, 5 * (5 + 4), 13, 13)
    assert shapes(network(picture)) == [(845, 4), (845, 4)]


def test_boxes_of_yolo_v3(weightless):
    network = YoloV3(classes=80)
    assert shapes(network(torch.empty(1, 3, 416, 416))) == [(10647, 4), (10647, 80)]
    # Darknet-53 counts its last layer, for ImageNet, too.
    backbone = [network.first, network.second, network.third]
    assert sum(isinstance(layer, nn.Conv2d) for part in backbone for layer in part.modules()) == 52


def test_stages_of_faster_rcnn(weightless):
    features, offsets, scores = RegionProposals()(torch.empty(1, 3, 600, 750))
    assert shapes([features, offsets, scores]) == [(1, 576, 38, 47), (38 * 47 * 12, 4), (38 * 47 * 12,)]
    outputs = BoxClassifier(classes=90)(features, torch.empty(PROPOSALS, 4))
    assert shapes(outputs) == [(300, 4 * 90), (300, 90)]


@pytest.mark.parametrize(
    ("network", "side", "published"),
    [
        # Of the configuration with a locally connected layer.
        (lambda: YoloV1(classes=20), 448, 40.19),
        (lambda: YoloV2(classes=80), 608, 62.94),
        (lambda: YoloV3(classes=80), 320, 38.97),
        (lambda: YoloV3(classes=80), 416, 65.86),
        (lambda: YoloV3(classes=80), 608, 140.69),
        # With 80 or 90 classes, which have a small share of the operations.
        (TinyYolo, 416, 5.56),
        (YoloNano, 640, 8.7),
        (SsdMobileNetV1, 300, 2 * 1.2),
    ],
    ids=["YOLO v1", "YOLO v2", "YOLO v3 320", "YOLO v3 416", "YOLO v3 608", "Tiny YOLO", "YOLO nano", "SSD MobileNet"],
)
def test_operations_are_the_published_ones(network, side, published):
    """Published by the authors of the networks [1e9 multiplications and additions]."""
    assert operations(network, (1, 3, side, side)) / 1e9 == pytest.approx(published, rel=0.1)


def test_operations_of_faster_rcnn_are_the_published_ones():
    """Howard et al. 2017 (table 13): 118.2e9 pairs of operations at 300 px, 129.6e9 at 600 px, for 300 proposals.

    The difference is in the first stage. The rest, less a third of the difference, is the second one, without the pool
    that TensorFlow's model zoo has before it.
    """
    small, large = (operations(RegionProposals, (1, 3, side, side)) / 2e9 for side in (300, 600))
    assert large - small == pytest.approx(129.6 - 118.2, rel=0.1)
    second = operations(lambda: BoxClassifier().blocks, (PROPOSALS, 576, CROP, CROP)) / 2e9
    assert second + large == pytest.approx(129.6, rel=0.1)


@pytest.mark.parametrize("classifier", CLASSIFIERS, ids=lambda each: each.name)
def test_a_patch_classifier_gives_probabilities(classifier):
    answers = classifier.network()(torch.rand(5, classifier.channels, classifier.side, classifier.side))
    assert answers.shape == (5, 2)
    assert torch.allclose(answers.sum(dim=1), torch.ones(5))


def test_offsets_of_zero_leave_the_anchors():
    bases = anchors(38, 47)
    assert bases.shape == (38 * 47 * 12, 4)
    assert np.allclose(np.unique(np.sqrt(bases[:, 2] * bases[:, 3])), [64.0, 128.0, 256.0, 512.0])
    boxes = decoded(np.zeros((len(bases), 4), dtype=np.float32), bases, (750, 600))
    inside = (boxes[:, 0] > 0) & (boxes[:, 1] > 0) & (boxes[:, 2] < 750) & (boxes[:, 3] < 600)
    assert np.allclose((boxes[:, 2:] - boxes[:, :2])[inside], bases[inside, 2:], atol=1e-3)
    assert boxes.min() == 0.0
    assert boxes[:, 2].max() == 750.0
    assert boxes[:, 3].max() == 600.0


class OnlyCrop(nn.Module):
    def forward(self, features, boxes):
        return Crop.apply(features, boxes)


def test_crops_in_torch_and_in_onnx_runtime_are_the_same():
    torch.manual_seed(0)
    features = torch.rand(1, 8, 38, 47)
    corners = torch.rand(PROPOSALS, 2) * torch.tensor([30.0, 20.0])
    boxes = torch.cat([corners, corners + 1.0 + 15.0 * torch.rand(PROPOSALS, 2)], dim=1)
    session = loaded(OnlyCrop(), {"features": features, "boxes": boxes}, ["crops"])
    found = session.run(None, {"features": features.numpy(), "boxes": boxes.numpy()})[0]
    assert found.shape == (PROPOSALS, 8, CROP, CROP)
    assert np.abs(found - OnlyCrop()(features, boxes).numpy()).max() < 1e-4


@pytest.mark.long
def test_faster_rcnn_proposes_300_boxes_that_hardly_overlap():
    image = np.random.default_rng(0).integers(0, 256, (512, 640, 3), dtype=np.uint8)
    detector = FasterRcnn((640, 512))
    assert detector.size == (750, 600)
    random = np.random.default_rng(0)
    count = 38 * 47 * 12
    offsets, scores = random.normal(size=(count, 4)).astype(np.float32), random.random(count, dtype=np.float32)
    boxes = detector.propose(offsets, scores)
    assert boxes.shape == (PROPOSALS, 4)
    low = np.maximum(boxes[:, None, :2], boxes[None, :, :2])
    high = np.minimum(boxes[:, None, 2:], boxes[None, :, 2:])
    shared = np.maximum(high - low, 0.0).prod(axis=2)
    area = (boxes[:, 2:] - boxes[:, :2]).prod(axis=1)
    overlaps = shared / (area[:, None] + area - shared)
    assert area.min() > 0.0
    assert overlaps[~np.eye(PROPOSALS, dtype=bool)].max() <= 0.7 + 1e-4
    assert detector.detect(image) >= 0


def test_the_tables_of_the_page_are_the_results():
    text = report.PAGE.read_text()
    assert tuple(json.loads(report.RESULTS.read_text())["calls"]) == ORDER
    for name, made in report.tables().items():
        place = re.search(rf"<!-- {name} -->\n(.*?)\n<!-- end -->", text, re.DOTALL)
        assert place[1] == made
