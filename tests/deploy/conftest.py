"""One bundle for all tests of a process."""

import pytest

from .bundles import bundle_command, need_wheels, unpacked


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
