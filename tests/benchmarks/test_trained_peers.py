"""Peers that learn from boxes get the same truth as our networks, and are scored by the same rules."""

from __future__ import annotations

import math
import shutil
from pathlib import Path

import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st
from torch import nn

from benchmarks.peers.boxes import LENSES as KINDS
from benchmarks.peers.boxes import box_of, kind_of_lens, link_pictures, read_boxes, read_truths, write_boxes
from benchmarks.peers.course import read_course
from benchmarks.peers.detector import BoxDetector, TrainedPeer, located, reported
from benchmarks.peers.score import _best, choose, enlarged, tally_ours, tally_peer, title
from benchmarks.peers.train import ALL_LENSES, EPOCHS, folder_of, still_improved
from benchmarks.shipped import CANDIDATES, classes_of
from tests.vm_train.drawn import draw_set
from vm_embedded import Orientation
from vm_embedded.geometry.radial_lenses import Equidistant, Rectilinear
from vm_embedded.geometry.shapes import Sphere
from vm_embedded.network.bundled import model_path
from vm_train.data.pictures import find_pictures
from vm_train.scores.object_scores import ObjectScores
from vm_train.scores.overlaps import TrueObject, common_areas, coverage
from vm_workstation.outlines import shape_outline

SIZE = (640, 512)
LENSES = (Rectilinear(focal_length=500.0, fov=1.6), Equidistant(focal_length=250.0, fov=2.6))


@pytest.fixture(scope="module")
def pictures(tmp_path_factory):
    return draw_set(tmp_path_factory.mktemp("drawn"), 40)


@pytest.fixture(scope="module")
def boxes(pictures, tmp_path_factory):
    out = tmp_path_factory.mktemp("boxes")
    write_boxes(pictures, out)
    return out


def test_only_the_pictures_of_one_kind_of_lens_are_linked(pictures, tmp_path):
    """The drawn pictures are rectilinear; some of these are declared to be fisheye pictures."""
    mixed = tmp_path / "mixed"
    shutil.copytree(pictures, mixed)
    for files in find_pictures(mixed)[::3]:
        files.lens.write_text(files.lens.read_text().replace("RECTILINEAR", "EQUISOLID"))
    kinds = {each.number: kind_of_lens(each) for each in find_pictures(mixed)}
    assert set(kinds.values()) == set(KINDS)
    for kind in KINDS:
        out = folder_of(tmp_path, kind) / "pictures"
        for _ in range(2):  # links that are there stay
            link_pictures(mixed, out, kind)
        linked = find_pictures(out)
        assert [each.number for each in linked] == [number for number, each in kinds.items() if each == kind]
        classes, originals = classes_of(model_path("ball")), {each.number: each for each in find_pictures(mixed)}
        for files in linked:
            assert read_truths(files, classes)[1] == read_truths(originals[files.number], classes)[1]
    write_boxes(tmp_path / "rectilinear" / "pictures", tmp_path / "boxes")
    parts = [sorted((tmp_path / "boxes" / "labels" / part).iterdir()) for part in ("training", "validation")]
    names = [path.stem for part in parts for path in part]
    assert sorted(names) == [number for number, kind in kinds.items() if kind == "rectilinear"]


def test_each_training_has_its_own_folder_and_its_own_row():
    folders = {folder_of(Path("out"), lens) for lens in EPOCHS}
    assert len(folders) == len({title("YOLO nano, 320", lens) for lens in EPOCHS}) == len(EPOCHS)
    assert title("YOLO nano, 320", ALL_LENSES) == "YOLO nano, 320"


def test_boxes_surround_the_balls_of_both_parts(pictures, boxes):
    seen = 0
    for files in find_pictures(pictures):
        picture, _, balls = read_truths(files, classes_of(model_path("ball")))
        height, width = picture.labels.shape
        part = next(
            each for each in ("training", "validation") if (boxes / "labels" / each / f"{files.number}.txt").exists()
        )
        assert (boxes / "images" / part / f"{files.number}.jpg").resolve() == files.image
        found = read_boxes(boxes / "labels" / part / f"{files.number}.txt", width, height)
        expected = [box_of(each) for each in balls if not each.is_ignored(0.25, 1.5)]
        np.testing.assert_allclose(found, np.reshape(expected, (-1, 4)), atol=1e-2)
        seen += len(found)
    assert seen > 20
    assert "train: images/training" in (boxes / "data.yaml").read_text()


