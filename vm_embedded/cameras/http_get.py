"""One GET of a camera's address over HTTP: its response, which is read until a deadline."""

from __future__ import annotations

import base64
import hashlib
import http.client
import io
import math
import secrets
import socket
import time
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from typing import TYPE_CHECKING, Any
from urllib.parse import SplitResult, quote, unquote, urlsplit
from urllib.request import parse_http_list

from ..borders.credentials import HINT, password_hint, without_password
from ..errors import InputError, one_line
from .camera import CameraError

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


_ALGORITHMS: dict[str, Callable[[bytes], Any]] = {
    "SHA-256": hashlib.sha256,
    "MD5": partial(hashlib.md5, usedforsecurity=False),
}
"""Hash functions by name, the strongest first."""


def digest_authorization(challenges: Sequence[str], user: str, password: str, target: str) -> str | None:
    """The header Authorization for GET; None if a server offers no digest that is known.

    challenges: the headers WWW-Authenticate of the server. target: path and query of the address.
    """
    offers = [offer for offer in _digests(challenges) if _algorithm(offer)[0] in _ALGORITHMS and _is_simple(offer)]
    if not offers:
        return None
    offer = min(offers, key=lambda each: list(_ALGORITHMS).index(_algorithm(each)[0]))
    algorithm, is_session = _algorithm(offer)

    def hashed(*parts: str) -> str:
        return str(_ALGORITHMS[algorithm](":".join(parts).encode()).hexdigest())

    nonce, client = offer["nonce"], secrets.token_hex(8)
    identity = hashed(user, offer.get("realm", ""), password)
    if is_session:
        identity = hashed(identity, nonce, client)
    count = ["00000001", client, "auth"] if "qop" in offer else []
    response = hashed(identity, nonce, *count, hashed("GET", target))
    fields = {"username": user, "realm": offer.get("realm", ""), "nonce": nonce, "uri": target, "response": response}
    fields |= {"opaque": offer["opaque"]} if "opaque" in offer else {}
    quoted = [f'{name}="{_escaped(value)}"' for name, value in fields.items()]
    if count:
        quoted += ["qop=auth", "nc=00000001"]
    if count or is_session:
        quoted.append(f'cnonce="{client}"')
    if "algorithm" in offer:
        quoted.append(f"algorithm={offer['algorithm']}")
    return "Digest " + ", ".join(quoted)


def _digests(challenges: Sequence[str]) -> Iterator[dict[str, str]]:
    """The fields of each digest that a server offers, by their names in lower case."""
    for header in challenges:
        offer: dict[str, str] | None = None
        for item in parse_http_list(header):
            scheme, blank, field = item.partition(" ")
            if blank and "=" not in scheme:  # the first field of another kind of authentication
                if offer is not None:
                    yield offer
                offer, item = ({} if scheme.lower() == "digest" else None), field
            if offer is not None:
                name, _, value = item.partition("=")
                offer[name.strip().lower()] = value.strip().strip('"')
        if offer is not None:
            yield offer


def _algorithm(offer: dict[str, str]) -> tuple[str, bool]:
    """Name of the hash function, and whether it also hashes the nonces into the password."""
    name = offer.get("algorithm", "MD5").upper()
    return name.removesuffix("-SESS"), name.endswith("-SESS")


def _is_simple(offer: dict[str, str]) -> bool:
    """Whether the digest is of the request only, and not of its content, too."""
    qualities = [each.strip().lower() for each in offer.get("qop", "auth").split(",")]
    return "auth" in qualities and "nonce" in offer


def _escaped(value: str) -> str:
    return value.replace("\\", "\\\\").replace('"', '\\"')


if TYPE_CHECKING:
    from typing_extensions import Buffer


class TimedStream(io.RawIOBase):
    """The bytes of a connected socket, in the form in which http.client uses a socket.

    A socket's own timeout begins again with each byte, so a server that sends a byte now and then holds its reader
    forever. deadline: monotonic time when reading raises TimeoutError [s]. pause: longest silence until then [s].
    Only `disconnect` closes the socket: http.client closes what it got while its response is still being read.
    """

    def __init__(self, connected: socket.socket, deadline: float) -> None:
        self.deadline, self.pause = deadline, math.inf
        self._socket = connected

    def makefile(self, mode: str) -> io.BufferedReader:
        """A buffered reader of the stream. mode: always "rb"."""
        return io.BufferedReader(self)

    def sendall(self, content: bytes) -> None:
        """Send all bytes. Raises OSError."""
        self._socket.sendall(content)

    def readable(self) -> bool:
        return True

    def readinto(self, buffer: Buffer) -> int:
        """Read into a buffer. Raises OSError, also after the deadline."""
        left = self.deadline - time.monotonic()
        if left <= 0.0:
            raise TimeoutError("timed out")
        self._socket.settimeout(min(left, self.pause))
        return self._socket.recv_into(buffer)

    def readall(self) -> bytes:
        """Refuse to read until the end, which http.client does for a chunk of the length -1."""
        raise io.UnsupportedOperation("the length of a chunk is negative")

    def close(self) -> None:
        """Keep the socket open."""

    def disconnect(self) -> None:
        """Close the socket."""
        self._socket.close()
