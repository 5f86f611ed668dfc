"""Archives and files that claim to hold far more than they do, or pack gigabytes into kilobytes."""

import gzip
import io
import resource
import subprocess
import sys
import tarfile
import zipfile

import numpy as np
import pytest
import torch

from tests.vm_train.data.test_pictures import write_pictures
from tests.vm_train.formats.test_tfrecord import masked
from vm_embedded.errors import InputError
from vm_export.checkpoint import Checkpoint
from vm_train.data import array_files, tar_members
from vm_train.data.array_files import read_arrays
from vm_train.data.shard_stream import stream
from vm_train.formats.tfexample import parse_example
from vm_train.formats.tfrecord import read_records

GIB = 2**30
_ALLOWED = 512 * 2**20
"""Address space that a reader may need beyond that of its imports [bytes]."""

_READ = f"""
import resource, sys
from pathlib import Path
from vm_embedded.errors import InputError
from vm_train.data.shard_index import open_shards
from vm_train.data.shard_stream import stream
from vm_train.formats.tfrecord import read_records
def index(path):
    return [each.raw() for each in open_shards(Path(path))]
def records(path):
    return [each.number for each in read_records(Path(path))]
read = {{"stream": lambda path: list(stream([path])), "index": index, "records": records}}[sys.argv[1]]
used = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
resource.setrlimit(resource.RLIMIT_AS, (used + {_ALLOWED},) * 2)
try:
    read(sys.argv[2])
except InputError as error:
    print(error)
"""


def refusal_in_little_memory(how, path):
    """What a reader says in a process that may not take more than _ALLOWED."""
    done = subprocess.run([sys.executable, "-c", _READ, how, path], capture_output=True, text=True, timeout=300)
    assert done.returncode == 0, done.stderr[-2000:]
    assert path.name in done.stdout
    return done.stdout


def written(path, *parts):
    path.write_bytes(b"".join(parts))
    return path


def header(name, size, kind=tarfile.REGTYPE, pax=None, format=tarfile.GNU_FORMAT):
    entry = tarfile.TarInfo(name)
    entry.size, entry.type, entry.pax_headers = size, kind, pax or {}
    return entry.tobuf(tarfile.PAX_FORMAT if pax else format)


def sparse_shard(path):
    """A picture whose image is a hole of 200 GB, as GNU tar writes it: 0 bytes of data."""
    pax = {"GNU.sparse.major": "1", "GNU.sparse.minor": "0", "GNU.sparse.realsize": str(200 * 10**9)}
    map_block = b"1\n200000000000\n0\n".ljust(512, b"\0")
    path.write_bytes(header("0.jpg", 512, pax=pax) + map_block + bytes(1024))
    return path


def old_sparse_shard(path):
    """The same in the older format of GNU tar."""
    block = bytearray(header("0.jpg", 0, tarfile.GNUTYPE_SPARSE))
    block[386:410] = b"%011o\0%011o\0" % (8**11 - 1, 0)
    block[483:495] = b"%011o\0" % (8**11 - 1)
    block[148:156] = b" " * 8
    block[148:156] = b"%06o\0 " % sum(block)
    path.write_bytes(bytes(block) + bytes(1024))
    return path


