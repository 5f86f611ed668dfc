"""What a reload refuses, before it changes anything."""

import asyncio

import pytest

from vm_embedded.cameras.camera import CameraSettings
from vm_embedded.errors import InputError
from vm_embedded.live.configuration import Configuration, FixedPose
from vm_embedded.live.reloading import read_again
from vm_embedded.poses.settings import PoseSettings

RUNNING = Configuration(
    camera=CameraSettings(source="rtsp://10.0.0.7/1"), fov=1.0, orientation=FixedPose(height=0.5, pitch=0.2)
)


def refusal(wanted):
    with pytest.raises(InputError) as error:
        asyncio.run(read_again(lambda: wanted, RUNNING))
    return str(error.value)


def test_a_configuration_that_works_only_after_a_restart_is_refused():
    """Its pose stream would replace the fixed pose, but a reload keeps the running one."""
    wanted = Configuration(camera=RUNNING.camera, fov=1.0, pose=PoseSettings(source="udp:0.0.0.0:5600"))
    said = refusal(wanted)
    assert "needs poses" in said
    assert said.endswith("(only a restart changes pose)")


def test_a_camera_that_would_not_start_is_refused():
    assert "needs a lens" in refusal(Configuration(camera=CameraSettings(source="rtsp://10.0.0.8/1")))
