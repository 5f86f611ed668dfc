"""What a robot refuses: bundles with other files than their listing, unsigned ones, and what is older."""

import os
import re
import shutil
import socket
import subprocess

import pytest

from tests.other_model import OTHER

from .bundles import CHECKOUT, bundle_command, changed, list_again, packed, signed, unpacked
from .prefixes import Prefix

pytestmark = pytest.mark.long

NEW, OLD = "2026-03-01T00:00:00Z", "2026-02-28T23:59:59Z"


@pytest.fixture(scope="module")
def prefix(bundle, alone, tmp_path_factory):
    found = Prefix(tmp_path_factory.mktemp("robot") / "prefix", alone)
    first = changed(bundle, tmp_path_factory.mktemp("bundles") / "first", "2-first", time=NEW)
    ran = found.install(first)
    assert ran.returncode == 0, ran.stdout + ran.stderr
    return found


@pytest.fixture(scope="module")
def small(bundle, tmp_path_factory):
    """A bundle without its wheels, for what is refused before any of them is used."""
    folder = tmp_path_factory.mktemp("small") / "small"
    shutil.copytree(bundle, folder, ignore=shutil.ignore_patterns("wheels"))
    list_again(folder)
    return folder


@pytest.fixture
def attacked(small, tmp_path):
    """A copy to attack."""
    return changed(small, tmp_path / "attacked", "3-attacked", time=NEW)


def _link_to_private(folder, private):
    (folder / "etc" / "notes.txt").symlink_to(private)


def _link_instead(folder, private):
    (folder / "etc" / "vm.toml").unlink()
    (folder / "etc" / "vm.toml").symlink_to(private)


def _link_to_the_same(folder, private):
    private.write_bytes((folder / "etc" / "vm.toml").read_bytes())
    _link_instead(folder, private)


def _linked_folder(folder, private):
    (folder / "wheels").symlink_to(private.parent)


def _fifo(folder, private):
    os.mkfifo(folder / "etc" / "notes.txt")


def _fifo_instead(folder, private):
    (folder / "etc" / "vm.toml").unlink()
    os.mkfifo(folder / "etc" / "vm.toml")


def _socket(folder, private):
    with socket.socket(socket.AF_UNIX) as made:
        descriptor = os.open(folder / "etc", os.O_RDONLY)
        made.bind(f"/proc/self/fd/{descriptor}/s")
        os.close(descriptor)


def _more(folder, private):
    (folder / "notes.txt").write_text("more")


def _missing(folder, private):
    (folder / "uninstall.sh").unlink()


def _changed(folder, private):
    content = (folder / "releases.sh").read_bytes()
    (folder / "releases.sh").unlink()
    (folder / "releases.sh").write_bytes(content + b"\n")


def _listed_twice(folder, private):
    with (folder / "SHA256SUMS").open("a") as file:
        file.write(f"{'0' * 64}  etc/vm.toml\n")


def _listed_outside(folder, private):
    with (folder / "SHA256SUMS").open("a") as file:
        file.write(f"{'0' * 64}  {private}\n")


ATTACKS = {
    _link_to_private: "notes.txt",
    _link_instead: "vm.toml",
    _link_to_the_same: "vm.toml",
    _linked_folder: "wheels",
    _fifo: "notes.txt",
    _fifo_instead: "vm.toml",
    _socket: "etc/s",
    _more: "notes.txt",
    _missing: "uninstall.sh",
    _changed: "releases.sh",
    _listed_twice: "vm.toml",
    _listed_outside: "private",
}


@pytest.mark.parametrize("attack", ATTACKS, ids=lambda each: each.__name__.strip("_"))
def test_attack_11_a_bundle_with_other_files_than_its_listing_is_refused(prefix, attacked, tmp_path, attack):
    private = tmp_path / "home" / "private"
    private.parent.mkdir()
    private.write_text("a secret")
    attack(attacked, private)
    before = prefix.link("current"), prefix.releases()
    with_tar = subprocess.run(["tar", "-czf", tmp_path / "b.tar.gz", "-C", tmp_path, "attacked"], capture_output=True)
    installed = [prefix.install(attacked)]
    if attack is not _socket:  # tar leaves sockets out
        assert with_tar.returncode == 0
        installed.append(prefix.deploy("install", tmp_path / "b.tar.gz"))
    for ran in installed:
        assert ran.returncode == 1, ran.stdout
        assert "bundle" in ran.stderr
        assert ATTACKS[attack] in ran.stderr
        assert "a secret" not in ran.stdout + ran.stderr
    assert (prefix.link("current"), prefix.releases()) == before
    assert not (prefix.path / ".bundle").exists()


