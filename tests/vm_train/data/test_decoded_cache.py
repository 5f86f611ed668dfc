"""Decoded pictures on disk: the same as the files', and absent when stale, damaged or without room."""

import multiprocessing
import os
import resource
import signal
from types import SimpleNamespace

import numpy as np
import pytest

from tests.folders import contents
from vm_embedded.errors import InputError
from vm_train.data import decoded_cache as module
from vm_train.data.classes import Classes
from vm_train.data.decoded_cache import MAGIC, DecodedCache, decoded_size, read_through_cache, remove_entries
from vm_train.data.pictures import find_pictures, read_picture

from .test_pictures import CLASSES, write_pictures


@pytest.fixture
def files(tmp_path):
    (tmp_path / "set").mkdir()
    write_pictures(tmp_path / "set", ["1"])
    return find_pictures(tmp_path / "set")[0]


@pytest.fixture
def kept(tmp_path):
    return DecodedCache(tmp_path / "kept")


def same(one, other):
    assert (one.image == other.image).all()
    assert (one.labels == other.labels).all()
    assert one.lens.lens == other.lens.lens
    assert np.array_equal(one.lens.orientation.level, other.lens.orientation.level)


def test_a_picture_comes_back_as_it_was(files, kept):
    assert kept.get(files, CLASSES) is None
    same(read_through_cache(files, CLASSES, kept), read_picture(files, CLASSES))
    found = kept.get(files, CLASSES)
    same(found, read_picture(files, CLASSES))
    assert not found.image.flags.writeable
    assert not kept.full
    same(read_through_cache(files, CLASSES, None), found)


def test_kept_pictures_take_the_room_that_is_told(files, kept):
    read_through_cache(files, CLASSES, kept)
    (path,) = kept.folder.iterdir()
    assert path.stat().st_size <= decoded_size(1, 160, 120)


@pytest.mark.parametrize("part", ["image", "mask", "lens"])
def test_a_changed_file_makes_it_stale(part, files, kept):
    read_through_cache(files, CLASSES, kept)
    os.utime(files.path(part), ns=(0, 0))
    assert kept.get(files, CLASSES) is None
    read_through_cache(files, CLASSES, kept)
    assert kept.get(files, CLASSES) is not None
    files.path(part).unlink()
    assert kept.get(files, CLASSES) is None


def test_other_classes_make_it_stale(files, kept):
    read_through_cache(files, CLASSES, kept)
    others = Classes(dict(reversed(CLASSES.colors.items())))
    assert kept.get(files, others) is None
    same(read_through_cache(files, others, kept), read_picture(files, others))


@pytest.mark.parametrize("left", [0, 10, 70, -1])
def test_a_damaged_file_is_made_again(left, files, kept):
    read_through_cache(files, CLASSES, kept)
    (path,) = kept.folder.iterdir()
    path.write_bytes(path.read_bytes()[:left])
    assert kept.get(files, CLASSES) is None
    read_through_cache(files, CLASSES, kept)
    assert kept.get(files, CLASSES) is not None


def test_what_killed_processes_left_does_not_matter(files, kept):
    for name in ("1.raw.part", ".1.raw.0123456789abcdef.part"):
        (kept.folder / name).write_bytes(b"half")
        read_through_cache(files, CLASSES, kept)
        read_through_cache(files, CLASSES, kept)
        assert kept.get(files, CLASSES) is not None
        assert not kept.full


def test_files_of_others_stay_as_they_are(files, kept):
    """Also a camera's image under the name of an entry, and one that is called as the mark of a full disk."""
    path = kept.folder / f"{files.number}.raw"
    for name in (path.name, "full", "notes.txt"):
        (kept.folder / name).write_bytes(b"II*\0 of another program")
    before = contents(kept.folder)
    again = DecodedCache(kept.folder)
    same(read_through_cache(files, CLASSES, again), read_picture(files, CLASSES))
    again.put(files, CLASSES, read_picture(files, CLASSES))
    remove_entries(kept.folder, MAGIC)
    assert contents(kept.folder) == before


def test_an_entry_does_not_follow_a_link(files, kept, tmp_path):
    (tmp_path / "else").touch()
    (kept.folder / f"{files.number}.raw").symlink_to(tmp_path / "else")
    read_through_cache(files, CLASSES, kept)
    remove_entries(kept.folder, MAGIC)
    assert (tmp_path / "else").read_bytes() == b""
    assert (kept.folder / f"{files.number}.raw").is_symlink()


def test_the_entries_and_what_killed_processes_left_are_removed(files, kept):
    read_through_cache(files, CLASSES, kept)
    (kept.folder / ".1.raw.0123456789abcdef.part").write_bytes(MAGIC + b"half")
    (kept.folder / "full").touch()
    (kept.folder / "2.raw").touch()
    remove_entries(kept.folder, MAGIC)
    assert not kept.folder.exists()


def test_without_room_it_goes_on_and_says_so(files, kept, monkeypatch):
    monkeypatch.setattr(module.shutil, "disk_usage", lambda path: SimpleNamespace(free=1 << 30))
    same(read_through_cache(files, CLASSES, kept), read_picture(files, CLASSES))
    assert kept.get(files, CLASSES) is None
    assert kept.full
    monkeypatch.undo()
    read_through_cache(files, CLASSES, kept)
    assert kept.get(files, CLASSES) is None  # no more are put there
    again = DecodedCache(kept.folder)
    assert not again.full
    read_through_cache(files, CLASSES, again)
    assert again.get(files, CLASSES) is not None


def put_with_small_files(folder, files):
    signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    resource.setrlimit(resource.RLIMIT_FSIZE, (10_000, 10_000))
    same(read_through_cache(files, CLASSES, folder), read_picture(files, CLASSES))


def test_a_write_that_fails_in_another_process_is_seen_here(files, kept):
    other = multiprocessing.get_context("spawn").Process(target=put_with_small_files, args=(kept, files))
    other.start()
    other.join()
    assert other.exitcode == 0
    assert kept.full
    assert [path.name for path in kept.folder.iterdir()] == ["full"]


def test_a_folder_that_can_not_be_made_is_named(tmp_path):
    (tmp_path / "file").touch()
    with pytest.raises(InputError, match="can't use folder"):
        DecodedCache(tmp_path / "file" / "kept")


def test_a_long_number_in_another_script_does_not_switch_the_cache_off(tmp_path, kept):
    (tmp_path / "long").mkdir()
    number = "Запись_робота_перед_воротами_кадр_" + "0" * 12
    write_pictures(tmp_path / "long", [number, number + "1"])
    for each in find_pictures(tmp_path / "long"):
        same(read_through_cache(each, CLASSES, kept), read_picture(each, CLASSES))
        same(kept.get(each, CLASSES), read_picture(each, CLASSES))
    assert not kept.full
