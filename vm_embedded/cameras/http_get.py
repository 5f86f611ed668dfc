"""One GET of a camera's address over HTTP: its response, which is read until a deadline."""

from __future__ import annotations

import base64
import http.client
import time
from urllib.parse import SplitResult, quote, unquote, urlsplit

from ..borders.credentials import HINT, password_hint, without_password
from ..errors import InputError, one_line
from .camera import CameraError
from .digest import digest_authorization
from .timed_stream import TimedStream

_ALLOWED = "/?%:@!$&'()*+,;="
"""Characters besides letters and digits that may be in a path or query as they are, and "%", which escapes others."""

_REFUSED = (401, 403)
"""Statuses of a server that wants a password, or another one."""


class HttpGet:
    """The response to a GET. Raises CameraError if the server does not respond with status 200.

    A user and a password in the address are sent as the server asks for it: by digest, or in clear text. seconds:
    longest time until the response [s]. response: its head was read. stream: for the times of further reads.
    """

    def __init__(self, source: str, seconds: float) -> None:
        self._name = without_password(source)
        self._source = source
        url = parse_url(source)
        self._url = url
        self._target = f"{url.path or '/'}?{url.query}" if url.query else url.path or "/"
        deadline = time.monotonic() + seconds
        self._get(deadline)
        if self.response.status in _REFUSED and url.username is not None:
            challenges = self.response.headers.get_all("WWW-Authenticate") or []
            self.close()
            self._get(deadline, self._authorization(challenges))
        if self.response.status != 200:
            self.close()
            raise CameraError(f"{self._name} responds {self.response.status} {self.response.reason[:100]}{self._why()}")

    def _get(self, deadline: float, authorization: str | None = None) -> None:
        """Connect and send the request."""
        headers = {"Accept": "multipart/x-mixed-replace, */*"}
        if authorization is not None:
            headers["Authorization"] = authorization
        kind = http.client.HTTPSConnection if self._url.scheme == "https" else http.client.HTTPConnection
        left = max(deadline - time.monotonic(), 1e-3)
        self._connection = kind(self._url.hostname or "", self._url.port, timeout=left)
        try:
            self._connection.connect()
            self.stream = TimedStream(self._connection.sock, deadline)
        except (OSError, http.client.HTTPException) as error:
            self._connection.close()
            raise self._no_response(error) from error
        try:
            self._connection.sock = self.stream
            self._connection.request("GET", self._target, headers=headers)
            self.response = self._connection.getresponse()
        except (OSError, http.client.HTTPException) as error:
            self.stream.disconnect()
            self._connection.close()
            raise self._no_response(error) from error

    def _authorization(self, challenges: list[str]) -> str:
        user, password = (unquote(each or "") for each in (self._url.username, self._url.password))
        digest = digest_authorization(challenges, user, password, self._target)
        if digest is not None:
            return digest
        if challenges and not any("basic" in each.lower() for each in challenges):
            raise CameraError(f"{self._name} asks for a kind of authentication that is neither basic nor digest")
        return "Basic " + base64.b64encode(f"{user}:{password}".encode()).decode()

    def _no_response(self, error: Exception) -> CameraError:
        return CameraError(f"no response from {self._name}: {one_line(error)}{password_hint(self._source)}")

    def _why(self) -> str:
        """The end of the message about a status."""
        if self.response.status != 401:
            return ""
        if self._url.username is None:
            return ": write USER:PASSWORD@ before the host in the address"
        return f": check user and password; {HINT}"

    def close(self) -> None:
        """End the connection."""
        self.stream.disconnect()
        self._connection.close()
        self.response.close()


def parse_url(source: str) -> SplitResult:
    """Split a URL into its parts, and escape what HTTP does not allow in path and query.

    Raises InputError if the host is missing or invalid, or the port is.
    """
    shown = without_password(source)
    try:
        url = urlsplit(source)
        valid = bool(url.hostname) and (url.port is None or url.port > 0)
        (url.hostname or "").encode("idna")  # as the connection does
    except ValueError as error:
        why = "" if "@" in source else f": {error}"  # it may quote a part of the password
        raise InputError(f"{shown!r} is not a valid address{why}{password_hint(source)}") from error
    if not valid:
        raise InputError(
            f"{shown!r} is not a valid address{password_hint(source)}; write it like http://192.168.0.20:8080/stream"
        )
    return url._replace(path=quote(url.path, _ALLOWED), query=quote(url.query, _ALLOWED))
