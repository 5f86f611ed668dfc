"""Images that the tests of cameras share."""

import cv2
import pytest

from vm_embedded.cameras.camera import CameraSettings
from vm_embedded.cameras.synthetic import SyntheticCamera


@pytest.fixture(scope="module")
def pictures():
    """Two seconds of a synthetic camera as JPEGs."""
    camera = SyntheticCamera(CameraSettings())
    return [cv2.imencode(".jpg", camera.draw(at / 30.0))[1].tobytes() for at in range(60)]
