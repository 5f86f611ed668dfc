"""A robot without internet: a real Debian with a real systemd, this machine's own, of which nothing is changed.

The root of this machine lies under a layer in memory, systemd-nspawn starts its systemd in that, with no network but
its own loopback, and commands enter its namespaces.
"""

import os
import shutil
import signal
import subprocess
import time
from contextlib import contextmanager
from pathlib import Path

import pytest

ENVIRONMENT = {"PATH": "/usr/local/sbin:/usr/local/bin:/usr/sbin:/usr/bin:/sbin:/bin", "HOME": "/root", "LC_ALL": "C"}
SIZE_MIB = 3000
"""Memory for what the robot writes."""


class Robot:
    """A running one. root: its files, as they are seen from here."""

    def __init__(self, leader, root):
        self._leader, self.root = leader, root

    @property
    def entering(self):
        """Words before a command that is to run in it."""
        into = ["--mount", "--uts", "--ipc", "--net", "--pid", "--cgroup"]
        return ["nsenter", "--target", str(self._leader), *into, "--"]

    def start(self, *words):
        """A command in it, begun."""
        pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.STDOUT, "stdin": subprocess.DEVNULL}
        return subprocess.Popen([*self.entering, *map(str, words)], env=ENVIRONMENT, text=True, **pipes)

    def run(self, *words, check=True, seconds=300.0):
        """A command in it, done: what it said, status first."""
        with self.start(*words) as process:
            try:
                said = process.communicate(timeout=seconds)[0]
            finally:
                process.kill()
        assert process.returncode == 0 or not check, said
        return process.returncode, said


@contextmanager
def booted(folder):
    """A robot that lives as long as the block; skips where there can't be one."""
    for tool in ("systemd-nspawn", "nsenter", "mount"):
        if shutil.which(tool) is None:
            pytest.skip(f"needs {tool}")
    if os.geteuid() != 0 or not Path("/lib/systemd/systemd").exists():
        pytest.skip("needs root, and systemd")
    memory = folder / "robot"
    memory.mkdir()
    with _mounted("-t", "tmpfs", "-o", f"size={SIZE_MIB}m", "tmpfs", memory):
        for each in ("changes", "work", "root"):
            (memory / each).mkdir()
        root = memory / "root"
        layers = f"lowerdir=/,upperdir={memory / 'changes'},workdir={memory / 'work'}"
        with _mounted("-t", "overlay", "-o", layers, "overlay", root), _running(root, memory / "boot.log") as leader:
            robot = Robot(leader, root)
            deadline = time.monotonic() + 60.0
            while robot.run("systemctl", "is-active", "--quiet", "basic.target", check=False)[0]:
                assert time.monotonic() < deadline, (memory / "boot.log").read_text()
                time.sleep(0.2)
            yield robot


@contextmanager
def _mounted(*words):
    ran = subprocess.run(["mount", *map(str, words)], capture_output=True, text=True)
    if ran.returncode:
        pytest.skip(f"can't mount: {ran.stderr.strip()}")
    try:
        yield
    finally:
        subprocess.run(["umount", "--lazy", words[-1]], check=True)


@contextmanager
def _running(root, log):
    """systemd in it, and its process as it is seen from here."""
    words = ["--quiet", "--private-network", "--register=no", "--keep-unit", "--machine=robot", "--boot"]
    command = ["systemd-nspawn", f"--directory={root}", *words, "systemd.unit=basic.target", "systemd.show_status=no"]
    with log.open("w") as written:
        process = subprocess.Popen(
            command, stdin=subprocess.DEVNULL, stdout=written, stderr=subprocess.STDOUT, start_new_session=True
        )
    leaders = []
    try:
        deadline = time.monotonic() + 30.0
        children = Path(f"/proc/{process.pid}/task/{process.pid}/children")
        while not (leaders := [each for each in children.read_text().split() if _is_systemd(each)]):
            if process.poll() is not None or time.monotonic() > deadline:
                pytest.skip(f"systemd-nspawn does not run here: {log.read_text()[-500:]}")
            time.sleep(0.05)
        yield int(leaders[0])
    finally:
        for each in leaders:  # with the first of its processes all others of the robot end
            os.kill(int(each), signal.SIGKILL)
        process.kill()
        process.wait()


def _is_systemd(pid):
    """Whether a child of systemd-nspawn is the robot's systemd, not the helper that prepares its root."""
    try:
        return Path(f"/proc/{pid}/comm").read_text().strip() == "systemd"
    except OSError:
        return False
