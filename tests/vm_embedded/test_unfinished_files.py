"""A file or folder is written under a name of its own. So nothing else is touched, and nothing else matters."""

import signal
import stat
import subprocess
import sys
from pathlib import Path

import pytest

from vm_embedded import InputError
from vm_embedded.files import atomic_folder, atomic_write, write_file


@pytest.mark.parametrize("make", [Path.mkdir, Path.touch, lambda path: path.symlink_to("nowhere")])
def test_things_of_similar_names_stay_and_do_not_matter(tmp_path, make):
    path, names = tmp_path / "file.txt", ("file.txt.part", ".file.txt.part", "file.part.txt", "file.part")
    for name in names:
        make(tmp_path / name)
    before = {name: (tmp_path / name).lstat() for name in names}
    write_file(path, "new")
    with atomic_folder(tmp_path / "file"):
        pass
    assert {name: (tmp_path / name).lstat() for name in names} == before
    assert {each.name for each in tmp_path.iterdir()} == {*names, "file.txt", "file"}


@pytest.mark.parametrize(
    "name", ["n" * 255, "\N{GRINNING FACE}" * 63, "\udcff" * 255], ids=["letters", "wide", "bytes"]
)
def test_the_longest_name_can_be_written(tmp_path, name):
    write_file(tmp_path / name, "new")
    assert (tmp_path / name).read_text() == "new"
    (tmp_path / name).unlink()
    with atomic_folder(tmp_path / name):
        pass
    assert [each.name for each in tmp_path.iterdir()] == [name]


def test_of_two_that_write_one_file_at_once_the_last_one_stays(tmp_path):
    path = tmp_path / "file"
    with atomic_write(path) as first, atomic_write(path) as second:
        assert first != second
        first.write_text("first")
        second.write_text("second")
    assert path.read_text() == "first"
    assert [each.name for each in tmp_path.iterdir()] == ["file"]


def test_a_killed_run_leaves_a_name_that_says_what_it_is(tmp_path):
    code = (
        "import os, signal, sys; from pathlib import Path; from vm_embedded.files import atomic_write\n"
        "with atomic_write(Path(sys.argv[1])) as part: part.write_text('half'); os.kill(os.getpid(), signal.SIGKILL)"
    )
    for _ in range(2):
        done = subprocess.run([sys.executable, "-c", code, tmp_path / "file"], check=False)
        assert done.returncode == -signal.SIGKILL
    left = {each.name for each in tmp_path.iterdir()}
    assert len(left) == 2
    assert all(name.startswith(".file.") and name.endswith(".part") for name in left)
    write_file(tmp_path / "file", "new")
    assert {each.name for each in tmp_path.iterdir()} == {*left, "file"}


def test_a_folder_gets_its_name_when_it_is_complete(tmp_path):
    path = tmp_path / "parent" / "folder"
    with atomic_folder(path) as part:
        (part / "file").touch()
        assert not path.exists()
    assert [each.name for each in path.iterdir()] == ["file"]
    assert [each.name for each in path.parent.iterdir()] == ["folder"]


def test_an_empty_folder_is_replaced_and_keeps_its_mode_and_its_link(tmp_path):
    folder, link = tmp_path / "folder", tmp_path / "link"
    folder.mkdir(mode=0o700)
    link.symlink_to(folder)
    with atomic_folder(link) as part:
        (part / "file").touch()
    assert link.is_symlink()
    assert [each.name for each in folder.iterdir()] == ["file"]
    assert stat.S_IMODE(folder.stat().st_mode) == 0o700


def test_the_current_folder_gets_the_content_because_a_shell_would_stay_in_a_replaced_one(tmp_path, monkeypatch):
    folder = tmp_path / "here"
    folder.mkdir()
    monkeypatch.chdir(folder)
    before = folder.stat().st_ino
    with atomic_folder(Path()) as part:
        (part / "within").mkdir()
        (part / "within" / "file").write_text("whole")
        assert not list(folder.iterdir())
    assert folder.stat().st_ino == before
    assert (folder / "within" / "file").read_text() == "whole"
    with pytest.raises(InputError, match=r"can't write \."), atomic_folder(Path()) as part:
        (part / "other").touch()
    assert [each.name for each in folder.iterdir()] == ["within"]
    assert [each.name for each in tmp_path.iterdir()] == ["here"]


@pytest.mark.parametrize("fill", [lambda path: (path / "own").touch(), lambda path: (path.rmdir(), path.touch())])
def test_what_has_the_name_of_a_folder_stays(tmp_path, fill):
    path = tmp_path / "folder"

    def write_folder():
        with atomic_folder(path) as part:
            (part / "file").touch()
            path.mkdir()  # meanwhile
            fill(path)

    with pytest.raises(InputError, match=r"can't write .*folder"):
        write_folder()
    assert path.is_file() or [each.name for each in path.iterdir()] == ["own"]
    assert [each.name for each in tmp_path.iterdir()] == ["folder"]


def test_work_that_fails_leaves_no_folder(tmp_path):
    with pytest.raises(ZeroDivisionError), atomic_folder(tmp_path / "folder") as part:
        (part / "file").write_text(f"half {1 / 0}")
    assert not list(tmp_path.iterdir())
