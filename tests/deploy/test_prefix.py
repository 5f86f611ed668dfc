"""The real bundle under a prefix, without network and systemd: installed, run, upgraded, and upgraded badly."""

import os
import re
import signal
import socket
import subprocess
import time
from contextlib import contextmanager

import pytest

from tests.messages import read_message

from .bundles import CHECKOUT, changed
from .prefixes import Prefix

pytestmark = pytest.mark.long

LARGEST = 301
"""Of the installation [MiB]."""


@pytest.fixture(scope="module")
def prefix(bundle, alone, tmp_path_factory):
    found = Prefix(tmp_path_factory.mktemp("robot") / "prefix", alone)
    first = changed(bundle, tmp_path_factory.mktemp("bundles") / "first", "1-first")
    ran = found.install(first)
    assert ran.returncode == 0, ran.stdout + ran.stderr
    return found


@pytest.fixture(autouse=True, scope="module")
def _installed(prefix):
    return prefix


def test_a_dry_run_changes_nothing(bundle, alone, tmp_path):
    other = Prefix(tmp_path / "prefix", alone)
    ran = other.install(bundle, "--dry-run")
    assert ran.returncode == 0, ran.stderr
    assert "would install" in ran.stdout
    assert not other.path.exists()


def test_it_is_small_and_has_neither_torch_nor_onnx(prefix):
    size = subprocess.run(["du", "-sk", prefix.path], capture_output=True, text=True, check=True).stdout.split()[0]
    assert int(size) / 1024 < LARGEST
    packages = {each.name for each in (prefix.path / "current/venv/lib/python3.11/site-packages").iterdir()}
    assert {"numpy", "onnxruntime", "cv2", "vm_embedded"} <= packages
    assert not {"torch", "onnx", "pip", "installer", "setuptools"} & packages


@pytest.mark.parametrize("program", ["vm-detect", "vm-bench"])
def test_a_network_that_is_not_installed_is_one_line(prefix, program):
    words = ["tests/fixtures/demo/image0000002.jpg"] if program == "vm-detect" else []
    command = [prefix.path / "current/venv/bin" / program, *words]
    ran = subprocess.run(command, cwd=CHECKOUT, capture_output=True, text=True, timeout=60)
    assert ran.returncode == 1
    assert ran.stderr.startswith(f"{program}: network ball is not installed")
    assert ran.stderr.count("\n") == 1


def test_it_runs_as_systemd_runs_it(prefix, tmp_path):
    """READY, WATCHDOG and detections, told to a socket as systemd has it."""
    told = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
    told.bind(str(tmp_path / "notify"))
    told.settimeout(60.0)
    environment = os.environ | {
        "NOTIFY_SOCKET": str(tmp_path / "notify"),
        "WATCHDOG_USEC": "2000000",
        "RUNTIME_DIRECTORY": str(tmp_path),
    }
    environment.pop("PYTHONPATH", None)
    program, configuration = prefix.path / "current/venv/bin/vm-detect", prefix.path / "current/etc/vm.toml"
    command = [program, "--config", configuration, "--output-unix", "", "--output-stdout"]
    command = [str(each) for each in command]
    with subprocess.Popen(command, env=environment, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL) as process:
        try:
            heard = []
            while not {"READY=1", "WATCHDOG=1", "STATUS=ok"} <= set(heard):
                heard += told.recv(4096).decode().split("\n")
            lines = (read_message(line) for line in process.stdout)
            found = next(line for line in lines if line.get("detections"))
            assert found["detections"][0]["class"] == "ball"
            process.send_signal(signal.SIGTERM)
            process.stdout.read()
            assert process.wait(10.0) == 0
        finally:
            process.kill()
            told.close()


@contextmanager
def started(command):
    """A detector that a printed command starts; stopped at the end."""
    with subprocess.Popen(command, shell=True, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True) as process:
        try:
            yield process
        finally:
            process.send_signal(signal.SIGTERM)
            process.stderr.read()
            assert process.wait(10.0) == 0


