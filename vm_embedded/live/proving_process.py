"""Run a model file in a child process with limits, so that a file of an enemy can't hurt the detector: its proof.

The parent reads the file once, and the child gets its bytes: nobody can change the file between the two.
"""

from __future__ import annotations

import asyncio
import json
import os
import resource
import signal
import sys
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from ..errors import ModelError, VisualMeshError, one_line
from ..network.model_file import parse_model
from .proof import prove

_LONGEST_S, _PROCESSOR_S = 25.0, 15
"""Limits of the whole run, and of its processor time after the imports [s]. The unit's TimeoutStartSec is 30 s."""

_MEMORY_MIB = 1024
"""Limit of the memory that the run may add [MiB]; the networks of the package add 120."""

_NOBODY = 65534
"""User and group without rights, if the parent is root."""


async def prove_in_process(path: str | Path, content: bytes) -> str:
    """Like `prove`, for the content of a model file, in another process. path: for messages. Raises ModelError."""
    answer = await ask_limited_process("vm_embedded.live.proving_process", path, content)
    return str(answer["proved"])


async def ask_limited_process(module: str, path: str | Path, content: bytes) -> dict[str, Any]:
    """The answer of a module of this package that runs in another process, and there calls `answer_limited`.

    path: of the model, for messages and the child. content: its standard input. Don't trust the answer: a hostile
    network may have written it. Raises ModelError.
    """
    try:
        process = await asyncio.create_subprocess_exec(
            *(sys.executable, "-m", module, str(path)),
            cwd=Path(__file__).parents[2],  # the only folder that -m adds to the path of modules
            stdin=asyncio.subprocess.PIPE,
            stdout=asyncio.subprocess.PIPE,
            stderr=asyncio.subprocess.DEVNULL,
            env=os.environ | {"OPENBLAS_NUM_THREADS": "1"},
        )
    except OSError as error:
        raise ModelError(f"{path}: can't start the process that proves it: {error.strerror}") from error
    try:
        output, _ = await asyncio.wait_for(process.communicate(content), _LONGEST_S)
    except asyncio.TimeoutError as error:
        raise ModelError(f"{path}: its proof takes longer than {_LONGEST_S:g} s") from error
    finally:
        if process.returncode is None:
            process.kill()
            await process.wait()
    try:
        answer = json.loads(output)
        refusal, found = str(answer["refusal"]), dict(answer["found"])
    except (ValueError, KeyError, TypeError) as error:
        raise ModelError(f"{path}: {_end(process.returncode)}") from error
    if refusal:
        raise ModelError(refusal)
    return found


def _end(status: int | None) -> str:
    """How a child that did not answer has ended."""
    if status in (-signal.SIGXCPU, -signal.SIGKILL):
        return f"its proof takes more than {_PROCESSOR_S} s of processor time, or too much memory"
    if status is not None and status < 0:
        return f"ONNX Runtime was ended by {signal.Signals(-status).name} during its proof"
    return f"its proof ended with status {status} and without an answer"


def answer_limited(path: str, work: Callable[[bytes], dict[str, Any]]) -> None:
    """The child: limit this process, call `work` with standard input, and print its answer as a line of JSON."""
    cv2.setNumThreads(1)
    _limit_this_process()
    found, refusal = dict[str, Any](), ""
    try:
        found = work(sys.stdin.buffer.read())
    except VisualMeshError as error:
        refusal = str(error)
    except (MemoryError, cv2.error) as error:
        refusal = f"{path}: its proof failed: {one_line(error) or 'not enough memory'}"
    print(json.dumps({"found": found, "refusal": refusal}))


def main(path: str) -> None:
    """The child: prove the model file on standard input."""
    answer_limited(path, lambda content: {"proved": prove(parse_model(path, content))})


def _limit_this_process() -> None:
    """Set the limits, and become a user without rights."""
    with open("/proc/self/statm", encoding="ascii") as file:  # noqa: PTH123
        in_use = int(file.read().split()[0]) * resource.getpagesize()
    used = sum(resource.getrusage(resource.RUSAGE_SELF)[:2])
    _limit(resource.RLIMIT_AS, in_use + _MEMORY_MIB * 2**20)
    _limit(resource.RLIMIT_CPU, int(used) + 1 + _PROCESSOR_S)
    _limit(resource.RLIMIT_FSIZE, 0)
    _limit(resource.RLIMIT_CORE, 0)
    _limit(resource.RLIMIT_NOFILE, 64)
    if os.geteuid() == 0 and modules_are_public():
        with suppress(OSError):  # a container may not allow it; the limits stay
            os.setgroups([])
            os.setgid(_NOBODY)
            os.setuid(_NOBODY)


def modules_are_public() -> bool:
    """Whether any user can read the modules of Python and of the package.

    If not, root's process keeps its rights, because it imports modules later, too; it still has the limits.
    """
    return all(map(_can_be_read_by_all, (__file__, np.__file__, os.__file__)))


def _can_be_read_by_all(file: str) -> bool:
    path = Path(file).resolve()
    return bool(path.stat().st_mode & 0o004) and all(each.stat().st_mode & 0o001 for each in path.parents)


def _limit(kind: int, most: int) -> None:
    _, hard = resource.getrlimit(kind)
    most = most if hard == resource.RLIM_INFINITY else min(most, hard)
    resource.setrlimit(kind, (most, most))


if __name__ == "__main__":
    main(sys.argv[1])
