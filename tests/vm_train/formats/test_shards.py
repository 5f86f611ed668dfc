"""Tar shards: written in webdataset's form, the same bytes each time."""

import tarfile

import pytest

from tests.vm_train.data.test_pictures import write_pictures
from vm_embedded.errors import InputError
from vm_train.data.picture_files import PictureFault
from vm_train.data.pictures import find_pictures
from vm_train.formats.shards import write_shards


def test_shards_hold_the_files_as_webdataset_names_them(shards, seven_pictures):
    assert [each.name for each in shards] == [f"pictures-{index:06d}.tar" for index in range(3)]
    with tarfile.open(shards[0]) as tar:
        names = [each.name for each in tar]
        assert names[:3] == ["000.jpg", "000.mask.png", "000.lens.yaml"]
        assert len(names) == 9
        assert tar.extractfile("001.mask.png").read() == (seven_pictures / "mask001.png").read_bytes()
        assert {(each.mtime, each.uid, each.mode) for each in tar} == {(0, 0, 0o644)}


def test_the_same_pictures_give_the_same_bytes(shards, pictures, tmp_path):
    others = write_shards(pictures, tmp_path / "others", 3, lambda: None)
    assert [each.read_bytes() for each in shards] == [each.read_bytes() for each in others]


def test_a_stopped_run_goes_on_and_other_pictures_are_not_mixed_in(shards, pictures):
    before = shards[1].read_bytes()
    shards[1].unlink()
    done = []
    write_shards(pictures, shards[0].parent, 3, lambda: done.append(1))
    assert len(done) == 3
    assert shards[1].read_bytes() == before
    with pytest.raises(InputError, match="shards of other pictures"):
        write_shards(pictures[1:], shards[0].parent, 3, lambda: None)
    (shards[0].parent / "shards.json").write_text("{")
    with pytest.raises(InputError, match=r"shards\.json is damaged"):
        write_shards(pictures, shards[0].parent, 3, lambda: None)
    (shards[0].parent / "shards.json").unlink()
    with pytest.raises(InputError, match="holds other tar files"):
        write_shards(pictures, shards[0].parent, 3, lambda: None)


def test_a_picture_that_lacks_a_file_leaves_no_shard(tmp_path):
    write_pictures(tmp_path, ["1"])
    (tmp_path / "mask1.png").unlink()
    with pytest.raises(PictureFault, match=r"mask1\.png: is missing"):
        write_shards(find_pictures(tmp_path), tmp_path / "out", 3, lambda: None)
    assert not (tmp_path / "out").exists()


def test_a_folder_can_be_used_again_after_a_missing_file_was_added(tmp_path):
    write_pictures(tmp_path, ["1", "2", "3"])
    mask = (tmp_path / "mask3.png").read_bytes()
    (tmp_path / "mask3.png").unlink()
    with pytest.raises(PictureFault, match="vm-train check lists all"):
        write_shards(find_pictures(tmp_path), tmp_path / "out", 1, lambda: None)
    (tmp_path / "mask3.png").write_bytes(mask)
    assert len(write_shards(find_pictures(tmp_path), tmp_path / "out", 1, lambda: None)) == 3


def test_numbers_with_a_dot_are_refused(tmp_path):
    write_pictures(tmp_path, ["1.5"])
    with pytest.raises(InputError, match=r"'1\.5' can't go into a shard"):
        write_shards(find_pictures(tmp_path), tmp_path / "out", 3, lambda: None)


def test_pictures_of_another_set_with_the_same_numbers_are_refused(shards, pictures, tmp_path):
    for each in (pictures[0].image.parent).iterdir():
        (tmp_path / each.name).write_bytes(each.read_bytes())
    with pictures[0].image.open("rb") as file:
        (tmp_path / pictures[0].image.name).write_bytes(file.read() + b"\0")
    with pytest.raises(InputError, match="shards of other pictures"):
        write_shards(find_pictures(tmp_path), shards[0].parent, 3, lambda: None)


def test_shards_of_other_shards_with_the_same_numbers_are_refused(shards, pictures, tmp_path):
    write_shards(find_pictures(shards[0].parent), tmp_path / "out", 3, lambda: None)
    for each in (pictures[0].image.parent).iterdir():
        (tmp_path / each.name).write_bytes(each.read_bytes() + (b"\0" if each.suffix == ".jpg" else b""))
    others = write_shards(find_pictures(tmp_path), tmp_path / "others", 3, lambda: None)
    with pytest.raises(InputError, match="shards of other pictures"):
        write_shards(find_pictures(others[0].parent), tmp_path / "out", 3, lambda: None)


def test_the_folder_of_the_pictures_gets_no_shards(pictures):
    folder = pictures[0].image.parent
    with pytest.raises(InputError, match="is the folder of the pictures"):
        write_shards(pictures, folder, 3, lambda: None)
    assert not list(folder.glob("*.tar"))
