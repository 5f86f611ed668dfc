"""What the tests of vm_synth share: a map, small pictures, and Mitsuba where it is."""

import cv2
import numpy as np
import pytest

from vm_embedded.errors import InputError
from vm_synth.scene.configuration import SceneConfiguration
from vm_synth.scene.environment import Environment


def sky(height=64):
    """Radiance (height, 2 height, 3) of a plain sky with a sun at 50 degrees over brown ground."""
    polar = (np.arange(height) + 0.5) / height * np.pi
    azimuth = 2.0 * np.pi * (0.5 - (np.arange(2 * height) + 0.5) / (2 * height))
    radiance = np.where(polar[:, None, None] < np.pi / 2.0, [0.6, 0.8, 1.0], [0.25, 0.2, 0.15])
    radiance = np.broadcast_to(radiance, (height, 2 * height, 3)).astype(np.float32).copy()
    row, column = int(height * 40 / 180), int(np.argmin(np.abs(azimuth - 0.5)))
    radiance[row, column] = 3000.0
    return radiance


@pytest.fixture(scope="session")
def environment():
    return Environment("sky", sky(), floor=0.1)


@pytest.fixture(scope="session")
def maps(tmp_path_factory):
    """A folder of two maps."""
    folder = tmp_path_factory.mktemp("maps")
    cv2.imwrite(str(folder / "noon.hdr"), sky()[..., ::-1])
    cv2.imwrite(str(folder / "evening.hdr"), sky()[:, ::-1, ::-1] * np.float32(0.3))
    return folder


@pytest.fixture(scope="session")
def tracer():
    """A tracer; skipped where Mitsuba or LLVM is missing."""
    from vm_synth.render.tracer import Tracer

    try:
        return Tracer()
    except InputError as error:
        pytest.skip(str(error))


@pytest.fixture(scope="session")
def defaults():
    return SceneConfiguration()
