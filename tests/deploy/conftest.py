"""One bundle for all tests of a process, and a machine without a network."""

import subprocess

import pytest

from .bundles import bundle_command, need_wheels, unpacked

CUT_OFF = ["unshare", "--user", "--map-root-user", "--net"]
"""Words before a command that leave it no network."""


@pytest.fixture(scope="session")
def alone():
    """Words before a command that leave it no network, where this machine can do that."""
    if subprocess.run([*CUT_OFF, "true"], capture_output=True).returncode:
        pytest.skip("needs user and network namespaces (unshare)")
    seen = subprocess.run([*CUT_OFF, "ip", "route"], capture_output=True, text=True)
    assert not seen.stdout
    return CUT_OFF


@pytest.fixture(scope="session")
def bundle_file(tmp_path_factory):
    """A bundle of this checkout, as it is without any option but its folder."""
    need_wheels()
    dist = tmp_path_factory.mktemp("dist")
    ran = bundle_command("--dist", dist)
    assert ran.returncode == 0, ran.stderr
    (path,) = dist.glob("*.tar.gz")
    return path


@pytest.fixture(scope="session")
def bundle(bundle_file, tmp_path_factory):
    """The same, unpacked."""
    return unpacked(bundle_file, tmp_path_factory.mktemp("unpacked"))
