"""Read Motion JPEG over HTTP, as network cameras and mjpg-streamer serve it: one response with JPEG after JPEG."""

from __future__ import annotations

import http.client
import time
from contextlib import suppress

from ..borders.credentials import without_password
from ..errors import one_line
from .camera import BrokenFrameError, CameraError, CameraSettings, Shot
from .decoding import decode_frame
from .frame_clock import FrameClock
from .http_get import HttpGet

_LARGEST_PART = 64 * 2**20
"""Largest size of a part, which holds one image [bytes]."""

_MOST_HEADERS = 64
"""Most header lines of a part."""


class NotMotionJpegError(CameraError):
    """The server sends another type of content. kind: such as image/jpeg."""

    def __init__(self, message: str, kind: str) -> None:
        super().__init__(message)
        self.kind = kind


class MjpegCamera:
    """A camera that responds with multipart/x-mixed-replace.

    Raises CameraError if the server does not respond, NotMotionJpegError if it sends another type of content.
    """

    def __init__(self, settings: CameraSettings, raw: bool = False) -> None:
        self.settings = settings
        self._raw = raw
        self._begun = False  # whether a part was requested
        self._clock = FrameClock()
        self._past_boundary = False  # whether the boundary before the next part was read already
        self._get = HttpGet(settings.source, 1e-3 * settings.open_ms)
        self._response, self._stream = self._get.response, self._get.stream
        kind = self._response.headers.get_content_type()
        boundary = self._response.headers.get_param("boundary")
        if kind != "multipart/x-mixed-replace" or not isinstance(boundary, str):
            self.close()
            raise NotMotionJpegError(f"{self._name} sends {kind}, not multipart/x-mixed-replace", kind)
        self._boundary = b"--" + boundary.removeprefix("--").encode("latin-1")
        self._stream.pause = 1e-3 * settings.lost_ms

    @property
    def _name(self) -> str:
        return without_password(self.settings.source)

    def read(self) -> Shot:
        """Return the next shot.

        Raises CameraError at the end of the stream, and BrokenFrameError for a bad image, or for one that is too old:
        decoding it would only delay the next.
        """
        limit = self.settings.lost_ms if self._begun else max(self.settings.open_ms, self.settings.lost_ms)
        asked = time.monotonic()
        self._stream.deadline, self._begun = asked + 1e-3 * limit, True
        try:
            content, stamp = self._read_part()
        except (OSError, ValueError, OverflowError, http.client.HTTPException) as error:  # overflow: a chunk's length
            raise CameraError(f"{self._name}: {one_line(error)}") from error
        now = time.monotonic()
        captured = self._clock.taken(now, stamp, now - asked) - 1e-3 * self.settings.latency_ms
        if 1e3 * (now - captured) > self.settings.max_age_ms:
            raise BrokenFrameError(
                f"frame is {1e3 * (now - captured):.0f} ms old, allowed are {self.settings.max_age_ms:g} ms"
            )
        return Shot(decode_frame(content, self._raw, self.settings.max_megapixels), captured, content)

    def _read_part(self) -> tuple[bytes, float | None]:
        """The content of the next part, and the server's time of it [s], if it sends one."""
        while not self._past_boundary and not self._read_line().startswith(self._boundary):
            pass
        self._past_boundary = False
        length = stamp = None
        for _ in range(_MOST_HEADERS):
            line = self._read_line()
            if not line.strip():
                break
            name, _, value = line.partition(b":")
            if name.strip().lower() == b"content-length":
                length = int(value)
            elif name.strip().lower() == b"x-timestamp":
                with suppress(ValueError):
                    stamp = float(value)
        if length is not None and not 0 <= length <= _LARGEST_PART:
            raise BrokenFrameError(f"image has {length} bytes, allowed are 0 to {_LARGEST_PART}")
        content = self._read_to_boundary() if length is None else self._read_bytes(length)
        return content, stamp

    def _read_line(self) -> bytes:
        line = self._response.readline(65536)
        if not line:
            raise CameraError(f"{self._name} ended the stream")
        return line

    def _read_bytes(self, length: int) -> bytes:
        response, content = self._response, bytearray()
        while len(content) < length:
            received = response.read1(length - len(content))
            if not received:
                raise CameraError(f"{self._name} ended the stream within an image")
            content += received
        return bytes(content)

    def _read_to_boundary(self) -> bytes:
        """A part of unknown length. The boundary after it also starts the next part."""
        content = bytearray()
        while not (line := self._read_line()).startswith(self._boundary):
            content += line
            if len(content) > _LARGEST_PART:
                raise BrokenFrameError(f"image has more than {_LARGEST_PART} bytes")
        self._past_boundary = True
        return bytes(content).removesuffix(b"\r\n")

    def close(self) -> None:
        """End the connection."""
        self._get.close()
