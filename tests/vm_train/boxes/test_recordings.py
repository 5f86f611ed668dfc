"""Recordings by names of folders and files."""

from pathlib import PurePath

import pytest

from vm_train.boxes.recordings import recording_of, recordings


@pytest.mark.parametrize(
    ("stem", "recording"),
    [
        ("20230709_r5_cam0_20230709_104538", "20230709_r5_cam0"),
        ("20230709_r8_cam3_20230706_121038", "20230709_r8_cam3"),
        ("frame0001", "frame"),
        ("cam0_0001", "cam0"),
        ("cam0-2024-01-31T12-00-01.250", "cam0"),
        ("robot 2024-01-31 120001Z", "robot 2024-01-31 120001Z"),
        ("lab_20240131T120001Z", "lab"),
        ("lab_0012_jpg.rf.0a1b2c", "lab"),
        ("20240131_120001", "20240131"),
        ("2024-01-31 12-00-01", "2024-01-31"),
        ("000123", ""),
        ("t_000", "t"),
        ("close up", "close up"),
    ],
)
def test_the_number_and_the_time_at_the_end_do_not_count(stem, recording):
    assert recording_of(stem) == recording


def test_sub_folders_count_if_there_are_several():
    paths = [PurePath(name) for name in ("a/images/f1.jpg", "a/f2.jpg", "b/train/g1.jpg", "h1.jpg")]
    assert recordings(paths) == ["a", "a", "b", "."]
    assert recordings(paths[:2]) == ["f", "f"]
    assert recordings([PurePath("images/train/x_1.jpg"), PurePath("images/val/y_1.jpg")]) == ["x", "y"]
