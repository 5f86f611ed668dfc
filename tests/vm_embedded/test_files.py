"""Files are written beside and renamed, and stay what they are."""

import errno
import io
import os
import socket
import stat
import threading
import time
from pathlib import Path

import pytest

from vm_embedded import InputError
from vm_embedded.files import (
    atomic_write,
    check_writable,
    locked_folder,
    open_regular,
    read_bytes,
    read_pieces,
    read_regular,
    read_text,
    write_file,
)


def write(path, text="new"):
    with atomic_write(path) as part:
        part.write_text(text)


def test_a_file_is_replaced_and_keeps_its_mode(tmp_path):
    path = tmp_path / "a.json"
    path.write_text("old")
    path.chmod(0o640)
    write(path)
    assert path.read_text() == "new"
    assert stat.S_IMODE(path.stat().st_mode) == 0o640
    assert [each.name for each in tmp_path.iterdir()] == ["a.json"]


def test_what_a_link_leads_to_is_replaced_and_not_the_link(tmp_path):
    (tmp_path / "there").mkdir()
    real, link = tmp_path / "there" / "real.json", tmp_path / "link.json"
    real.write_text("old")
    link.symlink_to(real)
    write(link)
    assert link.is_symlink()
    assert real.read_text() == "new"


def test_a_pipe_is_written_to(tmp_path):
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    read = []
    reader = threading.Thread(target=lambda: read.append(pipe.read_text()))
    reader.start()
    write(pipe)
    reader.join(10)
    assert read == ["new"]
    assert stat.S_ISFIFO(pipe.stat().st_mode)


def test_work_that_fails_leaves_the_old_file(tmp_path):
    path = tmp_path / "a.json"
    path.write_text("old")
    with pytest.raises(ZeroDivisionError), atomic_write(path) as part:
        part.write_text(f"half {1 / 0}")
    assert path.read_text() == "old"
    assert [each.name for each in tmp_path.iterdir()] == ["a.json"]


def test_a_read_only_file_is_left_alone(tmp_path, monkeypatch):
    path = tmp_path / "a.json"
    path.write_text("old")
    monkeypatch.setattr(os, "access", lambda path, mode: False)  # root may write everything
    with pytest.raises(InputError, match="read-only"):
        write(path)
    assert path.read_text() == "old"


@pytest.mark.parametrize("name", ["nowhere/a.json", "."])
def test_what_can_not_be_written_is_said_before_the_work_and_after(tmp_path, name):
    with pytest.raises(InputError, match="can't write"):
        check_writable(tmp_path / name)
    with pytest.raises(InputError, match="can't write"):
        write(tmp_path / name)


