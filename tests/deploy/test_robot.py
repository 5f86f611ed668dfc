"""The real bundle on a robot with systemd and no network: installed, watched, upgraded well and badly.

After each bad upgrade, and each kill, the release that runs must be whole and well.
"""

import os
import random
import re
import shutil
import subprocess
import time

import pytest

from tests.messages import read_message
from tests.other_model import OTHER

from .bundles import CHECKOUT, changed
from .robots import booted

pytestmark = pytest.mark.long

CURRENT = "/opt/vm-embedded/current"
DEPLOY = "/usr/local/bin/vm-deploy"
READER = """
import socket
lines = socket.socket(socket.AF_UNIX)
lines.connect("/run/vm-detect/lines.sock")
print(lines.makefile().readline())
"""
WELL = re.compile("^detector  (ok|degraded)", re.MULTILINE)
"""It runs. A frame that came late shows for half a second."""

IMPATIENT = ("healthy_s = 30", "healthy_s = 8")


class Team:
    """Who brings bundles to a robot."""

    def __init__(self, robot, bundle, folder):
        self.robot, self._bundle, self._folder = robot, bundle, folder

    def bring(self, release, files=(), **manifest):
        """A bundle on the robot, and the command that installs it."""
        folder = changed(self._bundle, self._folder / release, release, files, **manifest)
        there = self.robot.root / "var/tmp" / release
        subprocess.run(["cp", "-r", folder, there], check=True)
        return "/bin/sh", f"/var/tmp/{release}/install.sh"

    def install_until(self, step, *install, signal="KILL"):
        """Run install.sh, and end it when it says that it comes to a step."""
        with self.robot.start("sh", "-c", 'echo $$; exec "$@"', "sh", *install) as process:
            number = process.stdout.readline().strip()
            for line in process.stdout:
                if line.startswith(step):
                    break
            else:
                pytest.fail(f"it never came to {step}")
            self.robot.run("kill", f"-{signal}", number)
            process.stdout.read()
            process.wait()

    def configured(self, *changes):
        """vm.toml with some text replaced."""
        text = (self._bundle / "etc" / "vm.toml").read_text()
        for old, new in changes:
            assert old in text
            text = text.replace(old, new)
        return {"etc/vm.toml": text}

    def link(self, name):
        return (self.robot.root / "opt/vm-embedded" / name).readlink().name

    def status(self):
        """What the detector says of itself, or nothing."""
        command = [f"{CURRENT}/venv/bin/vm-detect", "--status", "--status-socket", "/run/vm-detect/vm-detect.sock"]
        _, said = self.robot.run(*command, check=False)
        return read_message(said) if said.startswith("{") else {"state": said}

    def check(self, *releases):
        """One of these releases is current and whole, and one of them runs and is well."""
        current = self.link("current")
        assert current in releases
        assert (self.robot.root / "opt/vm-embedded/releases" / current / "complete").exists()
        deadline = time.monotonic() + 60.0
        while (found := self.status())["state"] != "ok":
            assert time.monotonic() < deadline, (found, self.journal())
            time.sleep(0.3)
        assert self.robot.run("systemctl", "is-active", "vm-detect.service")[1].strip() == "active"
        running = self.own("cmdline")
        assert any(f"/releases/{each}/" in running for each in releases)
        return current

    def own(self, name):
        """What the kernel knows of the detector's process."""
        return self.robot.run("sh", "-c", f"cat /proc/$(systemctl show -P MainPID vm-detect)/{name}")[1]

    def journal(self):
        return self.robot.run("journalctl", "--unit", "vm-detect", "--lines", "15", "--no-pager", check=False)[1]


@pytest.fixture(scope="module")
def team(bundle, tmp_path_factory):
    folder = tmp_path_factory.mktemp("robot")
    with booted(folder) as robot:
        found = Team(robot, bundle, folder)
        assert robot.run("ip", "route")[1] == ""
        began = time.monotonic()
        robot.run(*found.bring("1-first"))
        print(f"installed in {time.monotonic() - began:.1f} s")
        yield found


