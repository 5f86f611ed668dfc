"""The web server of the labeling page. It needs no internet, and by default only this machine can reach it.

GET / is the page, /state the session as JSON, /alive a short sign of life, /crop/ID and /picture/ID are JPEGs of a crop
and of its entire image. POST /answer takes {"session": ID, "crop": ID, "answer": "yes", "no", "skip" or null}; its
response comes after the answer is on disk.
"""

from __future__ import annotations

import json
import os
from http import HTTPStatus
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from socketserver import TCPServer
from typing import Any

from vm_embedded.borders.text import to_json
from vm_embedded.errors import InputError
from vm_embedded.live.http_server import is_numeric_host

from .answers import ANSWERS
from .session import Session

_PAGE = Path(__file__).with_name("page.html")

_LONGEST_BODY = 4096
"""Longest body of an answer [bytes]."""


class LabelServer(ThreadingHTTPServer):
    """Serves a session. host: IPv4 address to listen at. port: 0 chooses a free one. Raises InputError."""

    daemon_threads = True

    def __init__(self, session: Session, host: str, port: int) -> None:
        self.session = session
        self._host = host
        self.page = _PAGE.read_bytes()
        try:
            super().__init__((host, port), _Handler)
        except OSError as error:
            reason = os.strerror(error.errno) if error.errno and error.errno > 0 else str(error)
            raise InputError(f"can't listen at {host}:{port}: {reason}; --port takes another port") from error

    @property
    def url(self) -> str:
        """The address of the page."""
        host = "127.0.0.1" if self._host == "0.0.0.0" else self._host
        return f"http://{host}:{self.server_address[1]}/"

    def server_bind(self) -> None:
        """Bind the socket. HTTPServer also looks for the name of the address, which may need a network."""
        TCPServer.server_bind(self)

    def handle_error(self, request: Any, client_address: Any) -> None:
        """Say nothing: a browser closes connections as it likes."""


class _Handler(BaseHTTPRequestHandler):
    protocol_version = "HTTP/1.1"
    timeout = 60.0  # [s], after which an idle connection is closed
    server: LabelServer

    def do_GET(self) -> None:
        session, (kind, _, crop) = self.server.session, self.path.partition("?")[0].strip("/").partition("/")
        if not is_numeric_host(self.headers.get("Host", "127.0.0.1")):
            self._refuse(HTTPStatus.FORBIDDEN, "use the IP address, not a host name")
        elif self.path == "/":
            self._send(HTTPStatus.OK, "text/html; charset=utf-8", self.server.page)
        elif self.path == "/state":
            self._send_json(session.state())
        elif self.path == "/alive":
            self._send_json({"session": session.id})
        elif kind in ("crop", "picture") and session.knows(crop):
            try:
                picture = session.picture(crop, entire=kind == "picture")
            except InputError as error:
                self._refuse(HTTPStatus.INTERNAL_SERVER_ERROR, str(error))
            else:
                self._send(HTTPStatus.OK, "image/jpeg", picture)
        else:
            self._refuse(HTTPStatus.NOT_FOUND, "page not found")

    def do_POST(self) -> None:
        length = self.headers.get("Content-Length", "")
        if not length.isdecimal() or int(length) > _LONGEST_BODY:
            self.close_connection = True
            self._refuse(HTTPStatus.BAD_REQUEST, "an answer needs a Content-Length")
            return
        body = self.rfile.read(int(length))
        # Another web site can send a form or text to this address, but not JSON.
        is_json = self.headers.get_content_type() == "application/json"
        if self.path != "/answer" or not is_json or not is_numeric_host(self.headers.get("Host", "127.0.0.1")):
            self._refuse(HTTPStatus.FORBIDDEN, "POST takes answers as JSON")
            return
        self._answer(body)

    def _answer(self, body: bytes) -> None:
        session = self.server.session
        try:
            fields = json.loads(body)
            ours, crop, answer = fields["session"] == session.id, fields["crop"], fields["answer"]
            good = isinstance(crop, str) and (answer is None or answer in ANSWERS)
        except (ValueError, KeyError, TypeError, RecursionError):
            good = False
        if not good:
            self._refuse(HTTPStatus.BAD_REQUEST, "an answer has a session, a crop and an answer")
        elif not ours or not session.knows(crop):
            self._refuse(HTTPStatus.CONFLICT, "this crop is not of the folder that vm-label shows now")
        else:
            try:
                session.answer(crop, answer)
            except InputError as error:
                self._refuse(HTTPStatus.INSUFFICIENT_STORAGE, str(error))
            else:
                self._send_json({"crop": crop, "answer": answer})

    def _send_json(self, content: Any) -> None:
        self._send(HTTPStatus.OK, "application/json", to_json(content, allow_nan=False).encode())

    def _refuse(self, status: HTTPStatus, reason: str) -> None:
        self._send(status, "text/plain; charset=utf-8", reason.encode(errors="replace") + b"\n")

    def _send(self, status: HTTPStatus, media_type: str, content: bytes) -> None:
        self.send_response(status)
        self.send_header("Content-Type", media_type)
        self.send_header("Content-Length", str(len(content)))
        # A crop never changes; its address holds a digest of image, class and box.
        keep = status == HTTPStatus.OK and media_type == "image/jpeg"
        self.send_header("Cache-Control", "private, max-age=3600" if keep else "no-store")
        self.end_headers()
        self.wfile.write(content)

    def log_message(self, format: str, *values: Any) -> None:
        """Say nothing about requests."""