def test_an_output_that_is_an_input_is_refused_under_every_name(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    given, link, twin = tmp_path / "given.yaml", tmp_path / "link.yaml", tmp_path / "twin.yaml"
    given.write_text("lens")
    link.symlink_to(given)
    twin.hardlink_to(given)
    for output in (given, Path("given.yaml"), tmp_path / ".." / tmp_path.name / "given.yaml", link, twin):
        with pytest.raises(InputError, match=r"(given|link|twin).yaml is an input and would be overwritten; give an"):
            check_writable(output, [None, tmp_path / "missing", given])


def test_an_output_that_replaces_no_input_passes(tmp_path):
    given, other = tmp_path / "given.yaml", tmp_path / "other.yaml"
    given.write_text("lens")
    other.write_text("lens")
    check_writable(other, [None, given, tmp_path])
    check_writable(given)
    check_writable(tmp_path / "new.yaml", iter([given]))
    check_writable(Path(os.devnull), [Path(os.devnull)])


def test_an_output_may_replace_a_link_to_itself(tmp_path):
    path = tmp_path / "a.json"
    path.symlink_to(path)
    check_writable(path)
    write_file(path, "new")
    assert path.read_text() == "new"


@pytest.mark.parametrize(("content", "written"), [("Bäll\n", "Bäll\n".encode()), (b"\x00\xff", b"\x00\xff"), ("", b"")])
def test_a_file_is_written_as_a_whole(tmp_path, content, written):
    path = tmp_path / "file"
    path.write_text("before")
    write_file(path, content)
    assert path.read_bytes() == written
    assert [each.name for each in tmp_path.iterdir()] == ["file"]


def test_a_file_that_can_not_be_written_is_named_and_stays(tmp_path):
    path = tmp_path / "file"
    path.write_text("before")
    with pytest.raises(InputError, match=r"can't write .*file"), atomic_write(path) as part:
        part.unlink()
    assert path.read_text() == "before"


def test_a_text_file_is_read_without_its_byte_order_mark_or_named(tmp_path):
    path = tmp_path / "file"
    with pytest.raises(InputError, match=r"can't read .*file: No such file"):
        read_text(path)
    path.write_text("\ufeffBäll\n", encoding="utf-8")
    assert read_text(path) == "Bäll\n"
    path.write_bytes(b"\xff\xfe")
    with pytest.raises(InputError, match=r"can't read .*file: it is not UTF-8 text"):
        read_text(path)


def test_a_pipe_that_has_only_a_descriptor_is_written():
    """As /dev/stdout in a pipeline, and what bash passes for >(command)."""
    reader, writer = os.pipe()
    path = Path(f"/dev/fd/{writer}")
    check_writable(path)
    write_file(path, "text")
    os.close(writer)
    with os.fdopen(reader) as file:
        assert file.read() == "text"


def no_regular_file(folder, kind):
    path = folder / kind
    if kind == "folder":
        path.mkdir()
    elif kind == "pipe":
        os.mkfifo(path)
    elif kind == "socket":
        with socket.socket(socket.AF_UNIX) as made:
            made.bind(str(path))
    else:
        path.symlink_to("/dev/zero")
    return path


@pytest.mark.parametrize(
    ("kind", "number"),
    [("folder", errno.EISDIR), ("pipe", errno.EINVAL), ("socket", errno.EINVAL), ("device", errno.EINVAL)],
)
def test_only_a_regular_file_is_opened_and_nothing_is_waited_for(tmp_path, kind, number):
    path = no_regular_file(tmp_path, kind)
    for read in (open_regular, read_regular):
        with pytest.raises(OSError, match=kind) as caught:
            read(path)
        assert caught.value.errno == number
    for told in (read_bytes, read_text):
        with pytest.raises(InputError, match=f"can't read thing .*{kind}: "):
            told(path, "thing")


@pytest.mark.parametrize("name", ["zero\0byte", "half\ud800"])
def test_a_name_that_no_file_can_have_is_an_error_of_the_file(tmp_path, name):
    with pytest.raises(OSError, match=r"embedded null|surrogates"):
        open_regular(tmp_path / name)
    with pytest.raises(InputError, match=r"can't read .*(zero|half)"):
        read_bytes(tmp_path / name)


def test_a_file_may_have_as_many_bytes_as_allowed_and_none_more(tmp_path):
    path = tmp_path / "file"
    path.write_bytes(b"12345")
    assert read_regular(path, 5) == read_bytes(path, largest=5) == b"12345"
    with pytest.raises(OSError, match="5 bytes; at most 4") as caught:
        read_regular(path, 4)
    assert caught.value.errno == errno.EFBIG
    with pytest.raises(InputError, match="at most 4 are allowed"):
        read_text(path, largest=4)


def test_a_file_with_a_hole_of_terabytes_is_not_read(tmp_path):
    path = tmp_path / "file"
    with path.open("wb") as file:
        file.truncate(2**42)
    with pytest.raises(InputError, match=f"{2**42} bytes"):
        read_bytes(path)


@pytest.mark.parametrize("count", [0, 1, 2**20, 2**20 + 1, 3 * 2**20 - 1])
def test_a_stream_is_read_to_its_end_or_to_the_limit(count):
    content = bytes(range(256)) * (count // 256 + 1)
    assert read_pieces(io.BytesIO(content[:count]), count) == content[:count]
    endless = open("/dev/zero", "rb")  # noqa: SIM115, PTH123
    with endless, pytest.raises(OSError, match=f"at most {count} bytes") as caught:
        read_pieces(endless, count)
    assert caught.value.errno == errno.EFBIG


@pytest.mark.parametrize("written", [b"a\nb\n", b"a\r\nb\r\n", b"a\rb\r"])
def test_lines_of_a_text_end_with_a_line_feed(tmp_path, written):
    (tmp_path / "file").write_bytes(written)
    assert read_text(tmp_path / "file") == "a\nb\n"


def test_the_lock_of_a_folder_is_that_of_the_folder_that_has_the_name(tmp_path):
    """Another folder may have got the name since the lock was waited for, some time after the first one lost it."""
    folder, names = tmp_path / "folder", []
    folder.mkdir()
    (folder / "old").touch()

    def wait_for_lock():
        with locked_folder(folder, patience=60.0):
            names.append([each.name for each in folder.iterdir()])
            with pytest.raises(BlockingIOError), locked_folder(folder):
                pass

    waiting = threading.Thread(target=wait_for_lock)
    with locked_folder(folder):
        waiting.start()
        time.sleep(0.05)
        folder.rename(tmp_path / "gone")
        time.sleep(0.05)
        folder.mkdir()
        (folder / "new").touch()
    waiting.join()
    assert names == [["new"]]


def test_a_link_to_a_folder_has_no_lock(tmp_path):
    (tmp_path / "link").symlink_to(tmp_path)
    with pytest.raises(NotADirectoryError), locked_folder(tmp_path / "link"):
        pass
