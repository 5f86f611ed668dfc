"""Run one input of a target, and see all that must not happen: other errors, output, more memory."""

import os
import traceback
from collections.abc import Callable
from pathlib import Path

from vm_embedded.errors import VisualMeshError

MOST_MEMORY = 300 * 2**20
"""Memory that inputs may add to what the corpus needed [bytes]."""

Target = Callable[[bytes], None]
"""Works on an input. May only raise VisualMeshError."""


def peak_memory() -> int:
    """The most memory that this process had so far [bytes]; getrusage would count that of its parent, too."""
    status = Path("/proc/self/status").read_text()
    return int(status.partition("VmHWM:")[2].split(maxsplit=1)[0]) * 1024


class Watch:
    """Calls a target; standard output and standard error are collected meanwhile."""

    def __init__(self, target: Target) -> None:
        self._target = target
        self._output = os.memfd_create("output")
        self._own = os.dup(1), os.dup(2)

    def finding(self, data: bytes, memory: int = 0) -> str:
        """What must not happen and did with an input; empty if nothing did. memory: peak before all inputs [bytes]."""
        os.dup2(self._output, 1)
        os.dup2(self._output, 2)
        try:
            found = self._error(data)
        finally:
            os.dup2(self._own[0], 1)
            os.dup2(self._own[1], 2)
        written = os.fstat(self._output).st_size
        if written and not found:
            found = "printed " + repr(os.pread(self._output, min(written, 2000), 0))
        if written:
            os.ftruncate(self._output, 0)
            os.lseek(self._output, 0, os.SEEK_SET)
        more = peak_memory() - memory if memory else 0
        if not found and more > MOST_MEMORY:
            found = f"uses {more >> 20} MiB more memory"
        return found

    def _error(self, data: bytes) -> str:
        try:
            self._target(data)
        except VisualMeshError as error:
            message = str(error)
            return "" if message.isprintable() else f"the message is not one line of text: {message!r}"
        except Exception:  # noqa: BLE001 - to find these is what this is for
            return traceback.format_exc()
        return ""
