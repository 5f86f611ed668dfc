"""Standard output and standard error of a program, which write printable text only, and know of text that is lost.

Programs print names and paths that others chose, such as those of a folder of images. In them, a control character
could change what the terminal shows or does, and a half character would end the program with an error.
"""

from __future__ import annotations

import io
import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any, TextIO, cast

from ..borders.text import printable_lines


class ClosedOutput(io.TextIOBase):
    """Takes the place of a standard output that was closed before the program began. lost: whether it was needed."""

    lost = False

    def write(self, text: str) -> int:
        """Remember that there was text."""
        self.lost = self.lost or bool(text)
        return len(text)


def open_streams() -> None:
    """Open standard output and standard error for text that goes nowhere, if they are closed.

    Otherwise, errors would be printed on standard output, and libraries would print into the file that is opened next.
    """
    if sys.stderr is None:
        _occupy(2)
        sys.stderr = open(2, "w", closefd=False)  # noqa: SIM115
    if sys.stdout is None:
        _occupy(1)
        sys.stdout = ClosedOutput()


def _occupy(descriptor: int) -> None:
    """Give a descriptor to the null device, unless something else has it already."""
    try:
        os.fstat(descriptor)
    except OSError:
        opened = os.open(os.devnull, os.O_WRONLY)
        if opened == descriptor:
            os.set_inheritable(opened, True)
        else:
            os.dup2(opened, descriptor)
            os.close(opened)


def lost_output() -> bool:
    """Whether something was printed on a standard output that is closed."""
    return isinstance(sys.stdout, ClosedOutput) and sys.stdout.lost


@contextmanager
def printable_output() -> Iterator[None]:
    """Meanwhile, what is printed on standard output and standard error is printable, line by line."""
    given = sys.stdout, sys.stderr
    sys.stdout, sys.stderr = map(_printable_stream, given)
    try:
        yield
    finally:
        sys.stdout, sys.stderr = given


def control_terminal(sequence: str) -> None:
    """Write a control sequence, or text with control sequences of the program itself, to standard error."""
    stream = sys.stderr.stream if isinstance(sys.stderr, _PrintableStream) else sys.stderr
    stream.write(sequence)
    stream.flush()


def _printable_stream(stream: TextIO) -> TextIO:
    if isinstance(stream, _PrintableStream):
        return stream
    if hasattr(stream, "reconfigure"):
        stream.reconfigure(errors="backslashreplace")  # for terminals that do not take all of Unicode
    return cast(TextIO, _PrintableStream(stream))


class _PrintableStream:
    """A text stream whose `write` escapes what can't be printed."""

    def __init__(self, stream: TextIO) -> None:
        self.stream = stream

    def write(self, text: str) -> int:
        return self.stream.write(printable_lines(text))

    def __getattr__(self, name: str) -> Any:
        return getattr(self.stream, name)
