"""Waiting for what another process or thread does."""

import time


def wait(what, seconds=60.0):
    """Wait until what() is true, and return it."""
    deadline = time.monotonic() + seconds
    while not (found := what()):
        assert time.monotonic() < deadline, "waited in vain"
        time.sleep(0.02)
    return found