def test_without_systemd_it_says_how_to_start_it_and_when_to_restart_it(bundle, tmp_path):
    """As a user types it: no command before it cuts it off from this machine, where the detector runs."""
    here = Prefix(tmp_path / "prefix", [])
    said = here.install(changed(bundle, tmp_path / "a", "1-a")).stdout
    (command,) = re.findall(r"start the detector with (.* run)$", said, re.MULTILINE)
    assert f"status socket: {here.path}/run/vm-detect.sock" in said
    assert "no lens is configured" not in said
    stopped = here.deploy("status")
    assert f"start the detector with {command}" in stopped.stdout
    assert stopped.returncode == 1
    model = here.path / "current" / "etc" / "model.onnx"
    with started(f"exec {command}"):
        deadline = time.monotonic() + 60.0
        while (seen := here.deploy("status")).returncode:
            assert time.monotonic() < deadline
        assert "detector  ok" in seen.stdout
        with socket.socket(socket.AF_UNIX) as reader:
            reader.connect(str(here.path / "run" / "lines.sock"))
            assert read_message(reader.makefile().readline())["state"] == "ok"
        restart = f"stop it, and start it again with {command}"
        assert restart in here.deploy("model", model).stdout
        assert restart in here.install(changed(bundle, tmp_path / "b", "2-b")).stdout
        assert restart in here.deploy("rollback").stdout
    assert "detector  no reply" in here.deploy("status").stdout
    taken = subprocess.run(f"{command} --output-unix /nowhere/lines.sock", shell=True, capture_output=True, text=True)
    assert taken.returncode == 78
    assert "/nowhere/lines.sock" in taken.stderr
    assert "--output-unix" in taken.stderr


def test_an_upgrade_keeps_what_the_robot_has_changed_and_goes_back(prefix, bundle, tmp_path):
    used = prefix.path / "current" / "etc" / "vm.toml"
    used.write_text(used.read_text().replace("threshold = 0.5", "threshold = 0.6"))
    began = time.monotonic()
    ran = prefix.install(changed(bundle, tmp_path / "second", "2-second"))
    assert ran.returncode == 0, ran.stderr
    print(f"an upgrade that shares its packages: {time.monotonic() - began:.1f} s")
    assert (prefix.link("current"), prefix.link("previous")) == ("2-second", "1-first")
    assert "threshold = 0.6" in used.read_text()
    assert "2-second is already in use" in prefix.install(tmp_path / "second").stdout

    theirs = {"etc/vm.toml": lambda text: text.replace("threshold = 0.5", "threshold = 0.7")}
    ran = prefix.install(changed(bundle, tmp_path / "third", "3-third", theirs))
    assert ran.returncode == 0, ran.stderr
    assert "threshold = 0.7" in used.read_text()
    assert "threshold = 0.6" in (used.parent / "vm.toml.of-3-third").read_text()
    assert prefix.releases() == {"2-second", "3-third"}

    assert prefix.deploy("rollback").returncode == 0
    assert (prefix.link("current"), prefix.link("previous")) == ("2-second", "3-third")
    assert "threshold = 0.6" in used.read_text()
    said = prefix.deploy("status").stdout
    assert "current   2-second" in said
    assert "previous  3-third" in said


@pytest.mark.parametrize(
    ("files", "manifest", "words"),
    [
        ({"etc/vm.toml": lambda text: text.replace("threshold", "treshold")}, {}, ["treshold", "threshold"]),
        ({"etc/model.onnx": b"no network"}, {}, ["model.onnx"]),
        ({}, {"machine": "aarch64"}, ["aarch64", "x86_64", "TARGET="]),
        ({}, {"python": "cp399"}, ["Python 3.99"]),
        ({}, {"glibc": "9.99"}, ["glibc 9.99"]),
        ({"wheels/numpy-1.0-py3-none-any.whl": b""}, {}, ["can't unpack", "not a zip file"]),
        ({"wheels/numpy-1.0-py3-none-any.whl": b""}, {"disk_mib": "99999999"}, ["MiB left", "99999999"]),
    ],
    ids=["configuration", "model", "machine", "python", "glibc", "wheel", "disk"],
)
def test_a_bad_upgrade_changes_nothing(prefix, bundle, tmp_path, files, manifest, words):
    before = prefix.link("current"), prefix.link("previous"), prefix.releases()
    ran = prefix.install(changed(bundle, tmp_path / "bad", "9-bad", files, **manifest))
    assert ran.returncode == 1, ran.stdout
    for word in words:
        assert word in ran.stderr, ran.stderr
    assert before == (prefix.link("current"), prefix.link("previous"), prefix.releases())
    assert not (prefix.path / "trial").exists()


