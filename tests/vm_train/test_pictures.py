"""Folders of training pictures: what is read, and every fault by name."""

import cv2
import numpy as np
import pytest

from vm_embedded import Orientation
from vm_embedded.errors import InputError
from vm_embedded.lens import Equisolid
from vm_embedded.manifest import Manifest, ObjectClass
from vm_synth.dataset import lens_text
from vm_train.graphs import graph_of
from vm_train.loading import Graphs, loaded
from vm_train.pictures import UNLABELED, Classes, check_pictures, find_pictures, read_picture
from vm_train.training import Item

CLASSES = Classes({"ball": ((255, 0, 0),), "field": ((0, 255, 0), (255, 255, 255)), "environment": ((0, 0, 0),)})
MANIFEST = Manifest(
    shape="sphere",
    radius=0.1,
    object_radius=0.1,
    intersections=4.0,
    mesh="ring6",
    max_distance=6.0,
    edge="hard",
    classes=(ObjectClass("ball", "object"), ObjectClass("field", "area"), ObjectClass("environment", "background")),
)
LENS = Equisolid(focal_length=90.0, fov=2.8)
LOOKING_DOWN = Orientation.from_roll_pitch(0.8, 0.1, 0.5)


@pytest.fixture
def folder(tmp_path):
    """Two good pictures of 160 x 120: a green field, a red ball, black above, the lower rows unlabeled."""
    for number in ("0000001", "0000002"):
        mask = np.zeros((120, 160, 4), dtype=np.uint8)
        mask[..., 3] = 255
        mask[40:, :, 1] = 255
        mask[60:80, 70:90] = (0, 0, 255, 255)
        mask[110:] = 0
        cv2.imwrite(str(tmp_path / f"mask{number}.png"), mask)
        cv2.imwrite(str(tmp_path / f"image{number}.jpg"), mask[..., :3])
        (tmp_path / f"lens{number}.yaml").write_text(lens_text(LENS, LOOKING_DOWN))
    return tmp_path


def checked(folder):
    return check_pictures(find_pictures(folder), CLASSES, lambda: None)


def test_pictures_are_found_by_number_and_read(folder):
    first, second = find_pictures(folder)
    assert (first.number, second.number) == ("0000001", "0000002")
    picture = read_picture(first, CLASSES)
    assert picture.labels[70, 80] == 0
    assert picture.labels[50, 10] == 1
    assert picture.labels[10, 10] == 2
    assert picture.labels[115, 10] == UNLABELED


def test_a_check_counts_what_good_pictures_hold(folder):
    found = checked(folder)
    assert len(found.good) == 2
    assert found.pixels["ball"] == 2 * 400
    assert found.sizes == {(160, 120): 2}
    assert found.lenses == {"equisolid": 2}
    assert found.absent == []


@pytest.mark.parametrize(
    ("damage", "said"),
    [
        (lambda folder: (folder / "mask0000001.png").unlink(), "mask0000001.png: is missing"),
        (lambda folder: (folder / "lens0000001.yaml").unlink(), "lens0000001.yaml"),
        (lambda folder: (folder / "image0000001.jpg").write_bytes(b"\xff\xd8 cut"), "image0000001.jpg: can't be read"),
        (
            lambda folder: cv2.imwrite(str(folder / "mask0000001.png"), np.zeros((60, 80, 4), np.uint8)),
            "mask0000001.png: 80 x 60 px, but the image is 160 x 120 px",
        ),
        (
            lambda folder: cv2.imwrite(str(folder / "mask0000001.png"), np.zeros((120, 160), np.uint8)),
            "a mask is an RGB or RGBA picture",
        ),
        (
            lambda folder: cv2.imwrite(str(folder / "mask0000001.png"), np.full((120, 160, 3), 7, np.uint8)),
            "a color of no class, as [7, 7, 7]",
        ),
        (
            lambda folder: (folder / "lens0000001.yaml").write_text("projection: EQUISOLDI\nfocal_length: 9\nfov: 1\n"),
            "did you mean 'equisolid'",
        ),
        (
            lambda folder: (folder / "lens0000001.yaml").write_text("projection: EQUISOLID\nfocal_length: 9\nfov: 1\n"),
            "lacks Hoc",
        ),
    ],
)
def test_each_fault_is_named_and_the_others_are_good(damage, said, folder):
    damage(folder)
    found = checked(folder)
    assert list(found.faults) == ["0000001"]
    assert said in found.faults["0000001"]
    assert [each.number for each in found.good] == ["0000002"]


def test_a_class_that_never_occurs_is_told(folder):
    classes = Classes({**CLASSES.colors, "robot": ((0, 0, 255),)})
    assert check_pictures(find_pictures(folder), classes, lambda: None).absent == ["robot"]


def test_folders_without_pictures_are_refused(tmp_path):
    with pytest.raises(InputError, match="no pictures"):
        find_pictures(tmp_path)
    with pytest.raises(InputError, match="no folder"):
        find_pictures(tmp_path / "nowhere")


def test_classes_that_share_a_color_or_stand_alone_are_refused():
    with pytest.raises(InputError, match="share the color"):
        Classes({"a": ((1, 2, 3),), "b": ((1, 2, 3),)})
    with pytest.raises(InputError, match="two classes"):
        Classes({"a": ((1, 2, 3),)})


def test_a_graph_shows_the_picture_at_the_meshs_pixels(folder):
    picture = read_picture(find_pictures(folder)[0], CLASSES)
    graph = graph_of(picture, MANIFEST)
    n = len(graph)
    assert graph.points.shape == (n + 1, 3)
    assert graph.neighbors.shape == (n + 1, 6)
    assert (graph.points[-1] == -1.0).all()
    assert (graph.neighbors[-1] == n).all()
    assert set(np.unique(graph.labels)) == {UNLABELED, 0, 1, 2}
    red = graph.points[:-1][graph.labels == 0].mean(axis=0)
    assert red[0] > 0.8 > 0.3 > max(red[1:])
    assert (graph.distances < 6.5).all()


@pytest.mark.parametrize("workers", [0, 1])
def test_batches_come_in_order_whoever_loads_them(workers, folder):
    pictures = find_pictures(folder)
    graphs = Graphs(pictures, CLASSES, MANIFEST)
    batches = [[Item(1, 0), Item(0, 0)], [Item(1, 1)]]
    found = list(loaded(graphs, batches, workers))
    assert [len(batch) for batch in found] == [2, 1]
    alone = graph_of(read_picture(pictures[1], CLASSES), MANIFEST)
    assert (found[0][0].points == alone.points).all()
    assert (found[1][0].labels == alone.labels).all()
