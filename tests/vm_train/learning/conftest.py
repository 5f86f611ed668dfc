"""Fixtures of trainings: pictures, and a short configuration."""

import pytest

from tests.vm_train.commands import SMALL
from tests.vm_train.drawn import CLASSES, draw_set


@pytest.fixture(scope="module")
def data(tmp_path_factory):
    return draw_set(tmp_path_factory.mktemp("drawn"), 16)


@pytest.fixture(scope="module")
def configuration(tmp_path_factory):
    path = tmp_path_factory.mktemp("configuration") / "train.toml"
    path.write_text(CLASSES + SMALL.replace('"hard"', '"all"'))
    return path
