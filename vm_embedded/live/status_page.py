"""The status page: state, counters, the camera's images with the detections drawn into them, and an overhead map.

Its preview shows what another threshold would change in the latest frame.
"""

from __future__ import annotations

import asyncio
import base64
import json
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

import cv2

from ..detection.detections import Detections
from ..output.messages import Message
from .http_server import Query, Response, Write
from .overhead_map import overhead_map

_PAGE = Path(__file__).with_name("status_page.html")
_BOUNDARY = b"--picture"
_QUALITY = 80

_REPEAT = 2.0
"""Time after which the last image is sent again, if there is no new one [s]."""


class StatusPage:
    """Pages and the video stream.

    state: returns the content of /state. preview: returns what a frame shows with the threshold of a query; it raises
    VisualMeshError.

    It draws images and computes maps only while a browser asks for them: in another thread, and once for all browsers.
    """

    def __init__(
        self, fps: float, state: Callable[[], Message], preview: Callable[[Detections, Query], Detections]
    ) -> None:
        self._state, self._preview = state, preview
        self._period = 1.0 / fps
        self._latest: Detections | None = None
        self._shown: tuple[Detections, bytes] | None = None
        self._mapped: tuple[Detections, bytes] | None = None
        self._changed = asyncio.Event()
        self._drawing = asyncio.Lock()
        self._mapping = asyncio.Lock()
        self._page = _PAGE.read_bytes()

    def show(self, detections: Detections) -> None:
        """Set the detections to show, with their frame."""
        self._latest = detections
        self._changed.set()

    def page(self, _: Query) -> Response:
        """The page itself."""
        return Response("text/html; charset=utf-8", self._page)

    def state(self, _: Query) -> Response:
        """State and counters as JSON."""
        return Response("application/json", json.dumps(self._state(), allow_nan=False).encode())

    async def map(self, _: Query) -> Response:
        """The overhead map as JSON, see overhead_map.py; null before the first frame."""
        async with self._mapping:
            if self._latest is not None and (self._mapped is None or self._mapped[0] is not self._latest):
                detections = self._latest
                self._mapped = detections, await asyncio.to_thread(_map_json, detections)
        return Response("application/json", b"null" if self._mapped is None else self._mapped[1])

    async def preview(self, query: Query) -> Response:
        """The latest frame with another threshold, as JSON: accepted, rejected (numbers), and the picture (base64).

        null before the first frame. Raises VisualMeshError for a wrong query.
        """
        if self._latest is None:
            return Response("application/json", b"null")
        # Here, and not in a thread: the detector belongs to the thread of the loop.
        detections = self._preview(self._latest, query)
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
            sent = self._latest
            picture = await self._picture()
            if picture is not None:
                head = b"\r\nContent-Type: image/jpeg\r\nContent-Length: %d\r\n\r\n" % len(picture)
                await write(_BOUNDARY + head + picture + b"\r\n")
            await asyncio.sleep(self._period)
            if self._latest is sent:
                self._changed.clear()
                # After that time, send the same image: only a write notices a closed connection.
                with suppress(asyncio.TimeoutError):
                    await asyncio.wait_for(self._changed.wait(), _REPEAT)

    async def _picture(self) -> bytes | None:
        """The latest image as a JPEG."""
        async with self._drawing:
            if self._latest is not None and (self._shown is None or self._shown[0] is not self._latest):
                detections = self._latest
                self._shown = detections, await asyncio.to_thread(_jpeg, detections)
        return None if self._shown is None else self._shown[1]


def _jpeg(detections: Detections) -> bytes:
    return cv2.imencode(".jpg", detections.draw(), [cv2.IMWRITE_JPEG_QUALITY, _QUALITY])[1].tobytes()


def _map_json(detections: Detections) -> bytes:
    return json.dumps(overhead_map(detections), allow_nan=False, separators=(",", ":")).encode()
