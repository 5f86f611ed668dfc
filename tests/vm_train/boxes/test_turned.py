"""Images that their EXIF entry turns."""

import numpy as np
import pytest
from PIL import Image

from vm_embedded.cameras.image_files import read_image
from vm_train.boxes.read import read_boxes

from .written import SIZE, WRITERS, boxes_of, write_image, write_yolo

BALL = ("ball", 20.0, 30.0, 40.0, 50.0)
GOAL = ("goal", 100.0, 10.0, 110.0, 90.0)
GOOD = {"good1": [BALL], "good2": [BALL, GOAL], "good3": []}


def marked(path, box, orientation):
    """A black image with a white box (class, left, top, right, bottom), stored upright."""
    image = np.zeros((SIZE[1], SIZE[0], 3), dtype=np.uint8)
    left, top, right, bottom = (int(each) for each in box[1:])
    image[top:bottom, left:right] = 255
    exif = Image.Exif()
    exif[0x0112] = orientation
    Image.fromarray(image).save(path, exif=exif)


@pytest.mark.parametrize("orientation", range(2, 9))
@pytest.mark.parametrize("format", ["voc", "coco"])
def test_boxes_drawn_on_the_image_as_stored_are_turned_with_it(format, orientation, tmp_path):
    WRITERS[format](tmp_path, {**GOOD, "a": [GOAL]})
    marked(tmp_path / "a.jpg", GOAL, orientation)
    boxes, (line,) = boxes_of(tmp_path)
    file = {"voc": "a.xml", "coco": "instances.json"}[format]
    assert list(boxes) == ["a", *GOOD]
    if orientation < 5:
        assert line == (
            f"a.jpg: turned by its EXIF orientation {orientation}; {file} leaves open whether its boxes are: taken as "
            "drawn on the turned image"
        )
        return
    assert line == (
        f"a.jpg: turned by its EXIF orientation {orientation}, but {file} states the size as stored, 160 x 120 px: "
        "boxes turned"
    )
    (box,) = boxes["a"]
    rows, columns = np.nonzero(read_image(tmp_path / "a.jpg")[..., 0] > 127)
    found = (columns.min() - 0.5, rows.min() - 0.5, columns.max() + 0.5, rows.max() + 0.5)
    assert (box.left, box.top, box.right, box.bottom) == found


@pytest.mark.parametrize("format", ["voc", "coco"])
def test_boxes_drawn_on_the_turned_image_are_right_and_other_sizes_are_not(format, tmp_path):
    WRITERS[format](tmp_path, {"a": [("goal", 10.0, 100.0, 90.0, 110.0)], "b": []}, size=(120, 160))
    for name in ("a", "b"):
        write_image(tmp_path / f"{name}.jpg", orientation=6)
    boxes, faults = boxes_of(tmp_path)
    assert faults == []
    assert boxes["a"][0].bottom == 109.5
    write_image(tmp_path / "a.jpg", size=(100, 80), orientation=6)
    file = {"voc": "a.xml", "coco": "instances.json"}[format]
    _, faults = boxes_of(tmp_path)
    assert faults == [
        f"a.jpg: {file} states a size of 120 x 160 px, but the image has 80 x 100 px, or 100 x 80 px without its EXIF "
        "turn; not used"
    ]


def test_yolo_boxes_and_lenses_are_taken_as_those_of_the_turned_image(tmp_path):
    write_yolo(tmp_path, {**GOOD, "a": [BALL], "b": [BALL]})
    for name, size in (("a", (120, 160)), ("b", SIZE)):
        write_image(tmp_path / f"{name}.jpg", orientation=6)
        lens = f"projection: RECTILINEAR\nfocal_length: 120.0\nfov: 1.5\nsize: [{size[0]}, {size[1]}]\n"
        (tmp_path / f"{name}.yaml").write_text(lens)
    found = read_boxes(tmp_path)
    assert found.pictures[0].size == found.pictures[1].size == (120, 160)
    assert [each.lens for each in found.pictures[:2]] == [tmp_path / "a.yaml", None]
    for remark, stated in zip(found.remarks, ("a.txt", "b.txt"), strict=True):
        assert stated in remark
    (fault,) = found.faults
    assert "b.yaml" in fault


@pytest.mark.parametrize("suffix", [".tif", ".webp"])
def test_a_tiff_is_turned_once_and_a_webp_too(suffix, tmp_path):
    write_yolo(tmp_path, {**GOOD, "a": [BALL]})
    write_image((tmp_path / "a.jpg").rename(tmp_path / f"a{suffix}"), orientation=6)
    picture = read_boxes(tmp_path).pictures[0]
    assert picture.size == (120, 160) == read_image(picture.image).shape[1::-1]
