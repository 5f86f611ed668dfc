"""The contact sheet of boxes."""

import cv2
import numpy as np

from vm_train.boxes.read import read_boxes
from vm_train.boxes.sheet import box_sheet, unusual_first

from .written import write_yolo


def test_unusual_sizes_and_proportions_come_first(tmp_path):
    usual = {f"a{n:02d}": [("ball", 20.0 + n, 30.0, 40.0 + 1.5 * n, 50.0)] for n in range(9)}
    odd = {"long": [("ball", 20.0, 30.0, 58.0, 50.0)], "tiny": [("ball", 20.0, 30.0, 23.0, 33.0)]}
    cut = {"cut": [("ball", 20.0, 0.0, 50.0, 15.0), ("robot", 1.0, 1.0, 90.0, 90.0)]}
    write_yolo(tmp_path, usual | odd | cut)
    found = read_boxes(tmp_path)
    places = unusual_first(found.pictures, "ball")
    assert len(places) == 12
    assert {picture.image.stem for picture, _ in places[:2]} == {"long", "tiny"}
    assert unusual_first(found.pictures, "cup") == []


def test_a_cell_shows_what_is_in_the_box(tmp_path):
    write_yolo(tmp_path, {"a": [("ball", 40.0, 40.0, 60.0, 60.0)]})
    image = np.zeros((120, 160, 3), dtype=np.uint8)
    image[40:60, 40:60] = (0, 0, 255)
    cv2.imwrite(str(tmp_path / "a.jpg"), image, [cv2.IMWRITE_JPEG_QUALITY, 100])
    (picture,) = read_boxes(tmp_path).pictures
    sheet = box_sheet([(picture, picture.boxes[0])], tmp_path)
    # The crop is twice as wide as the box and 112 px wide: the box reaches from 28 to 84.
    red = (sheet[:112, :112, 2] > 128) & (sheet[:112, :112, 1] < 64)
    rows, columns = np.nonzero(red)
    assert all(abs(each - edge) <= 2 for each, edge in zip((rows.min(), columns.min()), (28, 28), strict=True))
    assert all(abs(each - edge) <= 2 for each, edge in zip((rows.max(), columns.max()), (83, 83), strict=True))
    outline = (sheet[..., 1] > 180) & (sheet[..., 2] > 200) & (sheet[..., 0] < 60)
    rows, columns = np.nonzero(outline)
    assert all(abs(each - edge) <= 1 for each, edge in zip((rows.min(), columns.max()), (28, 84), strict=True))


def test_the_sheet_is_full_rows_of_cells(tmp_path):
    write_yolo(tmp_path, {f"a{n}": [("ball", 20.0, 30.0, 40.0, 50.0)] for n in range(18)})
    found = read_boxes(tmp_path)
    places = unusual_first(found.pictures, "ball")
    one, all_of_them = box_sheet(places[:1], tmp_path), box_sheet(places, tmp_path)
    assert all_of_them.shape == (2 * one.shape[0], 16 * one.shape[1], 3)


def test_places_without_a_box_follow_in_red(tmp_path):
    write_yolo(tmp_path, {"a": [("ball", 40.0, 40.0, 60.0, 60.0)]})
    cv2.imwrite(str(tmp_path / "a.jpg"), np.zeros((120, 160, 3), dtype=np.uint8))
    (picture,) = read_boxes(tmp_path).pictures
    place = (picture, picture.boxes[0])
    sheet = box_sheet([place], tmp_path, [place])
    first, second = np.hsplit(sheet, 2)
    np.testing.assert_array_equal(first, box_sheet([place], tmp_path))
    np.testing.assert_array_equal(second[28, 28], (60, 60, 255))
