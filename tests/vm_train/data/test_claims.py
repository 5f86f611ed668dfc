"""Archives and files that claim to hold far more than they do, or pack gigabytes into kilobytes."""

import gzip
import io
import subprocess
import sys
import tarfile
import zipfile

import numpy as np
import pytest
import torch

from tests.vm_train.formats.tfrecord_writer import framed, masked
from vm_embedded.errors import InputError
from vm_export.checkpoint import Checkpoint
from vm_train.data import array_files
from vm_train.data.array_files import read_arrays
from vm_train.data.picture_files import LARGEST_FILE

GIB = 2**30
_ALLOWED = 512 * 2**20
"""Address space that a reader may need beyond that of its imports [bytes]."""

_READ = f"""
import resource, sys
from pathlib import Path
from vm_embedded.errors import InputError
from vm_train.formats.importing import import_pictures
used = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
resource.setrlimit(resource.RLIMIT_AS, (used + {_ALLOWED},) * 2)
try:
    import_pictures([sys.argv[1]], Path(sys.argv[1] + "-out"), {{}}, False, True, lambda share: None)
except InputError as error:
    print(error)
"""


def refusal_in_little_memory(path):
    """What an import says in a process that may not take more than _ALLOWED."""
    done = subprocess.run([sys.executable, "-c", _READ, path], capture_output=True, text=True, timeout=300)
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


@pytest.mark.parametrize("make", [sparse_shard, old_sparse_shard])
def test_a_sparse_member_of_gigabytes_is_refused(make, tmp_path):
    assert "sparse" in refusal_in_little_memory(make(tmp_path / "a.tar"))


@pytest.mark.parametrize("size", [LARGEST_FILE + 1, 6 * GIB, 10**18])
def test_a_member_larger_than_a_picture_can_be_is_refused(size, tmp_path):
    path = tmp_path / "a.tar"
    path.write_bytes(header("0.jpg", size) + bytes(1024))
    assert f"0.jpg has {size} bytes; at most {LARGEST_FILE} are allowed" in refusal_in_little_memory(path)


def test_a_member_of_gigabytes_in_a_gzip_of_megabytes_is_refused(tmp_path):
    path = written(tmp_path / "a.tar.gz", gzip.compress(header("0.jpg", GIB)), zeros(GIB), zeros(2**20))
    assert path.stat().st_size < 2 * 2**20
    assert "0.jpg has" in refusal_in_little_memory(path)


@pytest.mark.parametrize("kind", [tarfile.XHDTYPE, tarfile.XGLTYPE, tarfile.GNUTYPE_LONGNAME, tarfile.GNUTYPE_LONGLINK])
def test_headers_of_gigabytes_are_refused(kind, tmp_path):
    path = written(tmp_path / "a.tar", gzip.compress(header("name", GIB, kind)), zeros(GIB), zeros(2**20))
    assert "headers of a member have more than" in refusal_in_little_memory(path)


def test_headers_of_headers_do_not_end_in_an_endless_recursion(tmp_path):
    path = tmp_path / "a.tar"
    path.write_bytes(header("name", 0, tarfile.XHDTYPE) * 5000 + header("0.jpg", 0) + bytes(1024))
    assert "can't be read" in refusal_in_little_memory(path)


@pytest.mark.parametrize("size", ["-512", "-1536", "9" * 18, "9" * 30])
def test_sizes_that_lead_back_or_nowhere_are_refused(size, tmp_path):
    path = tmp_path / "a.tar"
    path.write_bytes(header("0.jpg", 0) + header("readme", 0, pax={"size": size}) + header("1.jpg", 0) + bytes(1024))
    assert "can't be read" in refusal_in_little_memory(path)


def test_a_record_of_gigabytes_in_a_gzip_of_kilobytes_is_refused(tmp_path):
    length = (2**31 - 1).to_bytes(8, "little")
    path = written(tmp_path / "a.tfrecord", gzip.compress(length + masked(length)), zeros(GIB))
    assert "record 0 has 2147483647 bytes" in refusal_in_little_memory(path)


def test_a_record_may_have_so_many_bytes_that_protobuf_needs_no_gigabytes(tmp_path):
    """Two bytes for each of its values, which take 15 times as much memory."""
    payload = b"\x0a\x82\x80\x80\x04" + b"\x0a\x00" * (2**22 + 1)
    path = written(tmp_path / "a.tfrecord", framed(payload))
    assert "record 0: lacks image" in refusal_in_little_memory(path)


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
