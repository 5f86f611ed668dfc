"""The page that shows how a detector is: its state, its figures, and what it sees with what it found."""

from __future__ import annotations

import asyncio
import json
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

import cv2

from ..arrays import Image
from ..detection.detections import Detections
from ..output.messages import Message
from ..output.overlay import draw
from .http_server import Answer, Write

_PAGE = Path(__file__).with_name("status_page.html")
_BOUNDARY = b"--picture"
_QUALITY = 80

_STILL = 2.0
"""Seconds after which a picture is sent again, if there is no new one."""


class StatusPage:
    """Pages and the stream of pictures. state: what /state gives.

    A picture is drawn only while somebody looks, in another thread, and once for all who do.
    """

    def __init__(self, fps: float, state: Callable[[], Message]) -> None:
        self._state = state
        self._period = 1.0 / fps
        self._latest: tuple[Image, Detections] | None = None
        self._shown: tuple[Image, bytes] | None = None
        self._changed = asyncio.Event()
        self._drawing = asyncio.Lock()
        self._page = _PAGE.read_bytes()

    def show(self, image: Image, detections: Detections) -> None:
        """What is to be seen from now on."""
        self._latest = image, detections
        self._changed.set()

    def page(self) -> Answer:
        """The page itself."""
        return Answer("text/html; charset=utf-8", self._page)

    def state(self) -> Answer:
        """State and figures."""
        return Answer("application/json", json.dumps(self._state(), allow_nan=False).encode())

    async def stream(self, write: Write) -> None:
        """Motion JPEG, until who looks has gone."""
        await write(
            b"HTTP/1.1 200 OK\r\nContent-Type: multipart/x-mixed-replace; boundary=picture\r\n"
            b"Cache-Control: no-store\r\nConnection: close\r\n\r\n"
        )
        while True:
            picture = await self._picture()
            if picture is not None:
                head = b"\r\nContent-Type: image/jpeg\r\nContent-Length: %d\r\n\r\n" % len(picture)
                await write(_BOUNDARY + head + picture + b"\r\n")
            await asyncio.sleep(self._period)
            self._changed.clear()
            with suppress(TimeoutError):  # then the same picture again: who has gone is noticed by writing only
                await asyncio.wait_for(self._changed.wait(), _STILL)

    async def _picture(self) -> bytes | None:
        """The latest picture as a JPEG."""
        async with self._drawing:
            if self._latest is not None and (self._shown is None or self._shown[0] is not self._latest[0]):
                image, detections = self._latest
                self._shown = image, await asyncio.to_thread(_jpeg, image, detections)
        return None if self._shown is None else self._shown[1]


def _jpeg(image: Image, detections: Detections) -> bytes:
    return cv2.imencode(".jpg", draw(image, detections), [cv2.IMWRITE_JPEG_QUALITY, _QUALITY])[1].tobytes()
