"""Motion JPEG: the whole answer of a server, read frame by frame."""

import socket
import threading
from contextlib import suppress

from vm_embedded.cameras.camera import BrokenFrameError, CameraSettings
from vm_embedded.cameras.library_messages import silence_opencv
from vm_embedded.cameras.mjpeg import MjpegCamera

_MOST_FRAMES = 8


class _Server:
    """Answers each request with the same bytes, and then ends the connection."""

    def __init__(self) -> None:
        self.answer = b""
        self._listening = socket.create_server(("127.0.0.1", 0))
        self.address = f"http://127.0.0.1:{self._listening.getsockname()[1]}/stream"
        threading.Thread(target=self._serve, daemon=True).start()

    def _serve(self) -> None:
        while True:
            connection, _ = self._listening.accept()
            with connection, suppress(OSError):
                connection.recv(4096)
                connection.sendall(self.answer)


silence_opencv()  # as vm-detect does
_SERVER = _Server()


def run(data: bytes) -> None:
    _SERVER.answer = data
    camera = MjpegCamera(CameraSettings(source=_SERVER.address, open_ms=20000.0, lost_ms=20000.0))
    try:
        for _ in range(_MOST_FRAMES):
            with suppress(BrokenFrameError):
                camera.read()
    finally:
        camera.close()
