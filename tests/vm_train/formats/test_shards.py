"""Tar archives become a folder of pictures: from files and servers, again after a stop, and every fault by name."""

import gzip
import io
import json
import os
import tarfile
from functools import partial
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from threading import Thread
from types import SimpleNamespace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.folders import contents
from tests.vm_train.data.test_pictures import write_pictures
from vm_embedded.errors import InputError
from vm_train.data.pictures import find_pictures
from vm_train.formats import picture_folder, shards
from vm_train.formats.importing import import_pictures

RECORD = "import.json"


def tar_of(path, files):
    """An archive of (name, content)."""
    with tarfile.open(path, "w") as tar:
        for name, content in files:
            entry = tarfile.TarInfo(name)
            entry.size = len(content)
            tar.addfile(entry, io.BytesIO(content))
    return path


def by_key(name):
    """The name of a file of a picture in webdataset's form."""
    stem, _, suffix = name.rpartition(".")
    part = next(each for each in ("image", "mask", "lens", "scene") if stem.startswith(each))
    number = stem.removeprefix(part)
    return f"{number}.{suffix}" if part == "image" else f"{number}.{part}.{suffix}"


@pytest.fixture(scope="module")
def files(tmp_path_factory):
    """The files of four pictures, by name, in order."""
    folder = tmp_path_factory.mktemp("set")
    write_pictures(folder, ["000", "001", "002", "ball"])
    (folder / "scene001.json").write_text("{}")
    return dict(sorted(contents(folder).items()))


@pytest.fixture
def archives(files, tmp_path):
    """Pictures 000 and 001 in webdataset's form, and the others as files in a folder, packed in any order."""
    first = [(by_key(name), each) for name, each in files.items() if "00" in name and "2" not in name]
    second = [(f"./train/{name}", each) for name, each in files.items() if "2" in name or "ball" in name]
    return [str(tar_of(tmp_path / "a.tar", first)), str(tar_of(tmp_path / "b.tar", second))]


def imported(names, out, strict=True, report=lambda share: None):
    return import_pictures([str(each) for each in names], out, {}, False, strict, report)


def pictures_in(folder):
    return {name: content for name, content in contents(folder).items() if name != RECORD}


def test_archives_become_the_folder_that_they_were_made_of(archives, files, tmp_path):
    shares = []
    made = imported(archives, tmp_path / "out", report=shares.append)
    assert (made.count, made.there, made.skipped, made.remarks) == (4, 0, (), ())
    assert pictures_in(tmp_path / "out") == files
    assert [each.number for each in find_pictures(tmp_path / "out")] == ["000", "001", "002", "ball"]
    assert shares == sorted(shares)
    assert shares[-1] == 1.0


def test_archives_come_gzipped_and_from_standard_input(archives, files, tmp_path, monkeypatch):
    (tmp_path / "a.tgz").write_bytes(gzip.compress((tmp_path / "a.tar").read_bytes()))
    with (tmp_path / "b.tar").open("rb") as file:
        monkeypatch.setattr(shards.sys, "stdin", SimpleNamespace(buffer=file))
        imported([tmp_path / "a.tgz", "-"], tmp_path / "out")
    assert pictures_in(tmp_path / "out") == files


@pytest.fixture
def served(tmp_path):
    """The address of a server of the folder."""
    handler = partial(SimpleHTTPRequestHandler, directory=str(tmp_path))
    with ThreadingHTTPServer(("127.0.0.1", 0), handler) as server:
        Thread(target=server.serve_forever, daemon=True).start()
        yield f"http://127.0.0.1:{server.server_port}"
        server.shutdown()


def test_archives_come_from_servers_and_are_not_read_again(archives, files, served, tmp_path):
    names, out = [f"{served}/a.tar", f"{served}/b.tar"], tmp_path / "out"
    assert imported(names, out).count == 4
    assert pictures_in(out) == files
    assert list(json.loads((out / RECORD).read_text())) == names
    whole = (tmp_path / "b.tar").stat()
    (tmp_path / "b.tar").write_bytes(b"x" * whole.st_size)  # no archive, but with the stamp of the old one
    os.utime(tmp_path / "b.tar", (whole.st_atime, whole.st_mtime))
    assert imported(names, out).there == 4
    os.utime(tmp_path / "b.tar", (0, 0))
    with pytest.raises(InputError, match=rf"{served}/b\.tar: can't be read"):
        imported(names, out)
    with pytest.raises(InputError, match=r"nothing\.tar: can't be read after its start, at byte 0: .*404"):
        imported([f"{served}/nothing.tar"], out)


class Stop(Exception):
    pass


@pytest.mark.parametrize("after", [1, 5, 12])
def test_an_import_that_was_stopped_continues(after, archives, files, tmp_path):
    left = iter(range(after))

    def stop(share):
        if next(left, None) is None:
            raise Stop

    with pytest.raises(Stop):
        imported(archives, tmp_path / "out", report=stop)
    before = pictures_in(tmp_path / "out")
    assert before.items() < files.items()
    imported(archives, tmp_path / "out")
    assert pictures_in(tmp_path / "out") == files