def test_it_is_watched_and_says_what_it_sees(team):
    team.check("1-first")
    _, line = team.robot.run("python3", "-c", READER)
    assert read_message(line)["type"] in ("frame", "state")
    deadline = time.monotonic() + 30.0
    while not (team.status().get("last") or {}).get("detections"):
        assert time.monotonic() < deadline
    properties = team.robot.run("systemctl", "show", "vm-detect", "-p", "Type,WatchdogUSec,StatusText,NRestarts")[1]
    assert "Type=notify" in properties
    assert "WatchdogUSec=10s" in properties
    assert "StatusText=ok" in properties
    assert team.robot.run("systemctl", "is-enabled", "vm-detect")[1].strip() == "enabled"
    assert '"event": "ready"' in team.journal()


def test_it_listens_on_no_network_and_is_nobody(team):
    assert not team.robot.run("ss", "--listening", "--no-header", "--tcp", "--udp")[1]
    fields = dict(line.split(":\t", 1) for line in team.own("status").splitlines() if ":\t" in line)
    assert fields["Uid"].split()[0] != "0"
    assert int(fields["CapEff"], 16) == 0
    assert fields["NoNewPrivs"] == "1"
    assert int(fields["VmRSS"].split()[0]) < 200 * 1024


def test_one_that_hangs_is_started_again(team):
    team.check("1-first")
    team.robot.run("systemctl", "kill", "--kill-whom=main", "--signal", "STOP", "vm-detect")
    deadline = time.monotonic() + 60.0
    while "NRestarts=0" in team.robot.run("systemctl", "show", "vm-detect", "-p", "NRestarts")[1]:
        assert time.monotonic() < deadline
        time.sleep(0.5)
    team.check("1-first")


def test_upgraded_and_back(team):
    _, said = team.robot.run(*team.bring("2-second"))
    assert "2-second is in use" in said
    team.check("2-second")
    team.robot.run(DEPLOY, "rollback")
    team.check("1-first")
    _, said = team.robot.run(DEPLOY, "status")
    assert "current   1-first" in said
    assert "previous  2-second" in said
    assert WELL.search(said)


BLIND = [
    ('source = "synthetic"', 'source = "/dev/video99"'),
    ('# lens = "lens.yaml"', 'lens = { projection = "rectilinear", focal_length = 500.0, fov = 2.0 }'),
    ("# height =", "height = 0.8"),
    IMPATIENT,
]


@pytest.mark.parametrize(
    ("release", "changes", "words"),
    [
        ("8-blind", BLIND, ["camera_lost", "rolling back to 1-first"]),
        (
            "8-slow",
            [("budget_ms = 0", "budget_ms = 0.01"), IMPATIENT],
            ["degraded", "budget", "rolling back to 1-first"],
        ),
        ("8-typo", [("fps = 0", "fsp = 0")], ["fsp", "nothing has changed"]),
    ],
)
def test_a_configuration_that_does_no_good_is_taken_back(team, release, changes, words):
    team.check("1-first")
    status, said = team.robot.run(*team.bring(release, team.configured(*changes)), check=False)
    assert status == 1
    for word in words:
        assert word in said, said
    team.check("1-first")
    assert team.link("previous") == "2-second"
    assert sorted(os.listdir(team.robot.root / "opt/vm-embedded/releases")) == ["1-first", "2-second"]  # noqa: PTH208


def test_a_model_that_is_none_changes_nothing(team):
    status, said = team.robot.run(*team.bring("7-model", {"etc/model.onnx": b"\0" * 5000}), check=False)
    assert status == 1
    assert "nothing has changed" in said
    team.check("1-first")


def test_another_machine_is_refused(team):
    status, said = team.robot.run(*team.bring("7-machine", machine="aarch64"), check=False)
    assert status == 1
    assert "aarch64" in said
    team.check("1-first")


