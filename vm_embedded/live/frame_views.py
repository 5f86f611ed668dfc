"""The views of the latest frame for the status page: a video stream of pictures with the detections drawn into them,
an overhead map, and the preview of another threshold."""

from __future__ import annotations

import asyncio
import base64
import json
from contextlib import suppress

import cv2

from ..detection.detections import Detections
from .http_server import Query, Response, Write
from .overhead_map import overhead_map

_BOUNDARY = b"--picture"
_QUALITY = 80

_REPEAT = 2.0
"""Time after which the last image is sent again, if there is no new one [s]."""


class FrameViews:
    """The latest detections, with their frame, as responses. fps: frame rate of the stream [1/s].

    It draws images and computes maps only while a browser asks for them: in another thread, and once for all browsers.
    """

    def __init__(self, fps: float) -> None:
        self.latest: Detections | None = None
        self._period = 1.0 / fps
        self._shown: tuple[Detections | None, bytes | None] = None, None
        self._mapped: tuple[Detections | None, bytes] = None, b"null"
        self._changed = asyncio.Event()
        self._drawing = asyncio.Lock()
        self._mapping = asyncio.Lock()

    def show(self, detections: Detections) -> None:
        """Set the detections to show, with their frame."""
        self.latest = detections
        self._changed.set()

    async def map(self, _: Query) -> Response:
        """The overhead map as JSON, see overhead_map.py; null before the first frame."""
        async with self._mapping:
            latest = self.latest
            if latest is not None and latest is not self._mapped[0]:
                self._mapped = latest, await asyncio.to_thread(_map_json, latest)
            return Response("application/json", self._mapped[1])

    async def preview(self, detections: Detections) -> Response:
        """A frame with other detections, as JSON: accepted, rejected (numbers), and the picture (base64)."""
        async with self._drawing:
            picture = await asyncio.to_thread(_jpeg, detections)
        content = {
            "accepted": len(detections),
            "rejected": len(detections.rejected),
            "picture": base64.b64encode(picture).decode(),
        }
        return Response("application/json", json.dumps(content).encode())

    async def stream(self, write: Write) -> None:
        """Send Motion JPEG until the browser disconnects."""
        await write(
            b"HTTP/1.1 200 OK\r\nContent-Type: multipart/x-mixed-replace; boundary=picture\r\n"
            b"Cache-Control: no-store\r\nConnection: close\r\n\r\n"
        )
        while True:
            sent = self.latest
            picture = await self._picture()
            if picture is not None:
                head = b"\r\nContent-Type: image/jpeg\r\nContent-Length: %d\r\n\r\n" % len(picture)
                await write(_BOUNDARY + head + picture + b"\r\n")
            await asyncio.sleep(self._period)
            if self.latest is sent:
                self._changed.clear()
                # After that time, send the same image: only a write notices a closed connection.
                with suppress(asyncio.TimeoutError):
                    await asyncio.wait_for(self._changed.wait(), _REPEAT)

    async def _picture(self) -> bytes | None:
        """The latest image as a JPEG; None before the first frame."""
        async with self._drawing:
            latest = self.latest
            if latest is not None and latest is not self._shown[0]:
                self._shown = latest, await asyncio.to_thread(_jpeg, latest)
            return self._shown[1]


def _jpeg(detections: Detections) -> bytes:
    return cv2.imencode(".jpg", detections.draw(), [cv2.IMWRITE_JPEG_QUALITY, _QUALITY])[1].tobytes()


def _map_json(detections: Detections) -> bytes:
    return json.dumps(overhead_map(detections), allow_nan=False, separators=(",", ":")).encode()
