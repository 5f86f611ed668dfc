"""Tar shards: written as webdataset has them, read by position or streamed, and every damage by name."""

import gzip
import io
import tarfile
from functools import partial
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from threading import Thread
from types import SimpleNamespace

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from vm_embedded.errors import InputError
from vm_train.data import shard_stream
from vm_train.data.picture_files import PictureFault
from vm_train.data.pictures import decode_picture, find_pictures, read_picture
from vm_train.formats.shards import open_shards, run_shards, shards_parser, stream, write_shards

from ..data.test_pictures import CLASSES, write_pictures

NUMBERS = [f"{index:03d}" for index in range(7)]


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    made = tmp_path_factory.mktemp("set")
    write_pictures(made, NUMBERS)
    return made


@pytest.fixture(scope="module")
def pictures(folder):
    return find_pictures(folder)


@pytest.fixture
def shards(pictures, tmp_path):
    return write_shards(pictures, tmp_path / "shards", 3, lambda: None)


def tar_of(path, files):
    with tarfile.open(path, "w") as tar:
        for name, content in files:
            entry = tarfile.TarInfo(name)
            entry.size = len(content)
            tar.addfile(entry, io.BytesIO(content))
    return path


def test_shards_hold_the_files_as_webdataset_names_them(shards, folder):
    assert [each.name for each in shards] == [f"pictures-{index:06d}.tar" for index in range(3)]
    with tarfile.open(shards[0]) as tar:
        names = [each.name for each in tar]
        assert names[:3] == ["000.jpg", "000.mask.png", "000.lens.yaml"]
        assert len(names) == 9
        assert tar.extractfile("001.mask.png").read() == (folder / "mask001.png").read_bytes()
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
    with pytest.raises(InputError, match="tar files of something else"):
        write_shards(pictures, shards[0].parent, 3, lambda: None)


def test_a_picture_that_lacks_a_file_leaves_no_shard(tmp_path):
    write_pictures(tmp_path, ["1"])
    (tmp_path / "mask1.png").unlink()
    with pytest.raises(PictureFault, match=r"mask1\.png: is missing"):
        write_shards(find_pictures(tmp_path), tmp_path / "out", 3, lambda: None)
    assert [each.name for each in (tmp_path / "out").iterdir()] == ["shards.json"]


def test_numbers_with_a_dot_are_refused(tmp_path):
    write_pictures(tmp_path, ["1.5"])
    with pytest.raises(InputError, match=r"'1\.5' can't be in a shard"):
        write_shards(find_pictures(tmp_path), tmp_path / "out", 3, lambda: None)


def test_the_command_says_what_it_did(folder, tmp_path, capsys):
    options = shards_parser().parse_args([str(folder), str(tmp_path / "out"), "--size", "4"])
    assert run_shards(options) == 0
    assert capsys.readouterr().out == f"{tmp_path / 'out'}: 7 pictures in 2 shards\n"
    assert run_shards(options) == 0
    assert "7 pictures were there already" in capsys.readouterr().err


def test_a_folder_of_shards_is_a_folder_of_pictures(shards, pictures):
    found = find_pictures(shards[0].parent)
    assert [each.number for each in found] == NUMBERS
    for packed, files in zip(found, pictures, strict=True):
        assert packed.raw() == files.raw()
    assert (read_picture(found[4], CLASSES).image == read_picture(pictures[4], CLASSES).image).all()
    assert [each.number for each in open_shards(shards[0].parent / "pictures-00000[12].tar")] == NUMBERS[3:]


def test_pictures_beside_shards_are_refused(shards, folder):
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


