"""The scripts replace and remove nothing that they have not made: in a prefix, and in a folder of downloads."""

import json
import os
import platform
import shutil
import subprocess
import sys

import pytest

from tests.folders import contents

from .bundles import CHECKOUT, TARGET, list_again

ROBOT = CHECKOUT / "deploy" / "robot"


def script(path, *options):
    return subprocess.run(["/bin/sh", path, *map(str, options)], capture_output=True, text=True, check=False)


@pytest.fixture
def scripts(tmp_path):
    """The scripts of a bundle, whose listing is right; for a dry run, nothing else is needed."""
    folder = tmp_path / "bundle"
    shutil.copytree(ROBOT, folder)
    python = f"cp{sys.version_info.major}{sys.version_info.minor}"
    manifest = {"release": "1-a", "machine": platform.machine(), "glibc": "2.17", "python": python, "disk_mib": 1}
    (folder / "manifest.json").write_text(json.dumps(manifest, indent=1) + "\n")
    (folder / "SHA256SUMS").touch()
    list_again(folder)
    return folder


NAMES = ("releases", "current", "previous", "trial", "model-signed", "run", "left", "vm-deploy", "supervisor")


@pytest.mark.parametrize("kind", ["file", "folder", "link"])
@pytest.mark.parametrize("name", NAMES)
def test_a_prefix_with_files_of_others_is_refused(name, kind, scripts, tmp_path):
    prefix, path = tmp_path / "prefix", tmp_path / "prefix" / name
    prefix.mkdir()
    if kind == "link":
        path.symlink_to("nowhere")
    else:
        own = path if kind == "file" else path / "right.jpg"
        own.parent.mkdir(exist_ok=True)
        own.write_text("mine")
    before = contents(prefix)
    environment = {**os.environ, "PATH": f"{os.path.dirname(sys.executable)}:{os.environ['PATH']}"}  # noqa: PTH120
    command = ["/bin/sh", scripts / "install.sh", "--prefix", prefix, "--no-systemd", "--dry-run"]
    ran = subprocess.run(command, capture_output=True, text=True, check=False, env=environment)
    assert ran.returncode == 1, ran.stdout
    assert str(path) in ran.stderr
    assert contents(prefix) == before
    path.unlink() if kind != "folder" else shutil.rmtree(path)
    (prefix / "left" / "bundle" / "etc").mkdir(parents=True)
    (prefix / "own.txt").touch()
    ran = subprocess.run(command, capture_output=True, text=True, check=False, env=environment)
    assert ran.returncode == 0, ran.stderr


def test_what_was_removed_already_is_not_removed_again(tmp_path):
    """After uninstall.sh, other programs may use the prefix."""
    prefix = tmp_path / "prefix"
    for name in ("left/etc/vm.toml", "left/bundle/etc/vm.toml", *(f"{each}/own.txt" for each in NAMES[:6])):
        (prefix / name).parent.mkdir(parents=True)
        (prefix / name).write_text(name)
    ran = script(ROBOT / "uninstall.sh", "--prefix", prefix, "--purge")
    assert ran.returncode == 0, ran.stderr
    assert sorted(contents(prefix)) == sorted(f"{each}/own.txt" for each in NAMES[:6])


def test_only_an_installation_is_removed(tmp_path):
    prefix = tmp_path / "prefix"
    for name in ("current/etc/vm.toml", "current/bundle/etc/vm.toml", "run/socket", "own/thesis.txt", "trial"):
        (prefix / name).parent.mkdir(parents=True, exist_ok=True)
        (prefix / name).write_text(name)
    (prefix / "supervisor").write_text("none\n")
    ran = script(ROBOT / "uninstall.sh", "--prefix", prefix, "--purge")
    assert ran.returncode == 0, ran.stderr
    assert contents(prefix) == {"own/thesis.txt": b"own/thesis.txt"}


def download(folder):
    """Download packages into a folder, in vain."""
    command = [sys.executable, CHECKOUT / "deploy" / "bundle.py", "--download", "--wheels", folder, "--target", TARGET]
    environment = {**os.environ, "PIP_NO_INDEX": "1", "PIP_FIND_LINKS": ""}
    ran = subprocess.run(command, capture_output=True, text=True, check=False, env=environment)
    assert ran.returncode == 1, ran.stdout
    return ran.stderr.splitlines()[-1]


def test_a_folder_of_wheels_that_it_has_not_made_is_refused(tmp_path):
    (tmp_path / TARGET).mkdir()
    (tmp_path / TARGET / "own-1.0-py3-none-any.whl").write_text("mine")
    before = contents(tmp_path)
    assert str(tmp_path / TARGET) in download(tmp_path)
    assert contents(tmp_path) == before


@pytest.mark.long
def test_a_download_that_fails_leaves_the_former_one_and_other_folders(tmp_path):
    for name in (f"{TARGET}/lock", f".{TARGET}.part/own.txt"):
        (tmp_path / name).parent.mkdir()
        (tmp_path / name).write_text("former")
    before = contents(tmp_path)
    assert "can't be downloaded" in download(tmp_path)
    assert contents(tmp_path) == before
    assert len(list(tmp_path.iterdir())) == 2
