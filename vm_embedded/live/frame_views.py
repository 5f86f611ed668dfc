"""The views of the latest frame for the status page: a picture with the detections drawn into it, an overhead map of
the same frame, and the preview of another threshold."""

from __future__ import annotations

import asyncio
import base64
import json
from contextlib import suppress

import cv2
import numpy as np

from ..detection.detections import Detections
from ..detection.field_of_view import field_of_view
from ..detection.overlay import draw_horizon
from ..output.messages import Message
from .http_server import Query, Response, Write

_BOUNDARY = b"--picture"
_QUALITY = 80

_REPEAT = 2.0
"""Longest wait for a new frame [s]; then the stream sends the last image again."""


class FrameViews:
    """The latest detections, with their frame, as responses. fps: frame rate of the stream [1/s].

    It draws images and computes maps only while a browser asks for them: in another thread, and once for all browsers.
    """

    def __init__(self, fps: float) -> None:
        self.latest: Detections | None = None
        self._number = 0  # of the latest frame
        self._period = 1.0 / fps
        self._shown: tuple[Detections | None, bytes | None] = None, None
        self._mapped: tuple[Detections | None, bytes] = None, b"null"
        self._changed = asyncio.Event()
        self._drawing = asyncio.Lock()
        self._mapping = asyncio.Lock()

    def show(self, detections: Detections) -> None:
        """Set the detections to show, with their frame."""
        self.latest = detections
        self._number += 1
        self._changed.set()

    async def map(self, _: Query) -> Response:
        """The overhead map as JSON, see `overhead_map`; null before the first frame."""
        return Response("application/json", await self._map(self.latest))

    async def view(self, query: Query) -> Response:
        """Number, picture (base64) and map of the latest frame as JSON; null if it is still the frame `after`."""
        await asyncio.sleep(self._period)
        if query.get("after", "0") == str(self._number):
            await self._wait_for_change()
        latest, number = self.latest, self._number
        if latest is None or query.get("after") == str(number):
            return Response("application/json", b"null")
        picture = base64.b64encode(await self._picture(latest) or b"")
        content = b'{"number": %d, "picture": "%b", "map": %b}' % (number, picture, await self._map(latest))
        return Response("application/json", content)

    async def preview(self, detections: Detections) -> Response:
        """A frame with other detections, as JSON: accepted, rejected (numbers), picture (base64) and map."""
        async with self._drawing:
            picture = await asyncio.to_thread(_jpeg, detections)
            plan = await asyncio.to_thread(overhead_map, detections)
        content = {
            "accepted": len(detections),
            "rejected": len(detections.rejected),
            "picture": base64.b64encode(picture).decode(),
            "map": plan,
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
            picture = await self._picture(sent)
            if picture is not None:
                head = b"\r\nContent-Type: image/jpeg\r\nContent-Length: %d\r\n\r\n" % len(picture)
                await write(_BOUNDARY + head + picture + b"\r\n")
            await asyncio.sleep(self._period)
            if self.latest is sent:
                # After that time, send the same image: only a write notices a closed connection.
                await self._wait_for_change()

    async def _wait_for_change(self) -> None:
        """Wait for a new frame, but not for long."""
        self._changed.clear()
        with suppress(asyncio.TimeoutError):
            await asyncio.wait_for(self._changed.wait(), _REPEAT)

    async def _picture(self, detections: Detections | None) -> bytes | None:
        """The image of the latest frame as a JPEG; None before the first one."""
        async with self._drawing:
            if detections is not None and detections is not self._shown[0]:
                self._shown = detections, await asyncio.to_thread(_jpeg, detections)
            return self._shown[1]

    async def _map(self, detections: Detections | None) -> bytes:
        """The map of the latest frame as JSON; null before the first one."""
        async with self._mapping:
            if detections is not None and detections is not self._mapped[0]:
                self._mapped = detections, await asyncio.to_thread(_map_json, detections)
            return self._mapped[1]


def _jpeg(detections: Detections) -> bytes:
    picture = detections.draw()
    draw_horizon(picture, detections.observation.view)
    return cv2.imencode(".jpg", picture, [cv2.IMWRITE_JPEG_QUALITY, _QUALITY])[1].tobytes()


def _map_json(detections: Detections) -> bytes:
    return json.dumps(overhead_map(detections), allow_nan=False, separators=(",", ":")).encode()


def overhead_map(detections: Detections) -> Message:
    """The map of a frame, ready for JSON. Places are in the plane's frame, as in Detection.

    yaw [rad]: direction of the camera, counterclockwise from the x axis. radius [m]: of the object that is sought.
    view: polygons (m, 2) [m] around the part of the plane that the picture shows; fill them by the even-odd rule.
    detections, field: as in messages; field is None for a network without its classes.
    """
    view = detections.observation.view
    return {
        "yaw": round(float(np.arctan2(view.heading[1, 0], view.heading[0, 0])), 4),
        "radius": view.shape.radius,
        "view": [np.round(each, 2).tolist() for each in field_of_view(view)],
        "detections": [each.as_dict() for each in detections],
        "field": None if detections.field is None else detections.field.as_dict(),
    }
