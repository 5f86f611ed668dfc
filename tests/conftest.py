"""Shared by all tests: the settings for random inputs, and the folder of the reference data."""

import os
from pathlib import Path

import pytest
from hypothesis import settings

settings.register_profile(
    "repeatable", deadline=None, max_examples=50, derandomize=True, database=None, print_blob=False
)
settings.load_profile("repeatable")

CHECKOUT = Path(__file__).resolve().parent.parent


@pytest.fixture(scope="session")
def shared():
    """The folder of the reference data: $VM_SHARED, or `shared` beside the checkout."""
    path = Path(os.environ.get("VM_SHARED") or CHECKOUT.parent / "shared")
    if not path.is_dir():
        pytest.skip(f"needs the reference data, but there is no folder {path}; set VM_SHARED to its folder")
    return path