def zeros(count):
    """So many zeros as a gzip file, which may be put together of many."""
    return gzip.compress(bytes(2**20)) * (count // 2**20)


@pytest.mark.parametrize("how", ["stream", "index"])
@pytest.mark.parametrize("make", [sparse_shard, old_sparse_shard])
def test_a_sparse_member_of_gigabytes_is_refused(make, how, tmp_path):
    assert "sparse" in refusal_in_little_memory(how, make(tmp_path / "a.tar"))


@pytest.mark.parametrize("how", ["stream", "index"])
@pytest.mark.parametrize("size", [tar_members.LARGEST_FILE + 1, 6 * GIB, 10**18])
def test_a_member_larger_than_a_picture_can_be_is_refused(size, how, tmp_path):
    path = tmp_path / "a.tar"
    path.write_bytes(header("0.jpg", size) + bytes(1024))
    assert f"0.jpg has {size} bytes; at most {tar_members.LARGEST_FILE} are allowed" in refusal_in_little_memory(
        how, path
    )


def test_a_member_of_gigabytes_in_a_gzip_of_megabytes_is_refused(tmp_path):
    path = written(tmp_path / "a.tar.gz", gzip.compress(header("0.jpg", GIB)), zeros(GIB), zeros(2**20))
    assert path.stat().st_size < 2 * 2**20
    assert "0.jpg has" in refusal_in_little_memory("stream", path)


@pytest.mark.parametrize("kind", [tarfile.XHDTYPE, tarfile.XGLTYPE, tarfile.GNUTYPE_LONGNAME, tarfile.GNUTYPE_LONGLINK])
@pytest.mark.parametrize("how", ["stream", "index"])
def test_headers_of_gigabytes_are_refused(kind, how, tmp_path):
    """In a gzip they are there; in a plain file they are only claimed."""
    head = header("name", GIB, kind)
    parts = [gzip.compress(head), zeros(GIB), zeros(2**20)] if how == "stream" else [head, bytes(1024)]
    path = written(tmp_path / "a.tar", *parts)
    assert "headers of a member have more than" in refusal_in_little_memory(how, path)


@pytest.mark.parametrize("how", ["stream", "index"])
def test_headers_of_headers_do_not_end_in_an_endless_recursion(how, tmp_path):
    path = tmp_path / "a.tar"
    path.write_bytes(header("name", 0, tarfile.XHDTYPE) * 5000 + header("0.jpg", 0) + bytes(1024))
    assert "can't be read" in (said := refusal_in_little_memory(how, path)) or "damaged" in said


@pytest.mark.parametrize("how", ["stream", "index"])
@pytest.mark.parametrize("size", ["-512", "-1536", "9" * 18, "9" * 30])
def test_sizes_that_lead_back_or_nowhere_are_refused(size, how, tmp_path):
    path = tmp_path / "a.tar"
    path.write_bytes(header("0.jpg", 0) + header("readme", 0, pax={"size": size}) + header("1.jpg", 0) + bytes(1024))
    assert "damaged" in (said := refusal_in_little_memory(how, path)) or "can't be read" in said


def test_many_files_of_one_picture_are_not_collected(tmp_path):
    member = gzip.compress(header("0.jpg", 2**26))
    path = written(tmp_path / "a.tar.gz", *[member, zeros(2**26)] * 12, zeros(2**20))
    assert "two files for one part of picture 0" in refusal_in_little_memory("stream", path)


def test_pictures_that_wait_to_be_shuffled_are_limited_in_bytes(tmp_path, monkeypatch):
    parts = [header(f"{n}{end}", 2**10) + bytes(2**10) for n in range(9) for end in (".jpg", ".mask.png", ".lens.yaml")]
    path = tmp_path / "a.tar"
    path.write_bytes(b"".join(parts) + bytes(1024))
    whole = [each.number for each in stream([path], (1,), 100)]
    assert sorted(whole) == [str(n) for n in range(9)]
    monkeypatch.setattr("vm_train.data.shard_stream._BUFFER_BYTES", 6 * 2**10)
    found = stream([path], (1,), 100)
    first = next(found).number
    assert first in "012"
    assert sorted([first, *(each.number for each in found)]) == sorted(whole)


def test_a_record_of_gigabytes_in_a_gzip_of_kilobytes_is_refused(tmp_path):
    length = (2**31 - 1).to_bytes(8, "little")
    path = written(tmp_path / "a.tfrecord", gzip.compress(length + masked(length)), zeros(GIB))
    assert "record 0 has 2147483647 bytes" in refusal_in_little_memory("records", path)


@pytest.mark.parametrize("field", [b"\x0a\x00", b"\x15\x00\x00\x00\x00"])
def test_an_example_has_a_limited_number_of_values(field):
    with pytest.raises(InputError, match="values"):
        parse_example(b"".join([b"\x0a" + _varint(len(field) * 1_100_000), field * 1_100_000]))


def _varint(value):
    made = bytearray()
    while value > 127:
        made.append(value & 127 | 128)
        value >>= 7
    return bytes([*made, value])


def test_a_compressed_checkpoint_is_refused(tmp_path):
    """torch itself unpacks it, however large it becomes."""
    whole, packed = tmp_path / "whole.pt", tmp_path / "packed.pt"
    torch.save({"state": torch.zeros(2**22)}, whole)
    with zipfile.ZipFile(whole) as source, zipfile.ZipFile(packed, "w", zipfile.ZIP_DEFLATED) as target:
        for name in source.namelist():
            target.writestr(name, source.read(name))
    assert packed.stat().st_size < 2**20
    with pytest.raises(InputError, match=r"packed\.pt is not a checkpoint: it is damaged"):
        Checkpoint.load(packed)


def test_an_array_that_claims_more_than_its_file_has_is_refused(tmp_path):
    path = tmp_path / "a.npz"
    head = io.BytesIO()
    np.lib.format.write_array_header_1_0(head, {"descr": "|u1", "fortran_order": False, "shape": (200 * 10**9,)})
    with zipfile.ZipFile(path, "w") as packed:
        packed.writestr("a.npy", head.getvalue())
    with pytest.raises(InputError, match=r"a\.npz.*cut short"):
        read_arrays(path)


def test_compressed_arrays_may_have_a_limited_size(tmp_path, monkeypatch):
    assert array_files.LARGEST == GIB
    monkeypatch.setattr(array_files, "LARGEST", 2**20)
    path = tmp_path / "a.npz"
    np.savez_compressed(path, a=np.arange(5), b=np.zeros(2**19, np.uint8))
    assert read_arrays(path)["a"].tolist() == [0, 1, 2, 3, 4]
    np.savez_compressed(path, a=np.zeros(2**19, np.uint8), b=np.zeros(2**19, np.uint8))
    with pytest.raises(InputError, match="too large"):
        read_arrays(path)
    np.savez(path, a=np.zeros(2**21, np.uint8))  # not compressed: the file is as large
    assert len(read_arrays(path)["a"]) == 2**21


def test_vm_train_checks_a_shard_of_holes_in_little_memory(tmp_path):
    (tmp_path / "data").mkdir()
    shard = sparse_shard(tmp_path / "data" / "a.tar")
    write_pictures(tmp_path)
    command = [sys.executable, "-m", "vm_train", "check", shard.parent]
    limit = lambda: resource.setrlimit(resource.RLIMIT_DATA, (8 * GIB, 8 * GIB))  # noqa: E731
    done = subprocess.run(command, capture_output=True, text=True, preexec_fn=limit, timeout=120)
    assert done.returncode == 1
    assert "sparse" in done.stderr
    assert "Traceback" not in done.stderr
    assert list(read_records(_empty(tmp_path))) == []


def _empty(folder):
    path = folder / "empty"
    path.touch()
    return path


@pytest.mark.parametrize("fault", ["encrypted", "damaged"])
def test_arrays_that_can_not_be_unpacked_are_a_fault_of_the_file(tmp_path, fault):
    path = tmp_path / "arrays.npz"
    np.savez_compressed(path, values=np.arange(1000))
    content = bytearray(path.read_bytes())
    if fault == "encrypted":  # a flag of the part, in the list at the end, too
        for header, place in ((b"PK\x03\x04", 6), (b"PK\x01\x02", 8)):
            content[content.index(header) + place] |= 1
    else:
        middle = len(content) // 3
        content[middle : middle + 200] = bytes(200)
    path.write_bytes(content)
    with pytest.raises(InputError, match=r"arrays\.npz"):
        read_arrays(path)