def one_liner():
    """The command of deploy/README.md for the first installation, without its sudo."""
    (found,) = re.findall(r"^test -z .*$", (CHECKOUT / "deploy" / "README.md").read_text(), re.MULTILINE)
    assert found.endswith(" && sudo ./install.sh")
    return found.replace("sudo ./install.sh", "./install.sh --no-systemd --dry-run")


def _flip(path, old, new):
    """Change one bit of a file."""
    content = path.read_bytes()
    assert content.count(old) == 1
    assert sum((a ^ b).bit_count() for a, b in zip(old, new, strict=True)) == 1
    path.unlink()
    path.write_bytes(content.replace(old, new))
    path.chmod(0o755)


def test_attack_11_one_flipped_bit_in_install_sh_is_noticed_before_it_runs(prefix, attacked):
    _flip(attacked / "install.sh", b"\ncheck_files\n", b"\n#heck_files\n")
    (attacked / "README.md").unlink()
    (attacked / "README.md").write_text("damaged, too")
    assert "checking the machine" in prefix.install(attacked, "--dry-run").stdout  # it does not notice that itself
    ran = prefix.deploy("install", packed(attacked))
    assert ran.returncode == 1
    assert "install.sh: FAILED" in ran.stderr
    assert "checking the machine" not in ran.stdout
    ran = subprocess.run(one_liner(), shell=True, cwd=attacked, capture_output=True, text=True)
    assert ran.returncode == 1
    assert "install.sh: FAILED" in ran.stdout
    assert "checking" not in ran.stdout


def test_the_documented_command_starts_a_whole_bundle_and_no_other(small, attacked):
    ran = subprocess.run(one_liner(), shell=True, cwd=small, capture_output=True, text=True)
    assert "checking hashes" in ran.stdout, ran.stderr
    os.mkfifo(attacked / "etc" / "notes.txt")
    ran = subprocess.run(one_liner(), shell=True, cwd=attacked, capture_output=True, text=True, timeout=60)
    assert ran.returncode == 1
    assert not ran.stdout


def test_what_is_no_bundle_is_refused(prefix, tmp_path):
    (tmp_path / "text.tar.gz").write_text("text")
    for path, words in (
        (tmp_path / "text.tar.gz", "is not a bundle"),
        (tmp_path, "can't read"),
        ("none", "can't read"),
    ):
        ran = prefix.deploy("install", path)
        assert ran.returncode == 1
        assert words in ran.stderr


@pytest.mark.parametrize("release", ["../../outside", "", ".", "a b"])
def test_a_release_can_not_be_called_like_another_folder(prefix, small, tmp_path, release):
    ran = prefix.install(changed(small, tmp_path / "bundle", release, time=NEW))
    assert ran.returncode == 1
    assert "manifest.json has no release" in ran.stderr


@pytest.fixture
def keys(prefix, tmp_path):
    """The folder of two keys; the robot trusts `key`."""
    for name in ("key", "other"):
        subprocess.run(["ssh-keygen", "-q", "-t", "ed25519", "-N", "", "-f", tmp_path / name], check=True)
    used = prefix.path / "current" / "etc" / "vm.toml"
    before = used.read_text()
    used.write_text(before.replace('signer = ""', f'signer = "{(tmp_path / "key.pub").read_text().strip()}"'))
    yield tmp_path
    used.write_text(before)
    (prefix.path / "model-signed").unlink(missing_ok=True)


def test_attack_11_with_a_key_only_signed_bundles_are_accepted(prefix, keys, attacked):
    ran = prefix.deploy("install", packed(attacked))
    assert ran.returncode == 1
    assert "needs a signed bundle" in ran.stderr
    ran = prefix.deploy("install", packed(signed(attacked, keys / "other")))
    assert ran.returncode == 1
    assert "not signed by [deploy] signer" in ran.stderr
    ran = prefix.deploy("install", packed(signed(attacked, keys / "key")), "--dry-run")
    assert ran.returncode == 0, ran.stderr
    assert "would install 3-attacked" in ran.stdout
    (attacked / "uninstall.sh").unlink()
    (attacked / "uninstall.sh").write_text("#!/bin/sh\nexit 1\n")
    list_again(attacked)
    ran = prefix.deploy("install", packed(attacked), "--dry-run")
    assert ran.returncode == 1
    assert "not signed by [deploy] signer" in ran.stderr


