"""Motion JPEG over HTTP, as network cameras and mjpg-streamer give it: one JPEG after another in one answer."""

from __future__ import annotations

import base64
import http.client
import time
from urllib.parse import SplitResult, unquote, urlsplit

from ..errors import InputError, one_line
from .camera import BrokenFrameError, CameraError, CameraSettings, Shot, decode_frame, named

_LARGEST = 64 * 2**20
"""Bytes of a part."""

_HEADERS = 64
"""Lines before a part."""


class NoMotionJpegError(CameraError):
    """What the address gives is something else."""


class MjpegCamera:
    """A camera that answers with multipart/x-mixed-replace.

    Raises CameraError if there is no answer, NoMotionJpegError if it is of another kind.
    """

    def __init__(self, settings: CameraSettings, raw: bool = False) -> None:
        self.settings = settings
        self._raw = raw
        self._answer: http.client.HTTPResponse | None = None
        self._begun = False  # whether a part was read
        self._within = False  # whether the boundary before the next part was read already
        url = address_of(settings.source)
        kind = http.client.HTTPSConnection if url.scheme == "https" else http.client.HTTPConnection
        self._connection = kind(url.hostname or "", url.port, timeout=1e-3 * settings.open_ms)
        try:
            self._connection.connect()
            connected = self._connection.sock  # http.client lets go of it if the server will end the connection
            self._answer = self._ask(url.path or "/", url.query, url.username, url.password)
        except (OSError, http.client.HTTPException) as error:
            self.close()
            raise CameraError(f"no answer from {named(settings.source)}: {one_line(error)}") from error
        except CameraError:
            self.close()
            raise
        connected.settimeout(1e-3 * settings.lost_ms)

    def _ask(self, path: str, query: str, user: str | None, password: str | None) -> http.client.HTTPResponse:
        headers = {"Accept": "multipart/x-mixed-replace, */*"}
        if user is not None:
            credentials = f"{unquote(user)}:{unquote(password or '')}".encode()
            headers["Authorization"] = "Basic " + base64.b64encode(credentials).decode()
        self._connection.request("GET", f"{path}?{query}" if query else path, headers=headers)
        answer = self._connection.getresponse()
        if answer.status != 200:
            raise CameraError(f"{named(self.settings.source)} answers {answer.status} {answer.reason[:100]}")
        kind = answer.headers.get_content_type()
        boundary = answer.headers.get_param("boundary")
        if kind != "multipart/x-mixed-replace" or not isinstance(boundary, str):
            raise NoMotionJpegError(f"{named(self.settings.source)} gives {kind}, no multipart/x-mixed-replace")
        self._boundary = b"--" + boundary.removeprefix("--").encode("latin-1")
        return answer

    def read(self) -> Shot:
        """The next shot. Raises CameraError at the end of the stream, BrokenFrameError for half a picture."""
        limit = self.settings.lost_ms if self._begun else max(self.settings.open_ms, self.settings.lost_ms)
        deadline, self._begun = time.monotonic() + 1e-3 * limit, True
        try:
            content = self._part(deadline)
        except (OSError, ValueError, http.client.HTTPException) as error:
            raise CameraError(f"{named(self.settings.source)}: {one_line(error)}") from error
        captured = time.monotonic() - 1e-3 * self.settings.latency_ms
        return Shot(decode_frame(content, self._raw), captured, content)

    def _part(self, deadline: float) -> bytes:
        """The content of the next part."""
        while not self._within and not self._line().startswith(self._boundary):
            self._in_time(deadline)
        self._within = False
        length = None
        for _ in range(_HEADERS):
            line = self._line()
            if not line.strip():
                break
            name, _, value = line.partition(b":")
            if name.strip().lower() == b"content-length":
                length = int(value)
        if length is not None and not 0 <= length <= _LARGEST:
            raise BrokenFrameError(f"part of {length} bytes")
        return self._up_to_boundary(deadline) if length is None else self._bytes(length, deadline)

    def _line(self) -> bytes:
        assert self._answer is not None
        line = self._answer.readline(65536)
        if not line:
            raise CameraError(f"{named(self.settings.source)} has ended")
        return line

    def _bytes(self, length: int, deadline: float) -> bytes:
        answer, content = self._answer, bytearray()
        assert answer is not None
        while len(content) < length:
            self._in_time(deadline)
            some = answer.read1(length - len(content))
            if not some:
                raise CameraError(f"{named(self.settings.source)} ended within a picture")
            content += some
        return bytes(content)

    def _up_to_boundary(self, deadline: float) -> bytes:
        """A part of unknown length. The boundary that ends it begins the next one."""
        content = bytearray()
        while not (line := self._line()).startswith(self._boundary):
            self._in_time(deadline)
            content += line
            if len(content) > _LARGEST:
                raise BrokenFrameError(f"part of more than {_LARGEST} bytes")
        self._within = True
        return bytes(content).removesuffix(b"\r\n")

    def _in_time(self, deadline: float) -> None:
        if time.monotonic() > deadline:
            raise CameraError(f"{named(self.settings.source)} sends too slowly")

    def close(self) -> None:
        """End the connection."""
        self._connection.close()
        if self._answer is not None:
            self._answer.close()


def address_of(source: str) -> SplitResult:
    """The parts of an address. Raises InputError for one without a host, or with a port that is none."""
    try:
        url = urlsplit(source)
        known = bool(url.hostname) and (url.port is None or url.port > 0)
    except ValueError as error:
        raise InputError(f"{source!r} is no address: {error}") from error
    if not known:
        raise InputError(f"{source!r} is no address like http://192.168.0.20:8080/stream")
    return url
