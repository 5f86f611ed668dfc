"""Seven small pictures, as files and as shards."""

import pytest

from tests.vm_train.data.test_pictures import write_pictures
from vm_train.data.pictures import find_pictures
from vm_train.formats.shards import write_shards

NUMBERS = [f"{index:03d}" for index in range(7)]


@pytest.fixture(scope="module")
def seven_pictures(tmp_path_factory):
    made = tmp_path_factory.mktemp("set")
    write_pictures(made, NUMBERS)
    return made


@pytest.fixture(scope="module")
def pictures(seven_pictures):
    return find_pictures(seven_pictures)


@pytest.fixture
def shards(pictures, tmp_path):
    return write_shards(pictures, tmp_path / "shards", 3, lambda: None)
