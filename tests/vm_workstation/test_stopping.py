"""How programs stop."""

from __future__ import annotations

import subprocess
import sys

ENDS_AT_ONCE = """
import os
from multiprocessing import get_context
from vm_workstation.stopping import stoppable

with stoppable():
    held = get_context("spawn").Semaphore(1)
    os._exit(130)
"""


def test_a_program_that_ends_at_once_prints_nothing_about_its_semaphores():
    ended = subprocess.run([sys.executable, "-c", ENDS_AT_ONCE], capture_output=True, text=True, timeout=60)
    assert (ended.returncode, ended.stdout, ended.stderr) == (130, "", "")
