"""Drawn pictures and a short configuration, for the tests of the close look."""

import pytest

from ..drawn import draw_set

TINY = """
[data]
validation = 0.25
[patches]
size = 16
max_proposals = 10
jittered = 2
random = 2
[network]
channels = [4, 6, 8]
hidden = 8
[training]
epochs = 4
rounds = 2
batch = 16
"""
"""A look.toml for which seconds are enough."""


@pytest.fixture(scope="session")
def drawn(tmp_path_factory):
    """Folder of twenty drawn pictures."""
    return draw_set(tmp_path_factory.mktemp("drawn"), 20, seed=3)


@pytest.fixture(scope="session")
def tiny(tmp_path_factory):
    """A look.toml for which seconds are enough."""
    path = tmp_path_factory.mktemp("configuration") / "look.toml"
    path.write_text(TINY)
    return path
