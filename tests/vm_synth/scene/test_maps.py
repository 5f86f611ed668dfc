"""Which maps of a folder are rendered."""

import re

import pytest

from vm_embedded.errors import InputError
from vm_synth.scene.maps import MapRanges, find_maps, missing_held_out


@pytest.fixture
def maps(tmp_path):
    for name in ("c.hdr", "a.HDR", "b.exr", "d.pfm", "notes.txt", "preview.png"):
        (tmp_path / name).write_bytes(b"")
    return tmp_path


def names(paths):
    return [path.name for path in paths]


def test_all_maps_of_a_folder_are_found_by_suffix_in_order_of_their_names(maps):
    assert names(find_maps(maps, MapRanges(), held_out=False)) == ["a.HDR", "b.exr", "c.hdr", "d.pfm"]


def test_held_out_maps_are_found_only_when_they_are_asked_for(maps):
    ranges = MapRanges(held_out=("b", "d"))
    assert names(find_maps(maps, ranges, held_out=False)) == ["a.HDR", "c.hdr"]
    assert names(find_maps(maps, ranges, held_out=True)) == ["b.exr", "d.pfm"]


def test_a_folder_may_lack_maps_that_are_held_out(maps):
    assert names(find_maps(maps, MapRanges(held_out=("elsewhere", "b")), held_out=False)) == ["a.HDR", "c.hdr", "d.pfm"]


def test_names_that_are_held_out_and_no_maps_of_the_folder_are_told(maps):
    assert missing_held_out(maps, MapRanges(held_out=("b", "elsewhere", "c"))) == ["elsewhere"]


def test_no_folder_no_map_and_no_map_left_are_said(maps, tmp_path_factory):
    empty = tmp_path_factory.mktemp("empty")
    with pytest.raises(InputError, match=r"no maps \(\.hdr, \.exr, \.pfm\) in .*empty"):
        find_maps(empty, MapRanges(), held_out=False)
    for path in (empty / "none", maps / "c.hdr"):
        with pytest.raises(
            InputError, match=rf"there is no folder {re.escape(str(path))}; --hdri needs a folder of maps"
        ):
            find_maps(path, MapRanges(), held_out=False)
    with pytest.raises(InputError, match=r"all of the maps in .* are held out: nothing to render"):
        find_maps(maps, MapRanges(held_out=("a", "b", "c", "d")), held_out=False)
    with pytest.raises(InputError, match=r"none of the maps in .* are held out: nothing to render"):
        find_maps(maps, MapRanges(), held_out=True)
