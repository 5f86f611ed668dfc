"""Standard output and standard error of a program, which write printable text only.

Programs print names and paths that others chose, such as those of a folder of images. In them, a control character
could change what the terminal shows or does, and a half character would end the program with an error.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any, TextIO, cast

from ..text import printable_lines


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
    if stream is None or isinstance(stream, _PrintableStream):  # None: it was closed before the program began
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
