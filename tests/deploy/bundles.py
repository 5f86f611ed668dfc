"""A bundle as `make bundle` writes it, and others that differ from it on purpose."""

import hashlib
import json
import os
import shutil
import subprocess
import sys
import tarfile
from pathlib import Path

import pytest

CHECKOUT = Path(__file__).resolve().parents[2]
TARGET = "linux_x86_64-cp311"
WHEELS = CHECKOUT / "build" / "wheels"


def bundle_command(*options, **more):
    """Run deploy/bundle.py as make does, without a network: what it needs was downloaded before."""
    command = [sys.executable, CHECKOUT / "deploy" / "bundle.py", "--wheels", WHEELS, *map(str, options)]
    return subprocess.run(command, capture_output=True, text=True, **more)


def need_wheels():
    """Skip where `make test` has not downloaded the wheels, or where this Python is not the target's."""
    if not (WHEELS / TARGET / "lock").exists():
        pytest.skip(f"needs the wheels in build/wheels/{TARGET}: make test downloads them")
    if os.uname().machine != "x86_64" or sys.version_info[:2] != (3, 11):
        pytest.skip(f"needs a machine that is {TARGET}")


def unpacked(path, folder):
    """The folder of a bundle."""
    with tarfile.open(path) as tar:
        tar.extractall(folder, filter="data")
    (found,) = Path(folder).iterdir()
    return found


def changed(bundle, folder, release, files=(), **manifest):
    """Another bundle, of another release: some files new, or made anew from their text; its sums are right again."""
    shutil.copytree(bundle, folder, copy_function=os.link)
    for name, content in dict(files).items():
        path = folder / name
        if callable(content):
            content = content(path.read_text())
        path.unlink(missing_ok=True)
        path.write_bytes(content if isinstance(content, bytes) else content.encode())
    entries = json.loads((folder / "manifest.json").read_text()) | {"release": release} | manifest
    (folder / "manifest.json").unlink()
    (folder / "manifest.json").write_text(json.dumps(entries, indent=1) + "\n")
    list_again(folder)
    return folder


def list_again(folder):
    """Make the sums of a changed bundle right again, as anybody could."""
    names = {str(each.relative_to(folder)) for each in folder.rglob("*") if each.is_file()}
    names = sorted(names - {"SHA256SUMS", "SHA256SUMS.sig"})
    sums = "".join(f"{hashlib.sha256((folder / each).read_bytes()).hexdigest()}  {each}\n" for each in names)
    (folder / "SHA256SUMS").unlink()
    (folder / "SHA256SUMS").write_text(sums)


def signed(folder, key):
    """Sign a bundle's listing; return the bundle."""
    beside = folder / "SHA256SUMS.sig"
    beside.unlink(missing_ok=True)
    command = ["ssh-keygen", "-q", "-Y", "sign", "-f", key, "-n", "vm-embedded-bundle", folder / "SHA256SUMS"]
    subprocess.run(command, check=True, capture_output=True)
    return folder


def packed(folder):
    """The bundle file of a folder."""
    path = folder.with_name(folder.name + ".tar.gz")
    with tarfile.open(path, "w:gz", compresslevel=1) as tar:
        tar.add(folder, folder.name)
    return path
