"""The checks of a bundle, before anything of it is used: install.sh --dry-run of a bundle with damaged listings.

An input is a manifest.json, with the right checksum; one that begins with a hash is a SHA256SUMS.
"""

import hashlib
import re
import shutil
import subprocess
from pathlib import Path

from .scratch import scratch

_SCRIPTS = Path(__file__).parents[2] / "deploy" / "robot"
_FILES = {"README.md": b"read me\n", "etc/vm.toml": b'model = "model.onnx"\n', "etc/model.onnx": b"a network\n"}
_SAID = re.compile(r"checking .*|note: .*|would install .*")
_REFUSED = re.compile(rb"install\.sh: ")
_SHELL = re.compile(rb"(?m)^(sh|sed|awk|grep|\[|test|printf|cat|df|cd): |install\.sh: (line )?\d+: ")
"""Lines that it prints, the beginning of its refusals, and what the shell and its tools say about a wrong command."""


def _unpacked() -> Path:
    folder = scratch("bundle")
    (folder / "etc").mkdir(parents=True)
    for each in _SCRIPTS.iterdir():
        shutil.copy(each, folder)
    for name, content in _FILES.items():
        (folder / name).write_bytes(content)
    return folder


_FOLDER = _unpacked()


def run(data: bytes) -> None:
    listing = re.match(rb"[0-9a-f]{64}  ", data)
    (_FOLDER / "SHA256SUMS").unlink(missing_ok=True)
    (_FOLDER / "manifest.json").write_bytes(b"{}\n" if listing else data)
    names = sorted(str(each.relative_to(_FOLDER)) for each in _FOLDER.rglob("*") if each.is_file())
    sums = "".join(f"{hashlib.sha256((_FOLDER / each).read_bytes()).hexdigest()}  {each}\n" for each in names)
    (_FOLDER / "SHA256SUMS").write_bytes(data if listing else sums.encode())
    prefix = scratch("prefix")
    command = ["sh", _FOLDER / "install.sh", "--dry-run", "--no-systemd", "--prefix", prefix]
    done = subprocess.run(command, stdin=subprocess.DEVNULL, capture_output=True, check=False)
    assert done.returncode in (0, 1), done
    assert all(map(_SAID.fullmatch, done.stdout.decode("utf-8", "replace").splitlines())), done
    assert _REFUSED.match(done.stderr) if done.returncode else not done.stderr, done
    assert not _SHELL.search(done.stderr), done
    assert not prefix.exists(), done
    assert {each for each in _FOLDER.rglob("*") if each.is_file()} >= {_FOLDER / each for each in names}, done
