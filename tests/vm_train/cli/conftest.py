"""Fixtures of the tests of vm-train: pictures, a short configuration, and an undisturbed training."""

import pytest

from tests.vm_train.commands import SMALL, run
from tests.vm_train.drawn import CLASSES, draw_set


@pytest.fixture(scope="session")
def data(tmp_path_factory):
    return draw_set(tmp_path_factory.mktemp("drawn"), 30)


@pytest.fixture(scope="session")
def configuration(tmp_path_factory):
    path = tmp_path_factory.mktemp("configuration") / "train.toml"
    path.write_text(CLASSES + SMALL)
    return path


@pytest.fixture(scope="session")
def whole(data, configuration, tmp_path_factory):
    """A training that nobody disturbs."""
    folder = tmp_path_factory.mktemp("whole") / "run"
    done = run(data, "-o", folder, "--config", configuration, "--workers", 1, "--threads", 1)
    return folder, done