def test_a_damaged_wheel_changes_nothing(team):
    install = team.bring("7-damaged")
    (wheel,) = (team.robot.root / "var/tmp/7-damaged/wheels").glob("numpy-*.whl")
    with wheel.open("r+b") as file:
        file.seek(wheel.stat().st_size // 2)
        file.write(b"damaged")
    status, said = team.robot.run(*install, check=False)
    assert status == 1
    assert "the bundle is damaged" in said
    assert wheel.name in said
    team.check("1-first")


def test_a_disk_that_fills_changes_nothing(team):
    memory = str(team.robot.root.parent)
    another = {"wheels/zip-1.0-py3-none-any.whl": b""}  # so that it shares no packages with the release in use
    install = team.bring("7-disk", another, disk_mib="1")
    used = int(subprocess.run(["df", "-Pm", memory], capture_output=True, text=True).stdout.split("\n")[1].split()[2])
    subprocess.run(["mount", "-o", f"remount,size={used + 60}m", memory], check=True)
    try:
        status, said = team.robot.run(*install, check=False)
    finally:
        subprocess.run(["mount", "-o", "remount,size=3000m", memory], check=True)
    assert status == 1
    assert "No space left" in said
    assert "nothing has changed" in said
    team.check("1-first")


STEPS = ["copying", "installing packages", "testing the model", "switching", "starting", "watching"]


@pytest.mark.parametrize("step", STEPS)
def test_killed_at_any_step_the_old_or_the_new_release_runs(team, step):
    before = team.check("1-first")
    release = f"3-{step.split()[0]}"
    team.install_until(step, *team.bring(release))
    current = team.check("1-first", release)
    assert current == before or step in STEPS[3:]
    if current == release:
        assert "on trial" in team.robot.run(DEPLOY, "status", check=False)[1]
        # What was never seen to be well goes when it fails.
        team.robot.run("rm", f"{CURRENT}/etc/model.onnx")
        team.robot.run("systemctl", "kill", "--kill-whom=main", "--signal", "KILL", "vm-detect")
        deadline = time.monotonic() + 60.0
        while team.link("current") != "1-first":
            assert time.monotonic() < deadline, team.journal()
            time.sleep(0.3)
    else:
        team.robot.run(DEPLOY, "settle")  # waits for what the dead one had begun
    team.check("1-first")
    assert not (team.robot.root / "opt/vm-embedded/trial").exists()


def test_killed_on_the_way_back_it_is_gone_on_with(team):
    slow = team.configured(("budget_ms = 0", "budget_ms = 0.01"), IMPATIENT)
    team.install_until("rolling back", *team.bring("4-back", slow))
    assert (team.robot.root / "opt/vm-embedded/trial").exists()
    team.robot.run(DEPLOY, "settle")
    team.check("1-first")
    assert not (team.robot.root / "opt/vm-embedded/trial").exists()


def test_it_goes_back_even_if_nobody_listens_any_more(team):
    slow = team.configured(("budget_ms = 0", "budget_ms = 0.01"), IMPATIENT)
    install = " ".join(team.bring("4-alone", slow))
    team.robot.run("sh", "-c", f"{install} 2>&1 | sed /watching/q")
    team.robot.run(DEPLOY, "settle")  # waits for it
    team.check("1-first")
    assert not (team.robot.root / "opt/vm-embedded/releases/4-alone").exists()


def test_told_to_stop_it_goes_back(team):
    team.install_until("watching", *team.bring("4-term"), signal="TERM")
    team.check("1-first")
    assert not (team.robot.root / "opt/vm-embedded/trial").exists()


def test_one_that_was_stopped_is_started_by_the_same_bundle(team):
    team.robot.run("systemctl", "stop", "vm-detect")
    assert "already in use" in team.robot.run("/bin/sh", "/var/tmp/1-first/install.sh")[1]
    team.check("1-first")


def _model_command(team, model, signature=None):
    team.robot.root.joinpath("var/tmp/new.onnx").write_bytes(model)
    team.robot.root.joinpath("var/tmp/new.onnx").chmod(0o600)
    beside = team.robot.root.joinpath("var/tmp/new.onnx.sig")
    beside.unlink(missing_ok=True)
    if signature is not None:
        beside.write_bytes(signature)
    return team.robot.run(DEPLOY, "model", "/var/tmp/new.onnx", check=False)


def test_a_model_alone_is_exchanged_while_it_runs(team, bundle):
    team.check("1-first")
    before = team.status()
    ball = CHECKOUT / "vm_embedded" / "models" / "ball.onnx"
    status, said = _model_command(team, OTHER.read_bytes())
    assert status == 0, said
    now = team.status()
    assert now["model_sha256"] != before["model_sha256"]
    assert now["counts"]["frames"] > before["counts"]["frames"], "it was started again"
    status, said = _model_command(team, b"no network")
    assert status == 1
    assert "nothing has changed" in said
    team.robot.root.joinpath("var/tmp/new.onnx").write_bytes(ball.read_bytes())
    exchanged = f"while ! [ -e {CURRENT}/etc/.old.onnx ]; do sleep 0.01; done"
    interrupted = f"{DEPLOY} model /var/tmp/new.onnx & {exchanged}; kill -TERM $!; wait $!"
    assert "rolling back to the old model" in team.robot.run("sh", "-c", interrupted, check=False)[1]
    team.check("1-first")
    assert team.status()["model_sha256"] == now["model_sha256"]


@pytest.mark.parametrize("kind", ["model", "rollback"])
def test_killed_at_random_moments_of_a_change_a_detector_works(team, kind):
    """Also under systemd; test_kills.py does it more often without."""
    chance = random.Random(kind)
    for number in range(6):
        model = (CHECKOUT / "vm_embedded" / "models" / "ball.onnx", OTHER)[number % 2]
        shutil.copy(model, team.robot.root / "var/tmp/new.onnx")
        words = [DEPLOY, kind, *(["/var/tmp/new.onnx"] if kind == "model" else [])]
        with team.robot.start("setsid", "sh", "-c", 'echo $$; exec "$@"', "sh", *words) as process:
            group = process.stdout.readline().strip()
            time.sleep(chance.uniform(0.0, 6.0))
            team.robot.run("kill", "-KILL", "--", f"-{group}", check=False)
            process.stdout.read()
            process.wait()
        team.check("1-first", "2-second")
        team.robot.run(DEPLOY, "settle")
        team.check("1-first", "2-second")


def test_removed_nothing_is_left_but_the_configuration(team):
    team.robot.run(f"{CURRENT}/bundle/uninstall.sh")
    assert team.robot.run("systemctl", "is-active", "vm-detect", check=False)[1].strip() == "inactive"
    assert not (team.robot.root / "etc/systemd/system/vm-detect.service").exists()
    assert {each.name for each in (team.robot.root / "opt/vm-embedded").iterdir()} <= {"left", ".lock"}


def test_deployed_from_a_workstation_in_one_command(team, bundle_file, tmp_path):
    """With an ssh that enters the robot's namespaces instead of going over a network."""
    enter = " ".join(team.robot.entering)
    strip = 'while [ "${1#-}" != "$1" ]; do shift; done'
    fakes = {
        "ssh": f'{strip}\nshift\nexec {enter} sh -c "$*"',
        "scp": f'{strip}\nexec cp "$1" "{team.robot.root}/${{2#*:}}"',
    }
    for name, text in fakes.items():
        (tmp_path / name).write_text(f"#!/bin/sh\n{text}\n")
        (tmp_path / name).chmod(0o755)
    path = {"PATH": f"{tmp_path}:{os.environ['PATH']}"}
    command = ["sh", CHECKOUT / "deploy" / "deploy.sh", bundle_file, "somebody@robot"]
    ran = subprocess.run(command, env=os.environ | path, capture_output=True, text=True, stdin=subprocess.DEVNULL)
    assert ran.returncode == 0, ran.stdout + ran.stderr
    assert "unit      active" in ran.stdout
    assert WELL.search(ran.stdout)
    assert '"detections"' in ran.stdout
    assert "checking hashes" in ran.stdout
    ran = subprocess.run(command, env=os.environ | path, capture_output=True, text=True, stdin=subprocess.DEVNULL)
    assert ran.returncode == 0, ran.stdout + ran.stderr  # now with vm-deploy install
    assert "is already in use" in ran.stdout
    assert not (team.robot.root / "opt/vm-embedded/.bundle").exists()
    assert not list((team.robot.root / "var/tmp").glob("vm-embedded.*"))
