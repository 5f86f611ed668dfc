"""Read a camera that serves single images over HTTP: each request is answered with a new one."""

from __future__ import annotations

import http.client
import time

from ..borders.credentials import without_password
from ..errors import one_line
from .camera import CameraError, CameraSettings, Shot
from .decoding import decode_frame
from .http_get import HttpGet

_RATE = 10.0
"""Requests per second if the settings have no frame rate [1/s]."""

_LARGEST = 64 * 2**20
"""Largest size of an image [bytes]."""


class SnapshotCamera:
    """A camera whose address responds with one image. It is asked at the configured frame rate."""

    def __init__(self, settings: CameraSettings, raw: bool = False) -> None:
        self.settings = settings
        self._raw = raw
        self._due = time.monotonic()

    def read(self) -> Shot:
        """Return the next shot, when it is due. Raises CameraError, and BrokenFrameError for a bad image."""
        time.sleep(max(self._due - time.monotonic(), 0.0))
        self._due = max(self._due, time.monotonic() - 1.0 / _RATE) + 1.0 / (self.settings.fps or _RATE)
        name, seconds = without_password(self.settings.source), 1e-3 * self.settings.lost_ms
        get = HttpGet(self.settings.source, seconds)
        try:
            content = get.response.read(_LARGEST + 1)
        except (OSError, ValueError, OverflowError, http.client.HTTPException) as error:
            raise CameraError(f"{name}: {one_line(error)}") from error
        finally:
            get.close()
        captured = time.monotonic() - 1e-3 * self.settings.latency_ms
        return Shot(decode_frame(content[:_LARGEST], self._raw, self.settings.max_megapixels), captured, content)

    def close(self) -> None:
        """Nothing stays open between two images."""