def test_make_bundle_signs(bundle, keys, prefix):
    ran = bundle_command("--dist", keys / "dist", "--key", keys / "key")
    assert ran.returncode == 0, ran.stderr
    (path,) = (keys / "dist").iterdir()
    ran = prefix.deploy("install", path, "--dry-run", "--allow-older")
    assert ran.returncode == 0, ran.stderr
    made, expected = unpacked(path, keys / "made"), {str(each.relative_to(bundle)) for each in bundle.rglob("*")}
    assert {str(each.relative_to(made)) for each in made.rglob("*")} == expected | {"SHA256SUMS.sig"}
    ran = bundle_command("--dist", keys / "dist", "--key", keys / "none")
    assert ran.returncode == 1
    assert "can't sign the bundle with the key" in ran.stderr
    assert "Traceback" not in ran.stderr


def test_attack_11_an_older_bundle_needs_the_option(prefix, small, tmp_path):
    older = changed(small, tmp_path / "older", "1-older", time=OLD)
    for ran in (prefix.install(older, "--dry-run"), prefix.deploy("install", packed(older), "--dry-run")):
        assert ran.returncode == 1
        assert f"this bundle, 1-older of {OLD}, is older than the release in use, 2-first of {NEW}" in ran.stderr
        assert "--allow-older" in ran.stderr
    undated = changed(small, tmp_path / "undated", "1-undated", time="")
    assert "is older" in prefix.install(undated, "--dry-run").stderr
    for ran in (
        prefix.install(older, "--dry-run", "--allow-older"),
        prefix.deploy("install", packed(older), "--dry-run", "--allow-older"),
        prefix.install(changed(small, tmp_path / "same", "1-same", time=NEW), "--dry-run"),
    ):
        assert ran.returncode == 0, ran.stderr


def test_attack_11_with_a_key_only_signed_models_that_are_not_older_are_accepted(prefix, keys):
    model, used = keys / "new.onnx", prefix.path / "current" / "etc" / "model.onnx"
    first, second = used.read_bytes(), OTHER.read_bytes()

    def ask(content, key, namespace, *options):
        model.write_bytes(content)
        (keys / "new.onnx.sig").unlink(missing_ok=True)
        if key:
            sign = ["ssh-keygen", "-q", "-Y", "sign", "-f", keys / key, "-n", namespace, model]
            subprocess.run(sign, check=True, capture_output=True)
        return prefix.deploy("model", model, *options)

    for key, namespace, words in (
        ("", "", "is missing"),
        ("other", f"vm-embedded model {NEW}", "not signed"),
        ("key", "vm-embedded", "the signature has no time"),
        ("key", "vm-embedded-bundle", "the signature has no time"),
    ):
        ran = ask(second, key, namespace)
        assert ran.returncode == 1
        assert words in ran.stderr
    ran = ask(second, "key", f"vm-embedded model {NEW}")
    assert ran.returncode == 0, ran.stderr
    model.write_bytes(first)  # beside the signature of the other
    assert "not signed" in prefix.deploy("model", model).stderr
    assert used.read_bytes() == second
    ran = ask(first, "key", f"vm-embedded model {OLD}")
    assert ran.returncode == 1
    said = re.search(
        r"this model, (\w{16}) signed at (\S+), is older than the last one, (\w{16}) signed at (\S+):", ran.stderr
    )
    assert said, ran.stderr
    assert (said[2], said[4]) == (OLD, NEW)
    assert "--allow-older" in ran.stderr
    assert used.read_bytes() == second
    assert ask(first, "key", f"vm-embedded model {OLD}", "--allow-older").returncode == 0
    assert used.read_bytes() == first


def test_a_signed_bundle_is_unpacked_checked_and_installed_by_the_release_in_use(prefix, bundle, keys):
    whole = signed(changed(bundle, keys / "whole", "4-whole", time=NEW), keys / "key")
    ran = prefix.deploy("install", packed(whole))
    assert ran.returncode == 0, ran.stdout + ran.stderr
    assert "4-whole is in use" in ran.stdout
    assert (prefix.link("current"), prefix.link("previous")) == ("4-whole", "2-first")
    assert not (prefix.path / ".bundle").exists()
    assert (prefix.path / "current" / "bundle" / "SHA256SUMS.sig").exists()
