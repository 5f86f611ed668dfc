"""A target that does what must not happen, if an input says so; for the tests of the runner."""

import sys
import time

from vm_embedded.errors import InputError

_KEPT: list[bytes] = []


def run(data: bytes) -> None:
    if data == b"refuse":
        raise InputError("refused\nin two lines")  # which the base class makes one line
    if data == b"raise":
        raise KeyError("another error")
    if data == b"print":
        print("a line", file=sys.stderr, flush=True)
    if data == b"hang":
        while True:
            time.sleep(0.0)
    if data == b"grow":
        _KEPT.append(b"x" * (400 * 2**20))
