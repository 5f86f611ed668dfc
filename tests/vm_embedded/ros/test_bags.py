"""A bag gives the same detections as its frames."""

import pytest
from rosbags.rosbag2 import StoragePlugin

from tests.vm_embedded.cli.commands import lines, run

from .rolling_ball import Scene


def detections(done):
    return [each["detections"] for each in lines(done)]


@pytest.mark.slow
@pytest.mark.parametrize("storage", [StoragePlugin.MCAP, StoragePlugin.SQLITE3])
def test_a_bag_gives_the_same_detections_as_its_frames(tmp_path, storage):
    scene = Scene(count=100)
    scene.write_frames(tmp_path / "frames")
    bag = scene.write_bag(tmp_path / "bag", storage)
    assert bag.suffix == {StoragePlugin.MCAP: ".mcap", StoragePlugin.SQLITE3: ".db3"}[storage]
    expected = detections(run(tmp_path / "frames"))
    assert len(expected) == 100
    assert sum(map(bool, expected)) > 90
    assert detections(run(bag)) == expected
    assert detections(run(tmp_path / "bag")) == expected  # the folder, as ros2 bag record makes it