@given(
    st.sampled_from(LENSES),
    st.floats(0.5, 6.0),
    st.floats(-0.3, 0.3),
    st.floats(0.05, 0.12),
    st.floats(0.1, 0.5),
)
def test_a_box_around_a_ball_tells_its_place_and_that_its_size_is_possible(lens, ahead, aside, radius, pitch):
    orientation = Orientation.from_roll_pitch(0.9, pitch=pitch)
    center = np.array([ahead, aside, radius])
    outline = shape_outline(lens, orientation, Sphere(radius), center, SIZE)
    low, high = outline.min(axis=0), outline.max(axis=0)
    if not np.isfinite(outline).all() or (low < 0).any() or (high > SIZE).any():
        return
    boxes = np.concatenate([low, high])[None] + 0.5
    (found,) = located(boxes, np.array([0.7]), SIZE, lens, orientation, radius)
    assert math.hypot(*(found.position - center)) < 0.1 * ahead
    assert found.size == pytest.approx(1.0, abs=0.1)
    assert reported([found], 0.5, 1.25) == [found]
    assert reported([found], 0.8, 1.25) == []
    (twice,) = located(boxes, np.array([0.7]), SIZE, lens, orientation, 2.0 * radius)
    assert not twice.is_possible(1.5)


@pytest.mark.parametrize("radius", [3.0, 5.0, 9.0])
def test_the_box_of_a_small_ball_overlaps_it_almost_wholly(radius):
    """The ellipse is where the pixels of the box are, not half a pixel beside them."""
    center, orientation = np.array([102.4, 203.7]), Orientation.from_roll_pitch(0.9, pitch=0.4)
    around = np.linspace(0.0, 2.0 * np.pi, 90)
    window, share = coverage(center + radius * np.stack([np.cos(around), np.sin(around)], axis=1), SIZE)
    mask = np.zeros(SIZE[::-1], dtype=np.float32)
    mask[window] = share
    truth = TrueObject(mask, np.zeros(3), radius)
    found = located(box_of(truth)[None], np.ones(1), SIZE, LENSES[0], orientation, 0.1)
    assert common_areas([truth], found).iou[0, 0] > 0.85
    np.testing.assert_allclose(found[0].center, center, atol=0.5)


@pytest.mark.parametrize("factor", [0.5, 0.25])
def test_an_outline_in_a_smaller_picture_lies_at_the_same_place_of_the_whole_one(factor):
    """A pixel of a picture of half the size covers the pixels 2 x and 2 x + 1 of the whole picture."""
    x = np.arange(10.0)
    count = round(1.0 / factor)
    np.testing.assert_allclose(enlarged(x, factor), x * count + (count - 1) / 2.0)


def test_a_box_above_the_horizon_is_no_ball():
    orientation = Orientation.from_roll_pitch(0.9, pitch=0.1)
    (found,) = located(np.array([[300.0, 10, 320, 30]]), np.ones(1), SIZE, LENSES[0], orientation, 0.1)
    assert math.isnan(found.distance)
    assert not found.is_possible(100.0)
    assert reported([found], 0.0, None) == [found]


class Constant(nn.Module):
    """A network with the same output for each picture; it uses the picture, so the input remains."""

    def __init__(self, *outputs):
        super().__init__()
        self.outputs = [torch.tensor(each) for each in outputs]

    def forward(self, x):
        return tuple(each + 0.0 * x.mean() for each in self.outputs)


