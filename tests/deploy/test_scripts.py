"""What the system is told: scripts, units and the Debian package, each looked at by its own tool."""

import re
import shutil
import subprocess

import pytest

from .bundles import CHECKOUT

ROBOT = CHECKOUT / "deploy" / "robot"


def needed(tool):
    """Skip where a tool is missing; .ci/run installs it."""
    if shutil.which(tool) is None:
        pytest.skip(f"needs {tool}")


def test_shellcheck_has_nothing_to_say():
    needed("shellcheck")
    scripts = [ROBOT / "install.sh", ROBOT / "uninstall.sh", ROBOT / "vm-deploy", CHECKOUT / "deploy" / "deploy.sh"]
    ran = subprocess.run(
        ["shellcheck", "--external-sources", "--source-path", CHECKOUT, *scripts], capture_output=True, text=True
    )
    assert ran.returncode == 0, ran.stdout


def test_a_lock_that_was_removed_while_it_was_waited_for_is_none(tmp_path):
    """Otherwise, the next command locks a new file of the same name, and two are at work."""
    body = f"PREFIX={tmp_path}; . {ROBOT / 'releases.sh'}; %s lock 0; flock -n {tmp_path}/.lock true || echo alone"
    after_uninstall = 'flock() { rm -f "$PREFIX/.lock"; command flock "$@"; };'
    held, removed = (
        subprocess.run(["/bin/sh", "-c", body % each], capture_output=True, text=True, check=False)
        for each in ("", after_uninstall)
    )
    assert (held.returncode, held.stdout) == (0, "alone\n")
    assert (removed.returncode, removed.stdout) == (1, "")
    assert str(tmp_path) in removed.stderr


@pytest.fixture
def units(tmp_path):
    """The units, for a release that is there."""
    needed("systemd-analyze")
    program = tmp_path / "prefix" / "current" / "venv" / "bin" / "vm-detect"
    program.parent.mkdir(parents=True)
    for each in (program, tmp_path / "prefix" / "vm-deploy"):
        each.write_text("#!/bin/sh\n")
        each.chmod(0o755)
    (tmp_path / "prefix" / "current" / "bundle").mkdir()
    (tmp_path / "prefix" / "current" / "bundle" / "README.md").write_text("")
    for each in ROBOT.glob("*.service"):
        (tmp_path / each.name).write_text(each.read_text().replace("@PREFIX@", str(tmp_path / "prefix")))
    return tmp_path


def test_systemd_finds_nothing_wrong_with_the_units(units):
    for each in units.glob("*.service"):
        ran = subprocess.run(["systemd-analyze", "verify", "--man=no", each], capture_output=True, text=True)
        own = [line for line in (ran.stdout + ran.stderr).splitlines() if "vm-detect" in line]
        assert ran.returncode == 0, ran.stderr
        assert not own


@pytest.mark.parametrize("name", sorted(each.name for each in ROBOT.glob("*.service")))
def test_each_unit_is_exposed_to_little(units, name):
    command = ["systemd-analyze", "security", "--offline=true", "--no-pager", units / name]
    ran = subprocess.run(command, capture_output=True, text=True)
    found = re.search(rf"exposure level for {re.escape(name)}: ([0-9.]+)", ran.stdout)
    assert found, ran.stdout + ran.stderr
    assert float(found[1]) <= 2.0


@pytest.mark.long
def test_the_debian_package_holds_the_bundle_and_has_no_errors(bundle_file, tmp_path):
    needed("dpkg-deb")
    needed("lintian")
    path = tmp_path / bundle_file.name
    path.symlink_to(bundle_file)
    made = []
    for _ in range(2):
        command = ["python3", CHECKOUT / "deploy" / "debian.py", path]
        made.append(subprocess.run(command, capture_output=True, text=True, check=True).stdout.strip())
        made.append(open(made[-1], "rb").read())  # noqa: SIM115, PTH123
    assert made[:2] == made[2:]
    listed = subprocess.run(["dpkg-deb", "--contents", made[0]], capture_output=True, text=True, check=True).stdout
    assert "./usr/lib/vm-embedded-robot/install.sh" in listed
    assert "root/root" in listed
    found = subprocess.run(["lintian", "--allow-root", made[0]], capture_output=True, text=True)
    assert not [line for line in found.stdout.splitlines() if line.startswith("E:")], found.stdout
    assert found.returncode == 0, found.stdout + found.stderr
