"""Pictures streamed from tar shards: in order, shuffled, from pipes and servers, and every damage by name."""

import gzip
import io
from functools import partial
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from threading import Thread
from types import SimpleNamespace

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from tests.vm_train.conftest import NUMBERS
from tests.vm_train.data.test_pictures import CLASSES
from vm_embedded.errors import InputError
from vm_train.data import shard_stream
from vm_train.data.picture_files import PictureFault
from vm_train.data.pictures import decode_picture, read_picture
from vm_train.data.shard_stream import stream

from .test_shard_index import tar_of


def test_a_stream_gives_all_pictures_in_order(shards, pictures):
    found = list(stream(shards))
    assert found == [each.raw() for each in pictures]
    assert (decode_picture(found[2], CLASSES).labels == read_picture(pictures[2], CLASSES).labels).all()
    with pytest.raises(PictureFault, match="mask of 000: can't be decoded as an image"):
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
    with pytest.raises(InputError, match=r"zipped\.tar\.gz: can't be read after"):
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
        ("pipe:gzip -c {shard} | head -c 900; exit 5", "status 5"),
        ("nowhere.tar", "nowhere.tar: can't be read after its start, at byte 0"),
        ("http://127.0.0.1:9/a.tar", "can't be read after its start"),
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
    with pytest.raises(PictureFault, match="lens file of picture 0 is not UTF-8 text"):
        list(stream([tar_of(tmp_path / "a.tar", files)]))


def test_pictures_without_all_parts_are_left_out_where_faults_are_reported(shards, pictures, tmp_path):
    faulty = tar_of(tmp_path / "faulty.tar", [("x.jpg", b""), ("y.mask.png", b"")])
    faults = []
    found = list(stream([faulty, shards[0]], report=faults.append))
    assert [each.number for each in found] == NUMBERS[:3]
    assert [each.kind for each in faults] == ["missing", "missing"]
