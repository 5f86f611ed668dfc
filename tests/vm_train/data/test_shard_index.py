"""Pictures in tar shards, found and read by their position; every damage by name."""

import io
import tarfile

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from tests.vm_train.conftest import NUMBERS
from tests.vm_train.data.test_pictures import CLASSES, write_pictures
from vm_embedded.errors import InputError
from vm_train.data.picture_files import PictureFault
from vm_train.data.pictures import find_pictures, read_picture
from vm_train.data.shard_index import open_shards
from vm_train.data.shard_stream import stream


def tar_of(path, files):
    with tarfile.open(path, "w") as tar:
        for name, content in files:
            entry = tarfile.TarInfo(name)
            entry.size = len(content)
            tar.addfile(entry, io.BytesIO(content))
    return path


def test_a_folder_of_shards_is_a_folder_of_pictures(shards, pictures):
    found = find_pictures(shards[0].parent)
    assert [each.number for each in found] == NUMBERS
    for packed, files in zip(found, pictures, strict=True):
        assert packed.raw() == files.raw()
    assert (read_picture(found[4], CLASSES).image == read_picture(pictures[4], CLASSES).image).all()
    assert [each.number for each in open_shards(shards[0].parent / "pictures-00000[12].tar")] == NUMBERS[3:]


def test_pictures_beside_shards_are_refused(shards, seven_pictures):
    write_pictures(shards[0].parent, ["9"])
    with pytest.raises(InputError, match="both pictures and shards"):
        find_pictures(shards[0].parent)


def test_faults_in_shards_are_named(tmp_path, pictures):
    _, image, _, lens = pictures[0].raw()
    tar_of(tmp_path / "a.tar", [("dir/000.JPG", image), ("dir/000.lens.yaml", lens.encode()), ("000.other", b"")])
    (found,) = find_pictures(tmp_path)
    with pytest.raises(PictureFault, match=r"000\.mask\.png: is missing"):
        read_picture(found, CLASSES)
    tar_of(tmp_path / "b.tar", [("000.png", image)])
    with pytest.raises(InputError, match=r"picture 000 is both in .*a\.tar and in .*b\.tar"):
        find_pictures(tmp_path)
    tar_of(tmp_path / "a.tar", [("000.jpg", image), ("000.png", image)])
    with pytest.raises(InputError, match="two files for the image"):
        open_shards(tmp_path / "a.tar")
    with pytest.raises(InputError, match="no pictures"):
        open_shards(tar_of(tmp_path / "c.tar", [("readme.txt", b"text")]))
    with pytest.raises(InputError, match="no shards"):
        open_shards(tmp_path / "nowhere-*.tar")


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture], deadline=None, max_examples=60)
@given(share=st.floats(0.0, 1.0, exclude_max=True))
def test_a_cut_shard_is_never_taken_for_whole(share, shards, tmp_path_factory):
    whole = shards[0].read_bytes()
    end = whole.rstrip(b"\0")
    path = tmp_path_factory.mktemp("cut") / "cut.tar"
    path.write_bytes(whole[: int(share * len(end))])
    with pytest.raises(InputError, match=r"cut\.tar"):
        open_shards(path)
    with pytest.raises(InputError, match=r"cut\.tar"):
        list(stream([path]))


def test_the_place_of_a_cut_is_told(shards):
    with tarfile.open(shards[0]) as tar:
        place = tar.getmember("001.mask.png").offset
    shards[0].write_bytes(shards[0].read_bytes()[:place])
    with pytest.raises(InputError, match=f"after 001.jpg, at byte {place}"):
        open_shards(shards[0])
    with pytest.raises(InputError, match=f"after picture 000, at byte {place}: it is cut short"):
        list(stream(shards))


def test_a_shard_that_shrinks_after_it_was_opened_is_named(shards):
    found = open_shards(shards[0].parent)
    shards[2].write_bytes(shards[2].read_bytes()[:700])
    with pytest.raises(PictureFault, match=r"pictures-000002\.tar is cut short there"):
        read_picture(found[-1], CLASSES)
