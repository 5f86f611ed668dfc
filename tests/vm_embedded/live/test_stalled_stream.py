"""A stream that stalls while the daemon stops: its thread is inside of FFmpeg, and may return at any time."""

import os
import socket
import subprocess
import sys
import threading
import time
from contextlib import suppress

import cv2
import pytest

from tests.vm_embedded.live.running import LENS, PATIENCE, Running
from vm_embedded.cameras.camera import CameraSettings
from vm_embedded.cameras.synthetic import SIZE, SyntheticCamera

STALL = 0.6
"""How long no frame has come when the daemon is stopped [s]."""

SLOW_END = """
import os, sys, time

class LetTheStreamReturn:
    def __del__(self, close=os.close, descriptor=int(sys.argv[1]), sleep=time.sleep):
        close(descriptor)
        sleep(2.0)

kept = LetTheStreamReturn()
from vm_embedded.cli.detect import main
sys.exit(main(sys.argv[2:]))
"""
"""vm-detect. While Python finalizes it, the stream returns."""


@pytest.fixture
def half_a_video(tmp_path):
    path = tmp_path / "field.avi"
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter.fourcc(*"MJPG"), 25.0, SIZE)
    for at in range(40):
        writer.write(SyntheticCamera(CameraSettings()).draw(at / 25.0))
    writer.release()
    content = path.read_bytes()
    return content[: len(content) // 2]


def serve(listening, content, until):
    """Send the content to each client, and close the connection when the other end of a pipe is closed."""
    while True:
        with suppress(OSError):
            connection, _ = listening.accept()
            threading.Thread(target=_answer, args=(connection, content, until), daemon=True).start()


def _answer(connection, content, until):
    with connection, suppress(OSError):
        connection.recv(4096)
        connection.sendall(b"HTTP/1.1 200 OK\r\nContent-Type: video/x-msvideo\r\n\r\n" + content)
        os.read(until, 1)


@pytest.mark.long
def test_a_stream_that_returns_while_the_process_ends_does_no_harm(half_a_video, tmp_path):
    config = tmp_path / "vm.toml"
    config.write_text(LENS)
    until, kept_open = os.pipe()
    listening = socket.create_server(("127.0.0.1", 0))
    threading.Thread(target=serve, args=(listening, half_a_video, until), daemon=True).start()
    options = ("--config", config, "--camera", f"http://127.0.0.1:{listening.getsockname()[1]}/")
    options += ("--camera-lost-ms", 60000, "--camera-open-ms", 60000, "--status-socket", tmp_path / "control")
    process = subprocess.Popen(
        [sys.executable, "-c", SLOW_END, str(kept_open), *map(str, options)],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        pass_fds=(kept_open,),
    )
    os.close(kept_open)
    found = Running(process)
    try:
        found.wait(lambda: found.frames and found.frames[-1]["t"] < time.monotonic() - STALL)
        status, _ = found.stop()
    finally:
        process.kill()
        process.wait(PATIENCE)
    assert (status, found.errors) == (0, [])
    assert found.events[-1]["event"] == "stopped"
