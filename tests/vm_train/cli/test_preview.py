"""The sheet of vm-train preview: its size, and that it shows what it should."""

from dataclasses import replace

import cv2
import numpy as np
import pytest

from tests.manifests import ball_manifest
from vm_embedded import Orientation
from vm_embedded.errors import InputError
from vm_embedded.geometry.lens_files import LensFile
from vm_embedded.geometry.radial_lenses import Equisolid
from vm_export.grid import Grid
from vm_train.cli.preview import sheet
from vm_train.cli.preview_cells import middle, point_colors
from vm_train.data.pictures import Picture
from vm_train.graphs.augmentation import Augmentation
from vm_workstation.contact_sheet import GAP, write_sheet

from ..no_augmentation import NO_AUGMENTATION

MANIFEST = ball_manifest("ball", "environment", "field", max_distance=6.0)
GRID = Grid()
TEXT, HEAD = 20, 28  # [px] below each image, and of a legend
ENTRIES = 12


def picture(pitch=0.5, height=0.8):
    """160 x 120 px: gray with a ball on the left half, the right half field."""
    labels = np.full((120, 160), 2, dtype=np.int8)
    labels[:, :80] = 0
    image = np.full((120, 160, 3), 100, dtype=np.uint8)
    orientation = Orientation.from_roll_pitch(height, 0.0, pitch)
    return Picture(image, labels, LensFile(Equisolid(focal_length=90.0, fov=2.8), orientation))


def test_a_sheet_has_a_row_for_each_picture_and_cells_for_each_entry():
    made = sheet([picture(), picture(0.8)], MANIFEST, GRID, Augmentation(), seed=0, versions=3, width=80)
    assert made.dtype == np.uint8
    assert made.shape == (2 * HEAD + (2 + 2 * ENTRIES // 4) * (60 + TEXT), 4 * (80 + GAP), 3)


def test_entries_that_are_off_are_left_out():
    only = replace(NO_AUGMENTATION, hue=10.0, blur_share=0.1)
    made = sheet([picture()], MANIFEST, GRID, only, seed=0, versions=1, width=80)
    assert made.shape[0] == 2 * HEAD + 3 * (60 + TEXT)
    assert (
        sheet([picture()], MANIFEST, GRID, NO_AUGMENTATION, seed=0, versions=1, width=80).shape[0] == HEAD + 60 + TEXT
    )


def test_without_augmentation_all_versions_are_the_picture():
    made = sheet([picture()], MANIFEST, GRID, NO_AUGMENTATION, seed=0, versions=2, width=160)
    first, second, third = (made[HEAD : HEAD + 120, start : start + 160] for start in (0, 166, 332))
    assert np.array_equal(first, second)
    assert np.array_equal(first, third)


def test_points_have_the_colors_of_their_classes():
    made = sheet([picture()], MANIFEST, GRID, NO_AUGMENTATION, seed=0, versions=1, width=160)
    image = made[HEAD : HEAD + 120, :160].astype(int)
    ball, _, field = point_colors(MANIFEST)
    for half, color in ((image[:, :79], ball), (image[:, 82:], field)):
        painted = half[(half != 100).any(axis=2)]
        assert len(painted) > 50
        strongest = np.rint(0.3 * 100 + 0.7 * np.array(color[::-1]))
        assert (painted == strongest).all(axis=1).any()


def test_seeds_differ_and_repeat():
    def made(seed):
        return sheet([picture()], MANIFEST, GRID, Augmentation(), seed=seed, versions=2, width=80)

    assert np.array_equal(made(1), made(1))
    assert not np.array_equal(made(1), made(2))


@pytest.mark.parametrize("shown", [picture(pitch=-1.4), picture(height=0.05)], ids=["sky", "too low"])
def test_pictures_without_points_are_shown(shown):
    made = sheet([shown], MANIFEST, GRID, NO_AUGMENTATION, seed=0, versions=1, width=160)
    assert (made[HEAD : HEAD + 120, :160] == 100).all()


def test_a_hexagonal_grid_and_pictures_smaller_than_their_cells_are_shown():
    made = sheet([picture()], MANIFEST, Grid("hexagonal"), Augmentation(), seed=0, versions=2, width=200)
    assert made.shape[1] == 3 * (200 + GAP)


@pytest.mark.parametrize("width", [1, 7, 160, 200])
def test_the_middle_is_never_empty(width):
    assert middle(picture().image, width).shape == (max(round(min(width, 160) * 0.75), 1), min(width, 160), 3)


def test_no_pictures_are_an_error():
    with pytest.raises(InputError, match="no pictures"):
        sheet([], MANIFEST, GRID, NO_AUGMENTATION, seed=0)


def test_a_sheet_is_written_as_picture(tmp_path):
    made = sheet([picture()], MANIFEST, GRID, NO_AUGMENTATION, seed=0, versions=1, width=80)
    write_sheet(tmp_path / "preview.png", made)
    assert np.array_equal(cv2.imread(str(tmp_path / "preview.png")), made)
    with pytest.raises(InputError, match=r"must be a \.jpg or a \.png"):
        write_sheet(tmp_path / "preview.txt", made)
    with pytest.raises(InputError, match="70000 px is too large"):
        write_sheet(tmp_path / "preview.jpg", np.zeros((70000, 2, 3), np.uint8))
