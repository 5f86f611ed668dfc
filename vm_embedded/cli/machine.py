"""The machine that figures are measured on: processor, libraries, arithmetic rate and memory."""

from __future__ import annotations

import os
import platform
import subprocess
import sys
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from ..live.system import resident_bytes
from ..network.onnx_model import RUNTIME_VERSION
from .processor import read_processor

_SGEMM = """
import time
import numpy
a = numpy.random.default_rng(0).random((768, 768), dtype=numpy.float32)
best = 1e9
for _ in range(20):
    started = time.perf_counter()
    a @ a
    best = min(best, time.perf_counter() - started)
print(2 * 768**3 / best)
"""


def describe_machine(cpuinfo: Path = Path("/proc/cpuinfo")) -> dict[str, Any]:
    """Processor, number of usable cores, vector instructions, and versions of Python and the libraries."""
    name, flags, _ = read_processor(cpuinfo)
    return {
        "processor": name,
        "cores": len(os.sched_getaffinity(0)),
        "vectors": next((each for each in ("avx512f", "avx2", "avx", "sse4_2", "asimd") if each in flags), "unknown"),
        "python": platform.python_version(),
        "numpy": np.__version__,
        "opencv": cv2.__version__,
        "onnxruntime": RUNTIME_VERSION,
    }


def sgemm_rate() -> float:
    """Multiplications and additions per second [1/s] of numpy's single-precision matrix product on one core.

    It runs in a separate process, because numpy fixes its number of threads when it is loaded.
    """
    one = dict.fromkeys(("OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "OMP_NUM_THREADS", "BLIS_NUM_THREADS"), "1")
    done = subprocess.run(
        [sys.executable, "-c", _SGEMM], env={**os.environ, **one}, capture_output=True, text=True, check=True
    )
    return float(done.stdout)


def rss_mib() -> float:
    """Resident memory of this process [MiB]."""
    return resident_bytes() / 2**20
