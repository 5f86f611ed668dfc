"""The camera that draws a field."""

import os
import subprocess
import sys

import pytest

DRAWING = """
import time
import cv2
from vm_embedded.cameras.camera import CameraSettings
from vm_embedded.cameras.synthetic import SyntheticCamera
cv2.setNumThreads(1)
camera = SyntheticCamera(CameraSettings(source="synthetic"))
camera.draw(0.0)
process, thread = time.process_time(), time.thread_time()
for index in range(30):
    camera.draw(index / 30.0)
print(time.process_time() - process, time.thread_time() - thread)
"""


@pytest.mark.skipif(len(os.sched_getaffinity(0)) < 2, reason="needs a second core")
def test_it_draws_on_one_core():
    unlimited = {name: value for name, value in os.environ.items() if not name.endswith("_NUM_THREADS")}
    done = subprocess.run([sys.executable, "-c", DRAWING], capture_output=True, text=True, check=True, env=unlimited)
    process, thread = map(float, done.stdout.split())
    assert process < 1.2 * thread