def test_a_stream_gives_all_pictures_in_order(shards, pictures):
    found = list(stream(shards))
    assert found == [each.raw() for each in pictures]
    assert (decode_picture(found[2], CLASSES).labels == read_picture(pictures[2], CLASSES).labels).all()
    with pytest.raises(PictureFault, match="mask of 000: can't be read"):
        decode_picture(found[0]._replace(mask=b"none"), CLASSES)


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture], deadline=None, max_examples=30)
@given(seed=st.integers(0, 2**32), buffer=st.integers(1, 9))
def test_a_shuffled_stream_has_the_same_pictures_by_the_seed(seed, buffer, shards):
    found = [each.number for each in stream(shards, (seed, 1), buffer)]
    assert sorted(found) == NUMBERS
    assert found == [each.number for each in stream(shards, (seed, 1), buffer)]
    # None comes before so many others are there to choose from.
    assert all(NUMBERS.index(number) < position + buffer for position, number in enumerate(found))


def test_streams_come_from_pipes_standard_input_and_gzip(shards, pictures, tmp_path, monkeypatch):
    wanted = [each.raw() for each in pictures[:3]]
    zipped = tmp_path / "zipped.tar.gz"
    zipped.write_bytes(gzip.compress(shards[0].read_bytes()))
    monkeypatch.setattr(shard_stream.sys, "stdin", SimpleNamespace(buffer=io.BufferedReader(shards[0].open("rb"))))
    for source in (f"pipe:cat {shards[0]}", "-", zipped, f"pipe:cat {zipped}"):
        assert list(stream([source])) == wanted
    zipped.write_bytes(zipped.read_bytes()[:-200])
    with pytest.raises(InputError, match=r"zipped\.tar\.gz: can't be read on after"):
        list(stream([zipped]))


def test_streams_come_from_servers(shards, pictures):
    handler = partial(SimpleHTTPRequestHandler, directory=str(shards[0].parent))
    handler.func.log_message = lambda *_: None
    with ThreadingHTTPServer(("127.0.0.1", 0), handler) as server:
        Thread(target=server.serve_forever, daemon=True).start()
        place = f"http://127.0.0.1:{server.server_port}"
        assert list(stream([f"{place}/{shards[2].name}"])) == [pictures[-1].raw()]
        with pytest.raises(InputError, match="404"):
            list(stream([f"{place}/nothing.tar"]))
        server.shutdown()


@pytest.mark.parametrize(
    ("source", "said"),
    [
        ("pipe:exit 3", "status 3"),
        ("pipe:cat {shard}; exit 4", "status 4"),
        ("nowhere.tar", "nowhere.tar: can't be read on after its begin"),
        ("http://127.0.0.1:9/a.tar", "can't be read on"),
    ],
)
def test_sources_that_fail_are_named(source, said, shards):
    with pytest.raises(InputError, match=said):
        list(stream([source.format(shard=shards[0])]))


def test_a_reader_may_stop_early(shards):
    found = stream([f"pipe:cat {shards[0]}; sleep 100"])
    assert next(found).number == "000"
    found.close()


def test_pictures_without_all_parts_are_named(tmp_path, pictures):
    image = pictures[0].read("image")
    path = tar_of(tmp_path / "a.tar", [("0.jpg", image), ("1.jpg", image)])
    with pytest.raises(InputError, match="picture 0 lacks its mask and lens"):
        list(stream([path]))
    files = [("0.jpg", image), ("0.mask.png", image), ("0.lens.yaml", b"\xff")]
    with pytest.raises(PictureFault, match="two files for one part of picture 0"):
        list(stream([tar_of(tmp_path / "a.tar", [*files, ("0.png", image)])]))
    with pytest.raises(PictureFault, match="lens file of picture 0 is no text"):
        list(stream([tar_of(tmp_path / "a.tar", files)]))


def test_pictures_without_all_parts_are_left_out_where_faults_are_reported(shards, pictures, tmp_path):
    faulty = tar_of(tmp_path / "faulty.tar", [("x.jpg", b""), ("y.mask.png", b"")])
    faults = []
    found = list(stream([faulty, shards[0]], report=faults.append))
    assert [each.number for each in found] == NUMBERS[:3]
    assert [each.kind for each in faults] == ["missing", "missing"]