def test_other_pictures_are_never_mixed_in_or_overwritten(archives, files, tmp_path):
    imported(archives, tmp_path / "out")
    changed = tar_of(tmp_path / "changed.tar", [("000.jpg", files["image000.jpg"] + b"\0")])
    for archive in (changed, tar_of(tmp_path / "png.tar", [("000.png", b"")])):
        with pytest.raises(InputError, match=r"has another image000\.jpg already: two pictures have the number 000"):
            imported([archive], tmp_path / "out")
    assert pictures_in(tmp_path / "out") == files


def test_pictures_that_lack_a_file_are_named_each_time(files, tmp_path):
    archive = tar_of(tmp_path / "a.tar", [("000.jpg", files["image000.jpg"]), ("readme.txt", b""), ("x.seg.png", b"")])
    for _ in range(2):
        made = imported([archive], tmp_path / "out", strict=False)
        assert (made.count, made.skipped) == (0, ("picture 000: lacks its mask and lens",))
        assert made.remarks == (f"{archive}: left out 2 other files, for example x.seg.png",)
    with pytest.raises(InputError, match="picture 000: lacks its mask and lens; 1 pictures lack a file"):
        imported([archive], tmp_path / "out")
    rest = [(by_key(name), files[name]) for name in ("mask000.png", "lens000.yaml")]
    assert imported([archive, tar_of(tmp_path / "b.tar", rest)], tmp_path / "out").count == 1


@pytest.mark.parametrize("name", ["../image1.jpg", "a/../../1.jpg", "/tmp/1.mask.png"])
def test_names_that_lead_out_of_the_folder_are_refused(name, tmp_path):
    with pytest.raises(InputError, match=f"the name {name} leads out of the folder"):
        imported([tar_of(tmp_path / "a.tar", [(name, b"")])], tmp_path / "out")
    assert contents(tmp_path / "out") == {}


def test_links_in_an_archive_are_not_followed(tmp_path):
    link = tarfile.TarInfo("1.jpg")
    link.type, link.linkname = tarfile.SYMTYPE, "/etc/passwd"
    with tarfile.open(tmp_path / "a.tar", "w") as tar:
        tar.addfile(link)
    assert imported([tmp_path / "a.tar"], tmp_path / "out").remarks == (
        f"{tmp_path / 'a.tar'}: left out 1 other files, for example 1.jpg",
    )


@given(share=st.floats(0.0, 1.0, exclude_max=True), compressed=st.booleans())
def test_a_cut_archive_is_never_taken_for_whole(share, compressed, tmp_path_factory):
    folder = tmp_path_factory.mktemp("cut")
    tar_of(folder / "a.tar", [("0.jpg", b"image" * 200), ("0.mask.png", b"mask"), ("0.lens.yaml", b"lens")])
    whole = (folder / "a.tar").read_bytes().rstrip(b"\0")
    whole = gzip.compress(whole) if compressed else whole
    (folder / "a.tar").write_bytes(whole[: int(share * len(whole))])
    with pytest.raises(InputError, match=r"a\.tar: can't be read after"):
        imported([folder / "a.tar"], folder / "out")


def test_the_place_of_a_cut_is_told(archives, tmp_path):
    with tarfile.open(archives[0]) as tar:
        place = tar.getmember("000.lens.yaml").offset
    cut = tmp_path / "cut.tar"
    cut.write_bytes((tmp_path / "a.tar").read_bytes()[:place])
    with pytest.raises(InputError, match=f"after 001.jpg, at byte {place}: it is cut short"):
        imported([cut], tmp_path / "out")


def test_a_disk_without_room_is_named_before_it_is_full(archives, files, tmp_path, monkeypatch):
    monkeypatch.setattr(picture_folder.shutil, "disk_usage", lambda path: SimpleNamespace(free=1 << 30))
    with pytest.raises(InputError, match=r"the disk of .*out has less than 1 GiB left: free some space"):
        imported(archives, tmp_path / "out")
    monkeypatch.undo()
    imported(archives, tmp_path / "out")
    assert pictures_in(tmp_path / "out") == files


def test_folders_that_can_not_be_used_are_named(archives, tmp_path):
    with pytest.raises(InputError, match=r"can't use folder .*a\.tar: "):
        imported(archives, tmp_path / "a.tar")
    with pytest.raises(InputError, match=r"can't read .*nowhere\.tar: No such file"):
        imported([*archives, tmp_path / "nowhere.tar"], tmp_path / "new")
    assert not (tmp_path / "new").exists()
    imported(archives, tmp_path / "out")
    for text in ("{", "[]"):
        (tmp_path / "out" / RECORD).write_text(text)
        with pytest.raises(InputError, match=r"import\.json is damaged: remove it"):
            imported(archives, tmp_path / "out")


def test_a_folder_of_archives_is_not_read_but_the_import_is_advised(archives, tmp_path):
    with pytest.raises(InputError, match=r"no pictures in .*; unpack the archives with vm-train import .*a\.tar OUT"):
        find_pictures(tmp_path)