def test_a_damaged_bundle_is_noticed_before_anything_else(prefix, bundle, tmp_path):
    damaged = changed(bundle, tmp_path / "damaged", "9-damaged")
    (wheel,) = damaged.glob("wheels/numpy-*.whl")
    content = bytearray(wheel.read_bytes())
    content[len(content) // 2] ^= 1
    wheel.unlink()
    wheel.write_bytes(content)
    ran = prefix.install(damaged)
    assert ran.returncode == 1
    assert "damaged" in ran.stderr
    assert "numpy" in ran.stderr + ran.stdout


def test_only_one_is_at_work_at_a_time(prefix, bundle, tmp_path):
    with subprocess.Popen(["flock", prefix.path / ".lock", "sleep", "60"]) as holder:
        while subprocess.run(["flock", "-n", prefix.path / ".lock", "true"]).returncode == 0:
            time.sleep(0.01)
        try:
            ran = prefix.install(changed(bundle, tmp_path / "other", "9-other"))
        finally:
            subprocess.run(["pkill", "-P", str(holder.pid)])
            holder.kill()
    assert ran.returncode == 1
    assert "is running" in ran.stderr


@pytest.mark.parametrize("path", ["relative", "/a b", "", "/", "//"])
def test_a_prefix_must_be_a_plain_path(bundle, path):
    ran = subprocess.run([bundle / "install.sh", "--no-systemd", "--prefix", path], capture_output=True, text=True)
    assert ran.returncode == 2
    assert "--prefix must be" in ran.stderr


def test_a_folder_of_releases_that_is_not_ours_is_left_alone(bundle, tmp_path):
    theirs = tmp_path / "theirs" / "releases" / "thesis.txt"
    theirs.parent.mkdir(parents=True)
    theirs.write_text("years of work")
    inside = changed(bundle, theirs.parent / "bundle", "1-bundle")
    for command in ([inside / "uninstall.sh"], [inside / "uninstall.sh", "--prefix", theirs.parents[1], "--purge"]):
        ran = subprocess.run(command, capture_output=True, text=True)
        assert ran.returncode == 1
        assert "nothing is installed" in ran.stderr
    ran = subprocess.run([bundle / "install.sh", "--no-systemd", "--prefix", theirs.parents[1]], capture_output=True)
    assert ran.returncode == 1
    assert theirs.read_text() == "years of work"


def test_files_that_are_not_of_the_bundle_are_noticed(prefix, bundle, tmp_path):
    (changed(bundle, tmp_path / "other", "9-other") / "etc" / "left-lens.yaml").write_text("")
    ran = prefix.install(tmp_path / "other")
    assert ran.returncode == 1
    assert "not part of it" in ran.stderr


def test_unknown_words_are_wrong_usage(prefix, bundle):
    assert subprocess.run([bundle / "install.sh", "--frobnicate"], capture_output=True).returncode == 2
    assert prefix.deploy("frobnicate").returncode == 2
    assert prefix.deploy().returncode == 2


def test_everybody_reads_what_only_root_changes(bundle, alone, tmp_path):
    other = Prefix(tmp_path / "prefix", [])
    careful = changed(bundle, tmp_path / "careful", "1-careful")
    for each in careful.rglob("*"):
        if "wheels" not in str(each):
            each.chmod(0o700 if each.is_dir() else each.stat().st_mode & 0o700 | 0o020)
    assert other.install(careful).returncode == 0
    for each in (other.path / "current").resolve().rglob("*"):
        if "venv" not in str(each):
            mode = each.stat().st_mode
            assert mode & 0o022 == 0, each
            assert mode & 0o004, each
    assert (other.path / ".lock").stat().st_mode & 0o077 == 0


def test_removed_it_leaves_its_configuration_for_the_next(bundle, alone, tmp_path):
    other = Prefix(tmp_path / "prefix", alone)
    assert other.install(changed(bundle, tmp_path / "a", "1-a")).returncode == 0
    used = other.path / "current/etc/vm.toml"
    used.write_text(used.read_text().replace("threshold = 0.5", "threshold = 0.6"))
    uninstall = [other.path / "current/bundle/uninstall.sh"]
    assert subprocess.run(uninstall, capture_output=True).returncode == 0
    assert {each.name for each in other.path.iterdir()} <= {"left", ".lock"}
    assert other.install(changed(bundle, tmp_path / "b", "2-b")).returncode == 0
    assert "threshold = 0.6" in used.read_text()
    assert subprocess.run([*uninstall, "--purge"], capture_output=True).returncode == 0
    assert not other.path.exists()
