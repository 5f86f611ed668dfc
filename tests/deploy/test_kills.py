"""kill -9 at random moments of installations, upgrades, model swaps and rollbacks: a detector works every time."""

import hashlib
import os
import random
import shutil
import signal
import subprocess
import time
from pathlib import Path

import pytest

from tests.messages import read_message
from tests.other_model import OTHER

from .bundles import CHECKOUT, changed
from .prefixes import Prefix

pytestmark = pytest.mark.long

SEED = 29
KILLS = {"install": 20, "upgrade": 60, "model": 60, "rollback": 60}
"""Numbers of kills before the command has ended by itself."""

MODELS = [CHECKOUT / "vm_embedded" / "models" / "ball.onnx", OTHER]


class Killed:
    """Commands on a prefix, of which any may be killed."""

    def __init__(self, bundle, folder):
        self.prefix = Prefix(folder / "prefix", [])
        self.bundles = [changed(bundle, folder / name, name) for name in ("1-first", "2-second")]

    def command(self, kind):
        """The command of a kind that changes something now."""
        if kind == "model":
            used = (self.prefix.path / "current" / "etc" / "model.onnx").read_bytes()
            return [self.prefix.path / "vm-deploy", "model", MODELS[used == MODELS[0].read_bytes()]]
        if kind == "rollback":
            return [self.prefix.path / "vm-deploy", "rollback"]
        installed = (self.prefix.path / "current").exists() and self.prefix.link("current").startswith("1-first")
        return self.prefix.installing(self.bundles[installed])

    def prepare(self, kind):
        """Bring the prefix into a state in which a command of this kind has something to do."""
        if kind == "install":
            shutil.rmtree(self.prefix.path, ignore_errors=True)
        elif not (self.prefix.path / "current").exists():
            self.done("upgrade")
        if kind == "rollback" and not (self.prefix.path / "previous").exists():
            self.done("upgrade")

    def done(self, kind):
        """Run a command to its end; return how long it took [s]."""
        began = time.monotonic()
        ran = subprocess.run(self.command(kind), capture_output=True, text=True, timeout=300)
        assert ran.returncode == 0, ran.stdout + ran.stderr
        return time.monotonic() - began

    def killed(self, kind, seconds, everything):
        """Run a command and kill it after a time: the script alone, or also all that it has started."""
        with subprocess.Popen(
            self.command(kind), stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, start_new_session=True
        ) as process:
            time.sleep(seconds)
            (os.killpg if everything else os.kill)(process.pid, signal.SIGKILL)
        if process.returncode == 0:
            return False
        # What the script has started may still be at work: it holds the lock.
        if (self.prefix.path / ".lock").exists():
            subprocess.run(["flock", self.prefix.path / ".lock", "true"], check=True, timeout=120)
        return True

    def check(self):
        """The release in use is complete, its model is one of both, and its detector finds the ball."""
        current = self.prefix.path / "current"
        assert (current / "complete").exists()
        assert hashlib.sha256((current / "etc" / "model.onnx").read_bytes()).digest() in [
            hashlib.sha256(each.read_bytes()).digest() for each in MODELS
        ]
        line = [self.prefix.path / "vm-deploy", "run", "--output-stdout"]
        with subprocess.Popen(line, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
            try:
                lines = (read_message(each) for each in process.stdout)
                found = next((each for each in lines if each.get("detections")), None)
                process.terminate()
                _, log = process.communicate(timeout=60)
            finally:
                process.kill()
        assert found is not None, log
        assert process.returncode == 0, log


def test_killed_at_random_moments_a_detector_works_every_time(bundle, tmp_path):
    victim, chance = Killed(bundle, tmp_path), random.Random(SEED)
    took = {}
    for kind in KILLS:
        victim.prepare(kind)
        took[kind] = victim.done(kind)
    killed = dict.fromkeys(KILLS, 0)
    began = time.monotonic()
    while killed != KILLS:
        kind = chance.choice([each for each, count in killed.items() if count < KILLS[each]])
        victim.prepare(kind)
        killed[kind] += victim.killed(kind, chance.uniform(0.0, took[kind]), everything=chance.random() < 0.5)
        if kind == "install" and not (victim.prefix.path / "current").exists():
            victim.done("install")  # nothing worked before, so nothing may work after the kill, but the next time
        victim.check()
    print(f"killed in {time.monotonic() - began:.0f} s; uninterrupted they take {took} s")
    victim.done("upgrade")
    victim.check()
    left = {each.name for each in Path(victim.prefix.path).iterdir()}
    assert left <= {"current", "previous", "releases", "supervisor", "vm-deploy", ".lock", "run"}
