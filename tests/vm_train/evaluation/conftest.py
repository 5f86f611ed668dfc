"""A small drawn set, for the tests of this room."""

import pytest

from ..drawn import draw_set


@pytest.fixture(scope="session")
def drawn(tmp_path_factory):
    """Folder of ten drawn pictures."""
    return draw_set(tmp_path_factory.mktemp("drawn"), 10, seed=1)
