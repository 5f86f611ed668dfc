"""A real daemon without a camera, whose sockets answer to a client in the same thread."""

import asyncio
import atexit
import io
import socket
import time
from collections.abc import Awaitable, Callable
from functools import cache
from pathlib import Path

from tests.vm_embedded.live.running import DEMO
from vm_embedded.cameras.camera import CameraSettings, Shot
from vm_embedded.cameras.image_files import read_image
from vm_embedded.cameras.open_camera import camera_opener
from vm_embedded.detection.detector import Detector
from vm_embedded.geometry.lens_files import read_lens_file
from vm_embedded.live.configuration import Configuration, StatusSettings
from vm_embedded.live.daemon import Daemon
from vm_embedded.live.log import EventLog
from vm_embedded.network.bundled import model_path
from vm_embedded.output.channels import OutputSettings

from .scratch import scratch

CONTROL = scratch("control")

_FRAME = Path(DEMO) / "image0000000.jpg"
_LOOP = asyncio.new_event_loop()

Connect = Callable[[], Awaitable[tuple[asyncio.StreamReader, asyncio.StreamWriter]]]


@cache
def opened_daemon() -> tuple[Daemon, int]:
    """A daemon that has answered one frame, and the port of its page."""
    with socket.create_server(("127.0.0.1", 0)) as free:
        port = free.getsockname()[1]
    configuration = Configuration(
        model=str(model_path("ball")),
        camera=CameraSettings(source="synthetic", max_age_ms=10000.0),  # a busy machine may be slow
        output=OutputSettings(stdout=False),
        status=StatusSettings(socket=str(CONTROL), page=f"127.0.0.1:{port}"),
    )
    detector = Detector.from_file(configuration.model)
    return _LOOP.run_until_complete(_opened(configuration, detector)), port


async def _opened(configuration: Configuration, detector: Detector) -> Daemon:
    opener = camera_opener(configuration.camera)
    daemon = Daemon(lambda: configuration, configuration, opener, detector, "", EventLog(io.StringIO()))
    for part in daemon._parts:
        await part.open()
    file = read_lens_file(_FRAME.with_name("lens0000000.yaml"))
    now = time.monotonic()
    answer = await daemon.answerer.answer(
        Shot(read_image(_FRAME), now, lens=file.lens, orientation=file.orientation, arrived=now)
    )
    assert answer is not None
    daemon.page.show(answer)
    atexit.register(lambda: _LOOP.run_until_complete(_close(daemon)))
    return daemon


async def _close(daemon: Daemon) -> None:
    for part in daemon._parts:
        await part.close()


def reply(connect: Connect, data: bytes, enough: bytes) -> bytes:
    """What a server answers to these bytes and the end of input, until it closes or has sent `enough`."""
    return _LOOP.run_until_complete(_reply(connect, data, enough))


async def _reply(connect: Connect, data: bytes, enough: bytes) -> bytes:
    reader, writer = await connect()
    received = b""
    try:
        writer.write(data)
        writer.write_eof()
        while enough not in received and (part := await reader.read(65536)):
            received += part
    except ConnectionError:  # it closes while more is sent than it reads
        pass
    finally:
        writer.transport.abort()  # at once, so that no port waits for late packets
        await asyncio.sleep(0)
    return received
