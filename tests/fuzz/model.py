"""Model files, as they are and with a right seal. What is accepted is loaded as the detector does it.

ONNX Runtime loads it in a process with limits, because a file may make it allocate gigabytes, or crash: the detector
proves a model in such a process first.
"""

import os
import resource
import sys
import traceback
from contextlib import suppress

from vm_embedded.detection.detector import Detector
from vm_embedded.detection.settings import Settings
from vm_embedded.errors import ModelError, VisualMeshError
from vm_embedded.network.model_file import ModelFile, parse_model, sealed

_MEMORY, _WORK_S = 2**30, 2
"""Limits of loading: address space that it may add [bytes], and processor time."""


def run(data: bytes) -> None:
    with suppress(ModelError):
        parse_model("model.onnx", data)
    _load(parse_model("model.onnx", sealed(data)))


def _load(model: ModelFile) -> None:
    """Load a model in another process. Raises ModelError if it is refused there; other errors are printed there."""
    child = os.fork()
    if not child:
        try:
            _limit()
            Detector(model, Settings())
        except (VisualMeshError, MemoryError):
            os._exit(1)
        except Exception:  # noqa: BLE001 - to find these is what this is for
            traceback.print_exc()
            sys.stderr.flush()
        os._exit(0)
    if os.waitpid(child, 0)[1]:
        raise ModelError("refused")


def _limit() -> None:
    with open("/proc/self/statm", encoding="ascii") as file:  # noqa: PTH123 - as in proving_process.py
        used = int(file.read().split()[0]) * resource.getpagesize()
    resource.setrlimit(resource.RLIMIT_AS, (used + _MEMORY, used + _MEMORY))
    resource.setrlimit(resource.RLIMIT_CPU, (_WORK_S, _WORK_S))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