def constant_peer(path: Path, stretches: bool) -> BoxDetector:
    """A peer of 320 px that reports the same box three times, two of them hardly moved, and one far away."""
    corners = torch.tensor([[80.0, 40, 120, 60], [81.0, 40, 121, 60], [200.0, 100, 220, 120]] + [[0.0, 0, 1, 1]] * 200)
    scores = torch.tensor([0.9, 0.8, 0.3] + [0.0] * 200)
    if stretches:
        network = Constant(corners.tolist(), scores.tolist())
    else:
        centers, sizes = (corners[:, :2] + corners[:, 2:]) / 2, corners[:, 2:] - corners[:, :2]
        network = Constant(torch.cat([centers, sizes, scores[:, None]], dim=1).T[None].tolist())
    torch.onnx.export(network, (torch.zeros(1, 3, 320, 320),), str(path), dynamo=False, opset_version=17)
    return BoxDetector(TrainedPeer("constant", path.stem, 320, stretches), path)


@pytest.mark.parametrize(("stretches", "scale"), [(True, (4.0, 3.2)), (False, (4.0, 4.0))])
def test_boxes_are_in_pixels_of_the_picture_and_each_object_has_one(stretches, scale, tmp_path):
    detector = constant_peer(tmp_path / "peer.onnx", stretches)
    boxes, scores = detector.detect(np.zeros((1024, 1280, 3), dtype=np.uint8))
    np.testing.assert_allclose(scores, [0.9, 0.3], atol=1e-6)
    np.testing.assert_allclose(boxes, np.array([[80.0, 40, 120, 60], [200, 100, 220, 120]]) * np.tile(scale, 2))


def test_a_perfect_peer_has_the_best_scores_and_a_smaller_picture_the_same(pictures):
    class Oracle:
        def detect(self, image):
            truths = next(
                balls for shown, balls in known if shown.image.shape == image.shape and (shown.image == image).all()
            )
            found = np.reshape([box_of(each) for each in truths], (-1, 4))
            return found, np.full(len(found), 0.9)

    known = [read_truths(each, classes_of(model_path("ball")))[::2] for each in find_pictures(pictures)]
    tallies = tally_peer(Oracle(), find_pictures(pictures), (None, 1.5))
    for tally in tallies.values():
        assert tally.all.ranking(0.5).precision_recall.average_precision > 0.9
    assert tallies[None].by_lens["fisheye"].pictures == 0
    assert choose(Oracle(), find_pictures(pictures)).threshold == pytest.approx(0.9)


@pytest.mark.long
def test_our_networks_are_scored_in_pixels_of_the_whole_picture(pictures):
    for factor in (1.0, 0.5):
        scores = tally_ours(model_path("ball"), find_pictures(pictures), factor, CANDIDATES).all
        assert scores.ranking(0.5).precision_recall.average_precision > 0.3


def test_nothing_found_has_no_threshold():
    scores = ObjectScores()
    scores.add([], [])
    assert _best(scores) == (0.0, 1.0)


def test_a_training_that_ends_with_its_best_epoch_still_improved():
    rows = [{"ap50": 0.9, "ap50_95": each, "validation_loss": -each} for each in (0.1, 0.3, 0.2)]
    for stem in ("yolo320", "ssdlite"):
        assert still_improved(stem, rows[:2], 2)
        assert not still_improved(stem, rows, 3)
        assert still_improved(stem, rows, 4), "an interrupted training may have gone on"


def test_the_seconds_of_an_epoch_after_an_interruption_count_from_the_new_start(tmp_path):
    heads = "epoch,time,train/box_loss,train/cls_loss,train/dfl_loss,metrics/mAP50(B),metrics/mAP50-95(B)"
    lines = [heads, "1,100.4,2,1,0.5,0.3,0.1", "2,210,1,1,0.5,0.4,0.2", "3,90,1,0.5,0.5,0.5,0.3"]
    (tmp_path / "results.csv").write_text("\n".join(lines) + "\n")
    course = read_course(tmp_path / "results.csv")
    assert [each["seconds"] for each in course] == [100, 110, 90]
    assert [each["loss"] for each in course] == [3.5, 2.5, 2.0]
    assert course[-1]["ap50_95"] == 0.3
